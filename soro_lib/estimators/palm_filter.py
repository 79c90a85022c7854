"""Smoothing of the hand: a Kalman filter for the palm, spherical interpolation for its direction.

Lai et al., Section III-B, Eqs. (6)-(12) and Section III-C, Eqs. (13)-(16).
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from filterpy.kalman import KalmanFilter
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

MEASURED: Array = np.kron(np.eye(3), np.eye(2, 3)).astype(np.float64)
"""Observation matrix H (6, 9): position and velocity of each axis; Lai et al., Eq. (8)."""
MEASURED_POSITION = MEASURED[::2]
"""The position rows of H (3, 9), for trackers that report no velocity."""


@dataclass(frozen=True)
class PalmFilterSettings:
    """Noise model of the palm filter.

    Parameters
    ----------
    acceleration_density : float
        Random walk of the hand's acceleration [m/s^2/sqrt(s)]; w in Lai et al., Eq. (7).
    position_sd : float
        Measurement noise of the palm position [m].
    velocity_sd : float
        Measurement noise of the tracker's velocity [m/s]. It lags the palm by about 18 ms, so it is far
        noisier than the position.
    initial_variance : float
        Diagonal of the initial covariance. The paper's 0.7 in mm^2, (mm/s)^2, ... is 0.7e-6 here.
    adaptive : bool
        Scale the process noise so that the innovations have the size they should (Ding et al. 2007).
    window : int
        Innovations that the adaptation looks back on [-].
    """

    acceleration_density: float = 2.0
    position_sd: float = 0.3e-3
    velocity_sd: float = 40e-3
    initial_variance: float = 0.7e-6
    adaptive: bool = False
    window: int = 20

    def __post_init__(self) -> None:
        for name in ("acceleration_density", "position_sd", "velocity_sd", "initial_variance", "window"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"PalmFilterSettings.{name} = {value}, must be finite and > 0")


PAPER_SETTINGS = PalmFilterSettings(position_sd=math.sqrt(0.7) * 1e-3, velocity_sd=math.sqrt(0.7) * 1e-3)
"""R = 0.7 for position and velocity alike, in mm and mm/s: the paper's one number taken at its word."""


def transition_matrix(interval: float) -> Array:
    """Return the constant-acceleration transition F (9, 9) over ``interval`` [s]; Lai et al., Eq. (7)."""
    axis = np.array([[1.0, interval, 0.5 * interval**2], [0.0, 1.0, interval], [0.0, 0.0, 1.0]])
    return np.asarray(np.kron(np.eye(3), axis), dtype=np.float64)


