"""The ring of square markers around the wrist of an arm."""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from soro_lib.checks import Array, check_fields
from soro_lib.sensing.camera import Image, invert_pose, transform_points


@dataclass(frozen=True)
class MarkerRing:
    """Square markers on the sides of a prism around the wrist (Vervloet, Section 3.2.4).

    The wrist frame has its z axis along the arm, toward the gripper. A marker's z axis points outward and its
    y axis up the arm, so that the gripper lies along -y. (The thesis says +y: then the markers are glued on
    upside down.)

    Attributes
    ----------
    sides : int
        Number of markers.
    marker : float
        Side of the printed squares [m].
    width, height : float
        Size of the white facets [m]; their white rim is what the detector needs around a marker.
    dictionary : int
        OpenCV's number of the set of markers; the ids are 0, 1, ...
    """

    sides: int = 10
    marker: float = 0.020
    width: float = 0.026
    height: float = 0.028
    dictionary: int = cv2.aruco.DICT_4X4_50

    def __post_init__(self) -> None:
        check_fields(self, "sides", at_least=3)
        check_fields(self, "width", "height", above=0)
        check_fields(self, "marker", above=0, below=min(self.width, self.height))

    @property
    def apothem(self) -> float:
        """Return the distance of the markers from the axis of the arm [m]."""
        return float(self.width / 2 / np.tan(np.pi / self.sides))

    @cached_property
    def marker_poses(self) -> Array:
        """Return ``marker_in_wrist`` (sides, 4, 4) of every marker's middle."""
        angles = 2 * np.pi * np.arange(self.sides) / self.sides
        poses = np.tile(np.eye(4), (self.sides, 1, 1))
        outward = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(self.sides)])
        up = np.broadcast_to([0.0, 0.0, -1.0], outward.shape)
        poses[:, :3, :3] = np.stack([np.cross(up, outward), up, outward], axis=-1)
        poses[:, :3, 3] = self.apothem * outward
        return poses

    @cached_property
    def wrist_in_markers(self) -> Array:
        """Return the inverse (sides, 4, 4) of every marker's pose."""
        return np.array([invert_pose(pose) for pose in self.marker_poses])

    @cached_property
    def marker_corners(self) -> Array:
        """Return the corners (sides, 4, 3) [m] in the wrist frame, in OpenCV's order: clockwise from top
        left."""
        return self._rectangles(self.marker, self.marker)

    @cached_property
    def facets(self) -> Array:
        """Return the corners (sides, 4, 3) [m] of the white facets in the wrist frame."""
        return self._rectangles(self.width, self.height)

    @cached_property
    def prints(self) -> tuple[Image, ...]:
        """Return the pictures of the facets, exactly to scale: 6 texels to the millimetre, whole texels."""
        cells = 20
        side = 6 * cells
        per_metre = side / self.marker
        size = round(self.height * per_metre), round(self.width * per_metre)
        if not np.allclose(np.array(size) / per_metre, (self.height, self.width), atol=1e-9):
            raise ValueError("MarkerRing: facet and marker must be whole multiples of marker / 120")
        top, left = (size[0] - side) // 2, (size[1] - side) // 2
        dictionary = cv2.aruco.getPredefinedDictionary(self.dictionary)
        pictures = []
        for number in range(self.sides):
            picture = np.full((*size, 3), 235, dtype=np.uint8)
            square = cv2.aruco.generateImageMarker(dictionary, number, side)
            picture[top : top + side, left : left + side] = np.maximum(square, 18)[..., None]
            pictures.append(picture)
        return tuple(pictures)

    def _rectangles(self, width: float, height: float) -> Array:
        corners = np.array([(-1, 1, 0), (1, 1, 0), (1, -1, 0), (-1, -1, 0)]) * (width / 2, height / 2, 0)
        return np.array([transform_points(pose, corners) for pose in self.marker_poses])
