"""The few operations on poses that SciPy does not offer for batches of 4 x 4 transforms.

A pose is a homogeneous transform, shape (..., 4, 4), from the named frame to the base frame. Conversions
between matrices, quaternions (scalar last) and rotation vectors are `scipy.spatial.transform.Rotation`'s.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

FloatArray = NDArray[np.float64]


def make_transform(rotation: ArrayLike, translation: ArrayLike) -> FloatArray:
    """Return the transforms, shape (..., 4, 4), of rotations (..., 3, 3) and translations (..., 3) [m]."""
    turn, shift = np.asarray(rotation, dtype=float), np.asarray(translation, dtype=float)
    if turn.shape[-2:] != (3, 3) or shift.shape[-1:] != (3,):
        raise ValueError(
            "rotation must have shape (..., 3, 3) and translation (..., 3), "
            f"got {turn.shape} and {shift.shape}"
        )
    transform = np.zeros((*np.broadcast_shapes(turn.shape[:-2], shift.shape[:-1]), 4, 4))
    transform[..., :3, :3] = turn
    transform[..., :3, 3] = shift
    transform[..., 3, 3] = 1.0
    return transform


def invert_transform(transform: ArrayLike) -> FloatArray:
    """Return the inverse poses, shape (..., 4, 4), without a general matrix inversion.

    Raises
    ------
    ValueError
        If the shape is not (..., 4, 4) or a rotation is not orthonormal (to 1e-6).
    """
    pose = _as_transform(transform, "transform")
    inverse_rotation = np.swapaxes(require_rotation(pose[..., :3, :3]), -1, -2)
    return make_transform(inverse_rotation, -_rotate(inverse_rotation, pose[..., :3, 3]))


def transform_points(transform: ArrayLike, points: ArrayLike) -> FloatArray:
    """Return points, shape (..., 3), of the moving frame in the base frame.

    Parameters
    ----------
    transform : array_like, shape (..., 4, 4)
        One pose, or one for each point: leading axes are broadcast against those of `points`.
    points : array_like, shape (..., 3)
        Positions [m] in the moving frame.
    """
    pose, positions = _as_transform(transform, "transform"), np.asarray(points, dtype=float)
    if positions.shape[-1:] != (3,):
        raise ValueError(f"points must have shape (..., 3), got {positions.shape}")
    return _rotate(pose[..., :3, :3], positions) + pose[..., :3, 3]


def pointing_direction(transform: ArrayLike) -> FloatArray:
    """Return the z axis of the poses in the base frame, shape (..., 3): where the tip points."""
    return _as_transform(transform, "transform")[..., :3, 2].copy()


def magnitude(vector: ArrayLike) -> float:
    """Return the length of one vector (n,).

    Not by np.linalg.norm, which asks BLAS: its last bit differs from processor to processor, and in a closed
    loop that is chaotic the last bit decides where it ends.

    Examples
    --------
    >>> magnitude([3.0, 4.0])
    5.0
    """
    return math.hypot(*np.asarray(vector, dtype=float).tolist())


def angle_between(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """Return the angle [rad] in [0, pi] between directions of shape (..., 3), exact near 0 and near pi.

    Raises
    ------
    ValueError
        If a direction is zero or not finite.
    """
    first, second = (_as_direction(value, name) for value, name in ((a, "a"), (b, "b")))
    sine = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.arctan2(sine, (first * second).sum(axis=-1))


def pose_error(actual: ArrayLike, desired: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return translation [m] and rotation vector [rad], shapes (..., 3), that carry `actual` into `desired`.

    Both are in the base frame: ``desired`` has the position ``p + translation`` and the rotation
    ``exp(rotation_vector) @ R``, with p, R of ``actual``.
    """
    here, there = _as_transform(actual, "actual"), _as_transform(desired, "desired")
    turn = there[..., :3, :3] @ np.swapaxes(here[..., :3, :3], -1, -2)
    vector = Rotation.from_matrix(turn.reshape(-1, 3, 3)).as_rotvec()
    return there[..., :3, 3] - here[..., :3, 3], vector.reshape(*turn.shape[:-1])


def align_quaternion(quaternion: ArrayLike, reference: ArrayLike) -> FloatArray:
    """Return the quaternions, shape (..., 4), or their negatives, whichever is nearer to `reference`.

    q and -q are the same rotation, so blending or filtering quaternions needs them in one hemisphere first.
    """
    turn, near = np.asarray(quaternion, dtype=float), np.asarray(reference, dtype=float)
    return np.where((turn * near).sum(axis=-1, keepdims=True) < 0.0, -turn, turn)


def require_rotation(rotation: ArrayLike, tolerance: float = 1e-6) -> FloatArray:
    """Return rotations, shape (..., 3, 3), as an array, or raise ValueError where one is not a rotation.

    Raises
    ------
    ValueError
        If the shape is wrong, a matrix is not orthonormal to `tolerance`, or is a reflection.
    """
    turn = np.asarray(rotation, dtype=float)
    if turn.shape[-2:] != (3, 3):
        raise ValueError(f"rotation must have shape (..., 3, 3), got {turn.shape}")
    defect = np.abs(turn @ np.swapaxes(turn, -1, -2) - np.eye(3)).max(initial=0.0)
    if not defect <= tolerance:
        raise ValueError(f"rotation must be orthonormal to {tolerance:g}, R R^T - I reaches {defect:.3g}")
    if not (np.linalg.det(turn) > 0.0).all():
        raise ValueError("rotation must have determinant +1, got a reflection")
    return turn


def _rotate(rotation: FloatArray, vectors: FloatArray) -> FloatArray:
    return np.einsum("...ij,...j->...i", rotation, vectors)


def _as_transform(value: ArrayLike, name: str) -> FloatArray:
    pose = np.asarray(value, dtype=float)
    if pose.shape[-2:] != (4, 4):
        raise ValueError(f"{name} must have shape (..., 4, 4), got {pose.shape}")
    if not np.isfinite(pose).all():
        raise ValueError(f"{name} must be finite")
    return pose


def _as_direction(value: ArrayLike, name: str) -> FloatArray:
    direction = np.asarray(value, dtype=float)
    if direction.shape[-1:] != (3,):
        raise ValueError(f"{name} must have shape (..., 3), got {direction.shape}")
    if not (np.isfinite(direction).all() and (np.abs(direction).max(axis=-1, initial=0.0) > 0.0).all()):
        raise ValueError(f"{name} must be finite and not zero")
    return direction
