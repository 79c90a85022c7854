"""The ordinal claims of the paper, each as a test on one operator's mean results.

Source: Stroppa et al., Sections 5.4 and 5.5; thresholds for "alike" and "not felt" are ours, stated here.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from operator import lt
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from soro_lib.controllers.shared_control import PARADIGMS

ALIKE_TIME, ALIKE_ERROR = 0.15, 0.25
"""Relative differences up to which two paradigms count as alike; a dead heat within one person's scatter."""

NOT_FELT = 0.1
"""Mean force below which an assistance counts as hardly felt [N], half the friction of a desktop device."""

NOT_ZERO = 1.0
"""Placement error above which it counts as not zero [mm]."""

STABLE_PATH = 20.0
"""Path beyond which a trial counts as unstable [m], eight times the shortest way."""


TIME, ERROR, FORCE = "time_s", "release_error_mm", "assistance_n"
FULL, AAN, FIXED, MSAE, ASME, AUTO = PARADIGMS
NAMES = {
    **{FULL: "Full Teleoperation", AAN: "Assist-as-Needed", FIXED: "Fixed Assistance"},
    **{MSAE: "MSAE", ASME: "ASME", AUTO: "Mostly Autonomous"},
}
Means = Mapping[str, pd.DataFrame]
"""Mean results by metric: each table has one line per operator and one column per paradigm."""


@dataclass(frozen=True)
class Claim:
    """A claim about operators of one kind: its name, its words, whom it concerns, and for whom it holds."""

    name: str
    text: str
    kinds: tuple[str, ...]
    holds: Callable[[Means], pd.Series]


def best(metric: str) -> Callable[[Means], pd.Series]:
    """Mostly autonomous has the smallest mean of the six."""
    return lambda means: means[metric].idxmin(axis=1) == AUTO


def gradual(metric: str) -> Callable[[Means], pd.Series]:
    """Each step from manual to automatic lessens the mean."""
    return lambda means: (means[metric][[FULL, MSAE, ASME, AUTO]].diff(axis=1).iloc[:, 1:] < 0).all(axis=1)


def all_shorter(means: Means) -> pd.Series:
    """Every paradigm with an automatic axis is faster than full teleoperation."""
    return means[TIME][[MSAE, ASME, AUTO]].max(axis=1) < means[TIME][FULL]


def error_not_zero(means: Means) -> pd.Series:
    """Mostly autonomous does not place exactly."""
    return means[ERROR][AUTO] > NOT_ZERO


def not_felt(means: Means) -> pd.Series:
    """The mean force of assist-as-needed is below what is felt."""
    return means[FORCE][AAN] < NOT_FELT


def stable(means: Means) -> pd.Series:
    """Every trial ends in time and without wild motion."""
    return (means["finished"] == 1).all(axis=1) & (means["path_m"] < STABLE_PATH).all(axis=1)


VERBS: Mapping[str, tuple[str, Callable[[pd.Series], pd.Series]]] = {
    "is shorter than": (TIME, lambda ratio: ratio < 1),
    "takes longer than": (TIME, lambda ratio: ratio > 1),
    "takes as long as": (TIME, lambda ratio: (ratio - 1).abs() <= ALIKE_TIME),
    "is more accurate than": (ERROR, lambda ratio: ratio < 1),
    "is less accurate than": (ERROR, lambda ratio: ratio > 1),
    "is as accurate as": (ERROR, lambda ratio: (ratio - 1).abs() <= ALIKE_ERROR),
}
"""What is compared between two paradigms, and what its ratio must be."""


def compared(name: str, kinds: tuple[str, ...], first: str, verb: str, second: str) -> Claim:
    """The claim that one paradigm compares with another as the verb says."""
    metric, holds = VERBS[verb]
    text = f"{NAMES[first]} {verb} {NAMES[second]}"
    return Claim(name, text, kinds, lambda means: holds(means[metric][first] / means[metric][second]))


