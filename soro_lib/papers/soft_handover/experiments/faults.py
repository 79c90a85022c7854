"""What the arm does when something is wrong: eleven faults at three severities.

Each fault wraps the eyes, the motors, the plant or the ball. The stated rule is that of
:class:`soro_lib.controllers.handover.SafetyRules`: hold what cannot be trusted, go home if it lasts. Counted
are handovers, safe stops (home, gripper open), grasps beside the ball, and runs out of time, and whether
every command stayed within the limits of arm and motors.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from soro_lib.controllers.handover import HandoverCommand, HandoverController, HandoverParameters, Mode
from soro_lib.controllers.virtual_stiffness import within_limits
from soro_lib.papers.soft_handover.experiments.handover import Guide, Scene, run_handover
from soro_lib.papers.soft_handover.world.observer import Observer
from soro_lib.papers.soft_handover.world.plant import Hand, HelixPlant
from soro_lib.poses import magnitude
from soro_lib.robots.helix_motors import TendonMotors
from soro_lib.sensing.handover_observation import HandoverObservation

ONSET = 2
"""Step at which a fault sets in."""

Change = Callable[[HandoverObservation, int, np.random.Generator], HandoverObservation]
"""What a fault makes of a look, given the step."""


@dataclass
class FaultyObserver:
    """Eyes whose looks are changed by a fault.

    Parameters
    ----------
    observer : Observer
    change : callable
    """

    observer: Observer
    change: Change

    def reset(self) -> None:
        """Start again."""
        self.observer.reset()
        self.step = -1

    def observe(
        self, state: NDArray[np.float64], ball: NDArray[np.float64], rng: np.random.Generator
    ) -> HandoverObservation:
        """Return what is seen, spoilt."""
        self.step += 1
        return self.change(self.observer.observe(state, ball, rng), self.step, rng)


@dataclass
class CheckedController(HandoverController):
    """A handover controller that counts commands outside the limits of arm and motors."""

    parameters: HandoverParameters
    violations: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        super().__init__(self.parameters)

    def update(self, observation: HandoverObservation) -> HandoverCommand:
        """Return the command, and count it if it is outside the limits or not finite."""
        command = super().update(observation)
        motors = self.parameters.motors
        inside = (
            np.isfinite(command.tendon_change).all()
            and np.all(command.tendon_change >= motors.shortest)
            and np.all(command.tendon_change <= motors.longest)
            and within_limits(command.q_sys, self.arm)
        )
        self.violations += not inside
        return command


@dataclass(frozen=True)
class Fault:
    """One fault at one severity.

    Attributes
    ----------
    name, severity : str
        "lost ball", "10 steps".
    change : callable, optional
        What it does to a look.
    scene : Scene, optional
        Where the ball is instead.
    motors : TendonMotors, optional
        Which motors the arm has instead.
    guide : callable, optional
        A hand that disturbs the arm.
    """

    name: str
    severity: str
    change: Change = lambda look, step, rng: look
    scene: Scene = field(default_factory=Scene)
    motors: TendonMotors = field(default_factory=TendonMotors)
    guide: Guide | None = None


def hidden_ring(share: float) -> Change:
    """Hide the marker ring in a share of the looks."""

    def change(look: HandoverObservation, step: int, rng: np.random.Generator) -> HandoverObservation:
        hidden = rng.random() < share and step >= ONSET
        return replace(look, wrist=None, direction=None) if hidden else look

    return change


def lost_ball(steps: int) -> Change:
    """Hide the ball for a number of steps."""

    def change(look: HandoverObservation, step: int, rng: np.random.Generator) -> HandoverObservation:
        return replace(look, ball=None) if ONSET <= step < ONSET + steps else look

    return change


def frozen_cameras(steps: int) -> Change:
    """Repeat one look for a number of steps."""
    kept: list[HandoverObservation] = []

    def change(look: HandoverObservation, step: int, rng: np.random.Generator) -> HandoverObservation:
        if step == ONSET:
            kept[:] = [look]
        return kept[0] if ONSET <= step < ONSET + steps else look

    return change


def swapped_cameras(share: float) -> Change:
    """Take the left image for the right one in a share of the looks: left and right change sides, rays miss
    each other."""
    mirror = np.array([-1.0, 1.0, 1.0])

    def change(look: HandoverObservation, step: int, rng: np.random.Generator) -> HandoverObservation:
        if rng.random() >= share or step < ONSET or look.wrist is None or look.ball is None:
            return look
        direction = None if look.direction is None else mirror * look.direction
        return replace(
            look, wrist=mirror * look.wrist, direction=direction, ball=mirror * look.ball, disagreement=0.1
        )

    return change


def wrong_calibration(offset: float) -> Change:
    """See ring and ball apart from each other: the ball farther from the cameras, the ring nearer [m]."""
    depth = np.array([0.0, offset / 2, 0.0])

    def change(look: HandoverObservation, step: int, rng: np.random.Generator) -> HandoverObservation:
        if look.wrist is None or look.ball is None:
            return look
        return replace(look, wrist=look.wrist + depth, ball=look.ball - depth)

    return change


def not_a_number(share: float) -> Change:
    """Return NaN in a share of the looks."""
    nothing = np.full(3, np.nan)

    def change(look: HandoverObservation, step: int, rng: np.random.Generator) -> HandoverObservation:
        spoilt = rng.random() < share and step >= ONSET
        return replace(look, wrist=nothing, direction=nothing, ball=nothing) if spoilt else look

    return change


def flipped_markers(share: float) -> Change:
    """Turn the gripper's direction by 60 degrees and throw the wrist 8 cm off in a share of the looks."""

    def change(look: HandoverObservation, step: int, rng: np.random.Generator) -> HandoverObservation:
        if rng.random() >= share or step < ONSET or look.wrist is None or look.direction is None:
            return look
        aside = rng.standard_normal(3)
        aside -= np.sum(aside * look.direction) * look.direction
        aside /= magnitude(aside)
        direction = np.cos(np.pi / 3) * look.direction + np.sin(np.pi / 3) * aside
        return replace(look, direction=direction, wrist=look.wrist + 0.08 * aside)

    return change


