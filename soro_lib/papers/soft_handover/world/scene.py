"""What the two cameras behind the arm see: arm, marker ring, gripper, ball, hand and room (Vervloet, Section
3.2 and Fig. 4).

The arm is drawn from its true state, so it hides what it would hide. Everything is rendered in the frame
`arm_base` [m], z down; the cameras stand at +y, beside each other, at about the height of the gripper. The
thesis prints the distance of the cameras (about 0.5 m) and the size of the markers (20 mm); all else is
chosen.

    scene = HandoverScene()
    image = photograph(scene.items(state, ball), STEREO[0], WEBCAM, rng)
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.arcs import backbone, chain_transform
from soro_lib.robots.helix import HelixArm
from soro_lib.sensing.camera import Camera, Image, look_at, transform_points
from soro_lib.sensing.marker_ring import MarkerRing
from soro_lib.worlds.rendering import Drawable, Photometry, Polygon, TexturedQuad, motion_kernel, render
from soro_lib.worlds.round_bodies import Ball, Color, Tube

BRIO = Camera(
    1280, 720, focal_length=907.0, principal_point=(643.5, 356.5), distortion=(0.06, -0.10, 0.0, 0.0)
)
"""The cameras: a diagonal field of view of 78 degrees, the middle one of the Logitech Brio's three."""

UP = (0.0, 0.0, -1.0)
TPU, TPU_DARK = (205, 205, 208), (150, 150, 156)
PLASTIC: Color = (62, 58, 56)
SKIN: Color = (120, 150, 200)
SLEEVE: Color = (120, 70, 60)
BALL: Color = (60, 175, 50)
DULL_GREEN: Color = (88, 118, 92)


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A camera and where it stands.

    Attributes
    ----------
    camera : Camera
        Intrinsic parameters.
    pose : ndarray, shape (4, 4)
        ``camera_in_world``, frame `arm_base`.
    """

    camera: Camera
    pose: NDArray[np.float64]

    @classmethod
    def aimed(cls, position: ArrayLike, target: ArrayLike, camera: Camera = BRIO) -> "Viewpoint":
        """Return an upright camera at ``position`` aimed at ``target``, both (3,) [m] in `arm_base`."""
        return cls(camera, look_at(position, target, UP))


def stereo_pair(
    baseline: float = 0.5, distance: float = 0.75, toe_in: float = 0.5, camera: Camera = BRIO
) -> tuple[Viewpoint, Viewpoint]:
    """Return the left and the right camera, as seen from behind them.

    Parameters
    ----------
    baseline : float
        Distance of the cameras from each other [m]; the thesis prints about 0.5.
    distance : float
        From the hanging arm, along y [m].
    toe_in : float
        0 for parallel cameras, 1 for cameras aimed at the hanging arm.
    camera : Camera
    """
    height = 0.62
    return tuple(  # type: ignore[return-value]
        Viewpoint.aimed((x, distance, height), ((1 - toe_in) * x, 0.0, height), camera)
        for x in (-baseline / 2, baseline / 2)
    )


STEREO = stereo_pair()
"""The cameras of the replication, half toed in, so that both see where the thesis's four locations are."""

SIDE_CAMERA = Viewpoint.aimed((0.80, -0.05, 0.62), (0.0, -0.05, 0.62))
"""A third camera, which looks at the arm from the right."""


@dataclass(frozen=True)
class Extras:
    """What else is in the picture, or is not.

    Attributes
    ----------
    hand : bool
        Whether a hand holds the ball.
    hidden_markers : frozenset of int
        Ids of markers that a cloth covers.
    second_ball : (float, float, float), optional
        Centre of another green ball [m].
    grip : float
        0 for an open gripper, 1 for a closed one.
    """

    hand: bool = True
    hidden_markers: frozenset[int] = frozenset()
    second_ball: tuple[float, float, float] | None = None
    grip: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.grip <= 1:
            raise ValueError(f"Extras.grip must be in [0, 1], got {self.grip}")


