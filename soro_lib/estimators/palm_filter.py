"""Smoothing of the hand: a Kalman filter for the palm, spherical interpolation for its direction.

Lai et al., Section III-B, Eqs. (6)-(12) and Section III-C, Eqs. (13)-(16).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import check_fields, finite, positive

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
        check_fields(self, "acceleration_density", "position_sd", "velocity_sd", above=0)
        check_fields(self, "initial_variance", "window", above=0)


PAPER_SETTINGS = PalmFilterSettings(position_sd=math.sqrt(0.7) * 1e-3, velocity_sd=math.sqrt(0.7) * 1e-3)
"""R = 0.7 for position and velocity alike, in mm and mm/s: the paper's one number taken at its word."""


def transition_matrix(interval: float) -> Array:
    """Return the constant-acceleration transition F (9, 9) over ``interval`` [s]; Lai et al., Eq. (7)."""
    return np.asarray(np.kron(np.eye(3), axis_transition(interval)), dtype=np.float64)


def axis_transition(interval: float) -> Array:
    """Return the block (3, 3) of the transition that moves one axis."""
    return np.array([[1.0, interval, 0.5 * interval**2], [0.0, 1.0, interval], [0.0, 0.0, 1.0]])


class PalmFilter:
    """Constant-acceleration Kalman filter of the palm position; Lai et al., Eqs. (6)-(12).

    The paper's state of nine numbers falls into three axes that move and are measured alike, so that one
    covariance (3, 3) serves them all; `ReadablePalmFilter` is the same filter as the paper writes it. The
    filter starts on the first measurement and takes intervals from the device clock, so that holes in the
    stream do no harm.

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
        self._variances = np.array([self.settings.position_sd**2, self.settings.velocity_sd**2])
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next measurement starts the filter anew."""
        self.time: float | None = None
        self.process_scale = 1.0
        self._innovations: deque[Array] = deque(maxlen=self.settings.window)
        self._begin(np.zeros(3))

    @property
    def state(self) -> Array:
        """Estimate (3, 3) in the device frame: per axis position [m], velocity [m/s], acceleration
        [m/s^2]."""
        return self._state.copy()

    @property
    def covariance(self) -> Array:
        """Covariance (3, 3) of the estimate of one axis, the same for all axes."""
        return self._covariance.copy()

    @property
    def position(self) -> Array:
        """Filtered palm position (3,) [m]."""
        return self.state[:, 0].copy()

    @property
    def velocity(self) -> Array:
        """Filtered palm velocity (3,) [m/s]."""
        return self.state[:, 1].copy()

    def predicted(self, time: float) -> Array:
        """Return the palm position (3,) [m] expected at ``time`` [s], without touching the filter."""
        if self.time is None:
            raise ValueError("PalmFilter.predicted: no measurement has been seen yet")
        return self.state @ axis_transition(time - self.time)[0]

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
        position = finite("PalmFilter.update: position", position, (3,))
        if self.time is None:
            self._begin(position)
            self.time = time
            return position
        interval = time - self.time
        if not interval > 0:
            raise ValueError(f"PalmFilter.update: time {time} s does not follow {self.time} s")
        measured = np.empty((3, 1 if velocity is None else 2))
        measured[:, 0] = position
        if velocity is not None:
            measured[:, 1] = velocity
        self._predict(interval, self.process_scale * self.settings.acceleration_density**2 * interval)
        if self.settings.adaptive:
            self._adapt(measured)
        self._correct(measured)
        self.time = time
        return self.position

    def _begin(self, position: Array) -> None:
        """Rest at a position (3,)."""
        self._state, self._covariance = np.zeros((3, 3)), self.settings.initial_variance * np.eye(3)
        self._state[:, 0] = position

    def _predict(self, interval: float, process_variance: float) -> None:
        _predict(self._state, self._covariance, interval, process_variance)

    def _correct(self, measured: Array) -> None:
        _correct(self._state, self._covariance, measured, self._variances)

    def _adapt(self, measured: Array) -> None:
        """Scale Q by the root of measured over predicted innovation power (Ding et al. 2007)."""
        kinds = measured.shape[1]
        if self._innovations and self._innovations[-1].shape != measured.shape:
            self._innovations.clear()  # the tracker began or ceased to report velocities
        self._innovations.append(measured - self.state[:, :kinds])
        if len(self._innovations) < self.settings.window:
            return
        noise = 3 * self._variances[:kinds].sum()
        power = np.mean(np.square(self._innovations)) * measured.size - noise
        predicted = 3 * np.trace(self.covariance[:kinds, :kinds])
        factor = math.sqrt(max(power, 0.0) / predicted)
        self.process_scale = min(max(self.process_scale * min(max(factor, 0.5), 2.0), 1e-3), 1e3)


