"""Which conclusions depend on the operator: rank correlations over a Latin hypercube of possible operators.

The ranges are far wider than the populations: from a developer of the arm to somebody who has never seen it.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import qmc, spearmanr

from soro_lib.controllers.shared_control import PARADIGMS
from soro_lib.papers.shared_control.experiments.claims import AAN, ASME, AUTO, FIXED, FULL, MSAE
from soro_lib.papers.shared_control.experiments.simulation import TrialPlan, simulate
from soro_lib.papers.shared_control.experiments.task import TaskSettings
from soro_lib.papers.shared_control.world import EXPERT, Operator

RANGES: Mapping[str, tuple[float, float]] = {
    "reaction_delay": (0.15, 0.40),
    "refractory": (0.2, 0.8),
    "submovement_time": (0.3, 0.7),
    "lag_model": (0.0, 1.0),
    "wait_speed": (0.01, 0.3),
    "gain_factor": (0.6, 1.6),
    "mapping_angle": (0.0, 0.5),
    "motor_noise": (0.02, 0.2),
    "lateral_error": (0.002, 0.015),
    "depth_error": (0.005, 0.1),
    "tolerance": (0.008, 0.03),
    "dwell": (0.2, 2.0),
    "think": (0.2, 1.5),
    "hand_stiffness": (80.0, 500.0),
    "cue_gain": (0.0, 0.04),
    "approach_height": (0.0, 0.15),
    "view_elevation": (math.radians(15.0), math.radians(60.0)),
}
"""Least and largest value of each parameter of `Operator`."""


def draw_anyone(count: int, seed: int) -> list[Operator]:
    """Operators of a Latin hypercube over `RANGES`."""
    sampler = qmc.LatinHypercube(len(RANGES), rng=np.random.default_rng([seed, 5]))
    low, high = np.array(list(RANGES.values())).T
    points = qmc.scale(sampler.random(count), low, high)
    return [replace(EXPERT, **dict(zip(RANGES, point.tolist(), strict=True))) for point in points]


def margins(trials: pd.DataFrame) -> pd.DataFrame:
    """How clearly each conclusion holds for each operator: logarithms of ratios, positive where it holds."""
    time = np.log(trials.pivot_table(index="operator", columns="paradigm", values="time_s"))
    error = np.log(trials.pivot_table(index="operator", columns="paradigm", values="release_error_mm"))
    force = trials.pivot_table(index="operator", columns="paradigm", values="assistance_n")
    others = [FULL, AAN, FIXED, MSAE, ASME]
    return pd.DataFrame(
        {
            "Auto shortest": time[others].min(axis=1) - time[AUTO],
            "Auto most accurate": error[others].min(axis=1) - error[AUTO],
            "ASME shorter than MSAE": time[MSAE] - time[ASME],
            "ASME more accurate": error[MSAE] - error[ASME],
            "MSAE shorter than Full": time[FULL] - time[MSAE],
            "AAN shorter than Full": time[FULL] - time[AAN],
            "AAN more accurate": error[FULL] - error[AAN],
            "AAN shorter than Fixed": time[FIXED] - time[AAN],
            "Fixed slower than MSAE": time[FIXED] - time[MSAE],
            "Force of AAN": force[AAN],
        }
    )


def sensitivity(count: int, seed: int, trials: int = 2, **run: Any) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Simulate anyone and correlate the margins with the parameters.

    Parameters
    ----------
    count : int
        Operators.
    seed : int
    trials : int
        Of each operator under each paradigm.
    **run
        jobs, scheduler or store of `simulate`.

    Returns
    -------
    correlations : pandas.DataFrame
        Spearman's rank correlation, one line per parameter and one column per conclusion.
    held : pandas.DataFrame
        One line per conclusion: share of operators for whom it holds, with a 95 % interval (normal).
    """
    people = draw_anyone(count, seed)

    def plans() -> Iterator[TrialPlan]:
        for name, paradigm in PARADIGMS.items():
            settings = TaskSettings(paradigm)
            for person, operator in enumerate(people):
                for trial in range(trials):
                    labels = {"paradigm": name, "operator": person, "trial": trial}
                    yield TrialPlan(settings, operator, (seed, 6, person, trial), labels)

    results = margins(simulate(plans(), time_limit=120.0, **run))
    parameters = pd.DataFrame([{name: getattr(person, name) for name in RANGES} for person in people])
    correlations = pd.DataFrame(
        {
            name: [
                spearmanr(parameters[parameter], margin, nan_policy="omit").statistic for parameter in RANGES
            ]
            for name, margin in results.items()
        },
        index=list(RANGES),
    )
    share = (results.drop(columns="Force of AAN") > 0).mean()
    spread = 1.96 * np.sqrt(share * (1 - share) / count)
    held = pd.DataFrame({"probability": share, "low": share - spread, "high": share + spread})
    return correlations, held.rename_axis("conclusion").reset_index()
