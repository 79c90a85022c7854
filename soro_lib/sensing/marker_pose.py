"""The pose of the wrist from the markers that the cameras see, by three estimators.

A square of known size seen by one camera has two poses that explain it almost equally well (both face the
camera). The estimators differ in how they live with that:

- :func:`average_pose`: the better of the two for each marker, then the plain average (Vervloet,
  Section 3.2.4);
- :func:`consensus_pose`: for each marker the one that agrees with the other markers, outliers left out;
- :func:`joint_pose`: one rigid ring fitted to all corners of all cameras.

The world is the frame `arm_base`; the wrist frame is that of
:class:`soro_lib.sensing.marker_ring.MarkerRing`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from soro_lib.checks import Array
from soro_lib.sensing.marker_ring import MarkerRing
from soro_lib.sensing.stereo_vision import CalibratedCamera

Markers = Mapping[int, Array]
"""Corners (4, 2) [px] of the markers that one camera sees, by id."""

AGREEMENT = 0.040
"""Farthest that wrist and gripper of a marker may lie from the consensus, root mean square [m]."""

DISAGREEMENT_CAP = 0.060
"""Distance beyond which a marker that disagrees does not disagree more [m]."""

CORNER_DEVIATION = 0.15
"""Standard deviation of a detected corner per axis [px], measured on rendered markers."""


@dataclass(frozen=True)
class WristPose:
    """The estimated wrist.

    Attributes
    ----------
    wrist : ndarray, shape (3,)
        Middle of the ring [m].
    direction : ndarray, shape (3,)
        Unit vector from wrist to gripper.
    wrist_deviation, direction_deviation : float
        Standard deviation per component that the estimator claims [m, -].
    markers : int
        Markers used, each camera's counted.
    pose : ndarray, shape (4, 4), or None
        ``wrist_in_world``, if the estimator gives one.
    """

    wrist: Array
    direction: Array
    wrist_deviation: float
    direction_deviation: float
    markers: int
    pose: Array | None = None


def wrist_candidates(markers: Markers, camera: CalibratedCamera, ring: MarkerRing) -> Array:
    """Return ``wrist_in_world`` (m, 2, 4, 4) of both poses of every marker, the better reprojection first."""
    half = ring.marker / 2
    square = np.array([(-half, half, 0), (half, half, 0), (half, -half, 0), (-half, -half, 0)])
    identity = np.eye(3)
    candidates = np.empty((len(markers), 2, 4, 4))
    for row, number, rays in zip(candidates, markers, _rays(markers, camera)):
        _, rotations, translations, _ = cv2.solvePnPGeneric(
            square, rays, identity, None, flags=cv2.SOLVEPNP_IPPE_SQUARE
        )
        wrist_in_marker = ring.wrist_in_markers[number]
        for i in range(2):
            j = min(i, len(rotations) - 1)
            marker_in_camera = np.eye(4)
            marker_in_camera[:3, :3] = cv2.Rodrigues(rotations[j])[0]
            marker_in_camera[:3, 3] = translations[j].ravel()
            row[i] = camera.pose @ marker_in_camera @ wrist_in_marker
    return candidates


def _rays(markers: Markers, camera: CalibratedCamera) -> Array:
    """Return x/z and y/z (m, 4, 2) of the corners of the markers in the camera frame."""
    rays = camera.camera.rays(np.concatenate(list(markers.values())))[:, :2]
    return np.ascontiguousarray(rays).reshape(-1, 4, 2)


def average_pose(candidates: Array) -> WristPose:
    """Return the plain average over all markers of all cameras (Vervloet, Section 3.2.4).

    Parameters
    ----------
    candidates : ndarray, shape (m, 2, 4, 4)
        Of :func:`wrist_candidates`, all cameras together, m at least 1.
    """
    return _mean(candidates[:, 0], np.ones(len(candidates)))


def consensus_pose(
    candidates: Array,
    cosines: Array,
    gripper_length: float,
    expected: Array | None = None,
) -> WristPose:
    """Return the weighted mean over the markers that agree, each with the pose that agrees better.

    Parameters
    ----------
    candidates : ndarray, shape (m, 2, 4, 4)
        Of :func:`wrist_candidates`, all cameras together, m at least 1.
    cosines : ndarray, shape (m, 2)
        Of the angle under which the marker would be seen in each of its poses.
    gripper_length : float
        Distance from wrist to gripper [m].
    expected : ndarray, shape (6,), optional
        Wrist and gripper where they were seen last [m]: decides when a single marker is left.
    """
    wrists = candidates[..., :3, 3]
    points = np.concatenate([wrists, wrists + gripper_length * candidates[..., :3, 2]], axis=-1)
    count = len(points)
    apart = np.linalg.norm(points[:, :, None, None] - points, axis=-1) / np.sqrt(2)
    to_others = np.minimum(apart.min(axis=-1), DISAGREEMENT_CAP).sum(axis=-1)
    if count == 1 and expected is not None:
        to_others = np.linalg.norm(points - expected, axis=-1)
    anchor = points.reshape(-1, 6)[np.argmin(to_others)]
    distance = np.linalg.norm(points - anchor, axis=-1) / np.sqrt(2)
    nearest = np.argmin(distance, axis=1)
    every = np.arange(count)
    kept = distance[every, nearest] <= AGREEMENT
    chosen = candidates[every, nearest][kept]
    return _mean(chosen, cosines[every, nearest][kept] ** 2)


def _mean(poses: Array, weights: Array) -> WristPose:
    """Return the weighted mean of wrist and direction; the claimed deviations are those of the mean."""
    share = weights / weights.sum()
    wrists, directions = poses[:, :3, 3], poses[:, :3, 2]
    wrist, direction = share @ wrists, share @ directions
    direction /= np.linalg.norm(direction)
    effective = 1 / np.sum(share**2)

    def deviation(values: Array, mean: Array, alone: float) -> float:
        """Return the deviation of the mean of values, each at least half as uncertain as one marker alone."""
        spread = np.sqrt(share @ np.mean((values - mean) ** 2, axis=1))
        return float(np.hypot(spread, alone / 2) / np.sqrt(effective))

    nearest = poses[
        np.argmin(np.linalg.norm(wrists - wrist, axis=1) + np.linalg.norm(directions - direction, axis=1))
    ]
    return WristPose(
        wrist,
        direction,
        deviation(wrists, wrist, 0.010),
        deviation(directions, direction, 0.05),
        len(poses),
        nearest,
    )


def joint_pose(
    start: Array,
    sights: Sequence[tuple[CalibratedCamera, Markers]],
    ring: MarkerRing,
    iterations: int = 8,
) -> WristPose:
    """Return the pose of the rigid ring that explains all corners in all images best.

    Gauss-Newton in the six coordinates of a small motion, in normalised image coordinates, with Huber's
    weights beyond two standard deviations.

    Parameters
    ----------
    start : ndarray, shape (4, 4)
        ``wrist_in_world`` to begin with, as of :func:`consensus_pose`.
    sights : sequence of (CalibratedCamera, markers)
        What each camera sees, at least one marker in all.
    ring : MarkerRing
    iterations : int
    """
    corners, rotations, positions, seen, scale = _all_corners(sights, ring)
    pose = start.copy()
    for _ in range(iterations):
        offsets = corners @ pose[:3, :3].T
        in_camera = np.einsum("nji,nj->ni", rotations, offsets + pose[:3, 3] - positions)
        depth = np.maximum(in_camera[:, 2:], 1e-3)
        rays = in_camera[:, :2] / depth
        residual = scale * (rays - seen)
        across, forward = rotations[:, :, :2].transpose(0, 2, 1), rotations[:, None, :, 2]
        by_point = (scale / depth)[:, None] * across - (scale * rays / depth)[..., None] * forward
        jacobian = np.concatenate([by_point, _cross(offsets[:, None], by_point)], axis=-1).reshape(-1, 6)
        norms = np.linalg.norm(residual, axis=1)
        weights = np.repeat(np.minimum(1, 2 * CORNER_DEVIATION / np.maximum(norms, 1e-9)), 2)
        normal = jacobian.T @ (weights[:, None] * jacobian)
        step = -np.linalg.solve(
            normal + 1e-9 * np.trace(normal) * np.eye(6), jacobian.T @ (weights * residual.ravel())
        )
        pose[:3, 3] += step[:3]
        pose[:3, :3] = Rotation.from_rotvec(step[3:]).as_matrix() @ pose[:3, :3]
        if np.abs(step).max() < 1e-6:
            break
    covariance = CORNER_DEVIATION**2 * np.linalg.inv(normal + 1e-9 * np.trace(normal) * np.eye(6))
    spread = max(1.0, float(np.sqrt(np.average(residual.ravel() ** 2, weights=weights))) / CORNER_DEVIATION)
    return WristPose(
        pose[:3, 3].copy(),
        pose[:3, 2].copy(),
        float(spread * np.sqrt(np.trace(covariance[:3, :3]) / 3)),
        float(spread * np.sqrt(np.trace(covariance[3:, 3:]) / 3)),
        len(corners) // 4,
        pose,
    )


def _all_corners(sights: Sequence[tuple[CalibratedCamera, Markers]], ring: MarkerRing) -> tuple[Array, ...]:
    """Return for every seen corner its place in the ring, its camera's rotation and position, its ray (x/z,
    y/z) and the focal length."""
    columns: list[tuple[Array, ...]] = []
    for camera, markers in sights:
        for number, rays in zip(markers, _rays(markers, camera)):
            columns.append(
                (
                    ring.marker_corners[number],
                    np.broadcast_to(camera.pose[:3, :3], (4, 3, 3)),
                    np.broadcast_to(camera.pose[:3, 3], (4, 3)),
                    rays,
                    np.full((4, 1), float(camera.camera.focal_length)),
                )
            )
    return tuple(np.concatenate(column) for column in zip(*columns))


def _cross(a: Array, b: Array) -> Array:
    """Return the vector products (..., 3); np.cross spends most of its time on the order of its axes."""
    ax, ay, az, bx, by, bz = a[..., 0], a[..., 1], a[..., 2], b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def viewing_cosines(candidates: Array, markers: Markers, camera: CalibratedCamera, ring: MarkerRing) -> Array:
    """Return the cosine (m, 2) of the angle between each marker's normal and the line to the camera, for both
    of its poses."""
    in_ring = ring.marker_poses[list(markers)]
    marker = candidates @ in_ring[:, None]
    to_camera = camera.pose[:3, 3] - marker[..., :3, 3]
    to_camera /= np.linalg.norm(to_camera, axis=-1, keepdims=True)
    return np.maximum(np.sum(to_camera * marker[..., :3, 2], axis=-1), 0.05)
