"""Beyond the thesis: what each of its own suggestions gains, and the best controller found (Vervloet,
Section 5.4).

Every suggestion is switched on alone and together with the others, on both plants, with the same balls,
noise and hands.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product

import pandas as pd

from soro_lib.controllers.handover import HandoverParameters
from soro_lib.controllers.virtual_stiffness import ErrorDependentStep, VirtualStiffnessController
from soro_lib.estimators.handover_filters import MEASURED_NOISE
from soro_lib.papers.soft_handover.experiments.handover import Blocks, Settings, compare, thesis_parameters
from soro_lib.papers.soft_handover.world.observer import Observer
from soro_lib.papers.soft_handover.world.plant import HelixPlant, LaggingPlant

NO_FLOOR = {"error_reference": "measurement"}
"""The inner error against measured pose plus modelled movement."""

VARIABLE_STEP = ErrorDependentStep(near=0.4, far=1.0, near_error=0.05, far_error=0.20)
"""Large steps far away, the thesis's largest near the goal."""


def best_controller() -> HandoverParameters:
    """Return the best settings found: no error floor, filters fed with the measurement's own variance, whole
    steps.

    The final threshold is half the thesis's, since the loop no longer stalls above it.
    """
    return replace(thesis_parameters(1.0, **NO_FLOOR), filters=MEASURED_NOISE, stop_threshold=0.025)


def labelled(controllers: Mapping[str, HandoverParameters]) -> Settings:
    """Return controllers labelled by their names."""
    return [({"controller": name}, parameters) for name, parameters in controllers.items()]


def suggestions() -> Settings:
    """Return the settings to compare; the first are the thesis's fastest."""
    thesis = thesis_parameters(0.4)
    floorless = thesis_parameters(0.4, **NO_FLOOR)
    measured = replace(thesis, filters=MEASURED_NOISE)
    variable = VirtualStiffnessController(step_size=VARIABLE_STEP)
    floorless_variable = replace(variable, error_reference="measurement")
    return labelled(
        {
            "thesis, step 0.4": thesis,
            "no error floor": floorless,
            "error-dependent step": replace(thesis, control=variable),
            "measured noise in filters": measured,
            "measured noise + pose bound from it": replace(measured, pose_bound=0.001, pose_bound_share=0.5),
            "state-dependent weights": replace(thesis, bend_softening=0.5),
            "no floor + measured noise": replace(floorless, filters=MEASURED_NOISE),
            "no floor + measured noise + variable step": replace(measured, control=floorless_variable),
            "no floor + measured noise, step 1": replace(best_controller(), stop_threshold=0.05),
            "best: and threshold 25 mm": best_controller(),
        }
    )


FASTEST = labelled({"thesis, step 0.4": thesis_parameters(0.4), "best": best_controller()})
"""The thesis's fastest controller, and the best one found."""


def compare_eyes(
    plants: Mapping[str, HelixPlant], observers: Mapping[str, Observer], repetitions: int, seed: int
) -> pd.DataFrame:
    """Return all runs of the thesis's loop and of the best one through better and better eyes, one row per
    run.

    A third camera enters through its noise budget alone.
    """
    settings = [*labelled({"thesis, step 0.1": thesis_parameters(0.1)}), *FASTEST]
    tables = [
        compare(settings, plants, Blocks(observer, repetitions, seed), observer=name)[0]
        for name, observer in observers.items()
    ]
    return pd.concat(tables, ignore_index=True)


def loop_speed(
    plants: Mapping[str, HelixPlant],
    blocks: Blocks,
    timesteps: Sequence[float],
    time_constants: Sequence[float],
) -> pd.DataFrame:
    """Return handover times over the duration of a step, for arms that need time to move (Section 5.4.5).

    The time constants are a range, not a measurement: the thesis does not say how fast the arm settles. A
    loop faster than its arm acts on an arm that has not yet followed, so the gain of a faster loop ends
    there.

    Returns
    -------
    DataFrame
        As the runs of `handovers`, with controller, timestep_s, time_constant_s and time_s.
    """
    tables = []
    for time_constant, timestep in product(time_constants, timesteps):
        lagging = {name: LaggingPlant(plant, timestep, time_constant) for name, plant in plants.items()}
        labels = {"timestep_s": timestep, "time_constant_s": time_constant}
        tables.append(compare(FASTEST, lagging, blocks, step_limit=600, **labels)[0])
    runs = pd.concat(tables, ignore_index=True)
    return runs.assign(time_s=runs["steps"] * runs["timestep_s"])


def summary(runs: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Return per group: runs, success rate, and the median and 5th and 95th percentile of steps, miss and
    overshoot."""
    groups = runs.groupby(list(by), sort=False)
    return pd.DataFrame(
        {
            "runs": groups.size(),
            "success": groups["success"].mean(),
            "steps": groups["steps"].median(),
            "steps_p05": groups["steps"].quantile(0.05),
            "steps_p95": groups["steps"].quantile(0.95),
            "miss_mm": groups["miss_mm"].median(),
            "miss_p95_mm": groups["miss_mm"].quantile(0.95),
            "overshoot_mm": groups["overshoot_mm"].median(),
        }
    ).reset_index()


def gain_over(table: pd.DataFrame, reference: str) -> pd.DataFrame:
    """Return a summary table with the factor by which each controller needs fewer steps than the reference
    on the same plant."""
    first = table[table["controller"] == reference].set_index("plant")["steps"]
    return table.assign(fewer_steps_factor=table["plant"].map(first) / table["steps"])
