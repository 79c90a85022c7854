"""The controllers of the four papers behind one call, for a batch of any arm."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np

from soro_lib.controllers import (
    AssistAsNeeded,
    FixedAssistance,
    GestureSteering,
    HybridController,
    VirtualStiffnessController,
)
from soro_lib.controllers.gesture_steering import SteeringSettings
from soro_lib.controllers.hand_mapping import PalmMapping
from soro_lib.controllers.hybrid import HybridSettings
from soro_lib.controllers.steering_step import StepWeights
from soro_lib.controllers.virtual_stiffness import HELIX, STIFFENING
from soro_lib.papers.cross_robot.world.benches import (
    CABLE_LENGTH,
    CHAMBER_LENGTH,
    GROWN_LENGTH,
    HELIX_LENGTH,
    Array,
    Bench,
    ResizedArm,
    as_it_is,
    resized,
)
from soro_lib.papers.shared_control.world.hand import pull_axis
from soro_lib.papers.shared_control.world.people import DEVICE_SCALE, SAMPLE_TIME, Operator
from soro_lib.papers.shared_control.world.vectors import after_friction
from soro_lib.robots import PneumaticArm
from soro_lib.robots.base import Robot
from soro_lib.sensing.hand_tracking import HandSample

STEP_TIME = 0.04
"""Time between two commands [s]."""

STRAIGHT = np.array([0.0, 0.0, 1.0])
"""Where the tip shall point, if the controller steers it."""


class NotApplicable(ValueError):
    """A controller cannot be used on an arm; the message says why."""


class Law(Protocol):
    """A controller for a batch of arms; lengths as the arm is shown to it.

    Attributes
    ----------
    actuation : ndarray (batch, n)
        The present command.
    steers : str
        Which coordinates it controls.
    """

    actuation: Array
    steers: str

    def update(self, tip: Array, direction: Array, goal: Array) -> None:
        """Take the measured tips and directions (batch, 3) and the goal (3,); set the next command."""
        ...


class Steering:
    """Gesture steering (Lai et al., Algorithm 1), from a flat hand that draws the path; it sees no tip.

    The paper's own mapping and weights; only the height of the hand is moved, to 0.25 m above the tracker.
    """

    def __init__(self, arm: ResizedArm, start: Array, batch: int, rng: np.random.Generator) -> None:
        points = len(start) >= 5
        self.steers = "x, y, z, direction" if points else "x, y, z"
        self.actuation = np.tile(start, (batch, 1))
        self.mapping = palm_mapping(arm.tip(start)[2])
        weights = StepWeights() if points else StepWeights(direction=0.0)
        # The compiled kinematics are for the paper's own arm, unwrapped.
        robot = arm.robot if arm.ratio == 1.0 and (arm.units == 1.0).all() else arm
        self.controller = GestureSteering(robot, SteeringSettings(self.mapping, weights=weights), start)
        self.time = 0.0

    def update(self, tip: Array, direction: Array, goal: Array) -> None:
        """Show the hand to the tracker where it asks for the goal."""
        palm = self.mapping.palm(tuple(goal.tolist()))
        if not self.mapping.in_box(palm):
            raise NotApplicable(
                f"the hand would have to move {1e3 * abs(palm[0]):.0f} mm sideways, out of the box"
            )
        self.time += STEP_TIME
        hand = HandSample(self.time, 1, palm, (0.0, -1.0, 0.0), (True,) * 5)
        self.actuation = np.tile(self.controller.update(hand).actuation, (len(self.actuation), 1))


def palm_mapping(height: float) -> PalmMapping:
    """Return the paper's mapping, with a hand 0.25 m above the tracker asking for a tip at `height` [m]."""
    return PalmMapping(offset=height - 0.25 * PalmMapping().scale_z)


