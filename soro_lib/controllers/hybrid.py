"""Hybrid control of a pneumatic arm: constant-curvature model plus compensator (Wang et al., Sec. III).

The model-based half turns a wanted tip motion into chamber lengths (Eqs. (23)-(27)); the other half predicts
from the last samples how much of a motion will be missing and asks for more (Eqs. (28), (29)). Controllers
broadcast over leading axes, so a batch of seeds and gains runs as one.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import check_fields, finite, one_of
from soro_lib.estimators.gaussian_process import RollingGaussianProcess
from soro_lib.robots.base import Robot

Array = NDArray[np.float64]

MILLIMETRE = 1e-3
COMPENSATIONS = ("none", "quadratic", "literal", "relative", "additive")


def right_inverse(jacobian: ArrayLike, damping: float = 1e-5) -> Array:
    """Generalised inverse of a wide Jacobian of full rank (Wang et al., Eq. (24)).

    Parameters
    ----------
    jacobian : array_like (..., 2, n)
        Tip velocity per chamber velocity [-].
    damping : float
        Added in squares, so that the inverse stays below ``1 / (2 damping)`` where the rank is lost [-].

    Returns
    -------
    ndarray (..., n, 2)
        ``J' (J J' + damping^2 I)^-1``; equal to the Moore-Penrose inverse within 1e-8 away from that.
    """
    jacobian = np.asarray(jacobian, dtype=float)
    transpose = np.swapaxes(jacobian, -1, -2)
    (a, b), (_, d) = np.moveaxis(jacobian @ transpose + damping**2 * np.eye(2), (-2, -1), (0, 1))
    adjugate = np.stack([np.stack([d, -b], axis=-1), np.stack([-b, a], axis=-1)], axis=-2)
    return np.asarray(transpose @ adjugate / (a * d - b * b)[..., None, None], dtype=np.float64)


def length_increment(
    jacobian: ArrayLike, displacement: ArrayLike, null_gain: float, offset_from_home: ArrayLike
) -> Array:
    """Chamber increments for a wanted tip displacement (Wang et al., Eq. (25); Erratum VS-10).

    Parameters
    ----------
    jacobian : array_like (..., 2, 3)
        Tip velocity in x and y per chamber velocity [-].
    displacement : array_like (..., 2)
        Wanted displacement of the tip [m].
    null_gain : float
        Gain beta that pulls the redundant elongation home [-].
    offset_from_home : array_like (..., 3)
        Preferred minus present chamber lengths [m].

    Returns
    -------
    ndarray (..., 3)
        Increments before the gain K_p of Eq. (26) [m].
    """
    inverse = right_inverse(jacobian)
    increment = (inverse @ np.asarray(displacement, dtype=float)[..., None])[..., 0]
    if null_gain == 0.0:
        return increment
    pull = null_gain * np.asarray(offset_from_home, dtype=float)
    moved = (np.asarray(jacobian, dtype=float) @ pull[..., None])[..., None, :, 0]
    return increment + pull - (inverse @ np.swapaxes(moved, -1, -2))[..., 0]


def limit_step(displacement: ArrayLike, maximum_step: float) -> Array:
    """Shorten displacements ``(..., 2)`` to a maximum length [m], keeping their direction."""
    displacement = np.asarray(displacement, dtype=float)
    length = np.sqrt(np.sum(displacement**2, axis=-1, keepdims=True))
    return displacement * np.minimum(1.0, maximum_step / np.maximum(length, 1e-15))


def motion_error(desired: ArrayLike, actual: ArrayLike) -> Array:
    """What is missing of a motion, desired minus actual (Wang et al., Eq. (28)) [m]."""
    return np.asarray(desired, dtype=float) - np.asarray(actual, dtype=float)


def compensate(desired: ArrayLike, predicted_error: ArrayLike, compensation: str) -> Array:
    """Enlarge a desired displacement by its predicted error, in one of the readings of Wang et al., Eq. (29).

    Parameters
    ----------
    desired : array_like (..., 2)
        Desired displacement [m].
    predicted_error : array_like (..., 2)
        Predicted error: [m] for "literal" and "additive", [-] for "relative"; not used by the others.
    compensation : str
        "none" keeps the desired displacement.
        "quadratic" needs no learning: the error is taken to be the displacement itself.
        "literal" multiplies error and length, both in millimetres, as printed (Erratum VS-11).
        "relative" multiplies a relative error with the length, which has consistent units.
        "additive" adds the error.

    Returns
    -------
    ndarray (..., 2)
        Compensated displacement [m].
    """
    desired = np.asarray(desired, dtype=float)
    length = np.sqrt(np.sum(desired**2, axis=-1, keepdims=True))
    match compensation:
        case "none":
            return desired
        case "quadratic":
            return desired + desired * length / MILLIMETRE
        case "literal":
            return desired + np.asarray(predicted_error) * length / MILLIMETRE
        case "relative":
            return desired + np.asarray(predicted_error) * length
        case "additive":
            return desired + np.asarray(predicted_error)
    raise ValueError(f"compensation must be one of {COMPENSATIONS}, got {compensation!r}")


@dataclass(frozen=True)
class HybridSettings:
    """Settings of the hybrid controller; SI units.

    Attributes
    ----------
    proportional_gain : float or ndarray
        K_p of Eq. (26), or one per member of a batch [-].
    maximum_step : float
        Cap on the desired displacement per step [m]; infinity for none. The paper calls 3 mm its step size.
    null_gain : float
        beta of Eq. (25) [-]; with K_p it must keep ``K_p beta < 2``.
    compensation : str
        Reading of Eq. (29), see `compensate`.
    trained_on : str
        "desired" or "actual": the motion in the input of the training samples (Erratum VS-12).
    window, warm_up : int
        Largest number of samples N_r, and the number N_c from which the compensator acts.
    length_scale_actuation, length_scale_motion : float
        Length scales of the kernel over motor positions and over motions [m].
    noise : float
        Noise of the samples relative to their spread [-].
    """

    proportional_gain: Any = 0.1
    maximum_step: float = 3e-3
    null_gain: float = 0.0
    compensation: str = "literal"
    trained_on: str = "desired"
    window: int = 100
    warm_up: int = 50
    length_scale_actuation: float = 2e-3
    length_scale_motion: float = 2e-3
    noise: float = 0.3

    def __post_init__(self) -> None:
        """Check the values; the error names the field and its bound."""
        gain = finite("proportional_gain", self.proportional_gain, above=0, at_most=2)
        check_fields(self, "maximum_step", above=0, at_most=np.inf)
        if not (self.null_gain >= 0.0 and (gain * self.null_gain < 2.0).all()):
            raise ValueError(f"null_gain must satisfy 0 <= K_p beta < 2, got {self.null_gain}")
        one_of("compensation", self.compensation, COMPENSATIONS)
        one_of("trained_on", self.trained_on, ("desired", "actual"))
        check_fields(self, "warm_up", at_least=1, at_most=self.window)

    @property
    def learns(self) -> bool:
        """Whether the compensation needs the Gaussian process."""
        return self.compensation in ("literal", "relative", "additive")


@dataclass(frozen=True)
class HybridResult:
    """What the controller decided in one step.

    Attributes
    ----------
    actuation : ndarray (..., n)
        Chamber lengths to command [m].
    desired : ndarray (..., 2)
        Desired displacement after the cap [m].
    compensated : ndarray (..., 2)
        Displacement after Eq. (29) [m].
    saturated : ndarray (...) of bool
        Whether a chamber length was cut off at the limits of the arm.
    """

    actuation: Array
    desired: Array
    compensated: Array
    saturated: NDArray[np.bool_]


class HybridController:
    """Tracks a point with the tip of a pneumatic arm, from the measured tip position.

    Parameters
    ----------
    robot : Robot
        Kinematic model and limits. The paper's has three chambers; any arm with two actuators or more will
        do whose actuators are of one kind, since Eq. (24) adds their squares.
    settings : HybridSettings
        Gains, cap and compensator.
    batch : tuple of int
        Leading shape of the batch.

    Examples
    --------
    >>> from soro_lib.robots import PneumaticArm
    >>> arm = PneumaticArm()
    >>> controller = HybridController(arm)
    >>> lengths = arm.home
    >>> for _ in range(200):
    ...     tip = arm.tip(lengths)[:2]
    ...     lengths = controller.update(tip, [0.01, 0.02], lengths).actuation
    >>> arm.tip(lengths)[:2].round(4)
    array([0.01, 0.02])
    """

    def __init__(
        self, robot: Robot, settings: HybridSettings | None = None, batch: tuple[int, ...] = ()
    ) -> None:
        self.robot = robot
        self.settings = settings or HybridSettings()
        scales = [self.settings.length_scale_actuation] * len(robot.lower) + [
            self.settings.length_scale_motion
        ] * 2
        self._process = RollingGaussianProcess(
            self.settings.window, scales, outputs=2, noise=self.settings.noise, batch=batch
        )
        self._before: tuple[Array, Array, Array] | None = None

    @property
    def samples(self) -> int:
        """Number of samples that the compensator holds."""
        return self._process.size

    def update(
        self, end_effector: ArrayLike, goal: ArrayLike, lengths: ArrayLike, compensating: bool = True
    ) -> HybridResult:
        """Decide one step.

        Parameters
        ----------
        end_effector, goal : array_like (..., 2)
            Measured and wanted tip position, x and y in the base frame [m].
        lengths : array_like (..., n)
            Chamber lengths that the steppers stand at [m].
        compensating : bool
            False runs the model-based law alone, while the compensator goes on learning.

        Returns
        -------
        HybridResult

        Raises
        ------
        ValueError
            If an input is not finite or out of the arm's limits; nothing has been learned then.
        """
        position = finite("end_effector", end_effector, (..., 2))
        goal = finite("goal", goal, (..., 2))
        lengths = np.asarray(lengths, dtype=float)
        jacobian = self.robot.jacobian(lengths)[..., :2, :]
        if self.settings.learns:
            self._learn(position)
        desired = limit_step(goal - position, self.settings.maximum_step)
        compensated = self._compensate(desired, lengths) if compensating else desired
        increment = length_increment(
            jacobian, compensated, self.settings.null_gain, self.robot.home - lengths
        )
        gain = np.asarray(self.settings.proportional_gain, dtype=float)[..., None]
        wanted = lengths + gain * increment
        actuation = np.clip(wanted, self.robot.lower, self.robot.upper)
        self._before = (position, lengths, desired)
        return HybridResult(actuation, desired, compensated, (actuation != wanted).any(axis=-1))

    def _learn(self, position: Array) -> None:
        """Add the sample of the last step: motor positions and motion in, missing motion out (Eq. (28))."""
        if self._before is None:
            return
        position_before, lengths, desired = self._before
        actual = position - position_before
        error = motion_error(desired, actual)
        if self.settings.compensation == "relative":
            error = error / np.maximum(np.sqrt(np.sum(desired**2, axis=-1, keepdims=True)), 1e-6)
        motion = desired if self.settings.trained_on == "desired" else actual
        self._process.add(np.concatenate([lengths - self.robot.home, motion], axis=-1), error)

    def _compensate(self, desired: Array, lengths: Array) -> Array:
        if not self.settings.learns:
            return compensate(desired, desired, self.settings.compensation)
        if self._process.count < self.settings.warm_up:
            return desired
        error = self._process.predict(np.concatenate([lengths - self.robot.home, desired], axis=-1))
        return compensate(desired, error, self.settings.compensation)
