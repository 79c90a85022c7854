"""Experiment 3: take the ball, carry it to a bowl, drop it (Vervloet, Sections 3.5.3 and 4.4)."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.random import Generator

from soro_lib.controllers.handover import HandoverController, HandoverParameters, Mode
from soro_lib.papers.soft_handover.experiments import handover
from soro_lib.papers.soft_handover.world.observer import Observer
from soro_lib.papers.soft_handover.world.plant import Array, HelixPlant


@dataclass(frozen=True)
class Bowl:
    """Where the bowl stands; the thesis says only that its place was fixed.

    Attributes
    ----------
    heading : float
        Direction from the hanging gripper about z [deg].
    lateral, height : float
        From the hanging gripper to the point above the bowl where the ball is let go [m].
    radius : float
        Of the opening [m].
    ball_radius, ball_mass : float
        Of the ball [m, kg].
    """

    heading: float = 0.0
    lateral: float = 0.15
    height: float = 0.06
    radius: float = 0.08
    ball_radius: float = 0.02
    ball_mass: float = 0.03

    @property
    def release_point(self) -> Array:
        """Gripper point (3,) [m] over the bowl."""
        return handover.beside_the_gripper(self.heading, self.lateral, self.height)

    def off_centre(self, ball: Array) -> float:
        """Return the horizontal distance of a ball (3,) from the middle of the bowl [m]."""
        return float(np.linalg.norm((ball - self.release_point)[:2]))

    def catches(self, ball: Array) -> bool:
        """Return whether a ball (3,) let go falls in."""
        return self.off_centre(ball) <= self.radius - self.ball_radius


@dataclass(frozen=True)
class Carry:
    """What became of a ball that was taken.

    Attributes
    ----------
    dropped : bool
        Whether the true ball fell into the true bowl.
    steps : int
    miss : float
        Horizontal distance from the ball to the middle of the bowl when it was let go [m].
    states, commands : ndarray, shape (steps + 1, 9)
        True and commanded state at every look.
    """

    dropped: bool
    steps: int
    miss: float
    states: Array
    commands: Array


def carry_and_drop(
    controller: HandoverController,
    plant: HelixPlant,
    observer: Observer,
    bowl: Bowl,
    taken: handover.HandoverRun,
    rng: Generator,
    step_limit: int = 300,
) -> Carry:
    """Carry a ball that was taken to the bowl and let it go there."""
    arm = controller.arm
    motors = controller.parameters.motors
    in_gripper = taken.ball - arm.tip_points(taken.state)[3:]
    controller.carry_to(bowl.release_point)
    plant.carry(bowl.ball_mass)
    state = plant.settle(motors.pull(arm.tendon_lengths(controller.q_sys) - arm.tendon_lengths(arm.home)))
    states, commands = [state], [controller.q_sys]
    while len(states) <= step_limit:
        ball = arm.tip_points(state)[3:] + in_gripper
        command = controller.update(observer.observe(state, ball, rng))
        if command.mode in (Mode.RELEASE, Mode.STOPPED):
            break
        state = plant.settle(motors.pull(command.tendon_change))
        states.append(state)
        commands.append(command.q_sys)
    dropped = command.mode is Mode.RELEASE and bowl.catches(ball)
    return Carry(dropped, len(states) - 1, bowl.off_centre(ball), np.array(states), np.array(commands))


def use_cases(
    parameters: HandoverParameters, plant: HelixPlant, blocks: handover.Blocks, /, **labels: object
) -> pd.DataFrame:
    """Repeat the thesis's eight runs of the use case.

    Returns
    -------
    DataFrame
        One row per run: labels, block, run, location, taken, dropped, handover_steps, carry_steps,
        bowl_miss_mm.
    """
    controller = HandoverController(parameters)
    rows = []
    for trial, ball, rng in blocks.draw():
        run = handover.run_handover(controller, plant, blocks.observer, ball, rng)
        row = {**labels, **trial, "taken": run.success, "dropped": False}
        row |= {"handover_steps": run.steps, "carry_steps": 0, "bowl_miss_mm": np.nan}
        if run.success:
            carry = carry_and_drop(controller, plant, blocks.observer, Bowl(), run, rng)
            row |= {"dropped": carry.dropped, "carry_steps": carry.steps, "bowl_miss_mm": 1e3 * carry.miss}
        rows.append(row)
    return pd.DataFrame(rows)