class PalmFilter:
    """Constant-acceleration Kalman filter of the palm position; Lai et al., Eqs. (6)-(12).

    The state is (x, vx, ax, y, vy, ay, z, vz, az) in the device frame, SI units. The filter starts on the
    first measurement and takes intervals from the device clock, so that holes in the stream do no harm.

    Parameters
    ----------
    settings : PalmFilterSettings, optional
        Noise model.

    Examples
    --------
    >>> palm_filter = PalmFilter()
    >>> palm_filter.update(0.00, (0.1, 0.2, 0.0)).round(3).tolist()
    [0.1, 0.2, 0.0]
    """

    def __init__(self, settings: PalmFilterSettings | None = None) -> None:
        self.settings = settings or PalmFilterSettings()
        variances = (self.settings.position_sd**2, self.settings.velocity_sd**2)
        self._noise = np.diag(np.tile(variances, 3))
        self._position_noise = np.eye(3) * variances[0]
        self._filter = KalmanFilter(dim_x=9, dim_z=6)
        self._filter.F, self._filter.Q = np.eye(9), np.zeros((9, 9))
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next measurement starts the filter anew."""
        self.time: float | None = None
        self.process_scale = 1.0
        self._innovations: deque[Array] = deque(maxlen=self.settings.window)

    @property
    def position(self) -> Array:
        """Filtered palm position (3,) [m]."""
        return self._filter.x[::3, 0].copy()

    @property
    def velocity(self) -> Array:
        """Filtered palm velocity (3,) [m/s]."""
        return self._filter.x[1::3, 0].copy()

    def predicted(self, time: float) -> Array:
        """Return the palm position (3,) [m] expected at ``time`` [s], without touching the filter."""
        if self.time is None:
            raise ValueError("PalmFilter.predicted: no measurement has been seen yet")
        return (transition_matrix(time - self.time) @ self._filter.x)[::3, 0]

    def update(self, time: float, position: ArrayLike, velocity: ArrayLike | None = None) -> Array:
        """Take in one measurement.

        Parameters
        ----------
        time : float
            Device clock [s]; must increase.
        position : array_like (3,)
            Measured palm position [m].
        velocity : array_like (3,), optional
            Measured palm velocity [m/s]; without it only the position is used.

        Returns
        -------
        array (3,)
            Filtered palm position [m].

        Raises
        ------
        ValueError
            If the measurement is not finite or time does not increase.
        """
        position = np.asarray(position, dtype=float)
        if position.shape != (3,) or not np.isfinite(position).all():
            raise ValueError(f"PalmFilter.update: position = {position}, must be 3 finite numbers")
        if self.time is None:
            return self._start(time, position)
        interval = time - self.time
        if not interval > 0:
            raise ValueError(f"PalmFilter.update: time {time} s does not follow {self.time} s")
        self._predict(interval)
        if velocity is None:
            self._correct(position, MEASURED_POSITION, self._position_noise)
        else:
            both = np.empty(6)
            both[::2], both[1::2] = position, velocity
            self._correct(both, MEASURED, self._noise)
        self.time = time
        return self.position

    def _start(self, time: float, position: Array) -> Array:
        self.time = time
        self._filter.x = np.zeros((9, 1))
        self._filter.x[::3, 0] = position
        self._filter.P = self.settings.initial_variance * np.eye(9)
        return position

    def _predict(self, interval: float) -> None:
        """A priori state and covariance; Eqs. (6a), (9). Erratum GS-9: (9) starts from the posterior."""
        transition, process = self._filter.F, self._filter.Q
        for axis in (0, 3, 6):
            transition[axis, axis + 1] = transition[axis + 1, axis + 2] = interval
            transition[axis, axis + 2] = 0.5 * interval**2
            process[axis + 2, axis + 2] = (
                self.process_scale * self.settings.acceleration_density**2 * interval
            )
        self._filter.predict()

    def _correct(self, measurement: Array, observation: Array, noise: Array) -> None:
        """Gain, a posteriori covariance and state; Lai et al., Eqs. (10)-(12)."""
        if self.settings.adaptive:
            self._adapt(measurement, observation, noise)
        self._filter.update(measurement[:, None], R=noise, H=observation)

    def _adapt(self, measurement: Array, observation: Array, noise: Array) -> None:
        """Scale Q by the root of measured over predicted innovation power (Ding et al. 2007)."""
        self._innovations.append(measurement - (observation @ self._filter.x)[:, 0])
        if len(self._innovations) < self.settings.window or len(self._innovations[0]) != len(measurement):
            return
        measured = np.mean(np.square(self._innovations)) * len(measurement) - np.trace(noise)
        predicted = np.trace(observation @ self._filter.P @ observation.T)
        factor = math.sqrt(max(measured, 0.0) / predicted)
        self.process_scale = min(max(self.process_scale * min(max(factor, 0.5), 2.0), 1e-3), 1e3)


# --- orientation -------------------------------------------------------------------------------------------


def slerp(start: ArrayLike, end: ArrayLike, share: float) -> Array:
    """Interpolate between two unit quaternions on the shorter great circle; Lai et al., Eqs. (13)-(15).

    Erratum GS-10: the second term of (13) carries the orthonormalised quaternion of (14), not the end itself.

    Parameters
    ----------
    start, end : array_like (4,)
        Unit quaternions, any component order; q and -q are the same rotation.
    share : float
        0 gives ``start``, 1 gives ``end``.

    Returns
    -------
    array (4,)
        Unit quaternion.
    """
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    cosine = float(start @ end)
    if cosine < 0.0:  # Erratum GS-11
        cosine, end = -cosine, -end
    orthogonal = end - cosine * start
    length = math.sqrt(float(orthogonal @ orthogonal))
    if length < 1e-12:
        return start.copy()
    angle = math.atan2(length, cosine)
    return start * math.cos(share * angle) + orthogonal * (math.sin(share * angle) / length)


def angular_distance(start: ArrayLike, end: ArrayLike) -> float:
    """Return the rotation angle [rad] between two unit quaternions (4,), in [0, pi]; Lai et al., Eq. (16)."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    cosine = abs(float(start @ end))
    return 2.0 * math.acos(min(cosine, 1.0))


