"""Past an obstacle (Lai et al., Fig. 14): the cost of Eq. (29) and a guaranteed clearance side by side."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from soro_lib.controllers.gesture_steering import GestureSteering, SteeringSettings, replay
from soro_lib.controllers.obstacles import Sphere, smallest_clearance
from soro_lib.controllers.steering_step import StepWeights
from soro_lib.papers.gesture_steering.experiments import steering
from soro_lib.papers.gesture_steering.world.hand import Array
from soro_lib.robots import CableDrivenArm
from soro_lib.sensing.hand_tracking import HandSample, hand_samples

OBSTACLE = Sphere((0.0, 0.0, 0.120), 0.010)
"""The sphere of Fig. 14."""
LINES = {
    "y 12, z 125": (0.012, 0.125),
    "y 8, z 112": (0.008, 0.112),
    "y 0, z 104": (0.0, 0.104),
    "y 20, z 140": (0.020, 0.140),
}
"""Straight motions past the obstacle, from x = 25 mm to -25 mm, at a y and a z [m]; the paper prints none,
these are ours."""
DURATION = 6.0
"""Time that a motion takes [s]."""
POLICIES: dict[str, tuple[float, float | None]] = {
    "off": (0.0, None),
    "eta = 10": (10.0, None),
    "eta = 100": (100.0, None),
    "hard, 1 mm": (0.0, 1e-3),
}
"""Weight eta of Eq. (29) [mm^2] and guaranteed clearance [m] of the ways to avoid that are compared."""


def crossed(rng: np.random.Generator, line: str, policy: str) -> pd.DataFrame:
    """Steer the tip along a straight line past the obstacle.

    Parameters
    ----------
    rng : Generator
        Tremor and clock of the hand.
    line : str
        A key of ``LINES``.
    policy : str
        A key of ``POLICIES``.

    Returns
    -------
    DataFrame
        As :func:`~soro_lib.papers.gesture_steering.experiments.steering.result_table`,
        with ``deviation_{x,y,z}_mm`` (tip minus target) and ``clearance_mm`` (surface to surface, negative
        in collision), ``line`` and ``policy``.
    """
    start, end = (np.array([x, *LINES[line]]) for x in (0.025, -0.025))

    def path(time: Array) -> Array:
        share = np.clip(np.asarray(time) / DURATION, 0.0, 1.0)[:, None]
        return start + share * (end - start)

    eta, margin = POLICIES[policy]
    free = SteeringSettings(mapping=steering.HIGH_REACH, weights=StepWeights(direction=1.0), iterations=2)
    settings = replace(free, weights=StepWeights(avoidance=eta), obstacles=(OBSTACLE,), margin=margin)
    arm = CableDrivenArm()
    table = steering.commanding_hand(rng, DURATION, path, steering.straight, mapping=settings.mapping)
    samples = steering.at_interval(hand_samples(table), steering.CONTROL_PERIOD)
    results = replay(GestureSteering(arm, settings, _beside_the_obstacle(arm, free, start)), samples)
    found = steering.result_table(results, steering.LEAD)
    for axis in "xyz":
        found[f"deviation_{axis}_mm"] = found[f"tip_{axis}_mm"] - found[f"target_{axis}_mm"]
    found["clearance_mm"] = 1e3 * smallest_clearance(arm, steering.actuations(found), OBSTACLE)
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
    columns = {f"{axis}_mm": table[f"deviation_{axis}_mm"].abs() for axis in "xyz"}
    groups = table.assign(**columns).groupby(["line", "policy", "seed"], sort=False)
    largest = groups[list(columns)].max()
    return table, largest.join(groups["clearance_mm"].min()).reset_index()


def _beside_the_obstacle(arm: CableDrivenArm, settings: SteeringSettings, start: Array) -> Array:
    """Return the actuation (7,) at the start of a line, found by following (26) without the obstacle."""
    x, y, z = settings.mapping.palm(tuple(start))
    hand = HandSample(0.0, 1, (x, y, z), (0.0, -1.0, 0.0), (True,) * 5)
    steps = [replace(hand, time=0.02 * index) for index in range(150)]
    return replay(GestureSteering(arm, settings), steps)[-1].actuation
