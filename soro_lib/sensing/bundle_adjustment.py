"""Bundle adjustment: camera poses and points that explain the pixels best (Levenberg-Marquardt, sparse)."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_matrix, coo_matrix, csr_matrix
from scipy.spatial.transform import Rotation

from soro_lib.checks import Array

Indices = NDArray[np.intp]


def projection_jacobian(local: Array, focal_length: float) -> Array:
    """Return d pixel / d (v, w) of points in the camera frame, for the movement ``x -> x + v + w x x``.

    Parameters
    ----------
    local : ndarray (n, 3)
        Points in the camera frame, z > 0.
    focal_length : float
        [px]

    Returns
    -------
    ndarray (n, 2, 6)
        Columns: translation v, rotation w. The first three are also the derivative by the point itself.
    """
    x, y, z = local.T
    zero = np.zeros(len(local))
    rows = np.array(
        [
            [1 / z, zero, -x / z**2, -x * y / z**2, 1 + x**2 / z**2, -y / z],
            [zero, 1 / z, -y / z**2, -1 - y**2 / z**2, x * y / z**2, x / z],
        ]
    )
    return focal_length * rows.transpose(2, 0, 1)


def adjust(
    matrix: Array,
    rotations: Rotation,
    translations: Array,
    points: Array,
    frame: Indices,
    point: Indices,
    pixels: Array,
    free: NDArray[np.bool_],
    iterations: int = 6,
    huber: float = 2.0,
) -> tuple[Rotation, Array, Array]:
    """Adjust poses and points to the pixels in which the points were seen.

    Parameters
    ----------
    matrix : ndarray (3, 3)
        Intrinsic parameters, one focal length.
    rotations : Rotation (k)
        From the map to the cameras.
    translations : ndarray (k, 3)
        Of the map's origin in the cameras.
    points : ndarray (p, 3)
        Points in the map.
    frame, point : ndarray (m,) of int
        Which camera saw which point.
    pixels : ndarray (m, 2)
        Where it was seen [px].
    free : ndarray (k,) of bool
        Which cameras may move; at least one must not, to hold the map in place.
    iterations : int, optional
        Steps tried.
    huber : float, optional
        Residuals beyond this count linearly instead of squared [px].

    Returns
    -------
    rotations, translations, points
        As given, adjusted. The cost never rises.
    """
    column = np.cumsum(free) - 1
    moves = free[frame]
    cameras = 6 * int(np.count_nonzero(free))
    damping = 1e-4

    def residual(rotations: Rotation, translations: Array, points: Array) -> tuple[Array, Array]:
        local = rotations[frame].apply(points[point]) + translations[frame]
        depth = np.maximum(local[:, 2:], 1e-6)
        return matrix[0, 0] * local[:, :2] / depth + matrix[:2, 2] - pixels, local

    def cost(error: Array) -> float:
        size = np.linalg.norm(error, axis=1)
        return float(np.where(size < huber, size**2, 2 * huber * size - huber**2).sum())

    error, local = residual(rotations, translations, points)
    for _ in range(iterations):
        size = np.linalg.norm(error, axis=1)
        root_weight = np.sqrt(huber / np.maximum(size, huber))[:, None]
        by_pose = root_weight[..., None] * projection_jacobian(local, matrix[0, 0])
        by_point = by_pose[..., :3] @ rotations[frame].as_matrix()
        rows = 2 * np.arange(len(frame))[:, None] + np.arange(2)
        pose_columns = 6 * column[frame][:, None] + np.arange(6)
        pose_jacobian = _stack(rows[moves], pose_columns[moves], by_pose[moves], error.size, cameras)
        point_jacobian = _stack(rows, 3 * point[:, None] + np.arange(3), by_point, error.size, points.size)
        target = (root_weight * error).ravel()
        # The points do not touch each other: eliminate them, solve the few poses, then put the points back.
        blocks = np.zeros((len(points), 3, 3))
        np.add.at(blocks, point, by_point.transpose(0, 2, 1) @ by_point)
        blocks += damping * blocks * np.eye(3) + 1e-9 * np.eye(3)
        diagonal = np.arange(len(points) + 1)
        inverse = bsr_matrix(
            (np.linalg.inv(blocks), diagonal[:-1], diagonal), shape=(points.size, points.size)
        )
        coupling = pose_jacobian.T @ point_jacobian
        normal = (pose_jacobian.T @ pose_jacobian).toarray()
        normal += damping * np.diag(np.diag(normal)) + 1e-9 * np.eye(cameras)
        carried = coupling @ inverse
        reduced = normal - (carried @ coupling.T).toarray()
        point_target = point_jacobian.T @ target
        turn = np.zeros((len(free), 6))
        pose_target = pose_jacobian.T @ target - carried @ point_target
        turn[free] = -np.linalg.solve(reduced, pose_target).reshape(-1, 6)
        shift = -inverse @ (point_target + coupling.T @ turn[free].ravel())
        spin = Rotation.from_rotvec(turn[:, 3:])
        moved = spin.apply(translations) + turn[:, :3]
        trial = spin * rotations, moved, points + shift.reshape(-1, 3)
        trial_error, trial_local = residual(*trial)
        if cost(trial_error) < cost(error):
            (rotations, translations, points), error, local = trial, trial_error, trial_local
            damping = max(damping / 10, 1e-8)
        else:
            damping *= 10
    return rotations, translations, points


def _stack(rows: Indices, columns: Indices, blocks: Array, height: int, width: int) -> csr_matrix:
    """Return a sparse matrix from blocks (n, 2, c) at rows (n, 2) and columns (n, c)."""
    shape = blocks.shape
    row = np.broadcast_to(rows[:, :, None], shape).ravel()
    column = np.broadcast_to(columns[:, None, :], shape).ravel()
    return coo_matrix((blocks.ravel(), (row, column)), shape=(height, width)).tocsr()
