"""The integrated handover: look, filter, estimate, step, pull, close (Vervloet, Algorithm 3 and Section 3.5).

The gripper comes from above in two stages, first to a point over the ball, then down to it. The thesis runs
with an operator beside the arm; :class:`SafetyRules` says what the arm does by itself when something is
wrong: it holds, and if that does not pass, it goes home. Frame `arm_base`, z down.
"""

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import check_fields
from soro_lib.controllers.virtual_stiffness import VirtualStiffnessController
from soro_lib.estimators.handover_filters import APPENDIX_A, FilterParameters, HandoverFilters
from soro_lib.estimators.shape_estimation import POSE_WEIGHTS, ShapeEstimate, estimate_shape
from soro_lib.poses import magnitude
from soro_lib.robots.helix_kernels import tip_points
from soro_lib.robots.helix_motors import TendonMotors
from soro_lib.sensing.handover_observation import HandoverObservation

UP = np.array([0.0, 0.0, -1.0])
"""Upward in `arm_base`."""


class Mode(StrEnum):
    """What the arm is doing."""

    APPROACH = "approach"
    DESCEND = "descend"
    GRASP = "grasp"
    CARRY = "carry"
    RELEASE = "release"
    HOLD = "hold"
    RETREAT = "retreat"
    STOPPED = "stopped"


@dataclass(frozen=True)
class SafetyRules:
    """When the arm holds and when it goes home.

    Attributes
    ----------
    ball_memory : int
        Steps for which a ball out of sight is still approached.
    frozen_looks : int
        Identical looks at the arm, while it is being moved, after which the cameras count as frozen.
    noticeable_move : float
        Commanded movement of wrist and gripper that must show in the next look [m].
    largest_jump : float
        Farthest that wrist or ball may appear from their last place [m].
    jump_confirmations : int
        Looks in a row at the new place after which a jump is believed.
    reach_margin : float
        How far beyond the longest arm a wrist may appear [m].
    largest_disagreement : float
        Distance between the cameras' rays above which a ball is not believed [m].
    hold_limit : int
        Held steps in a row after which the arm goes home.
    patience : int
        Steps without progress, far from the goal, after which the arm goes home.
    progress : float
        Decrease of the error that counts as progress [m].
    retreat_share : float
        Share of the way home that each retreating step takes.
    """

    ball_memory: int = 5
    frozen_looks: int = 2
    noticeable_move: float = 0.001
    largest_jump: float = 0.15
    jump_confirmations: int = 3
    reach_margin: float = 0.10
    largest_disagreement: float = 0.02
    hold_limit: int = 20
    patience: int = 60
    progress: float = 0.002
    retreat_share: float = 0.1

    def __post_init__(self) -> None:
        check_fields(self, above=0)
        check_fields(self, "retreat_share", at_most=1)


@dataclass(frozen=True)
class HandoverParameters:
    """Everything that can be set about a handover; the defaults are the thesis's, norms read as norms.

    Attributes
    ----------
    control : VirtualStiffnessController
        Algorithm 1, with the step size alpha, and the arm.
    filters : FilterParameters
        The three Kalman filters.
    pose_bound : float
        ``epsilon_pose,bound`` [m].
    pose_bound_share : float
        Share of the filtered pose's standard deviation that the bound grows by (suggested by Section 5.4.3)
        [-].
    pose_weights : tuple of 9 float
        Diagonal of ``A_pose,upd``.
    bend_softening : float
        Decrease of the weight of a bent or compressed segment and of those below it (suggested by
        Section 5.4.3) [1/rad].
    estimate_shape : bool
        Whether the state optimisation runs; without it ``q_est`` is ``q_sys``.
    stop_threshold : float
        ``epsilon_threshold``, for wrist and gripper together [m].
    grasp_offset : float
        ``d_grasp-offset``, height of the first goal over the ball [m].
    safety : SafetyRules
    motors : TendonMotors
    """

    control: VirtualStiffnessController = field(default_factory=VirtualStiffnessController)
    filters: FilterParameters = APPENDIX_A
    pose_bound: float = 0.005
    pose_bound_share: float = 0.0
    pose_weights: tuple[float, ...] = POSE_WEIGHTS
    bend_softening: float = 0.0
    estimate_shape: bool = True
    stop_threshold: float = 0.05
    grasp_offset: float = 0.05
    safety: SafetyRules = field(default_factory=SafetyRules)
    motors: TendonMotors = field(default_factory=TendonMotors)

    def __post_init__(self) -> None:
        check_fields(self, "pose_bound", "stop_threshold", above=0)
        check_fields(self, "pose_bound_share", "bend_softening", "grasp_offset", at_least=0)
        check_fields(self, "pose_weights", shape=(9,), above=0)