def second_ball(share: float) -> Change:
    """Take another green thing, 30 cm aside, for the ball in a share of the looks."""
    aside = np.array([0.30, 0.0, 0.0])

    def change(look: HandoverObservation, step: int, rng: np.random.Generator) -> HandoverObservation:
        mistaken = rng.random() < share and step >= ONSET
        return replace(look, ball=look.ball + aside) if mistaken and look.ball is not None else look

    return change


def noise_times(factor: float) -> Change:
    """Add noise of a multiple of what the look claims."""

    def change(look: HandoverObservation, step: int, rng: np.random.Generator) -> HandoverObservation:
        if look.wrist is None or look.direction is None or look.ball is None:
            return look
        extra = factor * rng.standard_normal((3, 3))
        direction = look.direction + look.direction_deviation * extra[1]
        return replace(
            look,
            wrist=look.wrist + look.wrist_deviation * extra[0],
            direction=direction / magnitude(direction),
            ball=look.ball + look.ball_deviation * extra[2],
        )

    return change


def pushed_away(distance: float, gripper_length: float = 0.10) -> Guide:
    """Hold the arm a distance [m] away from the ball for ten steps."""

    def guide(step: int, gripper: NDArray[np.float64], ball: NDArray[np.float64]) -> Hand | None:
        if not ONSET <= step < ONSET + 10:
            return None
        away = (gripper - ball) * np.array([1.0, 1.0, 0.0])
        place = ball + np.array([0.0, 0.0, -0.05]) + distance * away / max(magnitude(away), 1e-6)
        return Hand(np.concatenate([place - np.array([0, 0, gripper_length]), place]))

    return guide


