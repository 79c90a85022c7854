"""Experiment 3: take the ball, carry it to a bowl, drop it (Vervloet, Sections 3.5.3 and 4.4)."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from soro_lib.controllers.handover import UP, HandoverController, HandoverParameters, Mode
from soro_lib.papers.soft_handover.experiments.handover import HandoverRun, Scene, run_handover
from soro_lib.papers.soft_handover.world.observer import Observer
from soro_lib.papers.soft_handover.world.plant import HelixPlant


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

    def release_point(self, gripper: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the gripper point (3,) [m] over the bowl, given the calibrated one."""
        heading = np.deg2rad(self.heading)
        return gripper + self.lateral * np.array([np.cos(heading), np.sin(heading), 0.0]) + self.height * UP

    def catches(self, ball: NDArray[np.float64], gripper: NDArray[np.float64]) -> bool:
        """Return whether a ball (3,) let go falls in, given the calibrated gripper point."""
        aside = (ball - self.release_point(gripper))[:2]
        return bool(np.linalg.norm(aside) <= self.radius - self.ball_radius)


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
    states: NDArray[np.float64]
    commands: NDArray[np.float64]


def carry_and_drop(
    controller: HandoverController,
    plant: HelixPlant,
    observer: Observer,
    bowl: Bowl,
    handover: HandoverRun,
    rng: np.random.Generator,
    step_limit: int = 300,
) -> Carry:
    """Carry a ball that was taken to the bowl and let it go there."""
    arm = controller.arm
    motors = controller.parameters.motors
    calibrated = arm.tip_points(arm.home)[3:]
    in_gripper = handover.ball - arm.tip_points(handover.state)[3:]
    controller.carry_to(bowl.release_point(calibrated))
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
    miss = float(np.linalg.norm((ball - bowl.release_point(calibrated))[:2]))
    dropped = command.mode is Mode.RELEASE and bowl.catches(ball, calibrated)
    return Carry(dropped, len(states) - 1, miss, np.array(states), np.array(commands))


def use_cases(
    parameters: HandoverParameters,
    plant: HelixPlant,
    observer: Observer,
    repetitions: int,
    seed: int,
    /,
    *,
    scene: Scene | None = None,
    bowl: Bowl | None = None,
    **labels: object,
) -> pd.DataFrame:
    """Repeat the thesis's eight runs of the use case.

    Returns
    -------
    DataFrame
        One row per run: labels, block, run, location, taken, dropped, handover_steps, carry_steps,
        bowl_miss_mm.
    """
    scene, bowl = scene or Scene(), bowl or Bowl()
    controller = HandoverController(parameters)
    calibrated = controller.arm.tip_points(controller.arm.home)[3:]
    places = [location for location in scene.headings for _ in range(2)]
    rows = []
    for number, sequence in enumerate(np.random.SeedSequence(seed).spawn(repetitions * len(places))):
        rng = np.random.default_rng(sequence)
        block, run = divmod(number, len(places))
        ball = scene.ball(places[run], calibrated, rng)
        handover = run_handover(controller, plant, observer, ball, rng, scene=scene)
        carry = None
        if handover.success:
            carry = carry_and_drop(controller, plant, observer, bowl, handover, rng)
        rows.append(
            {
                **labels,
                "block": block,
                "run": run,
                "location": places[run],
                "taken": handover.success,
                "dropped": carry is not None and carry.dropped,
                "handover_steps": handover.steps,
                "carry_steps": carry.steps if carry else 0,
                "bowl_miss_mm": 1e3 * carry.miss if carry else np.nan,
            }
        )
    return pd.DataFrame(rows)
