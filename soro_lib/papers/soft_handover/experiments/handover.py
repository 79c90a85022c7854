"""One handover, and experiments 1 to 3 of the thesis (Vervloet, Sections 3.5 and 4).

A run looks, decides and moves, step by step, until the gripper closes or the arm gives up. Success is judged
by the true ball in the true gripper, never by what the filters believe. Frame `arm_base`, z down.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.random import Generator

from soro_lib.controllers.handover import UP, HandoverCommand, HandoverController, HandoverParameters, Mode
from soro_lib.controllers.virtual_stiffness import VirtualStiffnessController
from soro_lib.papers.soft_handover.world.observer import NO_NOISE, NoisyObserver, Observer
from soro_lib.papers.soft_handover.world.plant import Array, Gripper, HelixPlant, HoldingHand
from soro_lib.robots.helix import HelixArm
from soro_lib.robots.helix_kernels import tip_points

STEP_SIZES = (0.1, 0.2, 0.4)
"""alpha in the text, Table 1 and Figs. 7-8; Appendices A and B say 0.3 for the last (Erratum SH-18)."""

HEADINGS = {"front": 90.0, "front-left": 135.0, "left": 180.0, "back-left": 225.0}
"""Direction of the ball about z from +x [deg], seen from the cameras, which stand at +y (Section 3.5.1)."""

CALIBRATED_GRIPPER = HelixArm().tip_points(HelixArm().home)[3:]
"""Gripper point of the calibrated arm (3,) [m]."""

OPENINGS_MM = (20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0, 60.0)
"""Distances from the gripper point within which a ball may be caught [mm]."""


def beside_the_gripper(heading: float, lateral: float, height: float) -> Array:
    """Return the point (3,) [m] in a direction [deg] from the calibrated gripper, sideways and up [m]."""
    angle = np.deg2rad(heading)
    return CALIBRATED_GRIPPER + (lateral * np.array([np.cos(angle), np.sin(angle), 0.0]) + height * UP)


@dataclass(frozen=True)
class BallHolder:
    """The human who holds the ball; where is not printed but for the four directions.

    Attributes
    ----------
    lateral, height : float
        From the calibrated gripper point to the ball, sideways and up [m].
    headings : mapping of str to float
        Directions of the ball [deg].
    placement_deviation : float
        Standard deviation of where the hand holds the ball, per axis and run [m].
    sway : float
        Standard deviation of the hand while it holds still, per axis [m].
    sway_memory : float
        Correlation of the sway from step to step [-].
    """

    lateral: float = 0.15
    height: float = 0.06
    headings: Mapping[str, float] = field(default_factory=HEADINGS.copy)
    placement_deviation: float = 0.010
    sway: float = 0.002
    sway_memory: float = 0.5

    def ball(self, location: str, rng: Generator) -> Array:
        """Return where the hand holds the ball (3,) [m]."""
        place = beside_the_gripper(self.headings[location], self.lateral, self.height)
        return place + self.placement_deviation * rng.standard_normal(3)

    def sways(self, rng: Generator) -> Iterator[Array]:
        """Yield where the hand has swayed to (3,) [m], look by look."""
        sway = np.zeros(3)
        fresh = self.sway * np.sqrt(1 - self.sway_memory**2)
        while True:
            sway = self.sway_memory * sway + fresh * rng.standard_normal(3)
            yield sway


HOLDER = BallHolder()
"""The human of all experiments."""

STILL = BallHolder(placement_deviation=0.0, sway=0.0)
"""One who holds the ball exactly and still."""


@dataclass(frozen=True)
class HandoverRun:
    """What happened in one run.

    Attributes
    ----------
    steps : int
        Steps until the gripper closed, or all of them.
    mode : Mode
        Last mode: GRASP if the gripper closed.
    reason : str
        Why the arm gave up, or "".
    success : bool
        Whether the true ball was in the true gripper when it closed.
    lateral_overshoot : float
        Farthest that the true gripper went past the ball, sideways [m].
    state, ball : ndarray
        True state (9,) and true ball (3,) at the end.
    states, commands, estimates : ndarray, shape (steps + 1, 9)
        True, commanded and estimated state at every look; NaN where nothing was estimated.
    tendon_changes : ndarray, shape (steps + 1, 9)
        What the motors were told [m].
    trace : dict of str to ndarray
        One entry per step. ``error_mm``, to the goal, six numbers together; for the gripper point,
        ``measured_mm``, ``commanded_mm`` (``q_sys``), ``estimated_mm`` (``q_est``) and ``true_mm`` from the
        calibrated place, ``commanded_gap_mm`` and ``estimated_gap_mm`` from the measured one, ``miss_mm``
        from the true ball; ``estimate_residual_mm`` of the state optimisation, six numbers together;
        ``descending``, 1 in the second stage.
    """

    steps: int
    mode: Mode
    reason: str
    success: bool
    lateral_overshoot: float
    state: Array
    ball: Array
    states: Array
    commands: Array
    estimates: Array
    tendon_changes: Array
    trace: dict[str, Array]


Guide = Callable[[int, Array, Array], HoldingHand | None]
"""A human's hand on the arm: from step, true gripper (3,) and ball (3,) to the pull."""