class Guided:
    """A person who teleoperates (Stroppa et al.), with or without an assistance that pulls the hand.

    The person sees the way from tip to goal a reaction time late, misjudges the goal, and moves with the
    crossover frequency of McRuer's operator; eye, hand and device are those of
    `soro_lib.papers.shared_control.world`. The arm follows the commanded point by its model. The two halves
    of a batch have the same persons.
    """

    CROSSOVER = 2.0
    """Rate at which a seen error is corrected [1/s]."""

    steers = "x, y, z"

    def __init__(
        self,
        arm: ResizedArm,
        start: Array,
        batch: int,
        rng: np.random.Generator,
        assistance: Callable[[], AssistAsNeeded | FixedAssistance] | None = None,
    ) -> None:
        self.arm, self.rng, self.person = arm, rng, Operator()
        self.actuation = np.tile(start, (batch, 1))
        self.centre = self.goal = arm.tip(start)
        self.assistances = [assistance() for _ in range(batch)] if assistance else []
        self.misjudged = misjudgement(self.person, batch, rng)
        self.intention, self.drift, self.velocity, self.position = np.zeros((4, batch, 3))
        self.seen: deque[Array] = deque(maxlen=1 + round(self.person.reaction_delay / STEP_TIME))

    def update(self, tip: Array, direction: Array, goal: Array) -> None:
        """Move the hand and let the arm follow the point that it commands."""
        self.seen.append(goal + self.misjudged - tip)
        correction = self.CROSSOVER * STEP_TIME * self.seen[0] + goal - self.goal
        self.intention = self.intention + correction / DEVICE_SCALE
        self.goal = goal
        self._move_hand(self._felt(tip, goal))
        command = self.centre + DEVICE_SCALE * self.position
        pose, jacobian = self.arm.pose_and_jacobian(self.actuation)
        step = (np.linalg.pinv(jacobian[:, :3]) @ (command - pose[:, :3, 3])[..., np.newaxis])[..., 0]
        self.actuation = self.arm.clip(self.actuation + step).actuation

    def _felt(self, tip: Array, goal: Array) -> Array:
        forces = [
            after_friction(tuple(assistance.update(place, goal).force), self.person.device_friction)
            for assistance, place in zip(self.assistances, tip, strict=False)
        ]
        return np.array(forces) if forces else np.zeros_like(tip)

    def _move_hand(self, force: Array) -> None:
        keep = np.exp(-STEP_TIME / 0.5)
        fresh = self.person.wander * np.sqrt(1.0 - keep**2)
        self.drift = keep * self.drift + fresh * self.rng.standard_normal(self.drift.shape)
        aim = self.intention + self.drift
        for _ in range(round(STEP_TIME / SAMPLE_TIME)):
            # Three axes and the whole batch at once; the rule itself is written for one number.
            pulled = pull_axis(self.person, self.position, self.velocity, aim, force)  # type: ignore[arg-type]
            self.position, self.velocity = np.asarray(pulled[0]), np.asarray(pulled[1])


