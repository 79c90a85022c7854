"""What the cameras tell the handover controller, and an observer that makes it from the truth and a noise
budget.

An observer turns the true state of the arm and the true ball into one observation per step. The one here
draws its errors from a declared noise budget (``data/soft_handover/vision_noise.toml``, measured on rendered
images); the one that renders and detects images offers the same two methods. Frame `arm_base` throughout, z
down.
"""

import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from soro_lib.poses import magnitude
from soro_lib.project import data_directory
from soro_lib.robots.helix import HelixArm
from soro_lib.robots.helix_kernels import tip_points


@dataclass(frozen=True)
class HandoverObservation:
    """One look of the cameras at arm and ball.

    Attributes
    ----------
    wrist : ndarray, shape (3,), or None
        Middle of the marker ring [m]; None when no marker was found.
    direction : ndarray, shape (3,), or None
        Unit vector from wrist to gripper.
    ball : ndarray, shape (3,), or None
        Centre of the ball [m]; None when it was not found.
    wrist_deviation, direction_deviation, ball_deviation : float
        Standard deviation per component that the detection itself claims [m, -, m].
    disagreement : float
        Distance between the two cameras' rays to the ball [m].
    status : str
        "", or what went wrong.

    Raises
    ------
    ValueError
        If wrist, direction or ball does not have three components.
    """

    wrist: NDArray[np.float64] | None
    direction: NDArray[np.float64] | None
    ball: NDArray[np.float64] | None
    wrist_deviation: float = 0.007
    direction_deviation: float = 0.05
    ball_deviation: float = 0.002
    disagreement: float = 0.0
    status: str = ""

    def __post_init__(self) -> None:
        for name in ("wrist", "direction", "ball"):
            vector = getattr(self, name)
            if vector is not None and np.shape(vector) != (3,):
                raise ValueError(f"{name} must have shape (3,) or be None, got shape {np.shape(vector)}")


class Observer(Protocol):
    """What the handover loop sees through."""

    def observe(
        self, state: NDArray[np.float64], ball: NDArray[np.float64], rng: np.random.Generator
    ) -> HandoverObservation:
        """Return what is seen of the true state q (9,) and the true ball (3,) [m]."""
        ...

    def reset(self) -> None:
        """Forget earlier looks."""
        ...


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
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"{name} must be finite and at least 0, got {value}")
        if self.bias_length == 0:
            raise ValueError("bias_length must be positive")

    def scaled(self, factor: float) -> "VisionNoise":
        """Return the same budget with all standard deviations multiplied."""
        lengths = ("bias_length", "occlusion_distance")
        return VisionNoise(**{k: v if k in lengths else factor * v for k, v in vars(self).items()})


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
        self._bias: NDArray[np.float64] | None = None
        self._wrist = np.zeros(3)

    def observe(
        self, state: NDArray[np.float64], ball: NDArray[np.float64], rng: np.random.Generator
    ) -> HandoverObservation:
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

    def _pose_dependent_error(
        self, wrist: NDArray[np.float64], rng: np.random.Generator
    ) -> NDArray[np.float64]:
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