def run_handover(
    controller: HandoverController,
    plant: HelixPlant,
    observer: Observer,
    ball: Array,
    rng: Generator,
    *,
    holder: BallHolder = HOLDER,
    guide: Guide | None = None,
    step_limit: int = 300,
) -> HandoverRun:
    """Run one handover from the calibrated arm to the closed gripper (Vervloet, Algorithm 3).

    Parameters
    ----------
    controller, plant, observer
        Are reset first.
    ball : ndarray, shape (3,)
        Where the hand holds the ball [m].
    rng : numpy.random.Generator
    holder : BallHolder, optional
        Whose hand sways.
    guide : callable, optional
        A human who pulls the arm.
    step_limit : int
    """
    for part in (controller, plant, observer):
        part.reset()
    arm, motors = controller.arm, controller.parameters.motors
    sways = holder.sways(rng)
    state = plant.settle(motors.pull(np.zeros(9)))
    looks = []
    for step in range(step_limit):
        held_ball = ball + next(sways)
        command = controller.update(observer.observe(state, held_ball, rng))
        looks.append((state, held_ball, command))
        if command.mode in (Mode.GRASP, Mode.STOPPED):
            break
        hand = guide(step, tip_points(state, arm.gripper_length)[3:], held_ball) if guide else None
        state = plant.settle(motors.pull(command.tendon_change), hand)
    states, balls, commands = zip(*looks)
    return judged(np.array(states), np.array(balls), commands, arm)


def still_handover(
    parameters: HandoverParameters,
    plant: HelixPlant,
    location: str,
    step_limit: int,
    holder: BallHolder = STILL,
) -> HandoverRun:
    """Run one handover from a human who holds still, through eyes that see the truth."""
    rng = np.random.default_rng(0)
    controller, eyes = HandoverController(parameters), NoisyObserver(NO_NOISE)
    ball = holder.ball(location, rng)
    return run_handover(controller, plant, eyes, ball, rng, holder=holder, step_limit=step_limit)


def judged(states: Array, balls: Array, commands: Sequence[HandoverCommand], arm: HelixArm) -> HandoverRun:
    """Return what a run came to from the true states (n, 9), the true balls (n, 3) [m] and the commands that
    followed: success is the true ball in the true gripper."""
    unknown = np.full(9, np.nan)
    q_sys = np.array([command.q_sys for command in commands])
    q_est = np.array([unknown if command.q_est is None else command.q_est for command in commands])
    measured = np.array([command.measured_points[3:] for command in commands])
    true, commanded = arm.tip_points(states)[:, 3:], arm.tip_points(q_sys)[:, 3:]
    estimated = np.where(np.isnan(q_est[:, :3]), np.nan, arm.tip_points(np.nan_to_num(q_est))[:, 3:])

    def apart(first: Array, second: Array) -> Array:
        return 1e3 * np.linalg.norm(first - second, axis=1)

    trace = {
        "error_mm": 1e3 * np.array([command.error for command in commands]),
        "measured_mm": apart(measured, CALIBRATED_GRIPPER),
        "commanded_mm": apart(commanded, CALIBRATED_GRIPPER),
        "commanded_gap_mm": apart(commanded, measured),
        "estimated_mm": apart(estimated, CALIBRATED_GRIPPER),
        "estimated_gap_mm": apart(estimated, measured),
        "estimate_residual_mm": 1e3 * np.array([command.estimate_residual for command in commands]),
        "miss_mm": apart(true, balls),
        "true_mm": apart(true, CALIBRATED_GRIPPER),
        "descending": np.array([c.mode in (Mode.DESCEND, Mode.GRASP) for c in commands], dtype=float),
    }
    last = commands[-1]
    away = (balls[0] - CALIBRATED_GRIPPER)[:2]
    away /= np.linalg.norm(away)
    return HandoverRun(
        steps=len(commands) - 1,
        mode=last.mode,
        reason=last.reason,
        success=last.mode is Mode.GRASP and Gripper().holds(arm.tip_points(states[-1]), balls[-1]),
        lateral_overshoot=float(((true - balls)[:, :2] @ away).max()),
        state=states[-1],
        ball=balls[-1],
        states=states,
        commands=q_sys,
        estimates=q_est,
        tendon_changes=np.array([command.tendon_change for command in commands]),
        trace=trace,
    )


