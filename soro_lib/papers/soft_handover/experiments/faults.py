"""What the arm does when something is wrong: eleven faults at three severities.

Each fault wraps the eyes, the motors, the plant or the ball. The stated rule is that of
:class:`soro_lib.controllers.handover.SafetyRules`: hold what cannot be trusted, go home if it lasts. Counted
are handovers, safe stops (home, gripper open), grasps beside the ball, and runs out of time, and whether
every command stayed within the limits of arm and motors.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.random import Generator

from soro_lib.controllers.handover import UP, HandoverController, HandoverParameters, Mode, goal_over
from soro_lib.controllers.virtual_stiffness import within_limits
from soro_lib.papers.soft_handover.experiments import handover
from soro_lib.papers.soft_handover.experiments.handover import BallHolder
from soro_lib.papers.soft_handover.world.observer import Observer
from soro_lib.papers.soft_handover.world.plant import Array, HelixPlant, HoldingHand
from soro_lib.poses import magnitude
from soro_lib.robots.helix_motors import TendonMotors
from soro_lib.sensing.handover_observation import HandoverObservation

ONSET = 2
"""Step at which a fault sets in."""

Change = Callable[[HandoverObservation, int, Generator], HandoverObservation]
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

    def observe(self, state: Array, ball: Array, rng: Generator) -> HandoverObservation:
        """Return what is seen, spoilt."""
        self.step += 1
        return self.change(self.observer.observe(state, ball, rng), self.step, rng)


@dataclass(frozen=True)
class Fault:
    """One fault at one severity.

    Attributes
    ----------
    name, severity : str
        "lost ball", "10 steps".
    change : callable, optional
        What it does to a look.
    holder : BallHolder, optional
        Who holds the ball instead.
    motors : TendonMotors, optional
        Which motors the arm has instead.
    guide : callable, optional
        A hand that disturbs the arm.
    """

    name: str
    severity: str
    change: Change = lambda look, step, rng: look
    holder: BallHolder = handover.HOLDER
    motors: TendonMotors = field(default_factory=TendonMotors)
    guide: handover.Guide | None = None


Distortion = Callable[[HandoverObservation, Generator], HandoverObservation]
"""What a fault makes of a look in which arm and ball were seen."""


def always(distort: Distortion) -> Change:
    """Distortion every look."""
    return lambda look, step, rng: distort(look, rng) if saw_all(look) else look


def sometimes(share: float, distort: Distortion) -> Change:
    """Distortion a share of the looks."""

    def change(look: HandoverObservation, step: int, rng: Generator) -> HandoverObservation:
        spoilt = rng.random() < share and step >= ONSET and saw_all(look)
        return distort(look, rng) if spoilt else look

    return change


def saw_all(look: HandoverObservation) -> bool:
    """Return whether arm and ball were seen."""
    return look.wrist is not None and look.direction is not None and look.ball is not None


def hidden_ring(look: HandoverObservation, rng: Generator) -> HandoverObservation:
    """Hide the marker ring."""
    return replace(look, wrist=None, direction=None)


def lost_ball(steps: int) -> Change:
    """Hide the ball for a number of steps."""
    return lambda look, step, rng: replace(look, ball=None) if ONSET <= step < ONSET + steps else look


def frozen_cameras(steps: int) -> Change:
    """Repeat one look for a number of steps."""
    kept: list[HandoverObservation] = []

    def change(look: HandoverObservation, step: int, rng: Generator) -> HandoverObservation:
        if step == ONSET:
            kept[:] = [look]
        return kept[0] if ONSET <= step < ONSET + steps else look

    return change


def swapped_cameras(look: HandoverObservation, rng: Generator) -> HandoverObservation:
    """Take the left image for the right one: left and right change sides, rays miss each other."""
    mirror = np.array([-1.0, 1.0, 1.0])
    mirrored = {name: mirror * getattr(look, name) for name in ("wrist", "direction", "ball")}
    return replace(look, **mirrored, disagreement=0.1)


def wrong_calibration(offset: float) -> Change:
    """See ring and ball apart from each other: the ball farther from the cameras, the ring nearer [m]."""
    depth = np.array([0.0, offset / 2, 0.0])
    return always(lambda look, rng: replace(look, wrist=look.wrist + depth, ball=look.ball - depth))


def not_a_number(look: HandoverObservation, rng: Generator) -> HandoverObservation:
    """Return NaN."""
    nothing = np.full(3, np.nan)
    return replace(look, wrist=nothing, direction=nothing, ball=nothing)


def flipped_markers(look: HandoverObservation, rng: Generator) -> HandoverObservation:
    """Turn the gripper's direction by 60 degrees and throw the wrist 8 cm off."""
    wrist, direction = np.asarray(look.wrist), np.asarray(look.direction)
    aside = rng.standard_normal(3)
    aside -= np.sum(aside * direction) * direction
    aside /= magnitude(aside)
    turned = np.cos(np.pi / 3) * direction + np.sin(np.pi / 3) * aside
    return replace(look, direction=turned, wrist=wrist + 0.08 * aside)


