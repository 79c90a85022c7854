"""A complicated closed curve with fused feedback: linear and fitted actuation map (Wang et al., Sec. IV-E).

The points of the paper's elephant are not published. An octopus of about the same size stands in: 1500
targets, sharp turns, every bending direction. Only the effects carry over, not the millimetres.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from soro_lib import paths
from soro_lib.controllers.actuation_map import ActuationMap
from soro_lib.controllers.hybrid import HybridController, HybridSettings
from soro_lib.estimators.extreme_learning_machine import ExtremeLearningMachine
from soro_lib.estimators.visual_strain import VisualStrainEstimator, VisualStrainSettings
from soro_lib.papers.visual_strain_fusion.experiments.estimation import LABEL_NOISE
from soro_lib.papers.visual_strain_fusion.experiments.tracking import load_plant
from soro_lib.papers.visual_strain_fusion.world.motion import PERIOD, glue_fibre, tip_pose
from soro_lib.papers.visual_strain_fusion.world.plant import (
    Array,
    BackboneParameters,
    ChamberParameters,
    PneumaticPlant,
    Wall,
)
from soro_lib.robots.pneumatic import PneumaticArm

TARGETS = 1500
APPROACH = 200
OCTOPUS = 1e-3 * np.array(
    [
        *((-2, 29), (-13, 25), (-19, 15), (-17, 5), (-24, -2), (-31, -12), (-26, -16), (-19, -9)),
        *((-14, -8), (-15, -20), (-10, -28), (-5, -22), (-7, -11), (-1, -9), (4, -11), (4, -24)),
        *((10, -29), (14, -21), (10, -9), (17, -10), (25, -18), (31, -12), (24, -4), (16, 3)),
        *((19, 14), (14, 25)),
    ],
    dtype=float,
)
"""Points that the curve passes through [m]."""

LOSS_START, LOSS_END = 0.03, 0.10
"""Probability per step that the view is lost, and that it returns, while an obstacle moves [-]."""


@dataclass(frozen=True)
class CurveRun:
    """One run of three cycles.

    Attributes
    ----------
    tip, target : ndarray (steps, 2)
        True tip and target [m].
    cycle : ndarray (steps,)
        1 model-based, 2 hybrid, 3 hybrid with a moving obstacle.
    lost : ndarray (steps,) of bool
        Where the camera saw nothing.
    """

    tip: Array
    target: Array
    cycle: NDArray[np.int64]
    lost: NDArray[np.bool_]

    @property
    def error(self) -> Array:
        """Distance between tip and target [m]."""
        return np.asarray(np.linalg.norm(self.tip - self.target, axis=-1), dtype=np.float64)

    @property
    def deviation(self) -> Array:
        """Distance between tip and the closest point of the curve [m]."""
        dense = octopus(20 * TARGETS)
        return np.asarray(cKDTree(dense).query(self.tip)[0], dtype=np.float64)


def octopus(targets: int = TARGETS) -> Array:
    """Points of the curve at even distances, ``(targets, 2)`` [m]."""
    return paths.closed_curve(np.arange(targets) / targets, OCTOPUS)


def fit_actuation_map(chambers: ChamberParameters) -> ActuationMap:
    """Identify the actuation map by a slow sweep up and down, averaging out the play.

    The steppers move from 4 mm below rest to 10 mm above; what meets the limits of the arm is left out.
    """
    arm = PneumaticArm()
    commands = np.linspace(-0.004, 0.010, 281)
    sweep = np.concatenate([np.linspace(0.0, commands[0], 100), commands, commands[::-1]])
    plant = PneumaticPlant(arm, chambers)
    elongations = []
    for command in sweep:
        plant.drive(arm.home + command)
        elongations.append(plant.lengths[0])
    up = np.array(elongations[100:381])
    down = np.array(elongations[381:])[::-1]
    lengths = np.maximum.accumulate(0.5 * (up + down)) + 1e-9 * np.arange(len(commands))
    inside = (lengths > arm.lower[0]) & (lengths < arm.upper[0])
    return ActuationMap(arm.home[0] + commands[inside], lengths[inside])


def follow_curve(
    rng: np.random.Generator,
    fitted_map: bool,
    wall: Wall | None = None,
    cycles: int = 3,
    targets: int = TARGETS,
) -> CurveRun:
    """Follow the curve with the fused pose as feedback: model-based, then hybrid, then with an obstacle.

    Parameters
    ----------
    rng : numpy.random.Generator
        Draws the bonds of the fibre, the network, and the noise of both sensors.
    fitted_map : bool
        Whether the controller knows the fitted actuation map or takes it to be linear.
    wall : Wall, optional
        A rod beside the arm.
    cycles : int
        1 to 3 cycles.
    targets : int
        Points of a cycle; fewer make the arm hurry.
    """
    arm, chambers = PneumaticArm(), load_plant("pentagram").chambers
    plant = PneumaticPlant(arm, chambers, BackboneParameters(), wall=wall)
    mapping = fit_actuation_map(chambers) if fitted_map else None
    controller = HybridController(arm, HybridSettings(proportional_gain=0.1))
    estimator = VisualStrainEstimator(ExtremeLearningMachine(rng), VisualStrainSettings())
    fibre = glue_fibre(rng)
    steps = APPROACH + cycles * targets
    target = octopus(targets)[np.arange(-APPROACH, cycles * targets).clip(0) % targets]
    cycle = 1 + np.maximum(np.arange(steps) - APPROACH, 0) // targets
    tips, lost = np.empty((steps, 2)), np.zeros(steps, dtype=bool)
    for step in range(steps):
        configuration = plant.configuration
        pose = tip_pose(configuration)
        if step and cycle[step] == 3:
            lost[step] = rng.random() > LOSS_END if lost[step - 1] else rng.random() < LOSS_START
        seen = pose + np.concatenate([rng.normal(0.0, LABEL_NOISE), np.zeros(4)])
        shift = fibre.shift(configuration, plant.lengths - arm.home, rng)
        estimate = estimator.update(PERIOD * step, shift, None if lost[step] else seen, 1.0, 300.0)
        known = plant.motors if mapping is None else mapping.chamber_lengths(plant.motors)
        result = controller.update(estimate.pose[:2], target[step], known, compensating=bool(cycle[step] > 1))
        plant.drive(result.actuation if mapping is None else mapping.motor_lengths(result.actuation))
        tips[step] = pose[:2]
    return CurveRun(tips, target, cycle, lost)


CURVE_COLUMNS = ["cycle", "error_mm", "error_sd_mm", "error_max_mm", "deviation_mm", "deviation_sd_mm"]


def summarise_curve(run: CurveRun) -> pd.DataFrame:
    """Errors by cycle, `CURVE_COLUMNS`: mean, standard deviation and largest one."""
    table = pd.DataFrame({"cycle": run.cycle, "error": 1e3 * run.error, "deviation": 1e3 * run.deviation})
    groups = table.groupby("cycle")
    means, spreads = groups.mean().add_suffix("_mm"), groups.std(ddof=0).add_suffix("_sd_mm")
    return means.join(spreads).assign(error_max_mm=groups["error"].max()).reset_index()[CURVE_COLUMNS]
