"""Fusing the camera's pose with the fibre's (Wang et al., Sec. II-D, Eq. (18), corrected)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import number, numbers, positive
from soro_lib.estimators.extreme_learning_machine import same_hemisphere, unit_quaternion

Array = NDArray[np.float64]


def fibre_weight(reprojection_error: ArrayLike, lower: float, upper: float) -> Array:
    """Share of the fibre in the fused pose, 0 below ``lower`` and 1 above ``upper`` (Wang et al., Eq. (18)).

    Continuity at the upper bound leaves no choice for the paper's adjusting factor: K_S = 1/(E_U - E_L)
    (Erratum VS-1). An error that is not a number, as of a lost frame, counts as infinite.

    Parameters
    ----------
    reprojection_error : array_like (...)
        Reprojection error e_S [px].
    lower, upper : float
        Bounds E_L < E_U [px].

    Returns
    -------
    ndarray (...)
        Weights in [0, 1].

    Raises
    ------
    ValueError
        If the bounds are not increasing.
    """
    number("lower", lower, at_least=0, below=number("upper", upper))
    error = np.asarray(reprojection_error, dtype=float)
    error = np.where(np.isnan(error), np.inf, error)
    return np.clip((error - lower) / (upper - lower), 0.0, 1.0)


def inlier_weighted_error(reprojection_error: ArrayLike, inliers: ArrayLike, nominal: float = 200.0) -> Array:
    """Reprojection error raised where few features support the pose: ``e_S max(1, sqrt(nominal / n))`` [px].

    The mean error of the inliers alone says little about the error of the pose, because a pose from few
    features fits those few well. No inlier at all gives infinity.
    """
    inliers = np.asarray(inliers, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.sqrt(np.maximum(1.0, nominal / np.maximum(inliers, 0.0)))
        return np.where(inliers > 0.0, np.asarray(reprojection_error, dtype=float) * factor, np.inf)


def blend_poses(camera_pose: ArrayLike, fibre_pose: ArrayLike, weight: ArrayLike) -> Array:
    """Convex combination of two poses; quaternions on one hemisphere and renormalised.

    Parameters
    ----------
    camera_pose, fibre_pose : array_like (..., 7)
        Position [m] and scalar-last quaternion. Where one of them is not finite, the other is returned.
    weight : array_like (...)
        Share of the fibre, in [0, 1].

    Returns
    -------
    ndarray (..., 7)
        Blended poses with unit quaternions.

    Raises
    ------
    ValueError
        If a shape is wrong, or neither pose is finite.
    """
    camera = numbers("camera_pose", camera_pose, (..., 7))
    fibre = numbers("fibre_pose", fibre_pose, (..., 7))
    has_camera, has_fibre = np.isfinite(camera).all(axis=-1), np.isfinite(fibre).all(axis=-1)
    if not (has_camera & has_fibre).all():
        if not (has_camera | has_fibre).all():
            raise ValueError("neither the camera's nor the fibre's pose is finite")
        weight = np.where(has_camera, np.where(has_fibre, weight, 0.0), 1.0)
        camera = np.where(has_camera[..., None], camera, fibre)
        fibre = np.where(has_fibre[..., None], fibre, camera)
    share = np.asarray(weight, dtype=float)[..., None]
    fused = share * same_hemisphere(fibre, camera) + (1.0 - share) * camera
    fused[..., 3:] = unit_quaternion(fused[..., 3:])
    return fused


def fuse_poses(
    camera_pose: ArrayLike,
    fibre_pose: ArrayLike,
    reprojection_error: ArrayLike,
    *,
    lower: float = 1.2,
    upper: float = 2.4,
) -> Array:
    """Fuse camera and fibre by the reprojection error (Wang et al., Eq. (18), with Erratum VS-1).

    Parameters
    ----------
    camera_pose, fibre_pose : array_like (..., 7)
        Position [m] and scalar-last quaternion, of either sign.
    reprojection_error : array_like (...)
        Reprojection error e_S [px]; not-a-number or infinity for a lost frame.
    lower, upper : float
        Bounds E_L, E_U [px].

    Returns
    -------
    ndarray (..., 7)
        Fused poses with unit quaternions.

    Examples
    --------
    >>> camera, fibre = [0.0, 0, 0, 0, 0, 0, 1], [0.002, 0, 0, 0, 0, 0, -1]
    >>> fuse_poses(camera, fibre, 1.8)[[0, 6]]
    array([0.001, 1.   ])
    """
    return blend_poses(camera_pose, fibre_pose, fibre_weight(reprojection_error, lower, upper))


class InverseVarianceFusion:
    """Weigh each sensor by its own variance: a Kalman filter of tip position and velocity with a gate.

    Parameters
    ----------
    period : float
        Sample time [s].
    acceleration : float
        Standard deviation of the unmodelled acceleration [m/s^2].
    gate : float
        Largest squared Mahalanobis distance of an accepted innovation (3 degrees of freedom; 16.3 passes
        99.9 %).
    reacquire : int
        After this many refused samples of both sensors in a row the gate opens once.

    Notes
    -----
    The camera is trusted by variance ``s_c^2 max(1, nominal/n)`` and the fibre by that of its own recursive
    least squares. The orientation is blended with the share that the fibre had in the position.

    A sensor has one variance for all three axes, so all axes share one covariance of position and velocity,
    2 x 2. Equal to filterpy's filter of the six states (tested).
    """

    def __init__(
        self, period: float = 0.05, acceleration: float = 0.05, gate: float = 16.3, reacquire: int = 20
    ) -> None:
        positive("period", period)
        positive("acceleration", acceleration)
        self.gate = number("gate", gate, above=0, at_most=np.inf)
        self.reacquire = number("reacquire", reacquire, above=0, at_most=np.inf)
        self._transition = np.array([[1.0, period], [0.0, 1.0]])
        effect = np.array([0.5 * period**2, period])
        self._process = acceleration**2 * np.outer(effect, effect)
        self._state = np.zeros((2, 3))
        self._covariance = np.zeros((2, 2))
        self._last = np.full(7, np.nan)
        self._refused = 0

    @property
    def covariance(self) -> Array:
        """Covariance of the fused position, ``(3, 3)`` [m^2]."""
        return self._covariance[0, 0] * np.eye(3)

    def update(
        self, camera_pose: ArrayLike, camera_variance: float, fibre_pose: ArrayLike, fibre_variance: float
    ) -> Array:
        """Fuse one pair of poses ``(7,)``; variances [m^2], infinite for a sensor that is absent.

        Returns
        -------
        ndarray (7,)
            Fused pose; the predicted position if both sensors are refused.

        Raises
        ------
        ValueError
            If nothing usable was seen yet.
        """
        poses = [np.asarray(camera_pose, dtype=float), np.asarray(fibre_pose, dtype=float)]
        variances = [camera_variance, fibre_variance]
        pairs = list(zip(poses, variances))
        usable = [bool(np.isfinite(pose).all() and 0.0 < variance < np.inf) for pose, variance in pairs]
        if np.isnan(self._last[0]):
            self._start(poses, variances, usable)
        self._state = self._transition @ self._state
        self._covariance = self._transition @ self._covariance @ self._transition.T + self._process
        accepted = [ok and self._accept(*pair) for pair, ok in zip(pairs, usable)]
        self._refused = 0 if any(accepted) else self._refused + 1
        if self._refused >= self.reacquire and any(usable):
            self._start(poses, variances, usable)
        information = [1.0 / variance if ok else 0.0 for variance, ok in zip(variances, accepted)]
        share = information[1] / sum(information) if any(accepted) else float(not usable[0])
        pose = blend_poses(poses[0], poses[1], share) if any(usable) else self._last
        self._last = np.concatenate([self._state[0], pose[3:]])
        return self._last

    def _start(self, poses: list[Array], variances: list[float], usable: list[bool]) -> None:
        if not any(usable):
            raise ValueError("neither sensor has given a finite pose with a finite variance yet")
        first = usable.index(True)
        self._state = np.stack([poses[first][:3], np.zeros(3)])
        self._covariance = np.diag([variances[first], 1e-4])
        self._last = poses[first].copy()
        self._refused = 0

    def _accept(self, pose: Array, variance: float) -> bool:
        innovation = pose[:3] - self._state[0]
        spread = self._covariance[0, 0] + variance
        if innovation @ innovation > self.gate * spread:
            return False
        gain = self._covariance[:, 0] / spread
        self._state = self._state + gain[:, None] * innovation
        # Joseph's form keeps the covariance positive definite whatever the rounding of the gain.
        kept = np.array([[1.0 - gain[0], 0.0], [-gain[1], 1.0]])
        self._covariance = kept @ self._covariance @ kept.T + variance * np.outer(gain, gain)
        return True