def low_pass_share(distance: float, range_limit: float, low_pass: float) -> float:
    """Return how far to turn towards the new orientation, between 0 and 1; Lai et al., Eq. (16).

    Parameters
    ----------
    distance : float
        Angular distance of the two orientations [rad].
    range_limit : float
        h_RL in [0, 1]: how much more is taken over of a large turn.
    low_pass : float
        b_low: the share taken over of a small turn.
    """
    return min(max(distance / math.pi * range_limit + low_pass, 0.0), 1.0)


def direction_quaternion(direction: ArrayLike) -> Array:
    """Return the twist-free quaternion (w, x, y, z) that turns e_z into a unit vector (3,)."""
    x, y, z = np.asarray(direction, dtype=float).tolist()
    scale = 1.0 / math.sqrt(max(2.0 + 2.0 * z, 1e-18))
    return np.array([(1.0 + z) * scale, -y * scale, x * scale, 0.0])


def quaternion_direction(quaternion: ArrayLike) -> Array:
    """Return e_z turned by the unit quaternion (w, x, y, z): the pointing direction (3,)."""
    w, x, y, z = np.asarray(quaternion, dtype=float).tolist()
    return np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])


class DirectionFilter:
    """Low-pass filter of a pointing direction by spherical interpolation; Lai et al., Section III-C.

    (16) fixes the share taken over per *frame*, which makes the filter faster the faster it runs. Here the
    time constant is fixed and b_low follows from the interval: at 30 ms, 0.134 s gives b_low = 0.2.

    Parameters
    ----------
    time_constant : float
        Of a small turn [s].
    range_ratio : float
        h_RL / b_low: how much faster a half turn is taken over than a small one [-].

    Attributes
    ----------
    direction : ndarray (3,)
        Filtered unit direction.
    quaternion : ndarray (4,)
        The same as a twist-free quaternion (w, x, y, z).
    """

    def __init__(self, time_constant: float = 0.1, range_ratio: float = 2.0) -> None:
        if not (math.isfinite(time_constant) and time_constant > 0):
            raise ValueError(f"DirectionFilter.time_constant = {time_constant}, must be finite and > 0")
        self.time_constant = time_constant
        self.range_ratio = range_ratio
        self.reset((0.0, 0.0, 1.0))

    def reset(self, direction: ArrayLike) -> None:
        """Start anew from a unit direction (3,)."""
        self.quaternion = direction_quaternion(direction)
        self.direction = quaternion_direction(self.quaternion)

    def update(self, interval: float, direction: ArrayLike) -> Array:
        """Turn towards the unit vector ``direction`` (3,) for ``interval`` [s] and return the result (3,)."""
        target = direction_quaternion(direction)
        low_pass = -math.expm1(-interval / self.time_constant)
        distance = angular_distance(self.quaternion, target)
        share = low_pass_share(distance, self.range_ratio * low_pass, low_pass)
        self.quaternion = slerp(self.quaternion, target, share)
        self.direction = quaternion_direction(self.quaternion)
        return self.direction