@dataclass(frozen=True)
class HandoverCommand:
    """What the arm is told in one step, and why.

    Attributes
    ----------
    tendon_change : ndarray, shape (9,)
        Tendon lengths relative to calibration [m], within the motors' range.
    gripper_closed : bool
    mode : Mode
    reason : str
        "", or why the arm holds, retreats or stops.
    error : float
        ``|X_goal - X_meas|``, wrist and gripper together [m].
    q_sys : ndarray, shape (9,)
        Commanded state.
    q_est : ndarray, shape (9,), or None
        State that the optimisation found for this look (before the step), if it ran.
    measured_points, goal_points : ndarray, shape (6,)
        Filtered wrist and gripper, and where they should be [m].
    ball : ndarray, shape (3,)
        Filtered ball [m].
    estimate_residual : float
        ``|f(q_est) - X_meas|`` [m].
    crops : int
        Limits met in this step.
    """

    tendon_change: NDArray[np.float64]
    gripper_closed: bool
    mode: Mode
    reason: str
    error: float
    q_sys: NDArray[np.float64]
    q_est: NDArray[np.float64] | None
    measured_points: NDArray[np.float64]
    goal_points: NDArray[np.float64]
    ball: NDArray[np.float64]
    estimate_residual: float
    crops: int


def goal_over(ball: ArrayLike, height: float, gripper_length: float) -> NDArray[np.float64]:
    """Return ``X_goal`` (6,): the gripper upright at a height over the ball, the wrist above it [m] (Section
    3.5).

    Algorithm 3 subtracts a pose of six numbers from a ball of three; this makes the ball a pose (Erratum
    SH-14).
    """
    gripper = np.asarray(ball, dtype=float) + height * UP
    return np.concatenate([gripper + gripper_length * UP, gripper])


def softened_weights(q_sys: ArrayLike, weights: ArrayLike, softening: float) -> NDArray[np.float64]:
    """Return ``A_pose,upd`` (9,) with less weight where gravity has more hold (Vervloet, Section 5.4.3).

    A segment's weight falls with its own bend and with the bends of the segments above it [1/rad].
    """
    bends = np.hypot(*np.asarray(q_sys, dtype=float).reshape(3, 3)[:, :2].T)
    return np.asarray(weights) / np.repeat(1 + softening * np.cumsum(bends), 3)


