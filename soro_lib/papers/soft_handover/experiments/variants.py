"""What the printed algorithm does that the thesis does not say: six findings, each by an experiment.

1. The error stalls at ``epsilon_pose / alpha``, which for the smallest step size is the stop threshold
itself. 2. Early exit or all iterations, norms or squared norms: what each reading of Algorithm 1 changes.
3. The wrist's filter caps how fast the loop can converge, whatever the step size.
4. The state optimisation explains the measured pose with lengths that no segment can have.
5. Without it the loop stalls.
6. On the elastic arm, a ball opposite a tendon takes long, and farther out cannot be reached.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from soro_lib.controllers.handover import HandoverParameters, Mode, SafetyRules
from soro_lib.controllers.virtual_stiffness import state_limits
from soro_lib.estimators.handover_filters import APPENDIX_A, FilterNoise, FilterParameters
from soro_lib.estimators.shape_estimation import estimate_shape
from soro_lib.papers.soft_handover.experiments import handover
from soro_lib.papers.soft_handover.experiments.handover import Settings, thesis_parameters
from soro_lib.papers.soft_handover.world.plant import HelixPlant

NO_FILTER = FilterParameters(*[FilterNoise(1.0, 1e-12)] * 3)
"""Filters that take every measurement as it is."""


UNSTOPPED: dict[str, Any] = {
    "stop_threshold": 1e-9,
    "filters": NO_FILTER,
    "safety": SafetyRules(frozen_looks=10**9, patience=10**9),
}
"""Settings that let a loop stall for as long as it wants."""


def loop_variants(step_size: float) -> dict[str, HandoverParameters]:
    """Return the readings of Algorithms 1 and 3 and Eq. (16) that the thesis leaves open, by name (Finding
    2)."""
    printed = thesis_parameters(step_size)
    squared = thesis_parameters(step_size, tolerance=0.005**0.5, inner_loop="early exit")
    return {
        "all 20 iterations": printed,
        "early exit": thesis_parameters(step_size, inner_loop="early exit"),
        "squared norm in Algorithm 1": squared,
        "squared norm in Eq. (16)": replace(printed, pose_bound=0.005**0.5),
        "squared norm in Algorithm 3": replace(printed, stop_threshold=0.05**0.5),
        "pose bound 2 mm": replace(printed, pose_bound=0.002),
        "no filter": replace(printed, filters=NO_FILTER),
        "no error floor": thesis_parameters(step_size, error_reference="measurement"),
    }


def readings(step_sizes: Sequence[float]) -> Settings:
    """Return the settings of all :func:`loop_variants`, by step size and reading."""
    return [
        ({"alpha": step_size, "variant": name}, parameters)
        for step_size in step_sizes
        for name, parameters in loop_variants(step_size).items()
    ]


def with_and_without_filters(step_sizes: Sequence[float]) -> Settings:
    """Return the settings that show what the thesis's filters cost (Finding 3)."""
    return [
        ({"alpha": step_size, "filters": name}, replace(thesis_parameters(step_size), filters=filters))
        for step_size in step_sizes
        for name, filters in (("Appendix A", APPENDIX_A), ("no filter", NO_FILTER))
    ]


def with_and_without_estimation(step_size: float) -> Settings:
    """Return the settings that show what the state optimisation is good for (Finding 5)."""
    return [
        ({"alpha": step_size, "estimated": on}, replace(thesis_parameters(step_size), estimate_shape=on))
        for on in (True, False)
    ]


def error_floor(
    plant: HelixPlant,
    step_sizes: Sequence[float] = (0.1, 0.2, 0.4),
    pose_bounds: Sequence[float] = (0.001, 0.002, 0.005, 0.01),
    steps: int = 200,
) -> pd.DataFrame:
    """Return where the error comes to rest without noise, beside ``epsilon_pose / alpha`` (Finding 1).

    Each inner loop leads to its own rest; the stop threshold is out of the way.

    Returns
    -------
    DataFrame
        loop, alpha, pose_bound_mm, floor_mm (simulated), predicted_mm (bound over alpha).
    """
    rows = []
    for loop, step_size, bound in product(
        ("all 20 iterations", "early exit", "no error floor"), step_sizes, pose_bounds
    ):
        parameters = replace(loop_variants(step_size)[loop], pose_bound=bound, **UNSTOPPED)
        run = handover.still_handover(parameters, plant, "front", steps)
        floor = run.trace["error_mm"][-20:].mean()
        rows.append((loop, step_size, 1e3 * bound, floor, 1e3 * bound / step_size))
    return pd.DataFrame(rows, columns=["loop", "alpha", "pose_bound_mm", "floor_mm", "predicted_mm"])


