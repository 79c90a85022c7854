"""Beyond the thesis: what each of its own suggestions gains, and the best controller found (Vervloet,
Section 5.4).

Every suggestion is switched on alone and together with the others, on both plants, with the same balls,
noise and hands.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from soro_lib.controllers.handover import HandoverParameters
from soro_lib.controllers.virtual_stiffness import ErrorDependentStep, VirtualStiffnessController
from soro_lib.estimators.handover_filters import MEASURED_NOISE
from soro_lib.papers.soft_handover.experiments.handover import handovers, thesis_parameters
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


def suggestions() -> dict[str, HandoverParameters]:
    """Return the settings to compare, by name; the first is the thesis's fastest."""
    thesis = thesis_parameters(0.4)
    floorless = thesis_parameters(0.4, **NO_FLOOR)
    return {
        "thesis, step 0.4": thesis,
        "no error floor": floorless,
        "error-dependent step": replace(thesis, control=VirtualStiffnessController(step_size=VARIABLE_STEP)),
        "measured noise in filters": replace(thesis, filters=MEASURED_NOISE),
        "measured noise + pose bound from it": replace(
            thesis, filters=MEASURED_NOISE, pose_bound=0.001, pose_bound_share=0.5
        ),
        "state-dependent weights": replace(thesis, bend_softening=0.5),
        "no floor + measured noise": replace(floorless, filters=MEASURED_NOISE),
        "no floor + measured noise + variable step": replace(
            thesis,
            control=VirtualStiffnessController(step_size=VARIABLE_STEP, error_reference="measurement"),
            filters=MEASURED_NOISE,
        ),
        "no floor + measured noise, step 1": replace(
            thesis_parameters(1.0, **NO_FLOOR), filters=MEASURED_NOISE
        ),
        "best: and threshold 25 mm": best_controller(),
    }


def compare_controllers(
    controllers: Mapping[str, HandoverParameters],
    plants: Mapping[str, HelixPlant],
    observers: Mapping[str, Observer],
    repetitions: int,
    seed: int,
    step_limit: int,
) -> pd.DataFrame:
    """Return all runs of all controllers on all plants and through all eyes, one row per run."""
    tables = [
        handovers(
            parameters,
            plant,
            observer,
            repetitions,
            seed,
            step_limit=step_limit,
            plant=plant_name,
            observer=observer_name,
            controller=name,
        )[0]
        for plant_name, plant in plants.items()
        for observer_name, observer in observers.items()
        for name, parameters in controllers.items()
    ]
    return pd.concat(tables, ignore_index=True)


def compare_suggestions(
    plants: Mapping[str, HelixPlant],
    observers: Mapping[str, Observer],
    repetitions: int,
    seed: int,
    step_limit: int = 150,
) -> pd.DataFrame:
    """Return all runs of all suggestions, one row per run; see `compare_controllers`."""
    return compare_controllers(suggestions(), plants, observers, repetitions, seed, step_limit)


def compare_eyes(
    plants: Mapping[str, HelixPlant],
    observers: Mapping[str, Observer],
    repetitions: int,
    seed: int,
    step_limit: int = 300,
) -> pd.DataFrame:
    """Return all runs of the thesis's loop and of the best one through better and better eyes, one row per
    run.

    A third camera enters through its noise budget alone.
    """
    controllers = {
        "thesis, step 0.1": thesis_parameters(0.1),
        "thesis, step 0.4": thesis_parameters(0.4),
        "best": best_controller(),
    }
    return compare_controllers(controllers, plants, observers, repetitions, seed, step_limit)


def loop_speed(
    plants: Mapping[str, HelixPlant],
    observer: Observer,
    timesteps: Sequence[float],
    time_constants: Sequence[float],
    repetitions: int,
    seed: int,
    step_limit: int = 600,
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
    controllers = {"thesis, step 0.4": thesis_parameters(0.4), "best": best_controller()}
    tables = []
    for plant_name, plant in plants.items():
        for time_constant in time_constants:
            for timestep in timesteps:
                lagging = LaggingPlant(plant, timestep, time_constant)
                for name, parameters in controllers.items():
                    runs, _ = handovers(
                        parameters, lagging, observer, repetitions, seed, step_limit=step_limit
                    )
                    tables.append(
                        runs.assign(
                            plant=plant_name,
                            controller=name,
                            timestep_s=timestep,
                            time_constant_s=time_constant,
                            time_s=runs["steps"] * timestep,
                        )
                    )
    return pd.concat(tables, ignore_index=True)


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


def gain_over(table: pd.DataFrame, reference: str, by: Sequence[str]) -> pd.DataFrame:
    """Return a summary table with the factor by which each controller needs fewer steps than the
    reference."""
    first = table[table["controller"] == reference].set_index(list(by))["steps"]
    keys = pd.MultiIndex.from_frame(table[list(by)]) if len(by) > 1 else pd.Index(table[by[0]])
    return table.assign(fewer_steps_factor=first.reindex(keys).to_numpy() / np.asarray(table["steps"]))
