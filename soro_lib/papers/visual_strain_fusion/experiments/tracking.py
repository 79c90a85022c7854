"""Tracking a moving target with the tip: paths, runs and their errors (Wang et al., Sec. IV-D)."""

import tomllib
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from soro_lib import paths
from soro_lib.controllers.hybrid import HybridController
from soro_lib.papers.visual_strain_fusion.world.plant import Array, ChamberParameters, PneumaticPlant
from soro_lib.project import data_directory

GAINS = (0.04, 0.06, 0.08, 0.10)
RADIUS = 0.030
"""Radius of both paths [m]: deviation over percentage of the model cells of Table II gives 30.0-30.3 mm."""
STEPS_PER_CYCLE = {"pentagram": 1000, "circle": 750}
CYCLES = 2
SENSOR_NOISE = 1e-4
"""Standard deviation of the electromagnetic tracker per axis [m] (not printed in the paper)."""


def path_points(path: str, rotation: float = 0.0, steps: int | None = None) -> Array:
    """One cycle of target points of the "pentagram" or "circle", ``(steps, 2)`` [m].

    Parameters
    ----------
    path : str
        Name of the path.
    rotation : float
        Turn of the path about the arm, counter-clockwise [rad].
    steps : int, optional
        Points of the cycle; by default those of `STEPS_PER_CYCLE`.
    """
    steps = steps or STEPS_PER_CYCLE[path]
    curve = {"pentagram": paths.pentagram, "circle": paths.circle}[path]
    return turn(curve(np.arange(steps) / steps, RADIUS), rotation)


def turn(points: Array, angle: float) -> Array:
    """Turn points ``(..., 2)`` counter-clockwise."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[cosine, sine], [-sine, cosine]]), dtype=np.float64)


@dataclass(frozen=True)
class FittedPlant:
    """Plant parameters of one path, and how the path lies on the arm.

    Attributes
    ----------
    chambers : ChamberParameters
        Steppers, transmission, chambers.
    rotation : float
        Turn of the path about the arm [rad].
    """

    chambers: ChamberParameters
    rotation: float


def load_plant(path: str, hypothesis: str = "cap_3mm") -> FittedPlant:
    """Plant that was fitted to the model-based columns of the tables, see `calibration`.

    Parameters
    ----------
    path : str
        "pentagram" or "circle": the two experiments need different gains of the chambers.
    hypothesis : str
        "cap_3mm", or "no_cap" for the plant that was fitted without a cap on the desired step.

    Raises
    ------
    ValueError
        If the name is not one of these.
    """
    file = data_directory("visual_strain_fusion") / "plant.toml"
    fitted = tomllib.loads(file.read_text(encoding="utf-8"))
    if hypothesis not in fitted or f"gain_{path}" not in fitted[hypothesis]:
        raise ValueError(f"{file.name} has no plant for path {path!r} under hypothesis {hypothesis!r}")
    numbers = fitted[hypothesis]
    names = ("resolution", "play", "dead_band", "softness", "exponent", "suction")
    chambers = ChamberParameters(gain=numbers[f"gain_{path}"], **{name: numbers[name] for name in names})
    return FittedPlant(chambers, numbers["rotation"])


@dataclass(frozen=True)
class TrackingRun:
    """Tips and targets of a batch of tracking runs.

    Attributes
    ----------
    tip : ndarray (steps, ..., 2)
        True tip position [m].
    target : ndarray (steps, 2) or (steps, ..., 2)
        Target position, common or one per member of the batch [m].
    """

    tip: Array
    target: Array

    @property
    def error(self) -> Array:
        """Distance between tip and target, ``(steps, ...)`` [m]."""
        batch = [1] * (self.tip.ndim - self.target.ndim)
        target = self.target.reshape(len(self.target), *batch, *self.target.shape[1:])
        return np.asarray(np.linalg.norm(self.tip - target, axis=-1), dtype=np.float64)

    def deviation(self, path: Array, every: int = 1) -> Array:
        """Distance between tip and the closest point of a closed path ``(n, 2)``, of every n-th step [m]."""
        return path_distance(self.tip[::every], path)


def path_distance(tips: Array, path: Array) -> Array:
    """Distance ``(...)`` between tips ``(..., 2)`` and the closest point of a closed path ``(n, 2)`` [m]."""
    dense = paths.polygon(np.arange(20 * len(path)) / (20 * len(path)), path)
    return np.asarray(cKDTree(dense, leafsize=32).query(tips)[0], dtype=np.float64)


def track(
    plant: PneumaticPlant,
    controller: HybridController,
    targets: Array,
    *,
    compensating: bool,
    rng: np.random.Generator | None = None,
) -> TrackingRun:
    """Let a batch of plants follow a moving target, from wherever they stand.

    Parameters
    ----------
    plant : PneumaticPlant
        Moves on from its state.
    controller : HybridController
        Goes on with its samples.
    targets : ndarray (steps, 2) or (steps, ..., 2)
        Target positions, common or one per member of the batch [m].
    compensating : bool
        Whether the compensator acts.
    rng : numpy.random.Generator, optional
        Draws the noise of the position sensor; none without it.
    """
    tips = np.empty((len(targets), *plant.motors.shape[:-1], 2))
    tip = plant.tip[..., :2]
    for step, target in enumerate(targets):
        measured = tip if rng is None else tip + rng.normal(0.0, SENSOR_NOISE, tip.shape)
        plant.drive(controller.update(measured, target, plant.motors, compensating).actuation)
        tips[step] = tip = plant.tip[..., :2]
    return TrackingRun(tips, targets)
