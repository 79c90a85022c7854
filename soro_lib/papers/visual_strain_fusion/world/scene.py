"""What the camera in the arm's tip looks at, and what may come between (Wang et al., Secs. IV-B and IV-C).

A room of printed bricks: floor, four walls and boxes of different height, so that the view has depth. The
world frame is the paper's: the origin is the tip at rest, z points down along the arm, toward the floor. The
disturbances act on the pixels: a hand, a cover, fading light, a lamp that shines into the lens.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from soro_lib.checks import Vector, not_negative
from soro_lib.sensing.camera import Camera, Image
from soro_lib.worlds.rendering import Photometry, TexturedQuad, expose, render

Array = NDArray[np.float64]
Mask = NDArray[np.float32]

ENDOSCOPE = Camera(640, 480, focal_length=520.0)
"""The camera in the tip: 63 x 50 degrees. The paper prints neither image size nor focal length."""

TEXELS_PER_METRE = 5000.0
"""Resolution of the printed bricks; one texel is about one pixel at 10 cm."""

STUD = 40
"""Pitch of the studs on a brick [texels], which is 8 mm; a brick is two studs deep."""

FLOOR = 0.130
WALL = 0.165
CEILING = -0.150
"""Depth of the floor, distance of the walls, top of the walls [m]."""

PALM = 0.56
"""Half length of the palm as a part of the image's height: on the first scene it was raised from 0.42 until
the moving hand hid all features in rare frames, as Wang et al., Sec. IV-C1, describe."""

PALETTE = (
    *((40, 40, 190), (170, 90, 30), (60, 150, 60), (40, 190, 220)),
    *((210, 210, 210), (70, 70, 70), (30, 110, 220)),
)
"""Blue, green, red of the bricks."""


@dataclass(frozen=True)
class ViewConditions:
    """What disturbs one frame.

    Parameters
    ----------
    light : float, optional
        Ambient light, 1 is ordinary and 0 darkness.
    hand : (float, float, float), optional
        Middle of the palm of a hand before the lens, as parts of the image's width and height, and the
        direction of its fingers [rad].
    covered : bool, optional
        Whether the hand lies on the lens.
    lamp : (float, float), optional
        Where a lamp shines into the lens, as parts of the image's width and height.
    phase : int, optional
        The paper's number of the condition, in Figs. 6(a) and 7(a).

    Raises
    ------
    ValueError
        If the light is negative or not finite.
    """

    light: float = 1.0
    hand: Vector | None = None
    covered: bool = False
    lamp: tuple[float, float] | None = None
    phase: int = 1

    def __post_init__(self) -> None:
        not_negative("ViewConditions.light", self.light)


@dataclass(frozen=True)
class BrickScene:
    """A room of printed bricks with nine boxes on its floor.

    Parameters
    ----------
    seed : int
        Arrangement and print of the bricks; another seed is another scene.
    color : bool, optional
        Whether the pictures have three channels (blue, green, red) or are grey.
    """

    seed: int
    color: bool = False

    @property
    def quads(self) -> tuple[TexturedQuad, ...]:
        """Return all printed surfaces, which are made once in a process."""
        return printed_surfaces(self.seed, self.color)

    def image(self, camera_in_world: ArrayLike) -> Image:
        """Return the noise-free, undisturbed view (height, width[, 3]) from a (4, 4) camera pose."""
        return render(ENDOSCOPE, camera_in_world, self.quads, background=(0, 0, 0) if self.color else 0)


@lru_cache(maxsize=4)
def printed_surfaces(seed: int, color: bool) -> tuple[TexturedQuad, ...]:
    """Return floor, walls and boxes of a scene, see :class:`BrickScene`."""
    rng = np.random.default_rng(seed)
    size = 2 * WALL, 2 * WALL, FLOOR - CEILING
    surfaces = [
        _surface(rng, (-WALL, -WALL, FLOOR), (size[0], 0, 0), (0, size[1], 0), layer=-2),
        *_sides((-WALL, -WALL, CEILING), size, rng, inward=True),
    ]
    for row in range(3):
        for column in range(3):
            surfaces += _box(rng, np.array([column - 1.0, row - 1.0]) * 0.075)
    return tuple(surfaces if color else map(_in_grey, surfaces))


def _in_grey(surface: TexturedQuad) -> TexturedQuad:
    grey = np.asarray(cv2.cvtColor(surface.texture, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    return replace(surface, texture=grey)


def _box(rng: np.random.Generator, middle: Array) -> list[TexturedQuad]:
    """Return top and sides of a box standing near ``middle`` (2,) [m] on the floor."""
    width, depth = rng.uniform(0.024, 0.046, 2)
    height = rng.uniform(0.018, 0.052)
    x, y = middle + rng.uniform(-0.014, 0.014, 2) - np.array([width, depth]) / 2
    corner = (x, y, FLOOR - height)
    top = _surface(rng, corner, (width, 0, 0), (0, depth, 0))
    return [top, *_sides(corner, (width, depth, height), rng)]


def _sides(
    corner: Vector, size: Vector, rng: np.random.Generator, inward: bool = False
) -> list[TexturedQuad]:
    """Return the four upright faces of a block, seen from outside or, for the room, from inside."""
    (x, y, z), (width, depth, height) = corner, size
    starts = ((x, y), (x + width, y), (x + width, y + depth), (x, y + depth))
    along = ((width, 0), (0, depth), (-width, 0), (0, -depth))
    faces = []
    for (start_x, start_y), (right_x, right_y) in zip(starts, along):
        if not inward:
            start_x, start_y = start_x + right_x, start_y + right_y
            right_x, right_y = -right_x, -right_y
        start, right, layer = (start_x, start_y, z), (right_x, right_y, 0), -1 if inward else 0
        faces.append(_surface(rng, start, right, (0, 0, height), layer))
    return faces


def _surface(
    rng: np.random.Generator, corner: Vector, right: Vector, down: Vector, layer: int = 0
) -> TexturedQuad:
    """Return a freshly printed surface."""
    corners = np.array(corner) + np.array([(0, 0, 0), right, np.add(right, down), down])
    texture = brick_texture(rng, float(np.linalg.norm(right)), float(np.linalg.norm(down)))
    return TexturedQuad(corners, texture, layer)


def brick_texture(rng: np.random.Generator, width: float, height: float) -> Image:
    """Return the print of bricks with studs and marks, (h, w, 3) uint8, for a surface of a size in metres."""
    columns, rows = round(TEXELS_PER_METRE * width), round(TEXELS_PER_METRE * height)
    texture = np.zeros((rows, columns, 3), dtype=np.uint8)
    for top in range(0, rows, 2 * STUD):
        left = -STUD * int(rng.integers(0, 4))
        while left < columns:
            studs = int(rng.integers(2, 6))
            color = np.array(PALETTE[rng.integers(len(PALETTE))]) * rng.uniform(0.75, 1.1)
            _print_brick(rng, texture, (left, top), studs, color)
            left += studs * STUD
    # Down to whole grey levels: what a sum in floating point would be cut to.
    grain = np.floor(rng.normal(0.0, 6.0, (rows, columns))).astype(np.int16)
    return np.asarray(cv2.add(texture, cv2.merge([grain, grain, grain]), dtype=cv2.CV_8U), dtype=np.uint8)


def _print_brick(
    rng: np.random.Generator, texture: Image, corner: tuple[int, int], studs: int, color: Array
) -> None:
    """Draw one brick, two studs deep, with light and shade on the studs and three random marks."""
    left, top = corner
    size = studs * STUD, 2 * STUD
    end = left + size[0], top + size[1]
    rim, shade = (0.35 * color).tolist(), (0.45 * color).tolist()
    light = np.minimum(1.3 * color, 255).tolist()
    cv2.rectangle(texture, corner, end, color.tolist(), -1)
    cv2.rectangle(texture, corner, end, rim, 2)
    for x in range(left + STUD // 2, end[0], STUD):
        for y in range(top + STUD // 2, end[1], STUD):
            cv2.circle(texture, (x + 3, y + 3), 3 * STUD // 10, shade, -1)
            cv2.circle(texture, (x, y), 3 * STUD // 10, light, -1)
    for _ in range(3):
        *places, blue, green, red, line = rng.random(10)
        mark = np.round(np.reshape(places, (3, 2)) * size + corner).astype(np.int32)
        ink = (255 * blue, 255 * green, 255 * red)
        if line < 0.5:
            cv2.polylines(texture, [mark], False, ink, int(rng.integers(2, 5)), cv2.LINE_AA)
        else:
            cv2.fillConvexPoly(texture, mark, ink, cv2.LINE_AA)


def tip_camera(pose: ArrayLike) -> Array:
    """Return ``camera_in_world`` (4, 4) of the camera in the tip for a pose (7,): position [m], quaternion.

    Raises
    ------
    ValueError
        If the pose is not seven finite numbers.
    """
    pose = np.asarray(pose, dtype=float)
    if pose.shape != (7,) or not np.isfinite(pose).all():
        raise ValueError(f"pose must be seven finite numbers, got {pose}")
    transform = np.eye(4)
    transform[:3, :3] = Rotation.from_quat(pose[3:]).as_matrix()
    transform[:3, 3] = pose[:3]
    return transform


def disturb(image: Image, conditions: ViewConditions) -> Image:
    """Return the noise-free image with what comes between; the ambient light is left to the exposure.

    Parameters
    ----------
    image : array (h, w) or (h, w, 3), uint8
        Undisturbed view.
    conditions : ViewConditions
        Hand and cover.
    """
    skin = np.array([110.0, 135.0, 190.0]) if image.ndim == 3 else np.array(150.0)
    if conditions.covered:
        glow = np.linspace(0.18, 0.26, image.shape[0]).reshape(-1, *(1,) * (image.ndim - 1))
        return np.broadcast_to(np.round(skin * glow), image.shape).astype(np.uint8)
    if conditions.hand is None:
        return image
    opacity, shade = _hand(conditions.hand, image.shape[1], image.shape[0])
    if image.ndim == 3:
        opacity, shade = opacity[..., None], shade[..., None]
    return np.asarray(image + opacity * (skin * shade - image), dtype=np.uint8)


def _hand(hand: Vector, width: int, height: int) -> tuple[Mask, Mask]:
    """Return opacity and shading (height, width) of a defocused hand, drawn small and enlarged."""
    scale = 4
    size = width // scale, height // scale
    palm = np.array([hand[0] * size[0], hand[1] * size[1]])
    forward = np.array([np.cos(hand[2]), np.sin(hand[2])])
    sideways = np.array([-forward[1], forward[0]])
    mask: Mask = np.zeros(size[::-1], dtype=np.float32)
    degrees = float(np.degrees(hand[2]))
    reach = PALM * size[1]
    _ellipse(mask, palm, (reach, 0.85 * reach), degrees)
    for place in (-0.62, -0.2, 0.2, 0.62):
        middle = palm + reach * (1.15 * forward + place * sideways)
        _ellipse(mask, middle, (0.75 * reach, 0.19 * reach), degrees + 8 * place)
    _ellipse(mask, palm - reach * (1.5 * forward), (1.4 * reach, 0.6 * reach), degrees)
    opacity = cv2.GaussianBlur(mask, (0, 0), 2.0)
    shade = 0.75 + 0.35 * cv2.GaussianBlur(mask, (0, 0), 8.0)
    opacity, shade = (
        np.asarray(cv2.resize(part, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.float32)
        for part in (opacity, shade)
    )
    return opacity, shade


def _ellipse(mask: Mask, middle: Array, axes: tuple[float, float], angle: float) -> None:
    cv2.ellipse(mask, (tuple(middle.tolist()), (2 * axes[0], 2 * axes[1]), angle), 1.0, -1)


def add_lamp(image: Image, lamp: tuple[float, float]) -> Image:
    """Return the image with a lamp shining into the lens: the exposure drops and glare is added."""
    height, width = image.shape[:2]
    x = np.arange(width, dtype=np.float32) - lamp[0] * width
    y = np.arange(height, dtype=np.float32) - lamp[1] * height
    spot = 700.0 * np.outer(np.exp(-(y**2) / (2 * 55.0**2)), np.exp(-(x**2) / (2 * 55.0**2)))
    veil = 60.0 * np.outer(np.exp(-(y**2) / (2 * 220.0**2)), np.exp(-(x**2) / (2 * 220.0**2)))
    glare = spot + veil
    if image.ndim == 3:
        glare = glare[..., None]
    return np.clip(0.6 * image + glare, 0, 255).astype(np.uint8)


def photograph(
    scene: BrickScene, pose: ArrayLike, conditions: ViewConditions, noise: NDArray[np.float32]
) -> Image:
    """Return the picture that the camera in the tip takes.

    Parameters
    ----------
    scene : BrickScene
        What there is to see.
    pose : array (7,)
        True pose of the tip: position [m] and scalar-last quaternion.
    conditions : ViewConditions
        What disturbs the view.
    noise : array of the image's shape, float32
        Standard normal numbers for the sensor noise.

    Returns
    -------
    array (height, width) or (height, width, 3), uint8
    """
    sensor = Photometry()
    image = disturb(scene.image(tip_camera(pose)), conditions)
    if conditions.lamp is not None:
        image = add_lamp(image, conditions.lamp)
    return expose(image, replace(sensor, gain=sensor.gain * conditions.light), noise)


RESTING_HANDS = ((0.15, 0.25, 0.6), (0.8, 0.3, 2.6), (0.25, 0.85, -0.7), (0.85, 0.8, 3.8), (0.5, 0.95, -1.6))
"""Where the hand rests in the obstacle test, 5 s each; as :attr:`ViewConditions.hand`."""

Timeline = Callable[[float], ViewConditions]
"""Conditions as a function of time [s]."""


def undisturbed(time: float) -> ViewConditions:
    """Return ordinary conditions at any time."""
    return ViewConditions()


def moving_obstacles(time: float) -> ViewConditions:
    """Return the conditions of the obstacle test at a time [s] (Wang et al., Sec. IV-C1, Fig. 6).

    0-100 s nothing; then a hand sweeps across the view (phase 3), rests in it (2), sweeps again (3), and from
    170 s lies on the lens for 2 s at a time (4). The paper prints 100 s and "about 2 s"; the rest is chosen.
    """
    if time < 100:
        return ViewConditions(phase=1)
    if time >= 170:
        covered = (time - 170) % 7.5 >= 5.5
        return ViewConditions(covered=covered, phase=4 if covered else 1)
    if 125 <= time < 150:
        return ViewConditions(hand=RESTING_HANDS[int(time - 125) // 5], phase=2)
    sweep = 2 * np.pi * 0.23 * (time - 100)
    palm = 0.5 + 0.75 * np.sin(sweep), 0.55 + 0.4 * np.sin(0.71 * sweep + 1.0)
    return ViewConditions(hand=(*palm, 0.8 * np.sin(0.37 * sweep) - 1.2), phase=3)


def varying_light(time: float) -> ViewConditions:
    """Return the conditions of the light test at a time [s] (Wang et al., Sec. IV-C2, Fig. 7).

    0-75 s ordinary (phase 1); 75-150 s weak light (2) that fades or drops, twice to darkness for 2 s; from
    150 s a lamp moves before the lens (3). The paper prints 75, 150 and 200 s; the length of the darkness is
    chosen equal to that of the covers in the obstacle test.
    """
    if time < 75:
        return ViewConditions(phase=1)
    if time < 150:
        knots = (75, 95, 105, 105.01, 107, 107.01, 115, 130, 132, 132.5, 134.5, 136, 149, 150)
        light = (1.0, 0.25, 0.12, 0.0, 0.0, 0.3, 0.5, 0.15, 0.1, 0.0, 0.0, 0.12, 0.3, 1.0)
        return ViewConditions(light=float(np.interp(time, knots, light)), phase=2)
    swing = 2 * np.pi * 0.11 * (time - 150)
    return ViewConditions(lamp=(0.5 + 0.45 * np.sin(swing), 0.5 + 0.4 * np.sin(1.37 * swing)), phase=3)
