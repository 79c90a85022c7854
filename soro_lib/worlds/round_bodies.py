"""Shaded balls and tubes for the painter of :mod:`soro_lib.worlds.rendering`.

Their outlines are compiled: a picture of the handover has a ball of ten thousand samples and twenty tubes of
three hundred strips.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from soro_lib.sensing.camera import NEAR, Camera, Image, transform_points
from soro_lib.worlds.rendering import image_region, paste

Array = NDArray[np.float64]
Color = tuple[int, int, int]
"""Blue, green, red."""

STRIPS = np.array([-1.0, -0.62, -0.1, 0.45, 1.0])
STRIP_SHADES = (0.62, 0.85, 1.0, 0.8)
"""Edges and brightness of the strips across a tube."""


@dataclass(frozen=True, eq=False)
class Ball:
    """A matt ball under one distant lamp; its outline and shading are exact for every pixel.

    Parameters
    ----------
    centre : array (3,)
        Centre [m] in the world.
    radius : float
        Radius [m].
    color : int or (int, int, int)
        Grey level, or blue, green, red of the fully lit surface, 0 to 255.
    to_light : array (3,), optional
        Direction in the world from the ball to the lamp.
    ambient : float, optional
        Brightness of the unlit side as a part of the lit one, 0 to 1.
    layer, supersampling : int, optional
        As for :class:`soro_lib.worlds.rendering.TexturedQuad`.
    """

    centre: Array
    radius: float
    color: int | Color
    to_light: tuple[float, float, float] = (0.0, 0.0, 1.0)
    ambient: float = 1.0
    layer: int = 0
    supersampling: int = 3

    @cached_property
    def middle(self) -> Array:
        """Return the centre (3,) [m]."""
        return np.asarray(self.centre, dtype=float)

    def draw(self, image: Image, camera: Camera, world_in_camera: Array) -> None:
        """Paint the ball into ``image``, in place."""
        centre = transform_points(world_in_camera, self.middle[None])[0]
        if centre[2] < NEAR + self.radius:
            return
        silhouette = self._silhouette(centre)
        if not camera.sees(silhouette):
            return
        region = image_region(camera.project(silhouette), image)
        if region is None:
            return
        light = world_in_camera[:3, :3] @ np.asarray(self.to_light, dtype=float)
        (top, bottom), (left, right) = (
            (self.supersampling * axis.start, self.supersampling * axis.stop) for axis in region
        )
        picture, mask = ball_samples(
            (top, left),
            (bottom - top, right - left),
            self.supersampling,
            camera.numbers,
            tuple(centre.tolist()),
            self.radius,
            tuple((light / np.linalg.norm(light)).tolist()),
            self.ambient,
            np.atleast_1d(np.asarray(self.color, dtype=float)),
        )
        paste(image, region, picture.reshape(mask.shape + image.shape[2:]), mask)

    def _silhouette(self, centre: Array) -> Array:
        """Return points (32, 3) of the circle in which the cone of tangents touches the ball."""
        shrink = 1 - self.radius**2 / (centre @ centre)
        _, _, axes = np.linalg.svd(centre[None])
        angles = np.linspace(0, 2 * np.pi, 32, endpoint=False)
        circle = np.outer(np.cos(angles), axes[1]) + np.outer(np.sin(angles), axes[2])
        return shrink * centre + np.sqrt(shrink) * self.radius * circle


@dataclass(frozen=True, eq=False)
class Tube:
    """A round tube along a curve, shaded from left to right as seen from the camera.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        Centre line [m].
    radius : float or ndarray, shape (n,)
        Radius [m].
    colors : sequence of (int, int, int)
        Colours of the slices, in turn.
    layer : int
        See :class:`soro_lib.worlds.rendering.Drawable`.
    """

    points: Array
    radius: float | Array
    colors: Sequence[Color]
    layer: int = 0

    @cached_property
    def middle(self) -> Array:
        """Return the mean of the centre line (3,) [m]."""
        return self.points.mean(axis=0)

    def draw(self, image: Image, camera: Camera, world_in_camera: Array) -> None:
        """Paint the tube into ``image``, in place; nothing if it reaches beyond the camera's view cone."""
        points = np.ascontiguousarray(self.points)
        radius = np.full(len(points), self.radius)
        strips = tube_strips(points, radius, STRIPS, world_in_camera, camera.numbers, NEAR, camera.reach)
        shades = strip_colors(tuple(self.colors), len(points) - 1)
        for corners, color in zip(strips, shades):
            cv2.fillConvexPoly(image, corners, color, cv2.LINE_AA, 4)


