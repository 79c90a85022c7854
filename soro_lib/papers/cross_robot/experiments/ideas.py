"""What carries the papers' ideas: the freedom of an arm besides its tip, and its size beside a force."""

from __future__ import annotations

from itertools import product

import numpy as np
import pandas as pd

from soro_lib.controllers import AssistAsNeeded, FixedAssistance, GestureSteering
from soro_lib.controllers.gesture_steering import SteeringSettings
from soro_lib.controllers.steering_step import StepWeights
from soro_lib.papers.cross_robot.experiments.contest import SENSOR_NOISE
from soro_lib.papers.cross_robot.experiments.laws import (
    STEP_TIME,
    VirtualStiffness,
    actuator_stiffness,
    palm_mapping,
    stiff_step,
)
from soro_lib.papers.cross_robot.world.benches import (
    CABLE_LENGTH,
    GROWN_LENGTH,
    HELIX_LENGTH,
    Array,
    Bench,
    as_it_is,
    benches,
    resized,
)
from soro_lib.sensing.hand_tracking import HandSample

PUSH = 0.03
"""How far the tip is moved to see what the rest of the arm does, as a share of its length [-]."""


def redundancy() -> pd.DataFrame:
    """Return what each arm can do besides placing its tip, and what the papers' two ways to use it achieve.

    Returns
    -------
    pandas.DataFrame
        One row per arm: ``actuators``; how many of them are free beside the tip (``free_tip``), and beside
        tip and direction (``free_pose``); the motion of the mid point in percent of the tip motion asked for,
        with an open palm and with the fist that locks it, and how much of the tip motion the fist leaves
        ``undone``; the stretch of the arm per tip motion [mm/mm] under unit and under virtual stiffness, at
        the outermost point of the path.
    """
    rows = []
    for name, bench in benches().items():
        jacobian = bench.robot.jacobian(bent(bench))
        palm, fist = (pushed(bench, fingers) for fingers in ((True,) * 5, (False,) * 5))
        unit, virtual = stretch_per_motion(bench)
        rows.append(
            {
                "arm": name,
                "actuators": len(bench.start),
                "free_tip": len(bench.start) - np.linalg.matrix_rank(jacobian[:3]),
                "free_pose": max(len(bench.start) - 5, 0),
                "palm_percent": 100.0 * palm[0],
                "fist_percent": 100.0 * fist[0],
                "undone_percent": 100.0 * fist[1],
                "unit_stretch": unit,
                "stiff_stretch": virtual,
            }
        )
    return pd.DataFrame(rows)


def bent(bench: Bench) -> Array:
    """Return the actuation (n,) with the tip at the outermost point of the path, by the virtual stiffness."""
    arm = resized(bench, HELIX_LENGTH)
    law = VirtualStiffness(arm, bench.start / arm.units, 1, np.random.default_rng(0))
    for goal in np.repeat(bench.path(1, 0), 80, axis=0) / arm.ratio:
        pose = arm.forward(law.actuation)
        law.update(pose[:, :3, 3], pose[:, :3, 2], goal)
    return law.actuation[0] * arm.units


def pushed(bench: Bench, fingers: tuple[bool, bool, bool, bool, bool]) -> tuple[float, float]:
    """Move the hand; return the mid point's motion and the tip's missing one, per motion asked for."""
    arm = resized(bench, CABLE_LENGTH)
    start = bench.start / arm.units
    mapping = palm_mapping(arm.tip(start)[2])
    weights = StepWeights(direction=0.0)
    steering = GestureSteering(arm, SteeringSettings(mapping, weights=weights), start)
    middle = steering.pose.mid
    asked = PUSH * CABLE_LENGTH
    goal = arm.tip(start) + asked * np.array([1.0, 0.0, 0.0])
    for frame in range(75):
        target = arm.tip(start) if frame < 15 else goal
        palm = mapping.palm(tuple(target.tolist()))
        result = steering.update(HandSample(STEP_TIME * frame, 1, palm, (0.0, -1.0, 0.0), fingers))
    return float(np.linalg.norm(result.mid - middle) / asked), float(
        np.linalg.norm(result.tip - goal) / asked
    )


def stretch_per_motion(bench: Bench) -> tuple[float, float]:
    """Return how much the arm stretches per tip motion along x under unit and under virtual stiffness [-]."""
    own = bench.specimen.name == "helix"
    arm = as_it_is(bench) if own else resized(bench, HELIX_LENGTH)
    actuation = bent(bench) / arm.units
    jacobian, slope = arm.jacobian(actuation)[:3], arm.configuration_jacobian(actuation)
    motion = np.array([1.0, 0.0, 0.0])
    stiffnesses = np.eye(len(actuation)), actuator_stiffness(arm, actuation, 0.1, 1.0)
    unit, virtual = (slope @ stiff_step(jacobian, stiffness, motion) for stiffness in stiffnesses)
    return float(np.abs(unit[2::3]).sum()), float(np.abs(virtual[2::3]).sum())


DISTANCES = (0.02, 0.05, 0.10, 0.20)
"""Distances of a resting tip from its goal, as shares of the arm's length [-]."""

RESTING = 3.0
"""How long it rests there [s]."""


def guidance(rng: np.random.Generator, runs: int = 10) -> pd.DataFrame:
    """Return the force of either assistance on the hand while the tip rests away from its goal.

    Parameters
    ----------
    rng : numpy.random.Generator
        Draws the noise of the tip in the last column.
    runs : int
        Runs that this column is the mean of.

    Returns
    -------
    pandas.DataFrame
        One row per arm and distance; forces [N] with the constants as printed and scaled to the arm, and of
        the scaled assist-as-needed when the tip is measured with `SENSOR_NOISE`.
    """
    noise = SENSOR_NOISE * GROWN_LENGTH
    scaled = {}
    for share in DISTANCES:
        distance = share * GROWN_LENGTH
        noisy = [resting_force(AssistAsNeeded(), distance, rng, noise) for _ in range(runs)]
        scaled[share] = {
            "fixed_scaled_N": resting_force(FixedAssistance(), distance),
            "needed_scaled_N": resting_force(AssistAsNeeded(), distance),
            "needed_noisy_N": np.mean(noisy),
        }
    return pd.DataFrame(
        {
            "arm": name,
            "away_percent": 100.0 * share,
            "fixed_printed_N": resting_force(FixedAssistance(), share * bench.length),
            "needed_printed_N": resting_force(AssistAsNeeded(), share * bench.length),
            **scaled[share],
        }
        for (name, bench), share in product(benches().items(), DISTANCES)
    )


def resting_force(
    assistance: AssistAsNeeded | FixedAssistance,
    distance: float,
    rng: np.random.Generator | None = None,
    noise: float = 0.0,
) -> float:
    """Return the force [N] after the tip has rested so far from the goal [m], seen with so much noise [m]."""
    samples = round(RESTING * assistance.sample_rate)
    tips = np.zeros((samples, 3)) if rng is None else rng.normal(0.0, noise, (samples, 3))
    return [assistance.update(tip, [0.0, 0.0, distance]).magnitude for tip in tips][-1]
