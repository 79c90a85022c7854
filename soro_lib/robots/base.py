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
        """Return the actuation as an array, shape (..., n), or raise :class:`ActuationError`."""
        return check_actuation(actuation, self.lower, self.upper, self.actuator_names)

    def clip(self, actuation: ArrayLike) -> ClippedActuation:
        """Return the nearest admissible actuation and the report of what was changed."""
        return clip_actuation(actuation, self.lower, self.upper, self.actuator_names)


def check_actuation(
    actuation: ArrayLike, lower: FloatArray, upper: FloatArray, names: tuple[str, ...]
) -> FloatArray:
    """Return the actuation as an array if it lies within the limits.

    Parameters
    ----------
    actuation : array_like, shape (..., n)
        Commands, one per actuator.
    lower, upper : ndarray, shape (n,)
        Limits, both admissible; rounding may exceed them by `LIMIT_TOLERANCE` of the range.
    names : tuple of str
        What the actuators are called in the error, with unit.

    Raises
    ------
    ActuationError
        Naming the actuator, its index, the value and the bound.
    """
    array = _as_actuation(actuation, names)
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


def clip_actuation(
    actuation: ArrayLike, lower: FloatArray, upper: FloatArray, names: tuple[str, ...]
) -> ClippedActuation:
    """Move an actuation into the limits, actuator by actuator, and report what was changed.

    Raises
    ------
    ActuationError
        If the actuation is malformed or not finite: there is no nearest value then.
    """
    array = finite_actuation(actuation, names)
    return report_clipping(array, np.clip(array, lower, upper))


def finite_actuation(actuation: ArrayLike, names: tuple[str, ...]) -> FloatArray:
    """Return the actuation as an array, shape (..., n), or raise `ActuationError` where it is not finite."""
    return require_finite(_as_actuation(actuation, names), "actuation")


def report_clipping(requested: FloatArray, admissible: FloatArray) -> ClippedActuation:
    """Return the admissible actuation and the report of how it differs from the requested one."""
    return ClippedActuation(admissible, admissible != requested, requested - admissible)


def require_finite(array: FloatArray, name: str) -> FloatArray:
    """Return the array, or raise :class:`ActuationError` naming its first value that is not finite."""
    if not np.isfinite(array).all():
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise ActuationError(f"{name} must be finite, got {array[index]} at index {index}")
    return array


def require_positive(**values: float) -> None:
    """Raise ValueError naming the first parameter that is not a finite positive number."""
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} must be finite and positive, got {value!r}")


def _as_actuation(actuation: ArrayLike, names: tuple[str, ...]) -> FloatArray:
    try:
        array = np.asarray(actuation, dtype=float)
    except (TypeError, ValueError) as error:
        raise ActuationError(f"actuation must be numbers of shape (..., {len(names)}): {error}") from None
    if array.ndim == 0 or array.shape[-1] != len(names):
        raise ActuationError(
            f"actuation must have shape (..., {len(names)}) of ({', '.join(names)}), got {array.shape}"
        )
    return array
