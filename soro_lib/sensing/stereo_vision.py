"""From the images of several cameras to the positions of arm and ball (Vervloet, Sections 3.2.2-3.2.4).

Cameras are calibrated on the corners of a box; a point is where their rays meet; the ball is a green circle;
the arm is known by the markers around its wrist. OpenCV does all of it but what joins the views: how the
markers' poses become one pose, in :mod:`soro_lib.sensing.marker_pose`. The world is the frame `arm_base`.
"""

from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import finite, numbers
from soro_lib.sensing.camera import Camera, Image, invert_pose, transform_points
from soro_lib.sensing.marker_ring import MarkerRing

Window = tuple[slice, slice]
"""Rows and columns of an image."""

Piece = tuple[NDArray[Any], float]
"""Outline (n, 1, 2) and area [px] of a green piece."""


class CalibrationError(ValueError):
    """The corners of the calibration box do not fit; the message says by how much."""


@dataclass(frozen=True, eq=False)
class CalibratedCamera:
    """What is believed about a camera.

    Attributes
    ----------
    camera : Camera
        Intrinsic parameters.
    pose : ndarray, shape (4, 4)
        ``camera_in_world``.
    reprojection : float
        Root mean square distance of the box corners from where they should be seen [px].
    """

    camera: Camera
    pose: NDArray[np.float64]
    reprojection: float = 0.0

    def rays(self, pixels: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return origin (3,) [m] and unit directions (n, 3), in the world, of pixels (n, 2) as seen."""
        rays = self.camera.rays(pixels) @ self.pose[:3, :3].T
        return self.pose[:3, 3], rays / np.linalg.norm(rays, axis=1, keepdims=True)

    def project(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the pixels (n, 2) of points (n, 3) [m] of the world."""
        return self.camera.project(transform_points(invert_pose(self.pose), points))


BOX_SIZE = (0.20, 0.16, 0.12)
"""Edges of the calibration box along x, y, z [m]; the thesis prints only that six corners are used."""


def box_corners(middle: ArrayLike = (0.0, 0.0, 0.66)) -> NDArray[np.float64]:
    """Return six corners (6, 3) [m] of the calibration box that both cameras see: the near face, and the far
    edge of its top."""
    near = [(-1, 1, -1), (1, 1, -1), (1, 1, 1), (-1, 1, 1)]
    far_top = [(-1, -1, -1), (1, -1, -1)]
    return np.asarray(middle) + np.array(near + far_top) * np.array(BOX_SIZE) / 2


def calibrate(
    camera: Camera, corners: ArrayLike, pixels: ArrayLike, largest_reprojection: float = 3.0
) -> CalibratedCamera:
    """Return the camera's pose from corners of known position (Vervloet, Section 3.2.2).

    Parameters
    ----------
    camera : Camera
        Intrinsic parameters.
    corners : array_like, shape (n, 3)
        At least six points in the world [m], not all in one plane.
    pixels : array_like, shape (n, 2)
        Where they were selected in the image.
    largest_reprojection : float
        Largest root mean square distance of selected and explained pixels [px].

    Raises
    ------
    CalibrationError
        If there are too few points, a value is not finite, a corner would lie behind the camera, or the pose
        does not explain the pixels, as when corners were selected in another order.
    """
    world = finite("calibration: corners", corners, ("n >= 6", 3), CalibrationError)
    seen = finite("calibration: pixels", pixels, (len(world), 2), CalibrationError)
    for start in (None, cv2.SOLVEPNP_SQPNP):
        world_in_camera = _corner_pose(camera, world, seen, start)
        in_camera = transform_points(world_in_camera, world)
        in_front = bool((in_camera[:, 2] > 0).all())
        residual = float(np.sqrt(np.mean(np.sum((camera.project(in_camera) - seen) ** 2, axis=1))))
        if in_front and residual <= largest_reprojection:
            return CalibratedCamera(camera, invert_pose(world_in_camera), residual)
    if not in_front:
        raise CalibrationError("calibration: no pose sees all corners in front of the camera")
    raise CalibrationError(
        f"calibration: corners are off by {residual:.1f} px, more than {largest_reprojection} px; "
        "were they selected in the right order, in the image of this camera?"
    )


def _corner_pose(
    camera: Camera, corners: NDArray[np.float64], pixels: NDArray[np.float64], start: int | None
) -> NDArray[np.float64]:
    """Return ``world_in_camera`` (4, 4) by least squares, from OpenCV's own start or another method's.

    Its own is a linear solution, which on six corners of a box with ordinary selection errors can lead
    astray: six times in a thousand for the camera at the side.
    """
    intrinsic = camera.matrix, camera.coefficients
    if start is None:
        _, rotation, translation = cv2.solvePnP(corners, pixels, *intrinsic)
    else:
        _, rotation, translation = cv2.solvePnP(corners, pixels, *intrinsic, flags=start)
        _, rotation, translation = cv2.solvePnP(corners, pixels, *intrinsic, rotation, translation, True)
    pose = np.eye(4)
    pose[:3, :3] = cv2.Rodrigues(rotation)[0]
    pose[:3, 3] = translation.ravel()
    return pose


def triangulate(origins: ArrayLike, directions: ArrayLike) -> NDArray[np.float64]:
    """Return the point closest to all rays, in the sense of least squares (Vervloet, Section 3.2.2).

    For two rays it is the middle of the shortest line between them.

    Parameters
    ----------
    origins : array_like, shape (..., n, 3)
        A point of each ray [m], n at least 2.
    directions : array_like, shape (..., n, 3)
        Their directions, of any length but zero.

    Returns
    -------
    ndarray, shape (..., 3)
        The point [m].

    Raises
    ------
    ValueError
        If the shapes do not fit, a value is not finite, a direction is zero, or all rays are parallel.

    Examples
    --------
    >>> triangulate([(0, 0, 0), (1, 0, 0)], [(1, 0, 1), (-1, 0, 1)])
    array([0.5, 0. , 0.5])
    """
    start, along = _checked_rays(origins, directions)
    across = np.eye(3) - along[..., :, None] * along[..., None, :]
    normal = across.sum(axis=-3)
    if not (np.linalg.eigvalsh(normal)[..., 0] > 1e-9).all():
        raise ValueError("triangulate: the rays are parallel")
    return np.linalg.solve(normal, np.einsum("...nij,...nj->...i", across, start)[..., None])[..., 0]


def ray_gap(origins: ArrayLike, directions: ArrayLike) -> float:
    """Return the largest distance of the triangulated point from a ray, doubled: for two rays, how far they
    pass from each other [m]."""
    start, along = _checked_rays(origins, directions)
    offset = triangulate(start, along) - start
    return float(2 * np.linalg.norm(np.cross(along, offset), axis=-1).max())


def _checked_rays(
    origins: ArrayLike, directions: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    start, along = np.broadcast_arrays(
        finite("triangulate: origins", origins), finite("triangulate: directions", directions)
    )
    numbers("triangulate: rays", start, (..., "n >= 2", 3))
    lengths = np.linalg.norm(along, axis=-1, keepdims=True)
    if not lengths.all():
        raise ValueError("triangulate: directions must not be zero")
    return start, along / lengths


@dataclass(frozen=True)
class BallSight:
    """A green ball in one image.

    Attributes
    ----------
    centre : (float, float)
        Middle of the enclosing circle [px].
    radius : float
        Its radius [px].
    fill : float
        Share of the circle that is green: small for a ball that something hides in part.
    """

    centre: tuple[float, float]
    radius: float
    fill: float


@dataclass(frozen=True)
class BallDetector:
    """Blur, colour bounds, contours, smallest enclosing circle (Vervloet, Section 3.2.3).

    Attributes
    ----------
    lower, upper : (int, int, int)
        Bounds of hue (0 to 179), saturation and value; not printed.
    blur : int
        Size of the blur [px], odd.
    smallest_radius, largest_radius : float
        Radii that a ball in reach can have [px].
    join_pieces : bool
        Whether pieces that one such circle can enclose are taken together, as when a finger covers the middle
        of the ball. The thesis takes each piece for itself.
    """

    lower: tuple[int, int, int] = (40, 120, 45)
    upper: tuple[int, int, int] = (80, 255, 255)
    blur: int = 7
    smallest_radius: float = 6.0
    largest_radius: float = 45.0
    join_pieces: bool = False

    def detect(self, image: Image, window: Window | None = None) -> list[BallSight]:
        """Return the green circles of a picture (h, w, 3), the largest green area first.

        Without a window the whole picture is searched at a quarter of its size, and what is found is measured
        at full size.
        """
        if window is not None:
            return self._measure(image, window)
        sights: list[BallSight] = []
        for points, _ in self._pieces(np.ascontiguousarray(image[::4, ::4]), 3):
            (x, y), radius = cv2.minEnclosingCircle(points)
            for sight in self._measure(image, around((4 * x, 4 * y), 4 * radius + 24, image.shape)):
                if all(np.hypot(*np.subtract(sight.centre, s.centre)) > 1.0 for s in sights):
                    sights.append(sight)
        return sorted(sights, key=lambda sight: -sight.fill * sight.radius**2)

    def _measure(self, image: Image, window: Window) -> list[BallSight]:
        corner = window[1].start, window[0].start
        sights = []
        pieces = self._pieces(image[window], self.blur)
        for points, area in self._joined(pieces) if self.join_pieces else pieces:
            (x, y), radius = cv2.minEnclosingCircle(points)
            if self.smallest_radius <= radius <= self.largest_radius:
                fill = min(1.0, area / (np.pi * radius**2))
                sights.append(BallSight((x + corner[0], y + corner[1]), radius, fill))
        return sights

    def _pieces(self, image: Image, blur: int) -> list[Piece]:
        """Return outline (n, 1, 2) and area [px] of every green piece, the largest first."""
        smooth = cv2.GaussianBlur(image, (blur, blur), 0)
        mask = cv2.inRange(cv2.cvtColor(smooth, cv2.COLOR_BGR2HSV), self.lower, self.upper)
        contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        pieces = [(np.asarray(contour), cv2.contourArea(contour)) for contour in contours]
        return sorted((piece for piece in pieces if piece[1] > 0), key=lambda piece: -piece[1])

    def _joined(self, pieces: list[Piece]) -> list[Piece]:
        """Return the pieces, those that one ball can explain taken together."""
        balls: list[Piece] = []
        for points, area in pieces:
            for i, (others, other_area) in enumerate(balls):
                both = np.concatenate([others, points])
                if cv2.minEnclosingCircle(both)[1] <= self.largest_radius:
                    balls[i] = both, other_area + area
                    break
            else:
                balls.append((points, area))
        return balls


def around(centre: tuple[float, float], half: float, shape: tuple[int, ...]) -> Window:
    """Return the window of an image of a shape that reaches ``half`` pixels to all sides of a pixel."""
    x, y = centre
    rows = slice(max(0, int(y - half)), max(1, min(shape[0], int(y + half) + 1)))
    return rows, slice(max(0, int(x - half)), max(1, min(shape[1], int(x + half) + 1)))


CORNER_SHIFT = 0.26
"""How far a detected corner lies inside the true one [px], toward the middle of its marker: ArUco finds the
rim of the dark square as the sensor blurs it. Measured on rendered markers (see the study's error budget);
without the correction a single marker seems 14 to 20 mm too far away."""


@dataclass(frozen=True)
class MarkerDetector:
    """OpenCV's marker detector, set up for small markers.

    Attributes
    ----------
    ring : MarkerRing
        Which markers there are.
    smallest_side : float
        Smallest side of a marker [px].
    corner_shift : float
        Correction of the detected corners, away from the marker's middle [px].
    """

    ring: MarkerRing = field(default_factory=MarkerRing)
    smallest_side: float = 10.0
    corner_shift: float = CORNER_SHIFT

    def detect(self, image: Image, window: Window | None = None) -> dict[int, NDArray[np.float64]]:
        """Return the corners (4, 2) [px] of each marker of the ring that is seen in a picture (h, w, 3), by
        id."""
        part = image if window is None else image[window]
        grey = cv2.cvtColor(part, cv2.COLOR_BGR2GRAY)
        found, ids, _ = self._detector(max(grey.shape)).detectMarkers(grey)
        corner = np.zeros(2) if window is None else np.array([window[1].start, window[0].start])
        seen = {}
        for corners, number in zip(found, [] if ids is None else ids.ravel()):
            if number < self.ring.sides:
                square = corners.reshape(4, 2).astype(float)
                outward = square - square.mean(axis=0)
                outward /= np.linalg.norm(outward, axis=1, keepdims=True)
                seen[int(number)] = square + self.corner_shift * outward + corner
        return seen

    def _detector(self, longer_side: int) -> cv2.aruco.ArucoDetector:
        """Return a detector for pictures of a size: OpenCV takes the smallest perimeter relative to the
        longer side of the picture it is given, so a window needs a larger number than the whole picture."""
        parameters = cv2.aruco.DetectorParameters()
        parameters.minMarkerPerimeterRate = 4 * self.smallest_side / longer_side
        parameters.adaptiveThreshWinSizeMin = 5
        parameters.adaptiveThreshWinSizeMax = 13
        parameters.adaptiveThreshWinSizeStep = 8
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        parameters.cornerRefinementWinSize = 2
        parameters.relativeCornerRefinmentWinSize = 1.0
        return cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(self.ring.dictionary), parameters)
