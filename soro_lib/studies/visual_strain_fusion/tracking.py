"""Tracking a moving target: Tables I and II, the control experiments, and a closed curve (Wang et al., Sec. IV-D, E).

The plant is the simulated one, calibrated on the model-based columns of the two tables and on nothing else; all
hybrid columns are predictions.
"""

import tomllib
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from soro_lib.controllers.hybrid import HybridController, HybridSettings
from soro_lib.project import data_directory
from soro_lib.robots.pneumatic import PneumaticArm
from soro_lib.robots.pneumatic_plant import ChamberParameters, PneumaticPlant

Array = NDArray[np.float64]

GAINS = (0.04, 0.06, 0.08, 0.10)
RADIUS = 0.030
"""Radius of both paths [m]: deviation over percentage of the model cells of Table II gives 30.0-30.3 mm."""
STEPS_PER_CYCLE = {"pentagram": 1000, "circle": 750}
SENSOR_NOISE = 1e-4
"""Standard deviation of the electromagnetic tracker per axis [m] (not printed in the paper)."""


def pentagram(steps: int, rotation: float = 0.0, radius: float = RADIUS) -> Array:
    """Points ``(steps, 2)`` of a five-pointed star at even distances, from its top counter-clockwise [m]."""
    corner = np.pi / 2 + rotation + 2.0 * np.pi * 2.0 / 5.0 * np.arange(6)
    return resample(radius * np.stack([np.cos(corner), np.sin(corner)], axis=-1), steps)


def circle(steps: int, rotation: float = 0.0, radius: float = RADIUS) -> Array:
    """Points ``(steps, 2)`` of a circle at even distances, from +x counter-clockwise [m]."""
    angle = rotation + 2.0 * np.pi * np.arange(steps) / steps
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def resample(vertices: ArrayLike, steps: int) -> Array:
    """Points ``(steps, 2)`` at even distances along a closed polyline that repeats its first vertex [m]."""
    vertices = np.asarray(vertices, dtype=float)
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(vertices, axis=0), axis=1))])
    stations = travelled[-1] * np.arange(steps) / steps
    return np.stack([np.interp(stations, travelled, vertices[:, axis]) for axis in range(2)], axis=-1)


def path_points(path: str, rotation: float = 0.0) -> Array:
    """One cycle of target points of "pentagram" or "circle" [m]."""
    steps = STEPS_PER_CYCLE[path]
    return {"pentagram": pentagram, "circle": circle}[path](steps, rotation)


@dataclass(frozen=True)
class TrackingRun:
    """Tips and targets of a batch of tracking runs.

    Attributes
    ----------
    tip : ndarray (steps, ..., 2)
        True tip position [m].
    target : ndarray (steps, 2)
        Target position [m].
    saturated : float
        Share of the steps in which a chamber length met its limit.
    """

    tip: Array
    target: Array
    saturated: float

    @property
    def error(self) -> Array:
        """Distance between tip and target, ``(steps, ...)`` [m]."""
        target = self.target.reshape(len(self.target), *[1] * (self.tip.ndim - 2), 2)
        return np.asarray(np.linalg.norm(self.tip - target, axis=-1), dtype=np.float64)

    def deviation(self, path: Array) -> Array:
        """Distance between tip and the closest point of a closed path ``(n, 2)``, ``(steps, ...)`` [m]."""
        dense = resample(np.vstack([path, path[:1]]), 20 * len(path))
        return np.asarray(cKDTree(dense).query(self.tip)[0], dtype=np.float64)


def track(
    plant: PneumaticPlant,
    controller: HybridController,
    targets: Array,
    *,
    compensating: bool,
    rng: np.random.Generator | None = None,
    noise: float = SENSOR_NOISE,
) -> TrackingRun:
    """Let a batch of plants follow a moving target, from wherever they stand.

    Parameters
    ----------
    plant : PneumaticPlant
        Moves on from its state.
    controller : HybridController
        Goes on with its samples.
    targets : ndarray (steps, 2)
        Target positions [m].
    compensating : bool
        Whether the compensator acts.
    rng : numpy.random.Generator, optional
        Draws the noise of the position sensor; none without it.
    noise : float
        Its standard deviation per axis [m].
    """
    tips = np.empty((len(targets), *plant.motors.shape[:-1], 2))
    saturated = 0.0
    tip = plant.tip[..., :2]
    for step, target in enumerate(targets):
        measured = tip if rng is None else tip + rng.normal(0.0, noise, tip.shape)
        result = controller.update(measured, target, plant.motors, compensating)
        plant.drive(result.actuation)
        tip = plant.tip[..., :2]
        tips[step] = tip
        saturated += float(result.saturated.mean()) / len(targets)
    return TrackingRun(tips, targets, saturated)
