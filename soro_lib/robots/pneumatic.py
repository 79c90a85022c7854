"""The one-segment pneumatic arm of Wang et al., Section III-A, with three chambers.

The paper's angle, curvature and radius (Eqs. (19)-(21)) are 0/0 at the straight arm and its arctangent folds
half of the plane. The same arc is linear in the chamber lengths when written with bending components, which
needs neither.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from soro_lib.arcs import routing_matrix
from soro_lib.checks import check_fields, finite
from soro_lib.robots.base import ActuationError, FloatArray, Robot

CHAMBER_ANGLES = np.pi / 2.0 + 2.0 * np.pi / 3.0 * np.arange(3)
"""Directions of the three chambers about z [rad]: 90, 210 and 330 degrees, as Eqs. (19)-(22) imply."""


@dataclass(frozen=True)
class PneumaticArm(Robot):
    """One soft segment bent and stretched by three chambers; it bends away from the longest one.

    The actuation is the three chamber lengths [m]. The base frame has its origin at the base and z along the
    straight arm; the paper's displacements are relative to the tip at rest, see :meth:`displacement`.

    Parameters
    ----------
    chamber_distance : float
        Distance d of the chambers from the axis [m] (Wang et al., Section IV-A).
    rest_length : float
        Length of the unactuated segment [m] (Section IV-A).
    minimum_length, maximum_length : float
        Limits of a chamber length [m]. The paper prints none; half to twice the length at rest is assumed.
    motor_gains : tuple of 3 float
        Diagonal of alpha in Eq. (27) [motor unit per m]. The paper prints none.

    Raises
    ------
    ValueError
        If a parameter is out of range; the message names it and its bound.

    Examples
    --------
    >>> arm = PneumaticArm()
    >>> arm.tip([0.09, 0.09, 0.09]).round(3)
    array([0.  , 0.  , 0.09])
    """

    chamber_distance: float = 5.1e-3
    rest_length: float = 0.09
    minimum_length: float = 0.045
    maximum_length: float = 0.18
    motor_gains: tuple[float, float, float] = (1.0, 1.0, 1.0)
    actuator_names: tuple[str, ...] = field(
        default=("chamber 1 [m]", "chamber 2 [m]", "chamber 3 [m]"), init=False, repr=False
    )

    def __post_init__(self) -> None:
        check_fields(self, "chamber_distance", "minimum_length", above=0)
        check_fields(self, "maximum_length", at_least=self.minimum_length)
        check_fields(self, "rest_length", at_least=self.minimum_length, at_most=self.maximum_length)
        check_fields(self, "motor_gains", shape=(3,))
        if 0 in self.motor_gains:
            raise ValueError(f"motor_gains must be other than 0, got {self.motor_gains!r}")

    @cached_property
    def lower(self) -> FloatArray:
        """Lower limits of the chamber lengths [m]."""
        return np.full(3, self.minimum_length)

    @cached_property
    def upper(self) -> FloatArray:
        """Upper limits of the chamber lengths [m]."""
        return np.full(3, self.maximum_length)

    @cached_property
    def home(self) -> FloatArray:
        """The three chamber lengths at rest [m]."""
        return np.full(3, self.rest_length)

    def configuration(self, actuation: ArrayLike) -> FloatArray:
        """Return the arc of the chamber lengths, shape (..., 1, 3) of (dx, dy, length).

        Wang et al., Eqs. (19)-(21), without their singularity and folded arctangent: with
        ``v = (sqrt(3) (l2 - l3) / 2, (l2 + l3) / 2 - l1)``, (dx, dy) = 2 v / (3 d) and length = mean.
        """
        first, second, third = np.moveaxis(self.check(actuation), -1, 0)
        bend = 2.0 / (3.0 * self.chamber_distance)
        dx = bend * np.sqrt(0.75) * (second - third)
        dy = bend * (0.5 * (second + third) - first)
        return np.stack([dx, dy, (first + second + third) / 3.0], axis=-1)[..., np.newaxis, :]

    def configuration_jacobian(self, actuation: ArrayLike) -> FloatArray:
        """Return d configuration / d actuation, shape (..., 3, 3): the same everywhere."""
        batch_shape = self.check(actuation).shape[:-1]
        bend, root = 2.0 / (3.0 * self.chamber_distance), np.sqrt(0.75)
        slopes = [[0.0, bend * root, -bend * root], [-bend, 0.5 * bend, 0.5 * bend], [1.0 / 3.0] * 3]
        return np.broadcast_to(slopes, (*batch_shape, 3, 3))

    def displacement(self, actuation: ArrayLike) -> FloatArray:
        """Return the tip position relative to the tip at rest [m], shape (..., 3), as in Section II-A."""
        return self.tip(actuation) - np.array([0.0, 0.0, self.rest_length])

    def chamber_lengths(self, configuration: ArrayLike) -> FloatArray:
        """Return the chamber lengths [m], shape (..., 3), of one arc, shape (..., 1, 3): the inverse map."""
        arcs = finite("configuration", configuration, (..., 1, 3), ActuationError)
        lengths: FloatArray = arcs[..., 0, :] @ routing_matrix(self.chamber_distance, CHAMBER_ANGLES).T
        return lengths

    def motor_commands(self, actuation: ArrayLike) -> FloatArray:
        """Return the motor commands ``alpha (lengths - rest)``, shape (..., 3): Wang et al., Eq. (27)."""
        return np.asarray(self.motor_gains) * (self.check(actuation) - self.home)
