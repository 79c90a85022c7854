"""Observers, which turn the true state of the arm and the true ball into one observation per step.

:class:`NoisyObserver` draws its errors from a declared noise budget (``vision_noise.toml``, measured on
rendered images); :class:`RenderedObserver` renders images of a simulated room and lets
:class:`soro_lib.sensing.handover_vision.HandoverVision` look at them. Frame `arm_base` throughout, z down.
"""

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.random import Generator

from soro_lib.checks import not_negative, positive
from soro_lib.papers.soft_handover.world.plant import Array
from soro_lib.papers.soft_handover.world.scene import STEREO, WEBCAM, Extras, HandoverScene, photographs
from soro_lib.poses import magnitude
from soro_lib.project import data_directory
from soro_lib.robots.helix import HelixArm
from soro_lib.robots.helix_kernels import tip_points
from soro_lib.sensing.camera import Image
from soro_lib.sensing.handover_observation import HandoverObservation
from soro_lib.sensing.handover_vision import HandoverVision, Look
from soro_lib.sensing.stereo_vision import CalibratedCamera, box_corners, calibrate


class Observer(Protocol):
    """What the handover loop sees through."""

    def observe(self, state: Array, ball: Array, rng: Generator) -> HandoverObservation:
        """Return what is seen of the true state q (9,) and the true ball (3,) [m]."""

    def reset(self) -> None:
        """Forget earlier looks."""


@dataclass(frozen=True)
class VisionNoise:
    """Error budget of a camera system: what stays while the arm stands still, and what changes from look to
    look.

    Attributes
    ----------
    wrist_jitter, direction_jitter, ball_jitter : float
        Standard deviation per component from look to look [m, -, m].
    wrist_bias, direction_bias, ball_bias : float
        Standard deviation per component of the error that depends on the pose [m, -, m].
    bias_length : float
        Movement of the wrist after which the pose-dependent error has become another one [m].
    occluded_ball : float
        Standard deviation of the ball when the gripper covers it in part [m].
    occlusion_distance : float
        Distance from gripper to ball below which it does [m].
    """

    wrist_jitter: float
    wrist_bias: float
    direction_jitter: float
    direction_bias: float
    ball_jitter: float
    ball_bias: float
    bias_length: float = 0.03
    occluded_ball: float = 0.0
    occlusion_distance: float = 0.03

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            not_negative(name, value)
        positive("bias_length", self.bias_length)


NO_NOISE = VisionNoise(0, 0, 0, 0, 0, 0)
"""Perfect sight."""


def load_vision_noise(estimator: str, path: Path | None = None) -> VisionNoise:
    """Return the declared noise budget of a pose estimator: "thesis", "gated", "joint" or "three cameras".

    Raises
    ------
    KeyError
        If the file has no such estimator; the message lists those it has.
    """
    file = path or data_directory("soft_handover") / "vision_noise.toml"
    budgets = tomllib.loads(file.read_text())["estimator"]
    if estimator not in budgets:
        raise KeyError(f"no noise budget for {estimator!r} in {file.name}; it has {sorted(budgets)}")
    return VisionNoise(**budgets[estimator]["noise"])


@dataclass
class NoisyObserver:
    """Sees the truth with the errors of a noise budget.

    Parameters
    ----------
    noise : VisionNoise
    arm : HelixArm
    """

    noise: VisionNoise
    arm: HelixArm = field(default_factory=HelixArm)

    def __post_init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Draw new pose-dependent errors at the next look."""
        self._bias: Array | None = None
        self._wrist = np.zeros(3)

    def observe(self, state: Array, ball: Array, rng: Generator) -> HandoverObservation:
        """Return what is seen of the true state q (9,) and the true ball (3,) [m]."""
        points = tip_points(state, self.arm.gripper_length)
        wrist = points[:3]
        direction = (points[3:] - wrist) / self.arm.gripper_length
        noise = self.noise
        bias = self._pose_dependent_error(wrist, rng)
        jitter = rng.standard_normal((3, 3))
        covered = magnitude(points[3:] - ball) < noise.occlusion_distance
        ball_deviation = np.hypot(noise.ball_jitter, noise.occluded_ball if covered else 0.0)
        seen_direction = direction + noise.direction_jitter * jitter[1] + noise.direction_bias * bias[1]
        return HandoverObservation(
            wrist=wrist + noise.wrist_jitter * jitter[0] + noise.wrist_bias * bias[0],
            direction=seen_direction / magnitude(seen_direction),
            ball=ball + ball_deviation * jitter[2] + noise.ball_bias * bias[2],
            wrist_deviation=float(np.hypot(noise.wrist_jitter, noise.wrist_bias)),
            direction_deviation=float(np.hypot(noise.direction_jitter, noise.direction_bias)),
            ball_deviation=float(np.hypot(ball_deviation, noise.ball_bias)),
        )

    def _pose_dependent_error(self, wrist: Array, rng: Generator) -> Array:
        """Return unit normal errors (3, 3) of wrist, direction and ball that change as the wrist moves.

        The ball's own does not change: it hangs on the calibration and on where the ball is.
        """
        fresh = rng.standard_normal((3, 3))
        if self._bias is None:
            self._bias = fresh
        else:
            memory = np.exp(-magnitude(wrist - self._wrist) / self.noise.bias_length)
            self._bias[:2] = memory * self._bias[:2] + np.sqrt(1 - memory**2) * fresh[:2]
        self._wrist = wrist
        return self._bias


Spoil = Callable[[int, list[Image]], Sequence[Image | None]]
"""What a fault makes of the images, given the number of the look."""


@dataclass
class RenderedObserver:
    """Sees the truth through rendered images.

    Parameters
    ----------
    vision : HandoverVision
        Whose cameras are where they are believed to be, up to calibration.
    views : sequence of CalibratedCamera
        Where the cameras truly are.
    scene : HandoverScene
    extras : Extras
        What else is in the pictures.
    spoil : callable, optional
        A fault of the cameras.

    Attributes
    ----------
    images : list of images
        The last pictures.
    look : Look or None
        What was made of them.
    """

    vision: HandoverVision
    views: Sequence[CalibratedCamera] = STEREO
    scene: HandoverScene = field(default_factory=HandoverScene)
    extras: Extras = field(default_factory=Extras)
    spoil: Spoil | None = None

    def __post_init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget earlier looks."""
        self.vision.reset()
        self.images: list[Image] = []
        self.look: Look | None = None
        self._number = -1

    def observe(self, state: Array, ball: Array, rng: Generator) -> HandoverObservation:
        """Return what is seen of the true state q (9,) and the true ball (3,) [m]."""
        self._number += 1
        items = self.scene.items(state, ball, self.extras)
        self.images = photographs(items, self.views, WEBCAM, rng)
        shown = self.images if self.spoil is None else self.spoil(self._number, self.images)
        self.look = self.vision.look(shown)
        return self.look.observation


def calibrate_on_box(
    views: Sequence[CalibratedCamera], rng: Generator, selection_deviation: float = 0.5
) -> list[CalibratedCamera]:
    """Return the cameras as a calibration on the box finds them, its corners selected by hand.

    Parameters
    ----------
    views : sequence of CalibratedCamera
        The true cameras.
    rng : numpy.random.Generator
    selection_deviation : float
        Standard deviation of a selected corner per axis [px].
    """
    corners = box_corners()
    cameras = []
    for view in views:
        truth = view.project(corners)
        selected = truth + selection_deviation * rng.standard_normal(truth.shape)
        cameras.append(calibrate(view.camera, corners, selected))
    return cameras
