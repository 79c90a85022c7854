"""The map between stepper and chamber: linear in Wang et al., Eq. (27), fitted to a sweep in Sec. IV-E."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator

from soro_lib.checks import increasing

Array = NDArray[np.float64]


class ActuationMap:
    """Monotone interpolation between the positions of the steppers and the lengths of the chambers.

    The paper interpolates with cubic splines; the monotone kind is used, because a map that turns back cannot
    be inverted.

    Parameters
    ----------
    motor_lengths, chamber_lengths : array_like (n,)
        Stepper positions, in the length that they stand for, and chamber lengths measured at them [m].

    Raises
    ------
    ValueError
        If fewer than two points are given, or either does not increase strictly.
    """

    def __init__(self, motor_lengths: ArrayLike, chamber_lengths: ArrayLike) -> None:
        motor = increasing("motor_lengths", motor_lengths, ("n >= 2",))
        chamber = increasing("chamber_lengths", chamber_lengths, motor.shape)
        self._motor, self._chamber = motor, chamber
        self._forward = PchipInterpolator(motor, chamber)
        self._backward = PchipInterpolator(chamber, motor)

    def chamber_lengths(self, motor_lengths: ArrayLike) -> Array:
        """Chamber lengths of stepper positions; beyond the sweep its end counts [m]."""
        return np.asarray(self._forward(np.clip(motor_lengths, self._motor[0], self._motor[-1])))

    def motor_lengths(self, chamber_lengths: ArrayLike) -> Array:
        """Stepper positions for chamber lengths; beyond the sweep its end counts [m]."""
        return np.asarray(self._backward(np.clip(chamber_lengths, self._chamber[0], self._chamber[-1])))