def misjudgement(person: Operator, batch: int, rng: np.random.Generator) -> Array:
    """Return by how much each person misjudges the goal [m], (batch, 3): mostly along the line of sight."""
    sight = np.array([0.0, np.cos(person.view_elevation), np.sin(person.view_elevation)])
    depth = person.depth_error * rng.standard_normal((batch // 2, 1))
    return np.tile(person.lateral_error * rng.standard_normal((batch // 2, 3)) + depth * sight, (2, 1))


def fixed_assistance() -> FixedAssistance:
    """Return the fixed assistance of the paper at this clock; its filter spans half a second."""
    return FixedAssistance(window=round(0.5 / STEP_TIME), sample_rate=1.0 / STEP_TIME)


def assist_as_needed() -> AssistAsNeeded:
    """Return the paper's assist-as-needed at this clock."""
    return AssistAsNeeded(sample_rate=1.0 / STEP_TIME)


class Hybrid:
    """The hybrid controller (Wang et al., Eqs. (25)-(29)); it steers x and y."""

    steers = "x, y"

    def __init__(
        self, arm: ResizedArm, start: Array, batch: int, rng: np.random.Generator, compensation: str = "none"
    ) -> None:
        self.arm, self.actuation = arm, np.tile(start, (batch, 1))
        self.controller = HybridController(arm, HybridSettings(compensation=compensation), (batch,))

    def update(self, tip: Array, direction: Array, goal: Array) -> None:
        """Take one step of the controller."""
        result = self.controller.update(tip[:, :2], goal[:2], self.actuation)
        self.actuation = self.arm.clip(result.actuation).actuation


class VirtualStiffness:
    """Virtual stiffness (Vervloet, Eqs. (19)-(22)), carried over to any arm.

    The thesis states it for the state of its own arm. Its stiffness belongs to bends and stretches, which
    every arm has: ``C' K C`` with the slope C of the configuration brings it to any actuators. As in
    Algorithm 2, an actuator that meets its limit is held there and becomes a hundred times stiffer, and the
    others make up.
    """

    STEP_SIZE = 0.1
    BEND, STRETCH = 0.1, 1.0
    """Virtual stiffness of the outer segments, per rad and per m (Vervloet, Appendix A)."""

    ITERATIONS = 3
    """Rounds in which the others make up for an actuator at its limit [-]."""

    def __init__(self, arm: ResizedArm, start: Array, batch: int, rng: np.random.Generator) -> None:
        self.arm, self.actuation = arm, np.tile(start, (batch, 1))
        self.points = len(start) >= 5
        self.steers = "x, y, z, direction" if self.points else "x, y, z"

    def update(self, tip: Array, direction: Array, goal: Array) -> None:
        """Take a tenth of the way to the goal; tip and gripper, or the tip alone."""
        error = self.STEP_SIZE * (goal - tip)
        if self.points:
            turn = HELIX.gripper_length * self.STEP_SIZE * (STRAIGHT - direction)
            error = np.concatenate([error, error + turn], axis=-1)
        jacobian = self._points_jacobian()
        stiffness = actuator_stiffness(self.arm, self.actuation, self.BEND, self.STRETCH)
        for _ in range(self.ITERATIONS):
            wanted = self.actuation + stiff_step(jacobian, stiffness, error)
            clipped = self.arm.clip(wanted)
            error = error - (jacobian @ (clipped.actuation - self.actuation)[..., np.newaxis])[..., 0]
            self.actuation = clipped.actuation
            if not clipped.any_clipped:
                break
            diagonal = np.arange(stiffness.shape[-1])
            stiffness[..., diagonal, diagonal] *= np.where(clipped.clipped, STIFFENING, 1.0)

    def _points_jacobian(self) -> Array:
        pose, jacobian = self.arm.pose_and_jacobian(self.actuation)
        if not self.points:
            return jacobian[:, :3]
        pointing = HELIX.gripper_length * pose[:, :3, 2]
        swing = np.cross(jacobian[:, 3:], pointing[..., np.newaxis], axis=-2)
        return np.concatenate([jacobian[:, :3], jacobian[:, :3] + swing], axis=-2)


def actuator_stiffness(arm: Robot, actuation: Array, bend: float, stretch: float) -> Array:
    """Return ``C' K C``, shape (..., n, n): stiffness per rad of bend, per m of stretch, at the actuators."""
    slope = arm.configuration_jacobian(actuation)
    stiffness = np.tile([bend, bend, stretch], slope.shape[-2] // 3)
    return np.asarray(np.swapaxes(slope, -1, -2) @ (stiffness[:, np.newaxis] * slope))


def stiff_step(jacobian: Array, stiffness: Array, error: Array) -> Array:
    """Return ``K^-1 J' (J K^-1 J')^+ e``, shape (..., n), for a full matrix K (Vervloet, Eq. (19))."""
    compliant = np.linalg.solve(stiffness, np.swapaxes(jacobian, -1, -2))
    inverse = np.linalg.pinv(jacobian @ compliant, rcond=1e-8, hermitian=True)
    return np.asarray(compliant @ inverse @ error[..., np.newaxis])[..., 0]


class OwnVirtualStiffness:
    """The controller of the thesis itself, on its own arm."""

    steers = "x, y, z, direction"

    def __init__(self, arm: ResizedArm, start: Array, batch: int, rng: np.random.Generator) -> None:
        self.actuation = np.tile(start, (batch, 1))
        self.controller = VirtualStiffnessController(error_reference="measurement")

    def update(self, tip: Array, direction: Array, goal: Array) -> None:
        """Run Algorithm 1 for every member of the batch."""
        reach = HELIX.gripper_length
        goals = np.concatenate([goal, goal + reach * STRAIGHT])
        measured = np.concatenate([tip, tip + reach * direction], axis=-1)
        steps = [
            self.controller.update(q, q, goals, points)
            for q, points in zip(self.actuation, measured, strict=True)
        ]
        self.actuation = np.stack([step.q_sys for step in steps])


@dataclass(frozen=True)
class Controller:
    """A controller and the arm of its paper.

    Attributes
    ----------
    source, home : str
        The paper and its arm.
    length : float
        Length of that arm, as which other arms are shown [m].
    build : callable
        Returns the `Law` for (arm, start, batch, rng).
    sensitivity : float
        How far a unit of an actuator moves the tip of that arm at rest [m].
    build_at_home : callable, optional
        The same for its own arm, where that is another class.
    """

    source: str
    home: str
    length: float
    build: Callable[..., Law]
    sensitivity: float = 1.0
    build_at_home: Callable[..., Law] | None = None

    def on(self, bench: Bench, scaled: bool, batch: int, rng: np.random.Generator) -> tuple[Law, ResizedArm]:
        """Return the law for an arm, and the arm as the law sees it."""
        if bench.specimen.name == self.home:
            arm, build = as_it_is(bench), self.build_at_home or self.build
        else:
            length = self.length if scaled else bench.length
            arm, build = resized(bench, length, self.sensitivity), self.build
        return build(arm, bench.start / arm.units, batch, rng), arm

    def differs_in_size(self, bench: Bench) -> bool:
        """Whether an arm is less than two thirds or more than one and a half times as long as its own."""
        return not 2 / 3 <= bench.length / self.length <= 3 / 2


def controllers() -> dict[str, Controller]:
    """Return the controllers by name."""
    model = PneumaticArm()
    chamber = float(np.linalg.norm(model.jacobian(model.home)[:3, 0]))
    teleoperated = ("Stroppa et al.", "soft-growing", GROWN_LENGTH)
    pneumatic = ("Wang et al.", "pneumatic", CHAMBER_LENGTH)
    return {
        "gesture steering": Controller("Lai et al.", "cable-driven", CABLE_LENGTH, Steering),
        "hand alone": Controller(*teleoperated, Guided),
        "assist-as-needed": Controller(*teleoperated, partial(Guided, assistance=assist_as_needed)),
        "fixed assistance": Controller(*teleoperated, partial(Guided, assistance=fixed_assistance)),
        "model-based": Controller(*pneumatic, Hybrid, chamber),
        "quadratic gain": Controller(*pneumatic, partial(Hybrid, compensation="quadratic"), chamber),
        "hybrid, learning": Controller(*pneumatic, partial(Hybrid, compensation="literal"), chamber),
        "virtual stiffness": Controller(
            "Vervloet", "helix", HELIX_LENGTH, VirtualStiffness, build_at_home=OwnVirtualStiffness
        ),
    }
