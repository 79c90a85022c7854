"""Steering a redundant soft arm with one hand; Lai et al., Algorithm 1.

Each frame of the tracker goes through gate, filter, gesture rule, mapping and one small quadratic program;
out comes an actuation that is always valid, whatever the tracker says.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import check_fields, finite
from soro_lib.controllers.gestures import Gesture, GestureRule
from soro_lib.controllers.hand_gate import GatedHand, GateSettings, HandGate
from soro_lib.controllers.hand_mapping import PalmMapping, TipGoal, Vector
from soro_lib.controllers.obstacles import Sphere, clearances
from soro_lib.controllers.steering_step import (
    CABLE_UNITS,
    MILLIMETRE,
    Step,
    StepBounds,
    StepWeights,
    avoiding_step,
    locked_step,
    pose_step,
    solve,
)
from soro_lib.estimators.palm_filter import DirectionFilter, PalmFilter, PalmFilterSettings
from soro_lib.robots import CableDrivenArm
from soro_lib.robots.base import Robot
from soro_lib.robots.cable_driven_kernels import Kinematics, compiled_kinematics, generic_kinematics
from soro_lib.sensing.hand_tracking import HandSample

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SteeringSettings:
    """Everything that can be chosen about the steering.

    Parameters
    ----------
    mapping : PalmMapping
        Hand to tip.
    palm_filter : PalmFilterSettings
        Noise model of the Kalman filter.
    direction_time_constant : float
        Of the direction filter [s]; it acts after the gesture rule, so that a gesture change is no step.
    weights : StepWeights
        Of the least squares.
    gate : GateSettings
        Which frames to believe.
    gesture_hold, opposite_hold : float
        Hold times of the gesture rule [s].
    tip_speed : float
        Largest speed of the commanded tip [m/s].
    turn_rate : float
        Largest turn of the commanded direction [rad/s].
    cable_rate : float
        Largest change of a cable tension [N/s].
    slide_speed : float
        Largest speed of the slide [m/s]. Another arm's actuators cross their range in two seconds.
    minimum_tension : float
        Pretension that keeps cables from going slack [N]; the paper allows 0 (erratum GS-18).
    iterations : int
        Linearised steps per frame [-].
    longest_interval : float
        A pause longer than this counts as this long for the rate limits [s].
    obstacles : tuple of Sphere
        What the arm shall avoid; with any, Eq. (29) takes the place of (26) and the direction is free.
    margin : float or None
        Clearance that is guaranteed, as an inequality [m]; None leaves it to the cost of Eq. (29).
    """

    mapping: PalmMapping = field(default_factory=PalmMapping)
    palm_filter: PalmFilterSettings = field(default_factory=PalmFilterSettings)
    direction_time_constant: float = 0.1
    weights: StepWeights = field(default_factory=StepWeights)
    gate: GateSettings = field(default_factory=GateSettings)
    gesture_hold: float = 0.13
    opposite_hold: float = 0.25
    tip_speed: float = 0.15
    turn_rate: float = 2.5
    cable_rate: float = 3.0
    slide_speed: float = 0.15
    minimum_tension: float = 0.02
    iterations: int = 1
    longest_interval: float = 0.1
    obstacles: tuple[Sphere, ...] = ()
    margin: float | None = None

    def __post_init__(self) -> None:
        speeds = ("tip_speed", "turn_rate", "cable_rate", "slide_speed")
        check_fields(self, *speeds, "direction_time_constant", "longest_interval", "iterations", above=0)
        check_fields(self, "minimum_tension", at_least=0, below=1)


@dataclass(frozen=True, slots=True)
class SteeringResult:
    """What the controller commands and why.

    Attributes
    ----------
    time : float
        Of the frame [s].
    actuation : ndarray (n,)
        Command to the arm, always within its limits.
    mode : Gesture
        Gesture mode in force.
    converged : bool
        Whether the frame was sound and the least squares solved.
    reason : str
        What was wrong with the frame or the solver, or "".
    goal : TipGoal
        What the hand asks for under the mode: position [m] and direction, unfiltered in time.
    target_position, target_direction : ndarray (3,)
        What the arm was asked for in this frame, after rate limit and direction filter.
    tip, direction : ndarray (3,)
        Where the model of the arm is and points under ``actuation``.
    mid : ndarray (3,)
        Its mid point [m].
    """

    time: float
    actuation: Array
    mode: Gesture
    converged: bool
    reason: str
    goal: TipGoal
    target_position: Array
    target_direction: Array
    tip: Array
    direction: Array
    mid: Array

    @property
    def position_error(self) -> float:
        """Distance of tip and target [m]: the residual of tracking and reach, not an accuracy."""
        return math.dist(self.tip, self.target_position)

    @property
    def direction_error(self) -> float:
        """Angle between pointing direction and target [rad]."""
        return 2.0 * math.asin(min(math.dist(self.direction, self.target_direction) / 2.0, 1.0))


class GestureSteering:
    """Steer an arm by the frames of a hand tracker; Lai et al., Algorithm 1.

    Parameters
    ----------
    robot : Robot
        The arm; ``CableDrivenArm`` runs compiled. Another arm's actuators count in thousandths of SI units.
    settings : SteeringSettings, optional
        All choices.
    actuation : array_like (n,), optional
        Where to start; default the robot's home.

    Examples
    --------
    >>> steering = GestureSteering(CableDrivenArm())
    >>> palm, normal = (0.0, 0.2, 0.0), (0.0, -1.0, 0.0)
    >>> steering.update(HandSample(0.0, 1, palm, normal, fingers=(True,) * 5)).mode.value
    'palm'
    """

    def __init__(
        self, robot: Robot, settings: SteeringSettings | None = None, actuation: ArrayLike | None = None
    ) -> None:
        self.robot = robot
        self.settings = settings or SteeringSettings()
        self._kinematics: Callable[[Array], Kinematics] = (
            compiled_kinematics(robot) if isinstance(robot, CableDrivenArm) else generic_kinematics(robot)
        )
        self._lower, self._upper = robot.lower.copy(), robot.upper.copy()
        if isinstance(robot, CableDrivenArm):
            self._units = CABLE_UNITS
            self._rates = np.array([self.settings.slide_speed] + [self.settings.cable_rate] * 6)
            self._upper[1:] = -self.settings.minimum_tension
        else:
            self._units = np.full(len(self._lower), MILLIMETRE)
            self._rates = (self._upper - self._lower) / 2.0
        self.reset(robot.home if actuation is None else actuation)

    def reset(self, actuation: ArrayLike) -> None:
        """Start anew at an actuation (n,); it is moved into the limits."""
        self.actuation = finite("actuation", np.clip(actuation, self._lower, self._upper))
        self.pose = self._kinematics(self.actuation)
        self._gate = HandGate(self.settings.mapping, self.settings.gate)
        self._gesture = GestureRule(self.settings.gesture_hold, self.settings.opposite_hold)
        self._palm = PalmFilter(self.settings.palm_filter)
        self._direction = DirectionFilter(self.settings.direction_time_constant)
        self._direction.reset(self.pose.direction)
        self._hand: tuple[Vector, Vector] | None = None  # palm [m] and normal that are followed, device frame
        self._target, self._locked_mid = self.pose.tip, self.pose.mid
        self._mode = Gesture.PALM
        self._time: float | None = None

    def update(self, hand_sample: HandSample) -> SteeringResult:
        """Take in one frame and return the command for it; Lai et al., Algorithm 1, one pass of its loop."""
        hand = self._gate.update(hand_sample)
        interval = self._interval(hand_sample.time)
        mode = self._gesture.mode
        if hand.valid:
            mode = self._gesture.update(hand_sample.time, hand_sample.fingers)
        self._follow(hand, hand_sample.time)
        self._change(mode)

        goal = self._goal(mode)
        if interval > 0:
            self._target = self._approached(goal, interval)
            self._direction.update(interval, goal.direction)
        step = self._stepped(mode, interval) if interval > 0 else Step(np.zeros_like(self.actuation), True)
        reason = "; ".join(filter(None, (hand.reason, step.reason)))
        pose = self.pose
        return SteeringResult(
            hand_sample.time, self.actuation, mode, hand.valid and step.converged, reason, goal,
            self._target, self._direction.direction, pose.tip, pose.direction, pose.mid,
        )  # fmt: skip

    # --- parts of the loop -----------------------------------------------------------------------------

    def _interval(self, time: float) -> float:
        """Return the time since the last frame [s], 0 for the first frame or a clock that did not advance."""
        if not math.isfinite(time) or (self._time is not None and time <= self._time):
            return 0.0
        interval = 0.0 if self._time is None else min(time - self._time, self.settings.longest_interval)
        self._time = time
        return interval

    def _follow(self, hand: GatedHand, time: float) -> None:
        """Update what the hand asks for; hold it, after a short prediction, when the frame is not sound."""
        if hand.valid:
            if hand.restart:
                self._palm.reset()
            palm = self._palm.update(time, hand.palm, hand.velocity).tolist()
            self._hand = (palm, hand.normal)
        elif hand.reason == "no hand" and self._hand is not None and self._palm.time is not None:
            recent = time - self._palm.time <= self.settings.gate.predict_for
            palm = self._palm.predicted(time).tolist() if recent else self._hand[0]
            self._hand = (palm, self._hand[1]) if self.settings.mapping.in_box(palm) else self._hand

    def _goal(self, mode: Gesture) -> TipGoal:
        """Return what the hand asks for under the mode; before the first hand, to stay."""
        if self._hand is None:
            return TipGoal(tuple(self.pose.tip.tolist()), tuple(self.pose.direction.tolist()))
        return self.settings.mapping.goal(*self._hand, mode)

    def _change(self, mode: Gesture) -> None:
        """On entering the fist, lock the mid point; on leaving it, turn on from where the tip points now."""
        if mode is Gesture.FIST and self._mode is not Gesture.FIST:
            self._locked_mid = self.pose.mid
        elif mode is not Gesture.FIST and self._mode is Gesture.FIST:
            self._direction.reset(self.pose.direction)
        self._mode = mode

    def _approached(self, goal: TipGoal, interval: float) -> Array:
        """Move the target towards the goal no faster than the tip may move."""
        return self._target + _shortened(
            np.subtract(goal.position, self._target), self.settings.tip_speed * interval
        )

    def _stepped(self, mode: Gesture, interval: float) -> Step:
        """Solve for the step of the actuation and take it."""
        share = interval / self.settings.iterations
        for _ in range(self.settings.iterations):
            step = self._solved(mode, share)
            if not step.converged:
                break
            self._take(step.actuation_step, share)
        return step

    def _solved(self, mode: Gesture, interval: float) -> Step:
        settings, pose = self.settings, self.pose
        reach = self._rates * interval
        lower = np.maximum(self._lower - self.actuation, -reach)
        upper = np.minimum(self._upper - self.actuation, reach)
        position_step = _shortened(self._target - pose.tip, settings.tip_speed * interval)
        direction_step = _shortened(self._direction.direction - pose.direction, settings.turn_rate * interval)
        bounds = StepBounds(lower, upper, self._units)
        if mode is Gesture.FIST:
            mid_step = self._locked_mid - pose.mid
            problem = locked_step(pose, position_step, mid_step, direction_step, bounds, settings.weights)
        elif settings.obstacles:
            avoiding = settings.weights.avoidance > 0 or settings.margin is not None
            near = clearances(self.robot, self.actuation, settings.obstacles) if avoiding else []
            problem = avoiding_step(pose, position_step, near, bounds, settings.weights, settings.margin)
        else:
            problem = pose_step(pose, position_step, direction_step, bounds, settings.weights)
        return solve(problem)

    def _take(self, actuation_step: Array, interval: float) -> None:
        """Take the step, shortened until the tip keeps its speed limit."""
        limit = self.settings.tip_speed * interval
        for _ in range(10):
            actuation = np.minimum(np.maximum(self.actuation + actuation_step, self._lower), self._upper)
            pose = self._kinematics(actuation)
            moved = math.dist(pose.tip, self.pose.tip)
            if moved <= limit * (1 + 1e-9):
                self.actuation, self.pose = actuation, pose
                return
            actuation_step = actuation_step * (0.98 * limit / moved)


def replay(steering: GestureSteering, samples: Sequence[HandSample]) -> list[SteeringResult]:
    """Run a recording through the controller, frame by frame."""
    return [steering.update(sample) for sample in samples]


def _shortened(vector: Array, limit: float) -> Array:
    """Return the vector, shortened to ``limit`` if it is longer."""
    length = math.sqrt(float(vector @ vector))
    return vector if length <= limit else vector * (limit / length)