def second_ball(look: HandoverObservation, rng: Generator) -> HandoverObservation:
    """Take another green thing, 30 cm aside, for the ball."""
    return replace(look, ball=look.ball + np.array([0.30, 0.0, 0.0]))


def noise_times(factor: float) -> Change:
    """Add noise of a multiple of what the look claims."""

    def distort(look: HandoverObservation, rng: Generator) -> HandoverObservation:
        extra = factor * rng.standard_normal((3, 3))
        direction = look.direction + look.direction_deviation * extra[1]
        return replace(
            look,
            wrist=look.wrist + look.wrist_deviation * extra[0],
            direction=direction / magnitude(direction),
            ball=look.ball + look.ball_deviation * extra[2],
        )

    return always(distort)


def pushed_away(distance: float, gripper_length: float = 0.10) -> handover.Guide:
    """Hold the arm a distance [m] away from the ball for ten steps."""

    def guide(step: int, gripper: Array, ball: Array) -> HoldingHand | None:
        if not ONSET <= step < ONSET + 10:
            return None
        away = (gripper - ball) * np.array([1.0, 1.0, 0.0])
        place = ball + 0.05 * UP + distance * away / max(magnitude(away), 1e-6)
        return HoldingHand(goal_over(place, 0.0, gripper_length))

    return guide


def all_faults() -> list[Fault]:
    """Return every fault at mild, middle and severe strength, after no fault at all."""

    def in_a_share(name: str, distort: Distortion, shares: Sequence[float]) -> list[Fault]:
        return [Fault(name, f"{100 * share:.0f} %", sometimes(share, distort)) for share in shares]

    def motors(travel: float) -> TendonMotors:
        return TendonMotors(shortest=(-travel,) * 9, longest=(travel,) * 9)

    return [
        Fault("none", "-"),
        *in_a_share("ring hidden", hidden_ring, (0.3, 0.6, 1.0)),
        *(Fault("ball lost", f"{n} steps", lost_ball(n)) for n in (3, 12, 300)),
        *(Fault("cameras frozen", f"{n} steps", frozen_cameras(n)) for n in (3, 12, 300)),
        *in_a_share("cameras swapped", swapped_cameras, (0.1, 0.4, 1.0)),
        *(Fault("calibration off", f"{1e3 * s:.0f} mm", wrong_calibration(s)) for s in (0.01, 0.03, 0.1)),
        *in_a_share("NaN", not_a_number, (0.1, 0.5, 1.0)),
        *in_a_share("markers flipped", flipped_markers, (0.05, 0.2, 0.6)),
        *in_a_share("second ball", second_ball, (0.05, 0.3, 1.0)),
        *(Fault("noise", f"x {s + 1:.0f}", noise_times(s)) for s in (1.0, 3.0, 7.0)),
        *(Fault("ball out of reach", f"{100 * s:.0f} cm", holder=BallHolder(s)) for s in (0.25, 0.40, 0.80)),
        *(Fault("motor range", f"{1e3 * s:.0f} mm", motors=motors(s)) for s in (0.08, 0.05, 0.02)),
        *(Fault("arm pushed", f"{100 * s:.0f} cm", guide=pushed_away(s)) for s in (0.05, 0.15, 0.25)),
    ]


def run_faults(
    parameters: HandoverParameters,
    plant: HelixPlant,
    blocks: handover.Blocks,
    faults: Sequence[Fault],
    /,
    *,
    step_limit: int = 120,
    **labels: object,
) -> pd.DataFrame:
    """Return one row per run: labels, fault, severity, outcome, violations.

    `outcome` is "handover", "safe stop", "beside the ball" or "out of time"; `violations` counts commands
    outside the limits of arm and motors, or not finite.
    """
    rows = []
    for fault in faults:
        controller = HandoverController(replace(parameters, motors=fault.motors))
        eyes = FaultyObserver(blocks.observer, fault.change)
        options: dict[str, Any] = {"holder": fault.holder, "guide": fault.guide, "step_limit": step_limit}
        names = {**labels, "fault": fault.name, "severity": fault.severity}
        for _, ball, rng in blocks.draw(fault.holder):
            run = handover.run_handover(controller, plant, eyes, ball, rng, **options)
            rows.append({**names, "outcome": outcome(run), "violations": violations(run, fault.motors)})
    return pd.DataFrame(rows)


def violations(run: handover.HandoverRun, motors: TendonMotors) -> int:
    """Return how many commands of a run were outside the limits of arm and motors, or not finite."""
    return sum(
        not (np.all((motors.shortest <= change) & (change <= motors.longest)) and within_limits(q_sys))
        for q_sys, change in zip(run.commands, run.tendon_changes)
    )


def outcome(run: handover.HandoverRun) -> str:
    """Return what a run came to."""
    if run.success:
        return "handover"
    if run.mode is Mode.GRASP:
        return "beside the ball"
    return "safe stop" if run.mode is Mode.STOPPED else "out of time"