@dataclass(frozen=True)
class HandoverScene:
    """The arm with its ring and gripper, and the ball in a hand.

    Attributes
    ----------
    arm : HelixArm
    ring : MarkerRing
    ball_radius : float
        Radius of the green ball [m].
    """

    arm: HelixArm = field(default_factory=HelixArm)
    ring: MarkerRing = field(default_factory=MarkerRing)
    ball_radius: float = 0.020

    def items(self, state: ArrayLike, ball: ArrayLike, extras: Extras | None = None) -> list[Drawable]:
        """Return everything to draw for a true state q (9,) and a true ball (3,) [m].

        Raises
        ------
        ValueError
            If the ball is not three finite numbers, or the state not nine.
        """
        extras = extras or Extras()
        ball = np.asarray(ball, dtype=float)
        if ball.shape != (3,) or not np.isfinite(ball).all():
            raise ValueError(f"ball must be three finite numbers [m], got {ball}")
        wrist = self.wrist(state)
        items: list[Drawable] = [*self._arm(np.asarray(state, dtype=float)), *self._ring(wrist, extras)]
        items += self._gripper(wrist, extras.grip)
        items.append(self.ball(ball))
        if extras.hand:
            items += self._hand(ball)
        if extras.second_ball is not None:
            items.append(self.ball(np.array(extras.second_ball)))
        return items

    def wrist(self, state: ArrayLike) -> NDArray[np.float64]:
        """Return ``wrist_in_world`` (4, 4) for a true state q (9,), which no actuator limits."""
        q = np.asarray(state, dtype=float)
        if q.shape != (9,):
            raise ValueError(f"state must be nine numbers, got shape {q.shape}")
        return chain_transform(q.reshape(3, 3))

    def _arm(self, state: NDArray[np.float64]) -> list[Drawable]:
        """Return two tubes per segment, their slices alternating like the helicoid's."""
        slices = 8
        points = backbone(state.reshape(3, 3), 2 * slices)
        radius = np.linspace(1.05, 0.85, len(points)) * self.arm.tendon_radius
        return [
            Tube(points[i : i + slices + 1], radius[i : i + slices + 1], (TPU, TPU_DARK))
            for i in range(0, len(points) - 1, slices)
        ]

    def _ring(self, wrist: NDArray[np.float64], extras: Extras) -> list[Drawable]:
        facets: list[Drawable] = []
        for number, corners in enumerate(self.ring.facets):
            covered = number in extras.hidden_markers
            picture = CLOTH if covered else self.ring.prints[number]
            facets.append(TexturedQuad(transform_points(wrist, corners), picture, supersampling=3))
        return facets

    def _gripper(self, wrist: NDArray[np.float64], grip: float) -> list[Drawable]:
        """Return the palm and three fingers, whose tips close toward the gripper point."""
        below = self.ring.height / 2
        length = self.arm.gripper_length
        palm = np.array([(0, 0, below), (0, 0, 0.42 * length)])
        parts: list[Drawable] = [Tube(transform_points(wrist, palm), 0.024, (PLASTIC,))]
        along = np.array([0.38, 0.6, 0.82, 1.05]) * length
        outward = np.array([0.022, 0.040, 0.042, 0.034]) * (1 - 0.42 * grip * np.array([0, 0.6, 1, 1]))
        for angle in 2 * np.pi * np.arange(3) / 3:
            finger = np.column_stack([outward * np.cos(angle), outward * np.sin(angle), along])
            parts.append(Tube(transform_points(wrist, finger), 0.007, (PLASTIC,)))
        return parts

    def ball(self, centre: NDArray[np.float64]) -> Ball:
        """Return the green ball with its middle at a point (3,) [m]."""
        return Ball(centre, self.ball_radius, BALL, to_light=(0.3, 0.5, -1.0), ambient=0.55, supersampling=2)

    def _hand(self, ball: NDArray[np.float64]) -> list[Drawable]:
        """Return a palm under the ball, fingers and a forearm that comes from outside and below."""
        away = np.append(ball[:2], 0.0)
        norm = np.linalg.norm(away)
        away = away / norm if norm > 1e-6 else np.array([1.0, 0.0, 0.0])
        sideways = np.cross(away, UP)
        down = -np.array(UP)
        palm = ball + (self.ball_radius + 0.014) * down
        wrist = palm + 0.075 * away + 0.012 * down
        parts: list[Drawable] = [
            Tube(
                np.array([palm - 0.03 * away, palm, palm + 0.045 * away, wrist]),
                np.array([0.011, 0.013, 0.014, 0.022]),
                (SKIN,),
            ),
            Tube(np.array([wrist, wrist + 0.10 * away + 0.03 * down]), np.array([0.024, 0.03]), (SKIN,)),
        ]
        elbow, shoulder = wrist + 0.08 * away + 0.025 * down, wrist + 0.28 * away + 0.55 * down
        sleeve = np.linspace(elbow, shoulder, 7)
        parts += [Tube(sleeve[i : i + 2], np.array([0.036, 0.038]), (SLEEVE,)) for i in range(6)]
        for place in (-0.030, -0.012, 0.012, 0.030):
            root = palm + place * sideways
            finger = [root + 0.02 * away, root - 0.02 * away, root - 0.045 * away - 0.006 * down]
            parts.append(Tube(np.array(finger), 0.008, (SKIN,)))
        return parts


CLOTH = np.full((2, 2, 3), (70, 60, 75), dtype=np.uint8)
"""What covers a hidden marker."""