class HandoverController:
    """Runs Vervloet, Algorithm 3, one look at a time.

    Parameters
    ----------
    parameters : HandoverParameters
    """

    def __init__(self, parameters: HandoverParameters | None = None) -> None:
        self.parameters = parameters or HandoverParameters()
        self.reset()

    def reset(self) -> None:
        """Start again from the calibrated arm."""
        self.arm = self.parameters.control.arm
        self.q_sys = self.arm.home.copy()
        self._calibrated_tendons = self.arm.tendon_lengths(self.arm.home)
        self.filters = HandoverFilters(self.parameters.filters, self.arm.tip_points(self.arm.home))
        self.mode = Mode.APPROACH
        self.gripper_closed = False
        self.place: NDArray[np.float64] | None = None
        self._expected_move = np.zeros(6)
        self._task_mode = Mode.APPROACH
        self._last_wrist: NDArray[np.float64] | None = None
        self._last_seen: dict[str, NDArray[np.float64]] = {}
        self._jumped_to: dict[str, NDArray[np.float64]] = {}
        self._looks_after_jump = {"wrist": 0, "ball": 0}
        self._repeats = 0
        self._ball_unseen = 0
        self._held = 0
        self._best_error = np.inf
        self._without_progress = 0
        self._retreat_reason = ""

    def carry_to(self, place: ArrayLike) -> None:
        """Close on what was reached and bring it to a fixed gripper point (3,) [m], then open (Section
        3.5.3)."""
        self.place = np.asarray(place, dtype=float)
        self._enter(Mode.CARRY)

    def update(self, observation: HandoverObservation) -> HandoverCommand:
        """Return the command that follows from one look.

        Whatever is seen, the command stays within the arm's and the motors' limits; see :class:`SafetyRules`.
        """
        if self.mode in (Mode.GRASP, Mode.RELEASE, Mode.STOPPED):
            return self._command(self._retreat_reason)
        if self.mode is Mode.RETREAT:
            return self._retreat(self._retreat_reason)
        looked, reason = self._believable(observation)
        self.filters.predict(self._expected_move)
        self._expected_move = np.zeros(6)
        self.filters.update(looked)
        reason = reason or self._reason_to_hold(looked)
        if reason:
            return self._hold(reason)

        measured = self.filters.points
        goal = self._goal(measured)
        error = magnitude(goal - measured)
        if error < self.parameters.stop_threshold:
            return self._arrive(measured, goal, error)
        if self._stuck(error):
            return self._retreat(f"no progress for {self._without_progress} steps at {error * 1e3:.0f} mm")

        estimate = self._estimate(measured)
        if not estimate.converged:
            return self._hold(f"state estimation: {estimate.reason}")
        step = self.parameters.control.update(self.q_sys, estimate.q, goal, measured)
        length = self.arm.gripper_length
        self._expected_move = tip_points(step.q_est, length) - tip_points(estimate.q, length)
        self.q_sys = step.q_sys
        self._held = 0
        self.mode = self._task_mode
        return self._command("", error, estimate, measured, goal, step.crops)

    def _estimate(self, measured: NDArray[np.float64]) -> ShapeEstimate:
        """Return ``q_est`` = SOF(q_sys, X_meas), Eq. (16); or q_sys itself where the optimisation is left
        out."""
        parameters = self.parameters
        if not parameters.estimate_shape:
            residual = magnitude(self.arm.tip_points(self.q_sys) - measured)
            return ShapeEstimate(self.q_sys.copy(), 0.0, residual, 0, True, "")
        weights: ArrayLike = parameters.pose_weights
        if parameters.bend_softening:
            weights = softened_weights(self.q_sys, weights, parameters.bend_softening)
        bound = parameters.pose_bound + parameters.pose_bound_share * self.filters.points_deviation
        return estimate_shape(self.q_sys, measured, bound, weights, self.arm.gripper_length)

    def _goal(self, measured: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return ``X_goal`` of the stage; the second stage begins when the first goal is reached."""
        length = self.arm.gripper_length
        if self._task_mode is Mode.CARRY and self.place is not None:
            return goal_over(self.place, 0.0, length)
        ball = self.filters.ball.state
        if self._task_mode is Mode.APPROACH:
            above = goal_over(ball, self.parameters.grasp_offset, length)
            if magnitude(above - measured) >= self.parameters.stop_threshold:
                return above
            self._enter(Mode.DESCEND)
        return goal_over(ball, 0.0, length)

    def _arrive(
        self, measured: NDArray[np.float64], goal: NDArray[np.float64], error: float
    ) -> HandoverCommand:
        self._enter(Mode.RELEASE if self._task_mode is Mode.CARRY else Mode.GRASP)
        return self._command("", error, None, measured, goal)

    def _enter(self, mode: Mode) -> None:
        """Begin a stage of the task: the gripper closes to grasp and carry, and opens to release."""
        self.mode = self._task_mode = mode
        self.gripper_closed = mode in (Mode.GRASP, Mode.CARRY)
        self._best_error = np.inf
        self._without_progress = 0

    def _stuck(self, error: float) -> bool:
        """Return whether the error has not fallen for too long, far from the goal."""
        if error < self._best_error - self.parameters.safety.progress:
            self._best_error = error
            self._without_progress = 0
        elif error > 2 * self.parameters.stop_threshold:
            self._without_progress += 1
        return self._without_progress >= self.parameters.safety.patience

    def _believable(self, look: HandoverObservation) -> tuple[HandoverObservation, str]:
        """Return the look without what cannot be true, and why the arm should hold ("" if it need not)."""
        rules = self.parameters.safety
        wrist, direction, ball = (finite(v) for v in (look.wrist, look.direction, look.ball))
        if direction is not None and not abs(magnitude(direction) - 1) < 0.1:
            direction = None
        if ball is not None and not look.disagreement <= rules.largest_disagreement:
            ball = None
        if wrist is not None and magnitude(wrist) > sum(self.arm.maximum_lengths) + rules.reach_margin:
            wrist = None
        if wrist is None or self._last_wrist is None or not np.array_equal(wrist, self._last_wrist):
            self._repeats = 0
        elif magnitude(self._expected_move) > rules.noticeable_move:
            self._repeats += 1
        self._last_wrist = wrist
        if self._repeats >= rules.frozen_looks:
            wrist = direction = ball = None
        else:
            wrist, ball = self._without_jump("wrist", wrist), self._without_jump("ball", ball)
        reason = ""
        if wrist is None or direction is None:
            wrist = direction = None
            frozen = self._repeats >= rules.frozen_looks
            reason = "the cameras are frozen" if frozen else "the arm is not seen"
        deviations = (look.wrist_deviation, look.direction_deviation, look.ball_deviation)
        return HandoverObservation(wrist, direction, ball, *deviations), reason

    def _without_jump(self, name: str, point: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
        """Return the point, or None if it jumped and has not stayed where it jumped to."""
        if point is None:
            return None
        rules = self.parameters.safety
        last, new = self._last_seen.get(name), self._jumped_to.get(name)
        if last is not None and magnitude(point - last) > rules.largest_jump:
            stayed = new is not None and magnitude(point - new) <= rules.largest_jump
            self._looks_after_jump[name] = self._looks_after_jump[name] + 1 if stayed else 1
            self._jumped_to[name] = point
            if self._looks_after_jump[name] < rules.jump_confirmations:
                return None
        self._jumped_to.pop(name, None)
        self._last_seen[name] = point
        return point

    def _reason_to_hold(self, look: HandoverObservation) -> str:
        if self._task_mode is Mode.CARRY:
            return ""
        self._ball_unseen = self._ball_unseen + 1 if look.ball is None else 0
        if not self.filters.ball_seen:
            return "the ball has not been seen yet"
        if self._ball_unseen > self.parameters.safety.ball_memory:
            return f"the ball has not been seen for {self._ball_unseen} steps"
        return ""

    def _hold(self, reason: str) -> HandoverCommand:
        """Keep the last command; after too many held steps go home."""
        self._held += 1
        if self._held > self.parameters.safety.hold_limit:
            return self._retreat(f"held for {self.parameters.safety.hold_limit} steps: {reason}")
        self.mode = Mode.HOLD
        return self._command(reason)

    def _retreat(self, reason: str) -> HandoverCommand:
        """Go home open loop: a straight way within the limits, which are convex in `q_sys`, with an open
        gripper."""
        self._retreat_reason = reason
        self.gripper_closed = self._task_mode is Mode.CARRY
        self.q_sys = self.q_sys + self.parameters.safety.retreat_share * (self.arm.home - self.q_sys)
        self.mode = Mode.RETREAT
        if np.abs(self.q_sys - self.arm.home).max() < 0.01:
            self.q_sys = self.arm.home.copy()
            self.mode = Mode.STOPPED
        return self._command(reason)

    def _command(
        self,
        reason: str,
        error: float = np.nan,
        estimate: ShapeEstimate | None = None,
        measured: NDArray[np.float64] | None = None,
        goal: NDArray[np.float64] | None = None,
        crops: int = 0,
    ) -> HandoverCommand:
        change = self.arm.tendon_lengths(self.q_sys) - self._calibrated_tendons
        clipped, _ = self.parameters.motors.clip(change)
        unknown = np.full(6, np.nan)
        return HandoverCommand(
            tendon_change=clipped,
            gripper_closed=self.gripper_closed,
            mode=self.mode,
            reason=reason,
            error=error,
            q_sys=self.q_sys.copy(),
            q_est=estimate.q if estimate else None,
            measured_points=self.filters.points if measured is None else measured,
            goal_points=unknown if goal is None else goal,
            ball=self.filters.ball.state.copy(),
            estimate_residual=estimate.residual if estimate else np.nan,
            crops=crops,
        )


def finite(vector: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    """Return the vector, or None if it is missing or not finite."""
    if vector is None or not np.isfinite(vector).all():
        return None
    return vector