def filter_pole(step_gain: float, filter_gain: float) -> float:
    """Return the slowest pole's modulus of an integrating loop behind a Kalman filter.

    ``z^2 - (2 - k - k a) z + (1 - k) = 0`` with loop gain a per step and filter gain k (Finding 3).
    """
    roots = np.roots([1.0, -(2 - filter_gain - filter_gain * step_gain), 1 - filter_gain])
    return float(np.abs(roots).max())


def steady_gain(noise: FilterNoise) -> float:
    """Return the Kalman gain that the filter of Eqs. (14)-(15) settles to."""
    if noise.measurement is None:
        raise ValueError("measurement must be a number: a filter with claimed variances has no steady gain")
    ratio = noise.process / noise.measurement
    predicted = (ratio + np.sqrt(ratio**2 + 4 * ratio)) / 2
    return float(predicted / (predicted + 1))


def estimated_shapes(
    plants: Mapping[str, HelixPlant],
    cases: int,
    seed: int,
    length_weights: Sequence[float] = (1.0, 10.0, 100.0),
) -> pd.DataFrame:
    """Return how well the state optimisation finds the true shape, from perfect poses (Finding 4).

    Commands are drawn evenly within the limits; `length_weights` multiply the weights of the lengths in
    ``A_pose,upd``, which mixes rad and m (Erratum SH-22).

    Returns
    -------
    DataFrame
        plant, length_weight, case, segment, bend_error_deg (of the bending vector), length_error_mm, outside
        (whether the estimated length is outside the limits of Eq. (11)).
    """
    rng = np.random.default_rng(seed)
    parameters = HandoverParameters()
    arm = parameters.control.arm
    lower, upper = (limit[1::2] for limit in state_limits(arm))
    bends = np.asarray(arm.maximum_bends)
    tables = []
    for case in range(cases):
        heading, share = rng.uniform(0, 2 * np.pi, 3), np.sqrt(rng.uniform(0, 1, 3))
        lengths = rng.uniform(lower, upper)
        bending = share * bends * np.cos(heading), share * bends * np.sin(heading)
        command = np.stack([*bending, lengths], axis=-1).ravel()
        for name, plant in plants.items():
            plant.reset()
            true = plant.settle(arm.tendon_lengths(command))
            for weight in length_weights:
                weights = np.asarray(parameters.pose_weights) * np.tile([1, 1, weight], 3)
                estimate = estimate_shape(command, arm.tip_points(true), parameters.pose_bound, weights)
                miss = (estimate.q - true).reshape(3, 3)
                estimated = estimate.q[2::3]
                errors = {
                    "bend_error_deg": np.rad2deg(np.hypot(*miss[:, :2].T)),
                    "length_error_mm": 1e3 * miss[:, 2],
                    "outside": (estimated < lower) | (estimated > upper),
                }
                labels = {"plant": name, "length_weight": weight, "case": case, "segment": (1, 2, 3)}
                tables.append(pd.DataFrame({**labels, **errors}))
    return pd.concat(tables, ignore_index=True)


def reach_by_heading(
    plants: Mapping[str, HelixPlant], laterals: Sequence[float], step_limit: int = 120
) -> pd.DataFrame:
    """Return the steps to balls farther and farther aside, without noise (Finding 6).

    Tendons of a segment stand at 0, 120 and 240 degrees: a ball at 0 is on the side of a tendon, one at 180
    opposite.

    Returns
    -------
    DataFrame
        plant, heading_deg, lateral_mm, steps, closed.
    """
    rows = []
    for (name, plant), heading, lateral in product(plants.items(), (0.0, 180.0), laterals):
        holder = handover.BallHolder(lateral, headings={"ball": heading}, placement_deviation=0.0, sway=0.0)
        run = handover.still_handover(thesis_parameters(0.4), plant, "ball", step_limit, holder)
        rows.append((name, heading, 1e3 * lateral, run.steps, run.mode is Mode.GRASP))
    return pd.DataFrame(rows, columns=["plant", "heading_deg", "lateral_mm", "steps", "closed"])
