"""The pick-and-place task, one sample at a time: gripper, goal machine, assistance, arm, and the metrics.

`task_step` is the only place where the parts of a trial are put together. `Trial` calls it for a hand from
outside, the simulator for a simulated operator.

Source: Stroppa et al., Sections 3 to 5.1; the scene is that of the authors' published simulator.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import Vector, numbers, one_of, vector
from soro_lib.controllers.shared_control import assist_as_needed as aan
from soro_lib.controllers.shared_control import fixed_assistance, goal_selection
from soro_lib.controllers.shared_control.goal_selection import END, LIFTING_EMPTY, PLACING
from soro_lib.controllers.shared_control.guidance import distance_to_goal, guidance_force, hooke_magnitude
from soro_lib.controllers.shared_control.paradigms import ASSISTANCES, PARADIGMS, Paradigm, desired_position
from soro_lib.jit import inlined
from soro_lib.papers.shared_control.world import plant as arm
from soro_lib.papers.shared_control.world.loop import View
from soro_lib.papers.shared_control.world.people import SAMPLE_TIME
from soro_lib.papers.shared_control.world.vectors import ZERO, delay_line, difference, row, size

UNASSISTED, AS_NEEDED, FIXED = range(len(ASSISTANCES))

AUTOMATIC_LAG = 0.19
"""Lag with which an automatic axis takes up its goal [s]: 5 % of the gap per 10 ms, as programmed."""


# --- What is fixed during a trial ----------------------------------------------------------------------


@dataclass(frozen=True)
class Scene:
    """Where things lie [m], base frame, z down; the defaults are those of the authors' simulator.

    Parameters
    ----------
    start : tuple of float
        Tip at the start.
    items, targets : tuple of tuple of float
        Centres of the cubes and of the discs where they belong, in the order of the task.
    """

    start: Vector = (0.0, 0.0, 0.1)
    items: tuple[Vector, ...] = ((-0.095, 0.117, 0.645), (-0.103, -0.175, 0.645))
    targets: tuple[Vector, ...] = ((0.400, -0.170, 0.643), (0.400, 0.110, 0.643))


@dataclass(frozen=True)
class TaskSettings:
    """A trial before it begins: who steers what, with which law, arm and scene.

    Parameters
    ----------
    paradigm : Paradigm
        One of ``PARADIGMS``, or a blend of your own.
    environment : {"simulated", "real"}
        Which arm and gripper.
    force_law : {"printed", "program"}
        Unit direction and th_D = 30 mm as printed; or the authors' program: direction not normalised, th_D =
        50 mm, its own counter tau, fixed assistance without damper and silent below 30 mm.
    assist_as_needed : mapping
        Parameters that differ from the defaults of `AssistAsNeeded`.
    scene : Scene
    detection_error : tuple of float
        Error of the goals that the machine is told, added to items and targets alike [m].
    lift : bool or None
        Whether the machine lifts between goals; None: as the paradigm does.
    tracking_noise : float or None
        Of the real arm's tracked tip [m]; None: as in `real_arm`.
    """

    paradigm: Paradigm = PARADIGMS["full_teleoperation"]
    environment: Literal["simulated", "real"] = "simulated"
    force_law: Literal["printed", "program"] = "printed"
    assist_as_needed: Mapping[str, object] = field(default_factory=dict)
    scene: Scene = Scene()
    detection_error: Vector = (0.0, 0.0, 0.0)
    lift: bool | None = None
    tracking_noise: float | None = None

    def __post_init__(self) -> None:
        one_of("environment", self.environment, ("simulated", "real"))
        one_of("force_law", self.force_law, ("printed", "program"))

    def rule(self) -> "TaskRule":
        """Plain numbers for the compiled rules.

        Raises
        ------
        ValueError
            If a parameter is out of bounds or a goal out of reach.
        """
        program = self.force_law == "program"
        as_needed = {"near_distance": 0.05, "counter": "program"} if program else {}
        assist = aan.AssistAsNeeded(**{**as_needed, **self.assist_as_needed})  # type: ignore[arg-type]
        fixed = {"near_distance": 0.03, "damping": 0.0} if program else {}
        spring = fixed_assistance.FixedAssistance(**fixed)  # type: ignore[arg-type]
        real = self.environment == "real"
        plant = arm.real_arm(self.tracking_noise) if real else arm.PlantParameters()
        error = np.array(vector("detection_error", self.detection_error))
        goals = goal_selection.GoalSelection(
            np.array(self.scene.items) + error,
            np.array(self.scene.targets) + error,
            lift=self.paradigm.lifts if self.lift is None else self.lift,
            reach=plant.maximum_length,
        )
        return TaskRule(
            goals=goals.rule,
            items=self.scene.items,
            targets=self.scene.targets,
            assist=assist.rule,
            assist_maximum=assist.maximum_force,
            fixed=spring.rule,
            window=len(spring.window),
            plant=plant.rule(),
            gripper=arm.REAL_GRIPPER if real else arm.SIMULATED_GRIPPER,
            assistance=ASSISTANCES.index(self.paradigm.assistance),
            automation=vector("automation", self.paradigm.automation),
            unit_direction=not program,
            confirmed_by_hand=real,
        )


class TaskRule(NamedTuple):
    """What stays fixed during a trial; ``goals`` are as detected, ``items`` and ``targets`` as they are."""

    goals: goal_selection.GoalRule
    items: tuple[Vector, ...]
    targets: tuple[Vector, ...]
    assist: aan.AssistRule
    assist_maximum: float
    fixed: fixed_assistance.FixedRule
    window: int
    plant: arm.PlantParameters
    gripper: arm.GripperRule
    assistance: int
    automation: Vector
    unit_direction: bool
    confirmed_by_hand: bool


# --- What changes --------------------------------------------------------------------------------------


class TaskMemory(NamedTuple):
    """Arrays that a trial overwrites: filter window, commands on their way, items (n, 3), releases (n, 2).

    A row of ``releases`` holds the time at which an item fell [s] and the horizontal distance of the tip from
    its target when the gripper was opened [m].
    """

    window: NDArray[np.float64]
    delayed: NDArray[np.float64]
    items: NDArray[np.float64]
    releases: NDArray[np.float64]


class Tally(NamedTuple):
    """Running metrics: path length [m], integral and peak of the force [N s, N], horizontal tip error [m]."""

    path: float
    impulse: float
    peak_force: float
    opening_error: float


class TaskState(NamedTuple):
    """A trial between two samples."""

    sample: int
    goal: goal_selection.GoalState
    assist: aan.AssistState
    fixed: fixed_assistance.FixedState
    plant: arm.PlantState
    gripper: arm.GripperState
    automatic: Vector
    desired: Vector
    force: Vector
    magnitude: float
    closed: bool
    tally: Tally


def task_start(rule: TaskRule, start: Vector) -> tuple[TaskState, TaskMemory]:
    """A trial before its first sample: tip at rest, gripper open, no force."""
    items, first = np.array(rule.items, dtype=float), rule.goals.items[0]
    delayed = delay_line(start, round(rule.plant.command_delay))
    memory = TaskMemory(np.zeros(rule.window), delayed, items, np.full((len(items), 2), np.nan))
    state = TaskState(
        sample=0,
        goal=goal_selection.GoalState(0, 0, first, first),
        assist=aan.ASSIST_START,
        fixed=fixed_assistance.FIXED_START,
        plant=arm.plant_start(start),
        gripper=arm.GripperState(arm.NOTHING, -1.0),
        automatic=start,
        desired=start,
        force=ZERO,
        magnitude=0.0,
        closed=False,
        tally=Tally(0.0, 0.0, 0.0, math.nan),
    )
    return state, memory


# --- One sample ----------------------------------------------------------------------------------------


@inlined
def carry(rule: TaskRule, items: NDArray[np.float64], before: int, after: int, tip: Vector) -> None:
    """Move the held item with the tip; a released one falls straight down to where it lay."""
    moved = after if after != arm.NOTHING else before
    if moved != arm.NOTHING:
        items[moved, 0], items[moved, 1] = tip[0], tip[1]
        items[moved, 2] = tip[2] if after != arm.NOTHING else rule.items[moved][2]


@inlined
def assist(
    rule: TaskRule, state: TaskState, window: NDArray[np.float64], tip: Vector, goal: Vector
) -> tuple[aan.AssistState, fixed_assistance.FixedState, float, Vector]:
    """The assistance of the paradigm: its states, |f| and the rendered force [N]."""
    assisted, fixed = state.assist, state.fixed
    if rule.assistance == UNASSISTED:
        return assisted, fixed, 0.0, ZERO
    distance = distance_to_goal(tip, goal)
    if rule.assistance == AS_NEEDED:
        assisted = aan.assist_step(rule.assist, assisted, distance, 1.0)
        magnitude = hooke_magnitude(assisted.stiffness, distance, rule.assist_maximum)
    else:
        fixed = fixed_assistance.fixed_step(rule.fixed, fixed, window, distance, 1.0)
        magnitude = fixed.magnitude
    return assisted, fixed, magnitude, guidance_force(magnitude, tip, goal, rule.unit_direction)


@inlined
def task_step(
    rule: TaskRule,
    state: TaskState,
    memory: TaskMemory,
    command: Vector,
    closed: bool,
    confirmed: bool,
    rng: np.random.Generator,
) -> TaskState:
    """One sample of a trial: blend, move, grip, select the goal, assist, and keep the score.

    ``closed``: the gripper's button is held. ``confirmed``: the operator reports an item in the gripper (the
    second button); heeded by the real variant, which cannot sense it.
    """
    automatic = arm.simulated_tip(state.automatic, state.goal.goal, AUTOMATIC_LAG)
    desired = desired_position(command, automatic, rule.automation)
    plant = arm.plant_step(rule.plant, state.plant, memory.delayed, desired)
    tip = plant.tip

    opening_error = state.tally.opening_error
    item = state.gripper.item
    if item != arm.NOTHING and state.closed and not closed:
        off = difference(tip, rule.targets[item])
        opening_error = size((off[0], off[1], 0.0))
    gripper = state.gripper
    if closed or item != arm.NOTHING:
        gripper = arm.gripper_step(rule.gripper, gripper, memory.items, tip, desired, closed, rng)
        carry(rule, memory.items, item, gripper.item, tip)
    if item != arm.NOTHING and gripper.item == arm.NOTHING and state.goal.phase == PLACING:
        memory.releases[item, 0] = SAMPLE_TIME * (state.sample + 1)
        memory.releases[item, 1] = opening_error

    tracked = arm.tracked_tip(tip, rule.plant.tracking_noise, rng)
    held = confirmed if rule.confirmed_by_hand else gripper.item != arm.NOTHING
    goal = goal_selection.goal_step(rule.goals, state.goal, tracked, held)
    assisted, fixed, magnitude, force = assist(rule, state, memory.window, tracked, goal.goal)

    newton = size(force)
    tally = Tally(
        path=state.tally.path + size(difference(state.plant.tip, tip)),
        impulse=state.tally.impulse + SAMPLE_TIME * newton,
        peak_force=max(state.tally.peak_force, newton),
        opening_error=opening_error,
    )
    return TaskState(
        sample=state.sample + 1,
        goal=goal,
        assist=assisted,
        fixed=fixed,
        plant=plant,
        gripper=gripper,
        automatic=automatic,
        desired=desired,
        force=force,
        magnitude=magnitude,
        closed=closed,
        tally=tally,
    )


@inlined
def delivered(rule: TaskRule, state: TaskState) -> bool:
    """Whether the last item has been released on its target."""
    last = state.goal.item >= len(rule.goals.items) - 1
    return state.goal.phase == END or (last and state.goal.phase == LIFTING_EMPTY)


@inlined
def operator_view(rule: TaskRule, state: TaskState, items: NDArray[np.float64]) -> View:
    """What an operator sees and feels. Wanted: the target of the item in the gripper, else the next item."""
    held = state.gripper.item != arm.NOTHING
    if held:
        wanted = rule.targets[state.gripper.item]
    else:
        following = state.goal.item + 1 if state.goal.phase == LIFTING_EMPTY else state.goal.item
        wanted = row(items, min(following, len(items) - 1))
    return View(state.plant.tip, state.desired, wanted, state.force, held, rule.automation)


# --- The task for a hand from outside ------------------------------------------------------------------


@dataclass(frozen=True)
class Sample:
    """One sample of a trial, for display and recording.

    Attributes
    ----------
    time : float
        [s].
    tip, desired, goal, force : numpy.ndarray
        (3,) end-effector, desired position and goal [m], force on the hand [N], base frame.
    stiffness, magnitude : float
        Of the assistance [N/m, N].
    motion, phase : str
        States of Fig. 5 and Fig. 4.
    item : int
        Item held, -1 for none.
    items : numpy.ndarray
        (n, 3) centres of the items [m].
    done : bool
        The last item has been placed.
    held_command : bool
        The command was not a number; the last good one was used.
    """

    time: float
    tip: NDArray[np.float64]
    desired: NDArray[np.float64]
    goal: NDArray[np.float64]
    force: NDArray[np.float64]
    stiffness: float
    magnitude: float
    motion: str
    phase: str
    item: int
    items: NDArray[np.float64]
    done: bool
    held_command: bool


class Trial:
    """The task under one paradigm, driven by commands from outside, one per 10 ms.

    Parameters
    ----------
    settings : TaskSettings
    rng : numpy.random.Generator
        For the real arm's tracker and gripper; the simulated ones draw nothing.

    Raises
    ------
    ValueError
        If the settings are out of bounds or a goal is out of reach.

    Examples
    --------
    >>> trial = Trial(TaskSettings(PARADIGMS["mostly_autonomous"]), np.random.default_rng(1))
    >>> for _ in range(500):
    ...     sample = trial.step((0.0, 0.0, 0.1), gripper_closed=False)
    >>> sample.phase, bool(np.linalg.norm(sample.tip - sample.goal) < 0.01)
    ('grasping', True)
    """

    def __init__(self, settings: TaskSettings, rng: np.random.Generator) -> None:
        self.settings = settings
        self.rng = rng
        self.rule = settings.rule()
        self.state, self.memory = task_start(self.rule, settings.scene.start)
        self.command: Vector = settings.scene.start

    def step(self, command: ArrayLike, gripper_closed: bool, confirm: bool | None = None) -> Sample:
        """Advance by one sample.

        Parameters
        ----------
        command : array_like
            (3,) position commanded by the device, base frame [m]. A sample that is not finite is replaced by
            the last good one, and the result says so.
        gripper_closed : bool
            The gripper's button is held.
        confirm : bool, optional
            The operator reports an item in the gripper (real arm only); left out, the truth is reported.

        Returns
        -------
        Sample

        Raises
        ------
        ValueError
            If the command has not three components.
        """
        given = numbers("command", command, (3,))
        good = bool(np.all(np.isfinite(given)))
        if good:
            self.command = vector("command", given)
        holding = self.state.gripper.item != arm.NOTHING
        confirmed = holding if confirm is None else bool(confirm)
        self.state = task_step(
            self.rule, self.state, self.memory, self.command, bool(gripper_closed), confirmed, self.rng
        )
        state = self.state
        stiffness = {AS_NEEDED: state.assist.stiffness, FIXED: self.rule.fixed.stiffness}
        return Sample(
            time=SAMPLE_TIME * state.sample,
            tip=np.array(state.plant.tip),
            desired=np.array(state.desired),
            goal=np.array(state.goal.goal),
            force=np.array(state.force),
            stiffness=stiffness.get(self.rule.assistance, 0.0),
            magnitude=state.magnitude,
            motion=aan.MOTIONS[state.assist.motion],
            phase=goal_selection.PHASES[state.goal.phase],
            item=state.gripper.item,
            items=self.memory.items.copy(),
            done=self.done,
            held_command=not good,
        )

    @property
    def done(self) -> bool:
        """Whether the last item has been placed."""
        return delivered(self.rule, self.state)