@njit(cache=True)
def _predict(state: Array, covariance: Array, interval: float, process_variance: float) -> None:
    """A priori state and covariance, in place; Eqs. (6a), (9). Erratum GS-9: (9) starts from the posterior.

    Twice the shift by ``interval``: of the rows, then of the columns of ``F P F'``.
    """
    half = 0.5 * interval**2
    for k in range(3):
        state[k, 0] += interval * state[k, 1] + half * state[k, 2]
        state[k, 1] += interval * state[k, 2]
    for k in range(3):
        covariance[0, k] += interval * covariance[1, k] + half * covariance[2, k]
        covariance[1, k] += interval * covariance[2, k]
    for k in range(3):
        covariance[k, 0] += interval * covariance[k, 1] + half * covariance[k, 2]
        covariance[k, 1] += interval * covariance[k, 2]
    covariance[2, 2] += process_variance


@njit(cache=True)
def _correct(state: Array, covariance: Array, measured: Array, variances: Array) -> None:
    """A posteriori state and covariance, in place; Lai et al., Eqs. (10)-(12).

    Positions and velocities have independent noise, so one is taken in after the other: the innovation
    covariance of (10) is then a number. The covariance of (11) is in Joseph's form, ``(I - K H) P (I - K H)'
    + K R K'``, which stays positive after a long hole in the stream.
    """
    gain = np.empty(3)
    for kind in range(measured.shape[1]):
        innovation_variance = covariance[kind, kind] + variances[kind]
        for i in range(3):
            gain[i] = covariance[i, kind] / innovation_variance
        for axis in range(3):
            innovation = measured[axis, kind] - state[axis, kind]
            for i in range(3):
                state[axis, i] += gain[i] * innovation
        for j in range(3):
            seen = covariance[kind, j]
            for i in range(3):
                covariance[i, j] -= gain[i] * seen
        for i in range(3):
            seen = covariance[i, kind]
            for j in range(3):
                covariance[i, j] += gain[j] * (gain[i] * variances[kind] - seen)


class ReadablePalmFilter(PalmFilter):
    """The same filter with the matrices of the paper, on filterpy: the reference for `PalmFilter`.

    The state is (x, vx, ax, y, vy, ay, z, vz, az) in the device frame, SI units.
    """

    def _begin(self, position: Array) -> None:
        from filterpy.kalman import KalmanFilter

        self._filter = KalmanFilter(dim_x=9, dim_z=6)
        self._filter.x[::3, 0] = position
        self._filter.P = self.settings.initial_variance * np.eye(9)

    @property
    def state(self) -> Array:
        return self._filter.x.reshape(3, 3)

    @property
    def covariance(self) -> Array:
        return self.whole_covariance[:3, :3]

    @property
    def whole_covariance(self) -> Array:
        """Covariance (9, 9) of the estimate."""
        return self._filter.P

    def _predict(self, interval: float, process_variance: float) -> None:
        """A priori state and covariance; Lai et al., Eqs. (6a), (9)."""
        process = np.kron(np.eye(3), np.diag([0.0, 0.0, process_variance]))
        self._filter.predict(F=transition_matrix(interval), Q=process)

    def _correct(self, measured: Array) -> None:
        """Gain, a posteriori covariance and state; Lai et al., Eqs. (10)-(12)."""
        kinds = measured.shape[1]
        observation = MEASURED if kinds == 2 else MEASURED_POSITION
        noise = np.diag(np.tile(self._variances[:kinds], 3))
        self._filter.update(measured.reshape(-1, 1), R=noise, H=observation)


