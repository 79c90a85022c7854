"""The soft-growing arm of the shared-control paper: it steers at its base and grows by eversion.

The body is a straight tube from the base to the tip, as the authors' program draws it: a pivot at the base
(an arc of length zero) and a straight piece. Motor space and redistribution follow the paper's supplement,
Eqs. (1)-(10).
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from soro_lib.checks import check_fields, finite, number
from soro_lib.robots.base import ActuationError, FloatArray, Robot

MOTOR_ANGLES = np.array([-np.pi / 3.0, np.pi / 3.0, np.pi])
"""Directions in the plane that the three steering motors pull toward [rad] (supplement, Eq. (1))."""

STEERING_FROM_MOTORS = np.array([[0.5, 0.5, -1.0], [-np.sqrt(0.75), np.sqrt(0.75), 0.0]])
"""(x, y) = matrix @ (s1, s2, s3): supplement, Eq. (1); its null space is (1, 1, 1)."""

REDISTRIBUTION = 0.3
"""The share epsilon of the largest pull that is turned into release (supplement, Section 4)."""


@dataclass(frozen=True)
class SoftGrowingArm(Robot):
    """A straight tube that everts to any point below its base.

    The actuation is the tip position (x, y, z) [m] in the base frame, z down along gravity. The tip frame is
    the base frame turned about the horizontal axis that carries z onto the body, the shortest way; so it is
    regular everywhere except at the base itself and straight above it, which the limits exclude.

    Parameters
    ----------
    lower_limit, upper_limit : tuple of 3 float
        Corners of the box of admissible tip positions [m]. Neither the paper nor the authors' program limits
        the arm; the default, 1 m about the base and 1 cm below it, holds every item, target and lifting goal.

    Raises
    ------
    ValueError
        If the box is empty, or reaches up to the base (z <= 0).

    Examples
    --------
    >>> arm = SoftGrowingArm()
    >>> arm.motor_coordinates([0.3, 0.0, 0.4]).round(3)
    array([0.3, 0.3, 0. , 0.5])
    """

    lower_limit: tuple[float, float, float] = (-1.0, -1.0, 0.01)
    upper_limit: tuple[float, float, float] = (1.0, 1.0, 1.0)
    actuator_names: tuple[str, ...] = field(default=("x [m]", "y [m]", "z [m]"), init=False, repr=False)

    def __post_init__(self) -> None:
        check_fields(self, "lower_limit", "upper_limit", shape=(3,))
        if not np.less(self.lower_limit, self.upper_limit).all():
            raise ValueError(
                f"lower_limit must be below upper_limit, got {self.lower_limit} and {self.upper_limit}"
            )
        if self.lower_limit[2] <= 0.0:
            raise ValueError(
                f"lower_limit[2] (z) must be above 0, below the base, got {self.lower_limit[2]!r}"
            )

    @cached_property
    def lower(self) -> FloatArray:
        """Lower limits of the tip position [m]."""
        return np.array(self.lower_limit)

    @cached_property
    def upper(self) -> FloatArray:
        """Upper limits of the tip position [m]."""
        return np.array(self.upper_limit)

    @cached_property
    def home(self) -> FloatArray:
        """The tip at the start of a trial: 0.1 m straight below the base (authors' scene)."""
        return np.clip([0.0, 0.0, 0.1], self.lower, self.upper)

    def configuration(self, actuation: ArrayLike) -> FloatArray:
        """Return pivot and body, shape (..., 2, 3): an arc of length zero, then a straight piece."""
        tip = self.check(actuation)
        x, y, z = np.moveaxis(tip, -1, 0)
        tilt = _tilt_per_radius(x, y, z)
        pieces = np.zeros((*tip.shape[:-1], 2, 3))
        pieces[..., 0, 0], pieces[..., 0, 1] = tilt * x, tilt * y
        pieces[..., 1, 2] = eversion_length(tip)
        return pieces

    def configuration_jacobian(self, actuation: ArrayLike) -> FloatArray:
        """Return d configuration / d actuation, shape (..., 6, 3)."""
        tip = self.check(actuation)
        x, y, z = np.moveaxis(tip, -1, 0)
        square = (tip**2).sum(axis=-1)[..., np.newaxis, np.newaxis]
        radius = np.hypot(x, y)[..., np.newaxis]
        outward = np.divide(tip[..., :2], radius, out=np.zeros_like(tip[..., :2]), where=radius > 0.0)
        along = outward[..., :, np.newaxis] * outward[..., np.newaxis, :]
        across = np.eye(2) - along
        jacobian = np.zeros((*tip.shape[:-1], 2, 3, 3))
        jacobian[..., 0, :2, :2] = (
            _tilt_per_radius(x, y, z)[..., np.newaxis, np.newaxis] * across
            + z[..., np.newaxis, np.newaxis] / square * along
        )
        jacobian[..., 0, :2, 2] = -tip[..., :2] / square[..., 0]
        jacobian[..., 1, 2, :] = tip / np.sqrt(square)[..., 0]
        return jacobian.reshape(*tip.shape[:-1], 6, 3)

    def motor_coordinates(self, point: ArrayLike) -> FloatArray:
        """Return (s1, s2, s3, eversion) [m], shape (..., 4), of a point (..., 3) in the base frame.

        Supplement, Eqs. (2)-(5); see `steering_coordinates` and `eversion_length`. Differences of points are
        accepted too, so the limits of the tip do not apply.
        """
        position = finite("point", point, (..., 3), ActuationError)
        steering = steering_coordinates(position[..., :2])
        return np.concatenate([steering, eversion_length(position)[..., np.newaxis]], axis=-1)

    def point_from_motors(self, motors: ArrayLike) -> FloatArray:
        """Return the point (..., 3) [m] below the base of (s1, s2, s3, eversion): the inverse map.

        Raises
        ------
        ActuationError
            If the eversion is shorter than the steering reaches out: no such point exists.
        """
        values = finite("motors", motors, (..., 4), ActuationError)
        steered = values[..., :3] @ STEERING_FROM_MOTORS.T
        square = values[..., 3] ** 2 - (steered**2).sum(axis=-1)
        if (square < 0.0).any():
            raise ActuationError("motors: the eversion is shorter than the steering reaches out")
        return np.concatenate([steered, np.sqrt(square)[..., np.newaxis]], axis=-1)


def steering_coordinates(point: ArrayLike) -> FloatArray:
    """Return the pulls (s1, s2, s3) [m], shape (..., 3), that reach a point (x, y) [m] of the plane.

    Supplement, Eqs. (2)-(4), corrected (Eqs. (3) and (4) halve y, and their sectors overlap or leave a gap).
    All solutions of Eq. (1) differ by a common amount, and each sector's formula is the one whose smallest
    pull is zero; so one formula, less its minimum, serves all three sectors.
    """
    x, y = np.moveaxis(finite("point", point, (..., 2), ActuationError), -1, 0)
    pulls = np.stack([x - y / np.sqrt(3.0), x + y / np.sqrt(3.0), np.zeros_like(x)], axis=-1)
    return pulls - pulls.min(axis=-1, keepdims=True)


def eversion_length(point: ArrayLike) -> FloatArray:
    """Return the body length [m], shape (...), with its tip at a point (..., 3) [m]: supplement, Eq. (5)."""
    return np.sqrt((np.asarray(point, dtype=float) ** 2).sum(axis=-1))


def eversion_proxy(actual: ArrayLike, desired: ArrayLike) -> FloatArray:
    """Return the point toward `desired` that needs no eversion from `actual`: supplement, Eqs. (6)-(7).

    Parameters
    ----------
    actual, desired : array_like, shape (..., 3)
        Tip positions in the base frame [m].

    Raises
    ------
    ValueError
        If `desired` is the base itself, which has no direction.
    """
    length = eversion_length(desired)
    if not (length > 0.0).all():
        raise ValueError("desired must not be the base: it has no direction")
    return np.asarray(desired, dtype=float) * (eversion_length(actual) / length)[..., np.newaxis]


def redistribute_actuation(commands: ArrayLike, epsilon: float = REDISTRIBUTION) -> FloatArray:
    """Turn a share of the largest pull into release of all motors: supplement, Eq. (9).

    Parameters
    ----------
    commands : array_like, shape (..., 3)
        Steering commands (s1, s2, s3) [m].
    epsilon : float
        Share of the largest command, in [0, 1].

    Returns
    -------
    ndarray, shape (..., 3)
        Commands that steer to the same point, for any `epsilon`.

    Raises
    ------
    ValueError
        If `commands` is malformed or not finite, or `epsilon` outside [0, 1].

    Examples
    --------
    >>> redistribute_actuation([10.0, 0.0, 4.0])
    array([ 7., -3.,  1.])
    """
    number("epsilon", epsilon, at_least=0, at_most=1)
    pulls = finite("commands", commands, (..., 3), ActuationError)
    return pulls - epsilon * pulls.max(axis=-1, keepdims=True)


def redistribution_required(previous: ArrayLike, current: ArrayLike) -> bool:
    """Return whether no motor is idle in both steering commands: supplement, Eq. (10).

    Parameters
    ----------
    previous, current : array_like, shape (3,)
        Steering commands (s1, s2, s3) [m] from `steering_coordinates`.
    """
    before = finite("previous", previous, (..., 3), ActuationError)
    after = finite("current", current, (..., 3), ActuationError)
    return not ((before == 0.0) & (after == 0.0)).any()


def _tilt_per_radius(x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
    radius = np.hypot(x, y)
    return np.divide(np.arctan2(radius, z), radius, out=np.asarray(1.0 / z), where=radius > 0.0)