@cache
def strip_colors(colors: tuple[Color, ...], slices: int) -> list[tuple[float, ...]]:
    """Return the colour of every strip of a tube, slice by slice."""
    return [
        tuple(shade * c for c in colors[i % len(colors)]) for i in range(slices) for shade in STRIP_SHADES
    ]


@njit(cache=True)
def distorted(x: float, y: float, camera: tuple[float, ...]) -> tuple[float, float]:
    """Return the pixel of the direction (x, y, 1), by OpenCV's polynomials."""
    focal, centre_x, centre_y, k1, k2, p1, p2, k3 = camera
    square = x * x + y * y
    stretch = 1 + k1 * square + k2 * square * square + k3 * (square * square * square)
    bent_x = x * stretch + p1 * (2 * x * y) + p2 * (square + 2 * x * x)
    bent_y = y * stretch + p1 * (square + 2 * y * y) + p2 * (2 * x * y)
    return bent_x * focal + centre_x, bent_y * focal + centre_y


@njit(inline="always")
def undistorted(column: float, row: float, camera: tuple[float, ...]) -> tuple[float, float]:
    """Return x and y of the viewing direction (x, y, 1) of a pixel, by OpenCV's five iterations.

    Inlined, and without a test for a pole of the polynomial, which lies beyond the reach of the camera: only
    so does the processor treat several pixels at once.
    """
    focal, centre_x, centre_y, k1, k2, p1, p2, k3 = camera
    bent_x, bent_y = (column - centre_x) / focal, (row - centre_y) / focal
    x, y = bent_x, bent_y
    for _ in range(5):
        square = x * x + y * y
        shrink = 1 / (1 + ((k3 * square + k2) * square + k1) * square)
        aside_x = 2 * p1 * x * y + p2 * (square + 2 * x * x)
        aside_y = p1 * (square + 2 * y * y) + 2 * p2 * x * y
        x, y = (bent_x - aside_x) * shrink, (bent_y - aside_y) * shrink
    return x, y


@njit(cache=True, error_model="numpy")
def ball_samples(
    start: tuple[int, int],
    size: tuple[int, int],
    supersampling: int,
    camera: tuple[float, ...],
    centre: tuple[float, ...],
    radius: float,
    light: tuple[float, ...],
    ambient: float,
    color: Array,
) -> tuple[Image, Image]:
    """Return the picture (rows, columns, channels) of a ball in a supersampled region, and its mask.

    Parameters
    ----------
    start, size : (int, int)
        First row and column of the region, and how many of them, in samples.
    supersampling : int
        Samples per pixel along each axis.
    camera : (float, ...)
        Its :attr:`soro_lib.sensing.camera.Camera.numbers`.
    centre : (float, float, float)
        Of the ball, in the camera frame [m].
    radius : float
        Of the ball [m].
    light : (float, float, float)
        Unit vector to the lamp, in the camera frame.
    ambient : float
        Brightness of the unlit side.
    color : array (channels,)
        Of the lit side.

    Returns
    -------
    picture : array (rows, columns, channels), uint8
    mask : array (rows, columns), uint8
        255 where a sample hits the ball, else 0.
    """
    picture = np.empty((*size, len(color)), dtype=np.uint8)
    mask = np.empty(size, dtype=np.uint8)
    brightness = np.empty(size[1])
    x0, y0, z0 = centre
    light_x, light_y, light_z = light
    beyond = x0 * x0 + y0 * y0 + z0 * z0 - radius * radius
    centre_lit = x0 * light_x + y0 * light_y + z0 * light_z
    for i in range(size[0]):
        row = (start[0] + i + 0.5) / supersampling - 0.5
        inside = mask[i]
        for j in range(size[1]):
            x, y = undistorted((start[1] + j + 0.5) / supersampling - 0.5, row, camera)
            norm = np.sqrt(x * x + y * y + 1)
            along = (x * x0 + y * y0 + z0) / norm
            discriminant = along * along - beyond
            inside[j] = 255 if discriminant >= 0 else 0
            distance = along - np.sqrt(max(discriminant, 0.0))
            ray_lit = (x * light_x + y * light_y + light_z) / norm
            lit = max((distance * ray_lit - centre_lit) / radius, 0.0)
            brightness[j] = ambient + (1 - ambient) * lit
        for j in range(size[1]):
            for k in range(len(color)):
                picture[i, j, k] = min(max(brightness[j] * color[k], 0.0), 255.0)
    return picture, mask


