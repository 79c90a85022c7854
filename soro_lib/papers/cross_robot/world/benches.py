"""The four arms on the bench, as a controller sees them, and as they really are."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from soro_lib.arcs import chain_transform, chain_transform_and_jacobian
from soro_lib.papers.cross_robot.world.four_arms import Specimen, four_arms
from soro_lib.paths import infinity
from soro_lib.robots.base import ClippedActuation, Robot

Array = NDArray[np.float64]

HALF_WIDTH = 0.1
"""Half the width of the path, as a share of the length of the arm [-]."""

TURNS = 1.25
"""How often the path is travelled: the hold at its end is at its outermost point [-]."""

STIFFER = 0.10
"""By how much the body of the disturbed arm is stiffer than modelled: it bends that much less [-]."""

MOUNT_TILT = np.radians(2.0)
"""By how much the base of the disturbed arm is mounted askew, toward a random side [rad]."""

CABLE_LENGTH, GROWN_LENGTH, CHAMBER_LENGTH, HELIX_LENGTH = 0.1, 0.6, 0.09, 0.6
"""Length of what bends or swings in each arm; of the soft-growing one, where it works [m]."""


@dataclass(frozen=True, eq=False)
class Bench:
    """An arm on the bench.

    Attributes
    ----------
    specimen : Specimen
        The arm, its name and its paper.
    start : ndarray (n,)
        Actuation at the centre of the path: straight, away from every limit.
    length : float
        Length of what bends or swings [m].
    """

    specimen: Specimen
    start: Array
    length: float

    @property
    def robot(self) -> Robot:
        """The arm itself."""
        return self.specimen.robot

    @property
    def points(self) -> bool:
        """Whether there are the five actuators that a position and a direction need."""
        return len(self.start) >= 5

    def path(self, moving: int, holding: int) -> Array:
        """Return goals (moving + holding, 3) [m]: an infinity sign, then its outermost point."""
        turns = TURNS * np.minimum(np.arange(1, moving + holding + 1) / moving, 1.0)
        goals = np.tile(self.robot.tip(self.start), (len(turns), 1))
        goals[:, :2] += infinity(turns, HALF_WIDTH * self.length)
        return goals


def benches() -> dict[str, Bench]:
    """Return the four arms by name, in the order of the notebooks."""
    work = {
        "cable-driven": ([0.03, *[-0.5] * 6], CABLE_LENGTH),
        "soft-growing": ([0.0, 0.0, GROWN_LENGTH], GROWN_LENGTH),
        "pneumatic": ([CHAMBER_LENGTH] * 3, CHAMBER_LENGTH),
        "helix": ([0.0, 0.0, 0.12, 0.0, 0.0, 0.24, 0.0, 0.0, 0.24], HELIX_LENGTH),
    }
    return {arm.name: Bench(arm, np.array(work[arm.name][0]), work[arm.name][1]) for arm in four_arms()}


@dataclass(frozen=True, eq=False)
class ResizedArm(Robot):
    """An arm as a controller made for another one sees it: in another unit of length, with alike actuators.

    So every constant of a paper, from the 3 mm step to the 3 cm at which a goal counts as reached, keeps its
    meaning on an arm of another size.

    Parameters
    ----------
    robot : Robot
        The arm.
    ratio : float
        Metres of the arm per metre shown [-].
    units : ndarray (n,)
        The arm's actuation per unit of the actuation shown; one entry per actuator.
    """

    robot: Robot
    ratio: float
    units: Array
    actuator_names: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "actuator_names", self.robot.actuator_names)

    @property
    def lower(self) -> Array:
        """Lower limits, as shown."""
        return self.robot.lower / self.units

    @property
    def upper(self) -> Array:
        """Upper limits, as shown."""
        return self.robot.upper / self.units

    @property
    def home(self) -> Array:
        """Actuation at rest, as shown."""
        return self.robot.home / self.units

    def configuration(self, actuation: ArrayLike) -> Array:
        """Return the pieces of the arm, their lengths as shown."""
        return self.robot.configuration(np.asarray(actuation, dtype=float) * self.units) / [
            1.0,
            1.0,
            self.ratio,
        ]

    def configuration_jacobian(self, actuation: ArrayLike) -> Array:
        """Return the derivative of `configuration`."""
        slope = (
            self.robot.configuration_jacobian(np.asarray(actuation, dtype=float) * self.units) * self.units
        )
        return slope / np.tile([1.0, 1.0, self.ratio], slope.shape[-2] // 3)[:, np.newaxis]

    def pose_and_jacobian(self, actuation: ArrayLike) -> tuple[Array, Array]:
        """Return `forward` and `jacobian` from one pass along the arm."""
        pose, jacobian = chain_transform_and_jacobian(self.configuration(actuation))
        return pose, jacobian @ self.configuration_jacobian(actuation)

    def clip(self, actuation: ArrayLike) -> ClippedActuation:
        """Return the nearest admissible actuation; the arm's own rule decides."""
        clipped = self.robot.clip(np.asarray(actuation, dtype=float) * self.units)
        return ClippedActuation(clipped.actuation / self.units, clipped.clipped, clipped.excess / self.units)


def resized(bench: Bench, length: float, sensitivity: float = 1.0) -> ResizedArm:
    """Return the arm shown as `length` [m] long; a unit of an actuator moves the tip by `sensitivity` [m]."""
    ratio = bench.length / length
    reach = np.linalg.norm(bench.robot.jacobian(bench.start)[:3], axis=0)
    return ResizedArm(bench.robot, ratio, sensitivity * ratio / reach)


def as_it_is(bench: Bench) -> ResizedArm:
    """Return the arm shown in its own units."""
    return ResizedArm(bench.robot, 1.0, np.ones(len(bench.start)))


@dataclass(frozen=True, eq=False)
class Plants:
    """A batch of arms that differ from their model; the commands reach all of them.

    Attributes
    ----------
    robot : Robot
        The model.
    compliance : ndarray (batch,)
        Bend per modelled bend [-].
    mount : ndarray (batch, 3, 3)
        Orientation of the base.
    """

    robot: Robot
    compliance: Array
    mount: Array

    def tip_and_direction(self, actuation: Array) -> tuple[Array, Array]:
        """Return where the tips are [m] and where they point, each (batch, 3)."""
        pieces = self.robot.configuration(actuation).copy()
        pieces[..., :2] *= self.compliance[:, np.newaxis, np.newaxis]
        pose = chain_transform(pieces)
        turned = self.mount @ pose[:, :3, 2:]
        return turned[..., 1], turned[..., 0]


def disturbed_and_not(robot: Robot, seeds: int, rng: np.random.Generator) -> Plants:
    """Return `seeds` arms as modelled, then `seeds` arms that are stiffer and askew toward a random side."""
    side = rng.uniform(0.0, 2.0 * np.pi, seeds)
    askew = MOUNT_TILT * np.stack([np.cos(side), np.sin(side), np.zeros(seeds)], axis=-1)
    mount = Rotation.from_rotvec(np.concatenate([np.zeros((seeds, 3)), askew])).as_matrix()
    return Plants(robot, np.repeat([1.0, 1.0 / (1.0 + STIFFER)], seeds), mount)
