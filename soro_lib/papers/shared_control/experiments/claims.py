"""The ordinal claims of the paper, each as a test on one operator's mean results.

Source: Stroppa et al., Sections 5.4 and 5.5; thresholds for "alike" and "not felt" are ours, stated here.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

ALIKE_TIME, ALIKE_ERROR = 0.15, 0.25
"""Relative differences up to which two paradigms count as alike; a dead heat within one person's scatter."""

NOT_FELT = 0.1
"""Mean force below which an assistance counts as hardly felt [N], half the friction of a desktop device."""

NOT_ZERO = 1.0
"""Placement error above which it counts as not zero [mm]."""

STABLE_PATH = 20.0
"""Path beyond which a trial counts as unstable [m], eight times the shortest way."""


@dataclass(frozen=True)
class Means:
    """Mean results by operator: each table has one line per operator and one column per paradigm."""

    time: pd.DataFrame
    error: pd.DataFrame
    force: pd.DataFrame
    path: pd.DataFrame
    finished: pd.DataFrame


Held = Callable[[Means], pd.Series]


@dataclass(frozen=True)
class Claim:
    """A claim about operators of one kind: its name, its words, and whom it concerns."""

    name: str
    text: str
    kinds: tuple[str, ...]
    holds: Held


def shortest(means: Means) -> pd.Series:
    """Mostly autonomous has the shortest mean time of the six."""
    return means.time.idxmin(axis=1) == "mostly_autonomous"


def most_accurate(means: Means) -> pd.Series:
    """Mostly autonomous has the smallest mean error of the six."""
    return means.error.idxmin(axis=1) == "mostly_autonomous"


def autonomy_shorter(means: Means) -> pd.Series:
    """Every paradigm with an automatic axis is faster than full teleoperation."""
    return means.time[["msae", "asme", "mostly_autonomous"]].max(axis=1) < means.time["full_teleoperation"]


def gradual(table: str) -> Held:
    """Each step from manual to automatic improves the table."""

    def holds(means: Means) -> pd.Series:
        order = getattr(means, table)[["full_teleoperation", "msae", "asme", "mostly_autonomous"]]
        return (order.diff(axis=1).iloc[:, 1:] < 0).all(axis=1)

    return holds


def better(table: str, first: str, second: str) -> Held:
    """The first paradigm has the smaller value."""
    return lambda means: getattr(means, table)[first] < getattr(means, table)[second]


def alike(table: str, first: str, second: str, within: float) -> Held:
    """The two paradigms differ by at most a share of the second."""
    return lambda means: (getattr(means, table)[first] / getattr(means, table)[second] - 1).abs() <= within


def stable(means: Means) -> pd.Series:
    """Every trial ends in time and without wild motion."""
    return (means.finished == 1).all(axis=1) & (means.path < STABLE_PATH).all(axis=1)


BOTH = ("expert", "naive")
EXPERT = ("expert",)
NAIVE = ("naive",)
FULL, AAN, FIXED, MSAE, ASME, AUTO = (
    *("full_teleoperation", "assist_as_needed", "fixed_assistance"),
    *("msae", "asme", "mostly_autonomous"),
)

CLAIMS = (
    Claim("auto_shortest", "Mostly Autonomous is the shortest of the six", BOTH, shortest),
    Claim("auto_most_accurate", "Mostly Autonomous is the most accurate of the six", BOTH, most_accurate),
    Claim(
        "auto_error_not_zero",
        "The error of Mostly Autonomous is not zero",
        BOTH,
        lambda means: means.error[AUTO] > NOT_ZERO,
    ),
    Claim(
        "autonomy_shorter",
        "MSAE, ASME and Mostly Autonomous are shorter than Full Teleoperation",
        BOTH,
        autonomy_shorter,
    ),
    Claim("gradual_time", "Each step of autonomy shortens the trial", BOTH, gradual("time")),
    Claim("gradual_error", "Each step of autonomy places better", BOTH, gradual("error")),
    Claim("asme_shorter", "ASME is shorter than MSAE", BOTH, better("time", ASME, MSAE)),
    Claim("asme_more_accurate", "ASME is more accurate than MSAE", BOTH, better("error", ASME, MSAE)),
    Claim(
        "fixed_like_msae_time",
        "Fixed Assistance takes as long as MSAE",
        EXPERT,
        alike("time", FIXED, MSAE, ALIKE_TIME),
    ),
    Claim(
        "fixed_like_msae_error",
        "Fixed Assistance is as accurate as MSAE",
        EXPERT,
        alike("error", FIXED, MSAE, ALIKE_ERROR),
    ),
    Claim("fixed_slower_msae", "Fixed Assistance takes longer than MSAE", NAIVE, better("time", MSAE, FIXED)),
    Claim(
        "fixed_less_accurate_msae",
        "Fixed Assistance is less accurate than MSAE",
        NAIVE,
        better("error", MSAE, FIXED),
    ),
    Claim(
        "aan_shorter_fixed",
        "Assist-as-Needed is shorter than Fixed Assistance",
        NAIVE,
        better("time", AAN, FIXED),
    ),
    Claim(
        "aan_more_accurate_fixed",
        "Assist-as-Needed is more accurate than Fixed Assistance",
        NAIVE,
        better("error", AAN, FIXED),
    ),
    Claim(
        "aan_like_full_time",
        "Assist-as-Needed takes as long as Full Teleoperation",
        EXPERT,
        alike("time", AAN, FULL, ALIKE_TIME),
    ),
    Claim(
        "aan_like_full_error",
        "Assist-as-Needed is as accurate as Full Teleoperation",
        EXPERT,
        alike("error", AAN, FULL, ALIKE_ERROR),
    ),
    Claim(
        "aan_not_felt",
        "The force of Assist-as-Needed is hardly felt",
        EXPERT,
        lambda means: means.force[AAN] < NOT_FELT,
    ),
    Claim(
        "aan_shorter_full",
        "Assist-as-Needed is shorter than Full Teleoperation",
        NAIVE,
        better("time", AAN, FULL),
    ),
    Claim(
        "aan_more_accurate_full",
        "Assist-as-Needed is more accurate than Full Teleoperation",
        NAIVE,
        better("error", AAN, FULL),
    ),
    Claim("stable", "No instability", BOTH, stable),
)