BOTH, EXPERT, NAIVE = ("expert", "naive"), ("expert",), ("naive",)
CLAIMS = (
    Claim("auto_shortest", "Mostly Autonomous is the shortest of the six", BOTH, best(TIME)),
    Claim("auto_most_accurate", "Mostly Autonomous is the most accurate of the six", BOTH, best(ERROR)),
    Claim("auto_error_not_zero", "The error of Mostly Autonomous is not zero", BOTH, error_not_zero),
    Claim(
        "autonomy_shorter", f"MSAE, ASME and {NAMES[AUTO]} are shorter than {NAMES[FULL]}", BOTH, all_shorter
    ),
    Claim("gradual_time", "Each step of autonomy shortens the trial", BOTH, gradual(TIME)),
    Claim("gradual_error", "Each step of autonomy places better", BOTH, gradual(ERROR)),
    compared("asme_shorter", BOTH, ASME, "is shorter than", MSAE),
    compared("asme_more_accurate", BOTH, ASME, "is more accurate than", MSAE),
    compared("fixed_like_msae_time", EXPERT, FIXED, "takes as long as", MSAE),
    compared("fixed_like_msae_error", EXPERT, FIXED, "is as accurate as", MSAE),
    compared("fixed_slower_msae", NAIVE, FIXED, "takes longer than", MSAE),
    compared("fixed_less_accurate_msae", NAIVE, FIXED, "is less accurate than", MSAE),
    compared("aan_shorter_fixed", NAIVE, AAN, "is shorter than", FIXED),
    compared("aan_more_accurate_fixed", NAIVE, AAN, "is more accurate than", FIXED),
    compared("aan_like_full_time", EXPERT, AAN, "takes as long as", FULL),
    compared("aan_like_full_error", EXPERT, AAN, "is as accurate as", FULL),
    Claim("aan_not_felt", "The force of Assist-as-Needed is hardly felt", EXPERT, not_felt),
    compared("aan_shorter_full", NAIVE, AAN, "is shorter than", FULL),
    compared("aan_more_accurate_full", NAIVE, AAN, "is more accurate than", FULL),
    Claim("stable", "No instability", BOTH, stable),
)

ALL = sorted(PARADIGMS)
PAIR_CLAIMS = {
    "expert_faster": ("Experts are faster than naive users, mean over the paradigms", TIME, ALL),
    "expert_more_accurate": ("Experts place better than naive users, mean over the paradigms", ERROR, ALL),
    "expert_less_assisted": ("Assist-as-Needed pushes experts less than naive users", FORCE, [AAN]),
}
"""Claims that one expert has a smaller mean than one naive user, in each environment: words, of what."""

ACROSS_CLAIM = "aan_gain_larger_simulated"
"""Naive users gain more from Assist-as-Needed over Fixed Assistance in the simulation than in reality."""


def operator_means(trials: pd.DataFrame) -> Means:
    """Mean over the trials of each operator; time-outs count with their full time and no error.

    Parameters
    ----------
    trials : pandas.DataFrame
        One kind of operator in one environment: columns operator, paradigm and the metrics of a trial.

    Returns
    -------
    mapping of str to pandas.DataFrame
        By metric; of the path the longest, not the mean.
    """

    def table(metric: str, how: Literal["mean", "max"] = "mean") -> pd.DataFrame:
        return trials.pivot_table(index="operator", columns="paradigm", values=metric, aggfunc=how)

    return {metric: table(metric) for metric in (TIME, ERROR, FORCE, "finished")} | {
        "path_m": table("path_m", "max")
    }


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
    pieces: list[pd.DataFrame] = []

    def judge(claim: str, kind: str, environment: str, text: str, holds: ArrayLike) -> None:
        labels = {"claim": claim, "kind": kind, "environment": environment, "text": text}
        held = pd.DataFrame({**labels, "holds": np.asarray(holds, dtype=float)})
        held.insert(0, "id", f"{claim}_{kind}_{environment}")
        held.insert(5, "operator", held.index)
        pieces.append(held)

    means = {
        (str(kind), str(environment)): operator_means(group)
        for (kind, environment), group in trials.groupby(["kind", "environment"], sort=False)
    }
    for (kind, environment), table in means.items():
        for claim in CLAIMS:
            if kind in claim.kinds:
                judge(claim.name, kind, environment, claim.text, claim.holds(table))
    for environment in dict.fromkeys(environment for _, environment in means):
        if ("expert", environment) in means and ("naive", environment) in means:
            expert, naive = means["expert", environment], means["naive", environment]
            for name, (text, metric, paradigms) in PAIR_CLAIMS.items():
                means_of_both = (table[metric][paradigms].mean(axis=1) for table in (expert, naive))
                judge(name, "pair", environment, text, lt(*means_of_both))
    if ("naive", "simulated") in means and ("naive", "real") in means:
        times = [means["naive", environment][TIME] for environment in ("simulated", "real")]
        simulated, real = ((1 - time[AAN] / time[FIXED]).to_numpy() for time in times)
        text = "Naive users gain more time from AAN over Fixed in the simulation"
        judge(ACROSS_CLAIM, "naive", "both", text, simulated > real)
    return pd.concat(pieces, ignore_index=True)


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
    pieces = {
        condition: claim_probabilities(evaluate_claims(group))
        for condition, group in trials.groupby(conditions, sort=False)
    }
    return pd.concat(pieces, names=conditions).reset_index(conditions).reset_index(drop=True)