# --- orientation -------------------------------------------------------------------------------------------


# On tuples of plain floats: one direction at a time, which at this size is faster than arrays.

Quaternion = tuple[float, float, float, float]


def slerp(start: Sequence[float], end: Sequence[float], share: float) -> Quaternion:
    """Interpolate between two unit quaternions on the shorter great circle; Lai et al., Eqs. (13)-(15).

    Erratum GS-10: the second term of (13) carries the orthonormalised quaternion of (14), not the end itself.

    Parameters
    ----------
    start, end : sequence of 4 float
        Unit quaternions, any component order; q and -q are the same rotation.
    share : float
        0 gives ``start``, 1 gives ``end``.

    Returns
    -------
    tuple of 4 float
        Unit quaternion.
    """
    s0, s1, s2, s3 = start
    e0, e1, e2, e3 = end
    cosine = s0 * e0 + s1 * e1 + s2 * e2 + s3 * e3
    if cosine < 0.0:  # Erratum GS-11
        cosine, e0, e1, e2, e3 = -cosine, -e0, -e1, -e2, -e3
    o0, o1, o2, o3 = e0 - cosine * s0, e1 - cosine * s1, e2 - cosine * s2, e3 - cosine * s3
    length = math.sqrt(o0 * o0 + o1 * o1 + o2 * o2 + o3 * o3)
    if length < 1e-12:
        return s0, s1, s2, s3
    angle = math.atan2(length, cosine)
    kept, turned = math.cos(share * angle), math.sin(share * angle) / length
    return kept * s0 + turned * o0, kept * s1 + turned * o1, kept * s2 + turned * o2, kept * s3 + turned * o3


def angular_distance(start: Sequence[float], end: Sequence[float]) -> float:
    """Return the rotation angle [rad] between two unit quaternions, in [0, pi]; Lai et al., Eq. (16)."""
    s0, s1, s2, s3 = start
    e0, e1, e2, e3 = end
    return 2.0 * math.acos(min(abs(s0 * e0 + s1 * e1 + s2 * e2 + s3 * e3), 1.0))


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


def direction_quaternion(direction: Sequence[float]) -> Quaternion:
    """Return the twist-free quaternion (w, x, y, z) that turns e_z into a unit vector."""
    x, y, z = direction
    scale = 1.0 / math.sqrt(max(2.0 + 2.0 * z, 1e-18))
    return (1.0 + z) * scale, -y * scale, x * scale, 0.0


def quaternion_direction(quaternion: Sequence[float]) -> tuple[float, float, float]:
    """Return e_z turned by the unit quaternion (w, x, y, z): the pointing direction."""
    w, x, y, z = quaternion
    return 2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)


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
    quaternion : tuple of 4 float
        The same as a twist-free quaternion (w, x, y, z).
    """

    def __init__(self, time_constant: float = 0.1, range_ratio: float = 2.0) -> None:
        self.time_constant = positive("DirectionFilter.time_constant", time_constant)
        self.range_ratio = range_ratio
        self.reset((0.0, 0.0, 1.0))

    def reset(self, direction: ArrayLike) -> None:
        """Start anew from a unit direction (3,)."""
        self._turn_to(direction_quaternion(np.asarray(direction, dtype=float).tolist()))

    def update(self, interval: float, direction: ArrayLike) -> Array:
        """Turn towards the unit vector ``direction`` (3,) for ``interval`` [s] and return the result (3,)."""
        target = direction_quaternion(np.asarray(direction, dtype=float).tolist())
        low_pass = -math.expm1(-interval / self.time_constant)
        distance = angular_distance(self.quaternion, target)
        share = low_pass_share(distance, self.range_ratio * low_pass, low_pass)
        self._turn_to(slerp(self.quaternion, target, share))
        return self.direction

    def _turn_to(self, quaternion: Quaternion) -> None:
        self.quaternion = quaternion
        self.direction = np.array(quaternion_direction(quaternion))