PAIR_CLAIMS = {
    "expert_faster": "Experts are faster than naive users, mean over the paradigms",
    "expert_more_accurate": "Experts place better than naive users, mean over the paradigms",
    "expert_less_assisted": "Assist-as-Needed pushes experts less than naive users",
}
"""Claims that compare one expert with one naive user, in each environment."""

ACROSS_CLAIM = "aan_gain_larger_simulated"
"""Naive users gain more from Assist-as-Needed over Fixed Assistance in the simulation than in reality."""


def operator_means(trials: pd.DataFrame) -> Means:
    """Mean over the trials of each operator; time-outs count with their full time and no error.

    Parameters
    ----------
    trials : pandas.DataFrame
        One kind of operator in one environment: columns operator, paradigm and the metrics of a trial.
    """

    def table(metric: str, how: Literal["mean", "max"] = "mean") -> pd.DataFrame:
        return trials.pivot_table(index="operator", columns="paradigm", values=metric, aggfunc=how)

    return Means(
        time=table("time_s"),
        error=table("release_error_mm"),
        force=table("assistance_n"),
        path=table("path_m", "max"),
        finished=table("finished"),
    )


def evaluate_claims(trials: pd.DataFrame) -> pd.DataFrame:
    """Whether each claim holds for each operator, or pair of one expert and one naive user.

    Parameters
    ----------
    trials : pandas.DataFrame
        Columns kind, environment, operator, paradigm and the metrics of a trial.

    Returns
    -------
    pandas.DataFrame
        Columns id (``<claim>_<kind>_<environment>``), claim, kind, environment, text, operator, holds.
    """
    records = list(_operator_records(trials)) + list(_pair_records(trials))
    return pd.concat([_frame(*record) for record in records], ignore_index=True)


def claim_probabilities(held: pd.DataFrame) -> pd.DataFrame:
    """Share of operators for whom each claim holds."""
    columns = ["id", "claim", "kind", "environment", "text"]
    return held.groupby(columns, sort=False)["holds"].mean().rename("probability").reset_index()


def condition_probabilities(trials: pd.DataFrame) -> pd.DataFrame:
    """Probability of each claim under every attitude, force law and approach.

    Parameters
    ----------
    trials : pandas.DataFrame
        Of `run_conditions`.

    Returns
    -------
    pandas.DataFrame
        As `claim_probabilities`, with the columns attitude, law and approach.
    """
    conditions = ["attitude", "law", "approach"]
    pieces = [
        claim_probabilities(evaluate_claims(group)).assign(
            **dict(zip(conditions, map(str, condition), strict=True))
        )
        for condition, group in trials.groupby(conditions, sort=False)
    ]
    return pd.concat(pieces, ignore_index=True)


Record = tuple[str, str, str, str, NDArray[np.bool_]]


def _operator_records(trials: pd.DataFrame) -> Iterator[Record]:
    for (kind, environment), group in trials.groupby(["kind", "environment"], sort=False):
        means = operator_means(group)
        for claim in CLAIMS:
            if kind in claim.kinds:
                yield claim.name, str(kind), str(environment), claim.text, claim.holds(means).to_numpy(bool)


def _pair_records(trials: pd.DataFrame) -> Iterator[Record]:
    groups = trials.groupby(["environment", "kind"], sort=False)
    means = {(str(place), str(kind)): operator_means(group) for (place, kind), group in groups}
    environments = list(dict.fromkeys(environment for environment, _ in means))
    for environment in environments:
        if (environment, "expert") not in means or (environment, "naive") not in means:
            continue
        expert, naive = means[environment, "expert"], means[environment, "naive"]
        held = {
            "expert_faster": expert.time.mean(axis=1) < naive.time.mean(axis=1),
            "expert_more_accurate": expert.error.mean(axis=1) < naive.error.mean(axis=1),
            "expert_less_assisted": expert.force[AAN] < naive.force[AAN],
        }
        for name, text in PAIR_CLAIMS.items():
            yield name, "pair", environment, text, held[name].to_numpy(bool)
    if ("simulated", "naive") in means and ("real", "naive") in means:
        gains = [means[name, "naive"].time for name in ("simulated", "real")]
        simulated, real = ((1 - time[AAN] / time[FIXED]).to_numpy() for time in gains)
        text = "Naive users gain more time from AAN over Fixed in the simulation"
        yield ACROSS_CLAIM, "naive", "both", text, simulated > real


def _frame(name: str, kind: str, environment: str, text: str, holds: NDArray[np.bool_]) -> pd.DataFrame:
    labels = {
        "id": f"{name}_{kind}_{environment}",
        "claim": name,
        "kind": kind,
        "environment": environment,
        "text": text,
    }
    return pd.DataFrame({**labels, "operator": np.arange(len(holds)), "holds": holds.astype(float)})
