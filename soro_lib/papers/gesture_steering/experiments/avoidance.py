"""Past an obstacle (Lai et al., Fig. 14): the cost of Eq. (29) and a guaranteed clearance side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from soro_lib.controllers.gesture_steering import GestureSteering, SteeringSettings
from soro_lib.controllers.obstacles import Sphere, smallest_clearance
from soro_lib.controllers.steering_step import StepWeights
from soro_lib.papers.gesture_steering.experiments.steering import (
    CONTROL_PERIOD,
    HIGH_REACH,
    LEAD,
    at_interval,
    commanding_hand,
    result_table,
    straight,
)
from soro_lib.robots import CableDrivenArm
from soro_lib.sensing.hand_tracking import HandSample, hand_samples

Array = NDArray[np.float64]

OBSTACLE = Sphere((0.0, 0.0, 0.120), 0.010)
"""The sphere of Fig. 14."""
LINES: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "y 12, z 125": ((0.025, 0.012, 0.125), (-0.025, 0.012, 0.125)),
    "y 8, z 112": ((0.025, 0.008, 0.112), (-0.025, 0.008, 0.112)),
    "y 0, z 104": ((0.025, 0.0, 0.104), (-0.025, 0.0, 0.104)),
    "y 20, z 140": ((0.025, 0.020, 0.140), (-0.025, 0.020, 0.140)),
}
"""Straight motions past the obstacle, start and end of the tip [m]; the paper prints none, these are ours."""
POLICIES: dict[str, tuple[float, float | None]] = {
    "off": (0.0, None),
    "eta = 10": (10.0, None),
    "eta = 100": (100.0, None),
    "hard, 1 mm": (0.0, 1e-3),
}
"""Weight eta of Eq. (29) [mm^2] and guaranteed clearance [m] of the ways to avoid that are compared."""


def crossed(rng: np.random.Generator, line: str, policy: str, duration: float = 6.0) -> pd.DataFrame:
    """Steer the tip along a straight line past the obstacle.

    Parameters
    ----------
    rng : Generator
        Tremor and clock of the hand.
    line : str
        A key of ``LINES``.
    policy : str
        A key of ``POLICIES``.
    duration : float
        [s].

    Returns
    -------
    DataFrame
        As :func:`~soro_lib.papers.gesture_steering.experiments.steering.result_table`,
        with ``deviation_{x,y,z}_mm`` (tip minus target) and ``clearance_mm`` (surface to surface, negative
        in collision), ``line`` and ``policy``.
    """
    start, end = np.array(LINES[line])

    def path(time: Array) -> Array:
        share = np.clip(np.asarray(time) / duration, 0.0, 1.0)[:, None]
        return start + share * (end - start)

    eta, margin = POLICIES[policy]
    settings = SteeringSettings(
        mapping=HIGH_REACH,
        weights=StepWeights(avoidance=eta),
        iterations=2,
        obstacles=(OBSTACLE,),
        margin=margin,
    )
    arm = CableDrivenArm()
    table = commanding_hand(rng, duration, path, straight, mapping=settings.mapping)
    steering = _beside_the_obstacle(arm, settings, start)
    results = [steering.update(sample) for sample in at_interval(hand_samples(table), CONTROL_PERIOD)]
    found = result_table(results, LEAD)
    for axis in "xyz":
        found[f"deviation_{axis}_mm"] = found[f"tip_{axis}_mm"] - found[f"target_{axis}_mm"]
    actuations = np.array([result.actuation for result in results])
    found["clearance_mm"] = 1e3 * smallest_clearance(arm, actuations, OBSTACLE)
    found["line"], found["policy"] = line, policy
    return found.query("time_s >= 0").reset_index(drop=True)


def avoidance_table(
    seed: int, seeds: int = 3, lines: Sequence[str] = tuple(LINES)
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Try every policy on every line.

    Returns
    -------
    runs : DataFrame
        All rows of :func:`crossed`, with ``seed``.
    summary : DataFrame
        Per line, policy and seed: ``x_mm``, ``y_mm``, ``z_mm`` (largest deviation), ``clearance_mm``
        (smallest).
    """
    runs = []
    for index, child in enumerate(np.random.SeedSequence(seed).spawn(seeds)):
        for line in lines:
            for policy in POLICIES:
                runs.append(crossed(np.random.default_rng(child), line, policy).assign(seed=index))
    table = pd.concat(runs, ignore_index=True)
    deviations = (
        table[[f"deviation_{axis}_mm" for axis in "xyz"]].abs().set_axis(["x_mm", "y_mm", "z_mm"], axis=1)
    )
    keys = [table["line"], table["policy"], table["seed"]]
    summary = deviations.groupby(keys, sort=False).max()
    summary["clearance_mm"] = table.groupby(keys, sort=False)["clearance_mm"].min()
    return table, summary.reset_index()


def _beside_the_obstacle(arm: CableDrivenArm, settings: SteeringSettings, start: Array) -> GestureSteering:
    """Return a controller that begins on the line: its start is found by following (26)."""
    free = replace(settings, obstacles=(), margin=None, weights=StepWeights(direction=1.0))
    steering = GestureSteering(arm, free)
    hand = settings.mapping.palm(tuple(start))
    for index in range(150):
        result = steering.update(HandSample(0.02 * index, 1, hand, (0.0, -1.0, 0.0), (True,) * 5))
    return GestureSteering(arm, settings, result.actuation)