@lru_cache(maxsize=16)
def _room(camera: Camera, pose: bytes) -> Image:
    """Return the empty room as a camera sees it: walls, a poster, a plant of dull green, a bench."""

    def wall(corners: ArrayLike, color: Color, layer: int) -> Polygon:
        return Polygon(np.array(corners, dtype=float), color, layer)

    items: list[Drawable] = [
        wall([(-4, -2, -2), (4, -2, -2), (4, -2, 1.3), (-4, -2, 1.3)], (188, 196, 200), -9),
        wall([(-4, -2, 1.3), (4, -2, 1.3), (4, 3, 1.3), (-4, 3, 1.3)], (110, 122, 135), -8),
        wall([(-4, 3, -2), (-4, -2, -2), (-4, -2, 1.3), (-4, 3, 1.3)], (170, 178, 184), -8),
        wall(
            [(-1.1, -1.99, 0.05), (-0.3, -1.99, 0.05), (-0.3, -1.99, 0.6), (-1.1, -1.99, 0.6)],
            (150, 105, 70),
            -7,
        ),
        wall([(0.5, -1.9, 0.15), (1.5, -1.9, 0.15), (1.5, -1.9, 1.3), (0.5, -1.9, 1.3)], (96, 108, 128), -7),
        wall(
            [(0.55, -1.89, 0.25), (1.45, -1.89, 0.25), (1.45, -1.89, 0.5), (0.55, -1.89, 0.5)],
            (60, 62, 70),
            -6,
        ),
        wall(
            [(-1.9, -1.4, 0.85), (1.0, -1.4, 0.85), (1.0, -0.9, 0.95), (-1.9, -0.9, 0.95)],
            (135, 160, 182),
            -5,
        ),
    ]
    for x, z in ((-0.75, 0.62), (-0.62, 0.72), (-0.84, 0.76)):
        items.append(Ball(np.array([x, -1.2, z]), 0.11, DULL_GREEN, UP, 0.4, layer=-4))
    image = render(camera, np.frombuffer(pose).reshape(4, 4), items, background=(160, 165, 170))
    image = np.asarray(cv2.GaussianBlur(image, (0, 0), 2.5), dtype=np.uint8)
    image.setflags(write=False)
    return image


@lru_cache(maxsize=8)
def _sensor_noise(deviation: float, height: int, width: int) -> tuple[Image, Image]:
    """Return what a sensor adds and takes away: positive and negative part of a picture of normal noise.

    It is larger than the image by `NOISE_MARGIN`, to be shifted at random: millions of fresh normal numbers
    a frame would take longer than everything else.
    """
    rng = np.random.default_rng(20250430)
    shape = (height + NOISE_MARGIN, width + NOISE_MARGIN, 3)
    noise = np.round(deviation * rng.standard_normal(shape, dtype=np.float32))
    return tuple(np.clip(sign * noise, 0, 255).astype(np.uint8) for sign in (1, -1))


NOISE_MARGIN = 160
"""Range of the shifts of the noise picture along each axis [px]."""


def photograph(
    items: Sequence[Drawable], view: Viewpoint, photometry: Photometry, rng: np.random.Generator
) -> Image:
    """Return the picture (height, width, 3), blue, green, red, that a camera takes of things in the room.

    Parameters
    ----------
    items : sequence of Drawable
        Of :meth:`HandoverScene.items`.
    view : Viewpoint
        The camera.
    photometry : Photometry
        Gain, blur, motion and read noise. The noise here does not depend on the signal (shot_noise is not
        used), which saves most of the time of :func:`soro_lib.worlds.rendering.expose`.
    rng : numpy.random.Generator
        Source of the noise.
    """
    image = render(view.camera, view.pose, items, _room(view.camera, view.pose.tobytes()))
    if photometry.blur > 0:
        image = cv2.GaussianBlur(image, (0, 0) if photometry.blur > 0.8 else (3, 3), photometry.blur)  # type: ignore[assignment]
    if max(map(abs, photometry.motion)) >= 1:
        image = cv2.filter2D(image, -1, motion_kernel(*photometry.motion))  # type: ignore[assignment]
    if photometry.gain != 1:
        image = cv2.convertScaleAbs(image, alpha=photometry.gain)  # type: ignore[assignment]
    if photometry.read_noise > 0:
        height, width = image.shape[:2]
        row, column = rng.integers(NOISE_MARGIN, size=2)
        window = slice(row, row + height), slice(column, column + width)
        more, less = _sensor_noise(photometry.read_noise, height, width)
        cv2.subtract(cv2.add(image, more[window], image), less[window], image)
    return np.asarray(image, dtype=np.uint8)


WEBCAM = Photometry(read_noise=3.0, shot_noise=0.0, blur=0.6)
"""An ordinary exposure."""