@dataclass(frozen=True)
class Blocks:
    """The thesis's blocks of eight runs, four locations twice (Vervloet, Section 3.5.1).

    Attributes
    ----------
    observer : Observer
        The eyes of all runs.
    repetitions : int
        Number of blocks.
    seed : int
        The runs of one seed are the same whatever else runs.
    """

    observer: Observer
    repetitions: int
    seed: int

    def draw(self, holder: BallHolder = HOLDER) -> Iterator[tuple[dict[str, object], Array, Generator]]:
        """Yield block, number and location of every run, where the ball is (3,) [m], and the random
        numbers."""
        places = [location for location in holder.headings for _ in range(2)]
        sequences = np.random.SeedSequence(self.seed).spawn(self.repetitions * len(places))
        for number, rng in enumerate(map(np.random.default_rng, sequences)):
            block, run = divmod(number, len(places))
            yield {"block": block, "run": run, "location": places[run]}, holder.ball(places[run], rng), rng


def handovers(
    parameters: HandoverParameters,
    plant: HelixPlant,
    blocks: Blocks,
    /,
    *,
    guide: Guide | None = None,
    step_limit: int = 300,
    **labels: object,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Run blocks of eight handovers.

    Parameters
    ----------
    parameters, plant
        The controller's settings, and the arm.
    blocks : Blocks
    guide, step_limit
        As in :func:`run_handover`.
    **labels
        Columns to carry in both tables (``alpha=0.1, plant="K"``).

    Returns
    -------
    runs : DataFrame
        One row per run: labels, block, run, location, steps, closed, success, miss_mm, overshoot_mm, reason.
    traces : DataFrame
        One row per step: labels, block, run, step and what :class:`HandoverRun` traces.
    """
    controller = HandoverController(parameters)
    options: dict[str, Any] = {"guide": guide, "step_limit": step_limit}
    runs, traces = [], []
    for trial, ball, rng in blocks.draw():
        result = run_handover(controller, plant, blocks.observer, ball, rng, **options)
        outcome = {
            "steps": result.steps,
            "closed": result.mode is Mode.GRASP,
            "success": result.success,
            "miss_mm": result.trace["miss_mm"][-1],
            "overshoot_mm": 1e3 * result.lateral_overshoot,
            "reason": result.reason,
        }
        runs.append({**labels, **trial, **outcome})
        number = {"block": trial["block"], "run": trial["run"], "step": np.arange(result.steps + 1)}
        traces.append(pd.DataFrame({**labels, **number, **result.trace}))
    return pd.DataFrame(runs), pd.concat(traces, ignore_index=True)


def thesis_parameters(step_size: float = 0.1, **control: object) -> HandoverParameters:
    """Return the thesis's settings for a step size; further arguments go to `VirtualStiffnessController`."""
    return HandoverParameters(control=VirtualStiffnessController(step_size=step_size, **control))  # type: ignore[arg-type]


Settings = Sequence[tuple[dict[str, Any], HandoverParameters]]
"""What is compared: the controller's settings, each with its labels."""


def compare(
    settings: Settings, plants: Mapping[str, HelixPlant], blocks: Blocks, /, **options: Any
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return runs and traces of :func:`handovers` on every plant under all settings.

    The balls, the noise and the hands are the same under all; `options` go to :func:`handovers`.
    """
    tables = [
        handovers(parameters, plant, blocks, plant=name, **options, **labels)
        for name, plant in plants.items()
        for labels, parameters in settings
    ]
    runs, traces = (pd.concat(parts, ignore_index=True) for parts in zip(*tables))
    return runs, traces


def by_step_size(step_sizes: Sequence[float]) -> Settings:
    """Return the settings of experiment 1 and, with a guide, of experiment 2."""
    return [({"alpha": step_size}, thesis_parameters(step_size)) for step_size in step_sizes]


def block_times(runs: pd.DataFrame, timestep: Mapping[float, float]) -> pd.DataFrame:
    """Return the statistics of Table 1 for every block of eight runs.

    Parameters
    ----------
    runs : DataFrame
        Of experiment 1.
    timestep : mapping of float to float
        Duration of a step [s] by step size: the thesis's, a declared input.

    Returns
    -------
    DataFrame
        plant, alpha, block, min_s, median_s, max_s, mean_s, sd_s, successes.
    """
    timed = runs.assign(time_s=runs["steps"] * runs["alpha"].map(dict(timestep)))
    groups = timed.groupby(["plant", "alpha", "block"], sort=False)
    times = groups["time_s"].agg(["min", "median", "max", "mean", "std"]).rename(columns={"std": "sd"})
    return times.add_suffix("_s").assign(successes=groups["success"].sum()).reset_index()


def success_over_opening(runs: pd.DataFrame) -> pd.DataFrame:
    """Return the success rate for grippers that catch a ball within each of `OPENINGS_MM`.

    The thesis does not print the opening of its gripper; its threshold lets the arm stop 35 mm away.
    """
    table = runs.merge(pd.DataFrame({"opening_mm": OPENINGS_MM}), how="cross")
    table["success"] = table["closed"] & (table["miss_mm"] <= table["opening_mm"])
    return table.groupby(["plant", "alpha", "opening_mm"], sort=False)["success"].mean().reset_index()
