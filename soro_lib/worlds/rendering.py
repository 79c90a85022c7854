"""What a camera sees: textured quads and flat polygons, drawn far to near.

The images are made for real detectors (ORB features, ArUco markers, colour contours), so geometry is exact
to a fraction of a pixel and the photometry has the noise of a sensor. Nothing here knows a robot. Round
things, whose outlines are compiled, are in :mod:`soro_lib.worlds.round_bodies`.

Frames and pixels are those of :mod:`soro_lib.sensing.camera`.

    camera = Camera(640, 480, focal_length=520.0)
    image = render(camera, camera_in_world, [TexturedQuad(corners, texture), Polygon(outline, 200)])
    image = expose(image, Photometry(gain=0.5), rng.standard_normal(image.shape, dtype=np.float32))
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from math import ceil, dist, floor
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import check_fields, finite
from soro_lib.sensing.camera import Camera, Image, invert_pose, transform_points

Region = tuple[slice, slice]


class Drawable(Protocol):
    """What :func:`render` can draw: it has a layer and a middle to sort by, and paints itself."""

    @property
    def layer(self) -> int:
        """Return the layer; a lower one is drawn first, whatever the distance (floors, backgrounds)."""

    @property
    def middle(self) -> NDArray[np.float64]:
        """Return the point (3,) [m] in the world whose distance from the camera sets the painting order."""

    def draw(self, image: Image, camera: Camera, world_in_camera: NDArray[np.float64]) -> None:
        """Paint into ``image``, in place."""


@dataclass(frozen=True, eq=False)
class TexturedQuad:
    """A flat parallelogram with a picture on its front; from behind it cannot be seen.

    Parameters
    ----------
    corners : array (4, 3)
        Corners [m] in the world: upper left, upper right, lower right, lower left of the picture.
    texture : array (h, w) or (h, w, 3)
        The picture, uint8. It covers the quad exactly, so its scale is the quad's.
    layer : int, optional
        Painting layer, see :class:`Drawable`.
    supersampling : int, optional
        Samples per pixel along each axis. 1 is fast and has hard edges; 3 gives the soft, unbiased edges that
        subpixel corner detection (ArUco) needs.

    Raises
    ------
    ValueError
        If the corners are not finite, not (4, 3) or not a parallelogram, or the texture is not uint8.

    Notes
    -----
    With a distorting camera the corners are placed exactly and the inside by the homography through them:
    good for small quads. Cut large ones into pieces with :meth:`split`; a piece that reaches beyond
    :attr:`Camera.reach` is left out.
    """

    corners: NDArray[np.float64]
    texture: Image
    layer: int = 0
    supersampling: int = 1

    def __post_init__(self) -> None:
        corners = finite("TexturedQuad.corners", self.corners, (4, 3))
        gap = corners[0] - corners[1] + corners[2] - corners[3]
        if np.abs(gap).max() > 1e-6:
            raise ValueError("TexturedQuad.corners must form a parallelogram")
        if self.texture.dtype != np.uint8 or self.texture.ndim not in (2, 3):
            raise ValueError(f"TexturedQuad.texture must be a uint8 picture, got {self.texture.dtype}")
        object.__setattr__(self, "corners", corners)

    @cached_property
    def middle(self) -> NDArray[np.float64]:
        """Return the centre of the quad (3,) [m]."""
        return self.corners.mean(axis=0)

    def split(self, rows: int, columns: int) -> list["TexturedQuad"]:
        """Return the quad cut into ``rows`` x ``columns`` quads along whole pixels of its texture."""
        height, width = self.texture.shape[:2]
        vertical = np.linspace(0, height, rows + 1).astype(int)
        horizontal = np.linspace(0, width, columns + 1).astype(int)
        origin, right, down = self.corners[0], *self._edges(self.corners)
        pieces = []
        for top, bottom in pairwise(vertical):
            for left, end in pairwise(horizontal):
                ends = [(left, top), (end, top), (end, bottom), (left, bottom)]
                corners = np.array([origin + x / width * right + y / height * down for x, y in ends])
                texture = self.texture[top:bottom, left:end]
                pieces.append(TexturedQuad(corners, texture, self.layer, self.supersampling))
        return pieces

    def draw(self, image: Image, camera: Camera, world_in_camera: NDArray[np.float64]) -> None:
        """Paint the quad into ``image``, in place."""
        corners = transform_points(world_in_camera, self.corners)
        right, down = self._edges(corners)
        if _triple_product(right, down, corners[0]) <= 0:  # seen from behind
            return
        outline = camera.clip(corners)
        if len(outline) < 3 or (camera.distortion and not camera.sees(corners)):
            return
        pixels = camera.project(outline)
        region = image_region(pixels, image)
        if region is None:
            return
        height, width = self.texture.shape[:2]
        if camera.distortion:
            edges = (np.array([(0, 0), (width, 0), (width, height), (0, height)]) - 0.5).astype(np.float32)
            ends = (pixels if outline is corners else camera.project(corners)).astype(np.float32)
            homography = cv2.getPerspectiveTransform(edges, ends).astype(float)
        else:
            per_texel = np.array([[1 / width, 0, 0.5 / width], [0, 1 / height, 0.5 / height], [0, 0, 1]])
            homography = camera.matrix @ np.column_stack([right, down, corners[0]]) @ per_texel
        homography, size = _into_region(homography, region, self.supersampling)
        patch = _image(cv2.warpPerspective(self.texture, homography, size, borderMode=cv2.BORDER_REPLICATE))
        mask = _image(cv2.warpPerspective(_white(height, width), homography, size, flags=cv2.INTER_NEAREST))
        if outline is not corners:
            mask &= _polygon_mask(pixels, region, self.supersampling)
        paste(image, region, patch, mask)

    @staticmethod
    def _edges(corners: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return corners[1] - corners[0], corners[3] - corners[0]


@dataclass(frozen=True, eq=False)
class Polygon:
    """A flat convex polygon of one colour, seen from both sides.

    Parameters
    ----------
    corners : array (n, 3)
        Corners [m] in the world, in order around the polygon.
    color : int or (int, int, int)
        Grey level, or blue, green, red, 0 to 255.
    layer : int, optional
        Painting layer, see :class:`Drawable`.
    """

    corners: NDArray[np.float64]
    color: int | tuple[int, int, int]
    layer: int = 0

    @cached_property
    def middle(self) -> NDArray[np.float64]:
        """Return the mean of the corners (3,) [m]."""
        return np.mean(self.corners, axis=0)

    def draw(self, image: Image, camera: Camera, world_in_camera: NDArray[np.float64]) -> None:
        """Paint the polygon into ``image``, in place, with softened edges."""
        outline = camera.clip(transform_points(world_in_camera, self.corners))
        if len(outline) < 3 or (camera.distortion and not camera.sees(outline)):
            return
        pixels = camera.project(outline)
        if image_region(pixels, image) is not None:
            cv2.fillConvexPoly(image, _fixed_point(pixels), self.color, cv2.LINE_AA, shift=4)


def render(
    camera: Camera,
    camera_in_world: ArrayLike,
    scene: Sequence[Drawable],
    background: int | tuple[int, int, int] | Image = 0,
) -> Image:
    """Return the picture the camera takes of the scene, without noise: the painter's algorithm.

    Parameters
    ----------
    camera : Camera
        Intrinsic parameters.
    camera_in_world : array (4, 4)
        Pose of the camera.
    scene : sequence of Drawable
        What is there; drawn layer by layer, in each layer from the farthest middle to the nearest.
    background : int, (int, int, int) or image, optional
        Colour (grey, or blue, green, red) or picture behind everything; it decides whether the image is grey.

    Returns
    -------
    array (height, width) or (height, width, 3), uint8

    Raises
    ------
    ValueError
        If the pose is not a finite (4, 4) matrix or the background picture has another size than the image.
    """
    camera_in_world = finite("camera_in_world", camera_in_world, (4, 4))
    if isinstance(background, np.ndarray):
        if background.shape[:2] != (camera.height, camera.width):
            raise ValueError(
                f"background must be {camera.height} x {camera.width}, got {background.shape[:2]}"
            )
        image = background.copy()
    else:
        channels = () if isinstance(background, int) else (3,)
        image = np.full((camera.height, camera.width, *channels), background, dtype=np.uint8)
    position = camera_in_world[:3, 3]
    world_in_camera = invert_pose(camera_in_world)
    for item in sorted(scene, key=lambda item: (item.layer, -dist(item.middle, position))):
        item.draw(image, camera, world_in_camera)
    return image


@dataclass(frozen=True)
class Photometry:
    """How light becomes grey levels: a sensor with shot and read noise behind a lens.

    Parameters
    ----------
    gain : float, optional
        Light and exposure together: factor on the noise-free grey levels, 0 is darkness.
    read_noise : float, optional
        Standard deviation of the signal-independent noise [grey levels].
    shot_noise : float, optional
        Variance of the noise per grey level of signal [grey levels].
    blur : float, optional
        Standard deviation of the lens blur [px].
    motion : (float, float), optional
        How far the image moves during the exposure, to the right and down [px].

    Raises
    ------
    ValueError
        If a parameter is negative or not finite.
    """

    gain: float = 1.0
    read_noise: float = 3.0
    shot_noise: float = 0.15
    blur: float = 0.0
    motion: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        check_fields(self, "gain", "read_noise", "shot_noise", "blur", at_least=0)
        check_fields(self, "motion", shape=(2,))


def expose(image: Image, photometry: Photometry, noise: NDArray[np.float32]) -> Image:
    """Return the image as the sensor delivers it: blurred, scaled, noisy, clipped to 0 ... 255.

    Parameters
    ----------
    image : array (h, w) or (h, w, 3), uint8
        Noise-free image.
    photometry : Photometry
        Gain, noise and blur. The variance of a pixel is ``read_noise**2 + shot_noise * signal``.
    noise : array of the image's shape, float32
        Standard normal numbers: ``rng.standard_normal(image.shape, dtype=np.float32)``.

    Returns
    -------
    array of the image's shape, uint8

    Raises
    ------
    ValueError
        If the shapes differ.
    """
    if noise.shape != image.shape:
        raise ValueError(f"noise must have the image's shape {image.shape}, got {noise.shape}")
    if photometry.blur > 0:
        image = _image(cv2.GaussianBlur(image, (0, 0), photometry.blur))
    if max(map(abs, photometry.motion)) >= 1:
        image = _image(cv2.filter2D(image, -1, motion_kernel(*photometry.motion)))
    levels = np.arange(256, dtype=np.float32) * np.float32(photometry.gain)
    spread = np.sqrt(photometry.read_noise**2 + photometry.shot_noise * levels, dtype=np.float32)
    signal = np.maximum(levels[image] + spread[image] * noise, 0)
    return _image(cv2.convertScaleAbs(signal))


def motion_kernel(right: float, down: float) -> NDArray[np.float32]:
    """Return the normalised kernel of a straight camera movement by (right, down) [px] in one exposure."""
    size = 2 * int(np.ceil(max(abs(right), abs(down)) / 2)) + 1
    kernel = np.zeros((size, size), dtype=np.float32)
    half = np.array([right, down]) / 2
    ends = _fixed_point(np.array([size // 2 - half, size // 2 + half]))
    cv2.line(kernel, ends[0], ends[1], 1.0, 1, cv2.LINE_8, shift=4)
    return kernel / kernel.sum()


def image_region(pixels: NDArray[np.float64], image: Image) -> Region | None:
    """Return the rows and columns of the image that the pixels (n, 2) span, or None if they miss it."""
    (left, top), (right, bottom) = pixels.min(axis=0).tolist(), pixels.max(axis=0).tolist()
    rows = slice(max(0, floor(top)), min(image.shape[0], ceil(bottom) + 1))
    columns = slice(max(0, floor(left)), min(image.shape[1], ceil(right) + 1))
    return (rows, columns) if rows.start < rows.stop and columns.start < columns.stop else None


def paste(image: Image, region: Region, patch: Image, mask: Image) -> None:
    """Put the supersampled patch into the region of the image where the mask says so, softly at its edges."""
    target = image[region]
    if mask.shape == target.shape[:2]:
        cv2.copyTo(patch, mask, target)
        return
    size = target.shape[1::-1]
    patch = _image(cv2.resize(patch, size, interpolation=cv2.INTER_AREA))
    opacity = _image(cv2.resize(mask, size, interpolation=cv2.INTER_AREA))
    if target.ndim == 3:
        opacity = _image(cv2.merge([opacity, opacity, opacity]))
    weight = opacity / np.float32(255)
    target[...] = np.round(weight * patch + (1 - weight) * target)


def _image(picture: object) -> Image:
    """Return what an OpenCV function made as the 8-bit image it is (OpenCV's own types are wider)."""
    return np.asarray(picture, dtype=np.uint8)


def _into_region(
    homography: NDArray[np.float64], region: Region, supersampling: int
) -> tuple[NDArray[np.float64], tuple[int, int]]:
    """Return the homography into the supersampled region, and the region's size (width, height) there."""
    rows, columns = region
    centre = 0.5 * (supersampling - 1)
    shift = np.array(
        [
            [supersampling, 0, centre - supersampling * columns.start],
            [0, supersampling, centre - supersampling * rows.start],
            [0, 0, 1],
        ]
    )
    size = supersampling * (columns.stop - columns.start), supersampling * (rows.stop - rows.start)
    return shift @ homography, size


def _polygon_mask(pixels: NDArray[np.float64], region: Region, supersampling: int) -> Image:
    """Return a mask of the supersampled region, 255 inside the convex polygon of pixels (n, 2)."""
    shift, (width, height) = _into_region(np.eye(3), region, supersampling)
    inside = np.clip(pixels * shift[0, 0] + shift[:2, 2], -1e6, 1e6)
    mask = np.zeros((height, width), dtype=np.uint8)
    cv2.fillConvexPoly(mask, _fixed_point(inside), 255, shift=4)
    return mask


def _fixed_point(pixels: NDArray[np.float64]) -> NDArray[np.int32]:
    """Return pixel coordinates with four fractional bits, for OpenCV's drawing functions."""
    return np.round(np.clip(pixels, -1e6, 1e6) * 16).astype(np.int32)


@lru_cache(maxsize=64)
def _white(height: int, width: int) -> Image:
    """Return a white picture, what a quad's mask is made of."""
    return np.full((height, width), 255, dtype=np.uint8)


def _triple_product(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> float:
    """Return the determinant of three vectors (3,), on single numbers, which are quicker than arrays."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = a.tolist(), b.tolist(), c.tolist()
    return float((ay * bz - az * by) * cx + (az * bx - ax * bz) * cy + (ax * by - ay * bx) * cz)