def all_faults() -> list[Fault]:
    """Return every fault at mild, middle and severe strength, after no fault at all."""
    ranges = {s: TendonMotors(shortest=(-s,) * 9, longest=(s,) * 9) for s in (0.08, 0.05, 0.02)}
    return [
        Fault("none", "-"),
        *(Fault("ring hidden", f"{100 * s:.0f} %", hidden_ring(s)) for s in (0.3, 0.6, 1.0)),
        *(Fault("ball lost", f"{n} steps", lost_ball(n)) for n in (3, 12, 300)),
        *(Fault("cameras frozen", f"{n} steps", frozen_cameras(n)) for n in (3, 12, 300)),
        *(Fault("cameras swapped", f"{100 * s:.0f} %", swapped_cameras(s)) for s in (0.1, 0.4, 1.0)),
        *(Fault("calibration off", f"{1e3 * s:.0f} mm", wrong_calibration(s)) for s in (0.01, 0.03, 0.1)),
        *(Fault("NaN", f"{100 * s:.0f} %", not_a_number(s)) for s in (0.1, 0.5, 1.0)),
        *(Fault("markers flipped", f"{100 * s:.0f} %", flipped_markers(s)) for s in (0.05, 0.2, 0.6)),
        *(Fault("second ball", f"{100 * s:.0f} %", second_ball(s)) for s in (0.05, 0.3, 1.0)),
        *(Fault("noise", f"x {s + 1:.0f}", noise_times(s)) for s in (1.0, 3.0, 7.0)),
        *(
            Fault("ball out of reach", f"{100 * s:.0f} cm", scene=Scene(lateral=s))
            for s in (0.25, 0.40, 0.80)
        ),
        *(Fault("motor range", f"{1e3 * s:.0f} mm", motors=m) for s, m in ranges.items()),
        *(Fault("arm pushed", f"{100 * s:.0f} cm", guide=pushed_away(s)) for s in (0.05, 0.15, 0.25)),
    ]


def run_faults(
    parameters: HandoverParameters,
    plant: HelixPlant,
    observer: Observer,
    repetitions: int,
    seed: int,
    /,
    *,
    faults: Sequence[Fault] | None = None,
    step_limit: int = 120,
    **labels: object,
) -> pd.DataFrame:
    """Return one row per run: labels, fault, severity, outcome, steps, miss_mm, violations, reason.

    `outcome` is "handover", "safe stop", "beside the ball" or "out of time".
    """
    rows = []
    for fault in faults or all_faults():
        controller = CheckedController(replace(parameters, motors=fault.motors))
        calibrated = controller.arm.tip_points(controller.arm.home)[3:]
        eyes = FaultyObserver(observer, fault.change)
        places = [place for place in fault.scene.headings for _ in range(2)] * repetitions
        for place, sequence in zip(places, np.random.SeedSequence(seed).spawn(len(places))):
            rng = np.random.default_rng(sequence)
            ball = fault.scene.ball(place, calibrated, rng)
            controller.violations = 0
            run = run_handover(
                controller,
                plant,
                eyes,
                ball,
                rng,
                scene=fault.scene,
                guide=fault.guide,
                step_limit=step_limit,
            )
            rows.append(
                {
                    **labels,
                    "fault": fault.name,
                    "severity": fault.severity,
                    "outcome": outcome(run.mode, run.success),
                    "steps": run.steps,
                    "miss_mm": 1e3 * run.miss,
                    "violations": controller.violations,
                    "reason": run.reason,
                }
            )
    return pd.DataFrame(rows)


def outcome(mode: Mode, success: bool) -> str:
    """Return what a run came to."""
    if success:
        return "handover"
    if mode is Mode.GRASP:
        return "beside the ball"
    return "safe stop" if mode is Mode.STOPPED else "out of time"