@njit(cache=True)
def tube_strips(
    points: Array,
    radius: Array,
    strips: Array,
    world_in_camera: Array,
    camera: tuple[float, ...],
    near: float,
    reach: float,
) -> NDArray[np.int32]:
    """Return the corners of a tube's strips with four fractional bits [px / 16], slice by slice.

    Parameters
    ----------
    points : array (n, 3)
        Centre line in the world [m].
    radius : array (n,)
        Along it [m].
    strips : array (s + 1,)
        Edges of the strips, from -1 to 1 across the tube.
    world_in_camera : array (4, 4)
    camera : (float, ...)
        Its :attr:`soro_lib.sensing.camera.Camera.numbers`.
    near, reach : float
        Distance of the near plane [m], and :attr:`soro_lib.sensing.camera.Camera.reach`.

    Returns
    -------
    array ((n - 1) s, 4, 2)
        Empty if an edge lies before the near plane or beyond the reach.
    """
    count, edges = len(points), len(strips)
    seen = np.empty((count, 3))
    for i in range(count):
        for k in range(3):
            seen[i, k] = world_in_camera[k, 3]
            for m in range(3):
                seen[i, k] += world_in_camera[k, m] * points[i, m]
    pixels = np.empty((count, edges, 2), dtype=np.int32)
    for i in range(count):
        before, after = max(i - 1, 0), min(i + 1, count - 1)
        x, y, z = seen[i, 0], seen[i, 1], seen[i, 2]
        along_x = seen[after, 0] - seen[before, 0]
        along_y = seen[after, 1] - seen[before, 1]
        along_z = seen[after, 2] - seen[before, 2]
        across_x = along_y * z - along_z * y
        across_y = along_z * x - along_x * z
        across_z = along_x * y - along_y * x
        norm = max(np.sqrt(across_x**2 + across_y**2 + across_z**2), 1e-12)
        for j in range(edges):
            offset = radius[i] * strips[j] / norm
            edge_x, edge_y, edge_z = x + offset * across_x, y + offset * across_y, z + offset * across_z
            if edge_z < near or np.hypot(edge_x, edge_y) > reach * edge_z:
                return np.empty((0, 4, 2), dtype=np.int32)
            column, row = distorted(edge_x / edge_z, edge_y / edge_z, camera)
            pixels[i, j, 0] = np.int32(np.round(16 * min(max(column, -2000.0), 4000.0)))
            pixels[i, j, 1] = np.int32(np.round(16 * min(max(row, -2000.0), 4000.0)))
    corners = np.empty(((count - 1) * (edges - 1), 4, 2), dtype=np.int32)
    for i in range(count - 1):
        for j in range(edges - 1):
            strip = i * (edges - 1) + j
            for k in range(2):
                corners[strip, 0, k], corners[strip, 1, k] = pixels[i, j, k], pixels[i, j + 1, k]
                corners[strip, 2, k], corners[strip, 3, k] = pixels[i + 1, j + 1, k], pixels[i + 1, j, k]
    return corners
