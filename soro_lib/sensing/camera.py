"""A pinhole camera: what it projects where, and where it stands.

Frames: the camera frame is OpenCV's, x right, y down, z forward. A pose is a (4, 4) homogeneous matrix named
``camera_in_world``: it takes points of the camera frame to the world. Pixel (0, 0) is the centre of the
upper left pixel.
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import check_fields, one_of

NEAR = 1e-3
"""Distance of the near plane [m]: whatever is closer to the camera, or behind it, is cut off."""


Image = NDArray[np.uint8]


@dataclass(frozen=True)
class Camera:
    """A pinhole camera with optional radial and tangential distortion.

    Parameters
    ----------
    width, height : int
        Size of the image [px].
    focal_length : float
        Focal length [px], the same along both axes.
    principal_point : (float, float), optional
        Where the optical axis meets the image [px]; the middle of the image by default.
    distortion : tuple of float, optional
        OpenCV's coefficients (k1, k2, p1, p2[, k3]); empty for none.

    Raises
    ------
    ValueError
        If a size or the focal length is not positive, or the distortion has a length OpenCV does not know.
    """

    width: int
    height: int
    focal_length: float
    principal_point: tuple[float, float] | None = None
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self, "width", "height", "focal_length", above=0)
        one_of("number of coefficients in Camera.distortion", len(self.distortion), (0, 4, 5))

    @cached_property
    def matrix(self) -> NDArray[np.float64]:
        """Return the (3, 3) matrix of intrinsic parameters."""
        centre = self.principal_point or ((self.width - 1) / 2, (self.height - 1) / 2)
        return np.array([[self.focal_length, 0, centre[0]], [0, self.focal_length, centre[1]], [0, 0, 1.0]])

    @cached_property
    def coefficients(self) -> NDArray[np.float64]:
        """Return the distortion coefficients as OpenCV wants them, (n,)."""
        return np.array(self.distortion or (0.0, 0.0, 0.0, 0.0))

    def project(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the pixels (n, 2) of points (n, 3) [m] in the camera frame, in front of it."""
        points = np.asarray(points, dtype=float).reshape(-1, 3)
        if self.distortion:
            origin = np.zeros(3)
            pixels, _ = cv2.projectPoints(points, origin, origin, self.matrix, self.coefficients)
            return np.array(pixels, dtype=float).reshape(-1, 2)
        homogeneous = points @ self.matrix.T
        return homogeneous[:, :2] / homogeneous[:, 2:]

    def rays(self, pixels: ArrayLike) -> NDArray[np.float64]:
        """Return the viewing directions (n, 3), with z = 1 and the distortion removed, of pixels (n, 2)."""
        pixels = np.asarray(pixels, dtype=float).reshape(-1, 2)
        if self.distortion:
            flat = cv2.undistortPoints(pixels[:, None], self.matrix, self.coefficients)[:, 0]
        else:
            flat = (pixels - self.matrix[:2, 2]) / self.focal_length
        return np.column_stack([flat, np.ones(len(flat))])

    @cached_property
    def numbers(self) -> tuple[float, ...]:
        """Return focal length, principal point [px] and k1, k2, p1, p2, k3, for compiled code."""
        distortion = (*self.distortion, 0.0, 0.0, 0.0, 0.0, 0.0)[:5]
        return tuple(map(float, (self.focal_length, *self.matrix[:2, 2], *distortion)))

    @cached_property
    def reach(self) -> float:
        """Return the distance r / z from the optical axis up to which the radial distortion is monotonic.

        Beyond it the polynomial folds back and would show things that lie outside the field of view.
        """
        k1, k2, _, _, k3 = self.numbers[3:]
        roots = np.roots([7 * k3, 5 * k2, 3 * k1, 1.0])
        turns = roots.real[(abs(roots.imag) < 1e-12) & (roots.real > 0)]
        return float(np.sqrt(turns.min(initial=np.inf)))

    def clip(self, polygon: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the part (m, 3) of a convex polygon (n, 3) in front of the camera and near its view.

        The view is widened by a whole image on every side, which leaves room for the distortion.
        """
        normals, offsets = self._view
        if (polygon @ normals.T >= offsets).all():
            return polygon
        for normal, offset in zip(normals, offsets):
            polygon = clip_half_space(polygon, normal, offset)
        return polygon

    @cached_property
    def _view(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return normals (5, 3) and offsets (5,) [m] of the half spaces of :meth:`clip`."""
        (f, _, cx), (_, _, cy) = self.matrix[:2]
        left, top = cx + self.width, cy + self.height
        right, bottom = 2 * self.width - cx, 2 * self.height - cy
        normals = [(0, 0, 1), (f, 0, left), (-f, 0, right), (0, f, top), (0, -f, bottom)]
        return np.array(normals), np.array([NEAR, 0, 0, 0, 0])

    def sees(self, points: NDArray[np.float64]) -> bool:
        """Return whether all points (n, 3) in the camera frame lie in front and within :attr:`reach`."""
        distance = np.hypot(points[:, 0], points[:, 1])
        return bool((points[:, 2] >= NEAR).all() and (distance <= self.reach * points[:, 2]).all())


def transform_points(transform: NDArray[np.float64], points: ArrayLike) -> NDArray[np.float64]:
    """Return points (n, 3) taken through a (4, 4) homogeneous matrix."""
    return np.asarray(points, dtype=float) @ transform[:3, :3].T + transform[:3, 3]


def invert_pose(pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the inverse of a rigid (4, 4) homogeneous matrix."""
    inverse = np.eye(4)
    inverse[:3, :3] = pose[:3, :3].T
    inverse[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return inverse


def look_at(position: ArrayLike, target: ArrayLike, up: ArrayLike = (0.0, 0.0, 1.0)) -> NDArray[np.float64]:
    """Return ``camera_in_world`` (4, 4) of an upright camera at ``position`` aimed at ``target`` [m]."""
    position = np.asarray(position, dtype=float)
    forward = np.asarray(target, dtype=float) - position
    right = np.cross(forward, np.asarray(up, dtype=float))
    if not np.linalg.norm(right) > 1e-9:
        raise ValueError("look_at: target must differ from position, in a direction other than up")
    axes = np.array([right, np.cross(forward, right), forward])
    pose = np.eye(4)
    pose[:3, :3] = (axes / np.linalg.norm(axes, axis=1, keepdims=True)).T
    pose[:3, 3] = position
    return pose


def clip_half_space(polygon: NDArray[np.float64], normal: ArrayLike, offset: float) -> NDArray[np.float64]:
    """Return the part (m, 3) of a convex polygon (n, 3) where ``points @ normal >= offset``."""
    beyond = polygon @ np.asarray(normal, dtype=float) - offset
    if (beyond >= 0).all():
        return polygon
    kept = []
    for here, there, start, end in zip(beyond, np.roll(beyond, -1), polygon, np.roll(polygon, -1, axis=0)):
        if here >= 0:
            kept.append(start)
        if (here >= 0) != (there >= 0):
            kept.append(start + here / (here - there) * (end - start))
    return np.array(kept).reshape(-1, 3)
