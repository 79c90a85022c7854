"""What a controller may ask of any arm, and the one rule for limits.

The rule: a command outside the limits is never followed and never silently changed. ``forward``, ``jacobian``
and everything else that takes an actuation raise :class:`ActuationError`, naming the actuator, the value and
the bound. A limit that couples several actuators, as the bend of a segment of the Helix, is reported by an
:class:`ActuationWarning`, so that every point from ``lower`` to ``upper`` can still be evaluated. A caller
that wants the nearest admissible command asks ``clip`` for it and is told what was changed.
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.arcs import backbone, chain_jacobian, chain_transform
from soro_lib.checks import finite, numbers

FloatArray = NDArray[np.float64]

LIMIT_TOLERANCE = 1e-9
"""Share of an actuator's range by which rounding may exceed a limit."""


class ActuationError(ValueError):
    """An actuation is malformed, not finite, or outside the limits of its arm."""


class ActuationWarning(UserWarning):
    """An actuation is within the limits of every actuator, but violates a limit that couples several."""


@dataclass(frozen=True)
class ClippedActuation:
    """An actuation moved into the limits, and the report of what that changed.

    Attributes
    ----------
    actuation : ndarray, shape (..., n)
        The nearest admissible actuation, actuator by actuator.
    clipped : ndarray of bool, shape (..., n)
        Which actuators were changed.
    excess : ndarray, shape (..., n)
        Requested minus admissible value, in the unit of the actuator.
    """

    actuation: FloatArray
    clipped: NDArray[np.bool_]
    excess: FloatArray

    @property
    def any_clipped(self) -> bool:
        """Whether anything was changed at all."""
        return bool(self.clipped.any())


@runtime_checkable
class Robot(Protocol):
    """The small interface that every arm offers and every controller relies on.

    An arm inherits from this class and supplies its limits, ``configuration`` and ``configuration_jacobian``;
    the kinematics follow. Another object that merely has these members serves a controller just as well.
    """

    actuator_names: tuple[str, ...]

    @property
    def lower(self) -> FloatArray:
        """Lower actuator limits, shape (n,)."""
        ...

    @property
    def upper(self) -> FloatArray:
        """Upper actuator limits, shape (n,)."""
        ...

    @property
    def home(self) -> FloatArray:
        """Actuation at rest, shape (n,)."""
        ...

    def configuration(self, actuation: ArrayLike) -> FloatArray:
        """Return the pieces of the arm from base to tip, shape (..., m, 3) of (dx, dy, length)."""
        ...

    def configuration_jacobian(self, actuation: ArrayLike) -> FloatArray:
        """Return the derivative of the flattened configuration, shape (..., 3 m, n)."""
        ...

    def forward(self, actuation: ArrayLike) -> FloatArray:
        """Return the tip pose in the base frame, shape (..., 4, 4).

        Raises
        ------
        ActuationError
            If the actuation is malformed, not finite or outside the limits.
        """
        return chain_transform(self.configuration(actuation))

    def jacobian(self, actuation: ArrayLike) -> FloatArray:
        """Return the tip Jacobian, shape (..., 6, n): linear, then angular velocity in the base frame.

        Raises
        ------
        ActuationError
            If the actuation is malformed, not finite or outside the limits.
        """
        return chain_jacobian(self.configuration(actuation)) @ self.configuration_jacobian(actuation)

    def tip(self, actuation: ArrayLike) -> FloatArray:
        """Return the tip position in the base frame [m], shape (..., 3)."""
        return self.forward(actuation)[..., :3, 3]

    def backbone(self, actuation: ArrayLike, points_per_segment: int = 20) -> FloatArray:
        """Return points [m] along the arm in the base frame, shape (..., k, 3); see `arcs.backbone`."""
        return backbone(self.configuration(actuation), points_per_segment)

    def check(self, actuation: ArrayLike) -> FloatArray:
        """Return the actuation as an array, shape (..., n), if it lies within the limits.

        Both limits are admissible; rounding may exceed them by `LIMIT_TOLERANCE` of the range.

        Raises
        ------
        ActuationError
            Naming the actuator, its index, the value and the bound.
        """
        lower, upper, names = self.lower, self.upper, self.actuator_names
        array = numbers("actuation", actuation, (..., len(names)), ActuationError)
        slack = LIMIT_TOLERANCE * (upper - lower)
        within = (array >= lower - slack) & (array <= upper + slack)
        if not within.all():
            index = tuple(np.argwhere(~within)[0])
            actuator = int(index[-1])
            raise ActuationError(
                f"actuation[{actuator}] ({names[actuator]}) is {array[index]:.6g}, "
                f"outside [{lower[actuator]:.6g}, {upper[actuator]:.6g}]"
            )
        return array

    def clip(self, actuation: ArrayLike) -> ClippedActuation:
        """Return the nearest admissible actuation, actuator by actuator, and the report of what was changed.

        Raises
        ------
        ActuationError
            If the actuation is malformed or not finite: there is no nearest value then.
        """
        requested = finite("actuation", actuation, (..., len(self.actuator_names)), ActuationError)
        return report_clipping(requested, np.clip(requested, self.lower, self.upper))


def report_clipping(requested: FloatArray, admissible: FloatArray) -> ClippedActuation:
    """Return the admissible actuation and the report of how it differs from the requested one."""
    return ClippedActuation(admissible, admissible != requested, requested - admissible)
