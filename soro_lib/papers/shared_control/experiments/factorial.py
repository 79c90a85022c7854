"""The tuning study: 2^6 settings of assist-as-needed, three repetitions, analysed in two ways.

The printed F(1, 2) have two error degrees of freedom: the three repetitions were taken for subjects of a
repeated-measures design. A plain n-way analysis of the same 192 trials has 186 or fewer.

Source: Stroppa et al., Section 5.3 and Table 2.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import f as f_distribution
from statsmodels.formula.api import ols
from statsmodels.stats.anova import AnovaRM, anova_lm

from soro_lib.checks import one_of
from soro_lib.controllers.shared_control import PARADIGMS
from soro_lib.papers.shared_control.experiments.simulation import TrialPlan, person_plans, simulate
from soro_lib.papers.shared_control.experiments.task import TaskSettings
from soro_lib.papers.shared_control.world.people import Operator

FACTORS: Mapping[str, tuple[float, float]] = {
    "f_max": (3.0, 7.0),
    "k_max": (50.0, 100.0),
    "delta": (2.0, 5.0),
    "xi_s": (1.0, 3.0),
    "xi_c": (1.0, 3.0),
    "xi_a": (1.0, 3.0),
}
"""Low and high level of each factor (Stroppa et al., Table 2): N, N/m, unit of Delta disputed, s, s, s."""

RESPONSES = ("time_s", "path_m", "assistance_n", "placement_error_mm")
"""T, L, H and P."""

DeltaReading = Literal["seconds", "per_second", "per_sample"]
"""Delta of Table 2 as the time from 0 to k_MAX [s], as a rate [N/m per s], or as a step per sample [N/m]."""


def stiffness_rate(delta: float, k_max: float, reading: DeltaReading) -> float:
    """Delta of Table 2 as a rate [N/m per s] (Erratum SC-4).

    Raises
    ------
    ValueError
        If the reading has no such name.
    """
    rates = {"seconds": k_max / delta, "per_second": delta, "per_sample": 100.0 * delta}
    one_of("reading", reading, rates)
    return rates[reading]


def run_factorial(
    operators: list[Operator],
    seed: int,
    repetitions: int = 3,
    reading: DeltaReading = "seconds",
    force_law: Literal["printed", "program"] = "printed",
    **run: Any,
) -> pd.DataFrame:
    """Simulate the tuning study: every combination of the levels, for each repetition of each operator.

    Every trial has a random stream of its own, as a person never repeats himself: streams shared over the
    settings would leave the analysis hardly any error to divide by.

    Parameters
    ----------
    operators : list of Operator
        Each does the whole study.
    seed : int
    repetitions : int
    reading : str
        Of Delta.
    force_law : {"printed", "program"}
    **run
        jobs, scheduler or store of `simulate`.

    Returns
    -------
    pandas.DataFrame
        One line per trial: the levels (0 low, 1 high), operator, repetition and the metrics.
    """

    def plans() -> Iterator[TrialPlan]:
        for levels in product((0, 1), repeat=len(FACTORS)):
            labels = dict(zip(FACTORS, levels, strict=True))
            values = {name: FACTORS[name][level] for name, level in labels.items()}
            parameters = {
                "maximum_force": values["f_max"],
                "maximum_stiffness": values["k_max"],
                "stiffness_rate": stiffness_rate(values["delta"], values["k_max"], reading),
                "steady_delay": values["xi_s"],
                "approach_delay": values["xi_c"],
                "away_delay": values["xi_a"],
            }
            paradigm = PARADIGMS["assist_as_needed"]
            setting = TaskSettings(paradigm, force_law=force_law, assist_as_needed=parameters)
            yield from person_plans(
                setting, operators, (seed, 3), repetitions, labels, setting=levels, counted="repetition"
            )

    return simulate(plans(), chunk=96, **run)


# --- Analysis of one operator's study ------------------------------------------------------------


def repeated_measures_anova(trials: pd.DataFrame, response: str) -> pd.DataFrame:
    """Analysis with the repetitions as subjects: every effect has F(1, repetitions - 1).

    Returns
    -------
    pandas.DataFrame
        Columns effect (factors joined by ``:``), f, df, df_error, p.

    Raises
    ------
    ValueError
        If the trials are those of several operators, or a setting is missing.
    """
    _check_balanced(trials)
    fitted = AnovaRM(trials, response, "repetition", within=list(FACTORS)).fit().anova_table
    table = fitted.reset_index().set_axis(["effect", "f", "df", "df_error", "p"], axis=1)
    return table.astype({"df": int, "df_error": int})


def plain_anova(trials: pd.DataFrame, response: str) -> pd.DataFrame:
    """The n-way analysis with main effects and two-way interactions, every trial an independent sample.

    Returns
    -------
    pandas.DataFrame
        Columns effect, f, df, df_error, p.
    """
    _check_balanced(trials)
    factors = " + ".join(f"C({name}, Sum)" for name in FACTORS)
    fitted = ols(f"{response} ~ ({factors}) ** 2", data=trials).fit()
    table = anova_lm(fitted, typ=2).drop(index="Residual").rename(columns={"F": "f", "PR(>F)": "p"})
    effects = [name.replace("C(", "").replace(", Sum)", "") for name in table.index]
    table = table.assign(effect=effects, df=table["df"].astype(int), df_error=int(fitted.df_resid))
    return table[["effect", "f", "df", "df_error", "p"]].reset_index(drop=True)


def _check_balanced(trials: pd.DataFrame) -> None:
    counts = trials.groupby([*FACTORS, "repetition"]).size()
    expected = 2 ** len(FACTORS) * trials["repetition"].nunique()
    if len(counts) != expected or counts.max() > 1:
        raise ValueError(
            f"the analysis needs every setting once per repetition ({expected} trials of one operator), "
            f"got {len(trials)}"
        )


# --- Effects of many operators at once ------------------------------------------------------------


@dataclass(frozen=True)
class Contrast:
    """A difference of means: of what, the sets of levels whose means are subtracted, the claimed sign."""

    name: str
    response: str
    high: Mapping[str, int]
    low: Mapping[str, int]
    sign: float


CONTRASTS = (
    Contrast("fmax_time", "time_s", {"f_max": 1}, {"f_max": 0}, -1.0),
    Contrast("fmax_path", "path_m", {"f_max": 1}, {"f_max": 0}, -1.0),
    Contrast("fmax_assistance", "assistance_n", {"f_max": 1}, {"f_max": 0}, 1.0),
    Contrast("xi_time", "time_s", {"xi_a": 0, "xi_s": 0}, {"xi_a": 1, "xi_s": 1}, -1.0),
    Contrast("xi_a_path", "path_m", {"xi_a": 0}, {"xi_a": 1}, -1.0),
    Contrast("xi_s_path", "path_m", {"xi_s": 0}, {"xi_s": 1}, -1.0),
    Contrast("kmax_assistance", "assistance_n", {"k_max": 0, "xi_s": 1}, {"k_max": 1, "xi_s": 1}, 1.0),
)
"""The effects that the paper reports, in its signs."""


def contrast_samples(trials: pd.DataFrame, contrast: Contrast) -> NDArray[np.float64]:
    """The contrast for each operator and repetition, shape (operators, repetitions)."""
    means = [_cell_means(trials, contrast.response, levels) for levels in (contrast.high, contrast.low)]
    return (means[0] - means[1]).to_numpy()


def interaction_samples(trials: pd.DataFrame, response: str, first: str, second: str) -> NDArray[np.float64]:
    """Half the difference of the first factor's effect between the levels of the second, as above."""
    cells = {
        levels: _cell_means(trials, response, {first: levels[0], second: levels[1]})
        for levels in product((0, 1), repeat=2)
    }
    return ((cells[1, 1] - cells[0, 1] - cells[1, 0] + cells[0, 0]) / 2).to_numpy()


def blocked_f(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    """F(1, repetitions - 1) of contrasts (..., repetitions): the square of their t statistic."""
    count = samples.shape[-1]
    return count * samples.mean(axis=-1) ** 2 / samples.var(axis=-1, ddof=1)


def implied_trial_deviation(effect: float, f: float, trials_per_cell: int = 32) -> float:
    """Standard deviation of one trial implied by an effect and its F, for independent scatter.

    A contrast of two means of 32 trials per repetition, three repetitions, has the standard error
    sd sqrt(2 / (3 x 32)), and F is the square of effect over standard error.
    """
    return float(abs(effect) / np.sqrt(f) * np.sqrt(3 * trials_per_cell / 2))


def printed_p_value(f: Any, df: int = 1, df_error: int = 2) -> Any:
    """Probability of a larger F."""
    return f_distribution.sf(f, df, df_error)


def _cell_means(trials: pd.DataFrame, response: str, levels: Mapping[str, int]) -> pd.DataFrame:
    chosen = np.logical_and.reduce([trials[name] == level for name, level in levels.items()])
    return trials[chosen].pivot_table(index="operator", columns="repetition", values=response)
