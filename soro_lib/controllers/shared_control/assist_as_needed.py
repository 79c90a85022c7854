"""Assist-as-needed: guidance whose stiffness follows how the operator is doing.

Source: Stroppa et al., Eqs. (2) and (3), Fig. 5.
"""

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from soro_lib.checks import not_negative, one_of, positive, vector
from soro_lib.controllers.shared_control.guidance import (
    Guidance,
    distance_to_goal,
    guidance_force,
    hooke_magnitude,
    sample_count,
)
from soro_lib.jit import inlined

MOTIONS = ("start", "reached", "steady", "away", "closer")
START, REACHED, STEADY, AWAY, CLOSER = range(5)

COUNTERS = ("text", "caption", "program")
TEXT, CAPTION, PROGRAM = range(3)

ARMED = math.inf
"""The program's counter once it has reached its delay: it stays there until something resets it."""


class AssistRule(NamedTuple):
    """Constants of the assist-as-needed machine, times in samples; ``counter`` indexes ``COUNTERS``."""

    maximum_stiffness: float
    stiffness_step: float
    near_distance: float
    steady_speed: float
    steady_delay: float
    approach_delay: float
    away_delay: float
    counter: int
    sample_time: float


class AssistState(NamedTuple):
    """Stiffness k [N/m], last distance m [m], motion (index into ``MOTIONS``) and counter tau [samples]."""

    stiffness: float
    distance: float
    motion: int
    elapsed: float


ASSIST_START = AssistState(stiffness=0.0, distance=-1.0, motion=START, elapsed=0.0)


@inlined
def classify_motion(rule: AssistRule, previous_distance: float, distance: float, samples: float) -> int:
    """Where the tip is heading: one of the states of Fig. 5 (Stroppa et al., Table 3 for the thresholds)."""
    if previous_distance < 0.0:
        return START
    if distance <= rule.near_distance:
        return REACHED
    threshold = rule.steady_speed * rule.sample_time * samples
    if distance < previous_distance - threshold:
        return CLOSER
    if distance > previous_distance + threshold:
        return AWAY
    return STEADY


@inlined
def reaction_time(rule: AssistRule, motion: int) -> float:
    """Delay xi of a state [samples]; there is none at the goal (Erratum SC-6)."""
    if motion == STEADY:
        return rule.steady_delay
    if motion == AWAY:
        return rule.away_delay
    if motion == CLOSER:
        return rule.approach_delay
    return 0.0


@inlined
def reaction_counter(rule: AssistRule, previous: int, motion: int, elapsed: float, samples: float) -> float:
    """Time tau spent waiting [samples]: zero on entry, then counting (Erratum SC-2).

    The text resets it whenever the state changes; the caption of Fig. 5 lets it run on where a steady hand
    moves away or an escaping one stops. So does the program, in which a counter that has reached its delay
    is ``ARMED``, and stays so: an escaping hand that stops is still held against the delay of moving away
    (for one sample), and one that stood steady takes its counter with it to the goal.
    """
    program = rule.counter == PROGRAM
    if program and motion == REACHED:
        return elapsed if previous == STEADY else ARMED
    both_poor = motion in (STEADY, AWAY) and previous in (STEADY, AWAY)
    runs_on = motion == previous or (rule.counter != TEXT and both_poor)
    waited = elapsed + samples if runs_on else 0.0
    escaped = previous == AWAY and motion == STEADY
    delay = reaction_time(rule, AWAY if escaped else motion)
    return ARMED if program and waited >= delay else waited


@inlined
def stiffness_change(rule: AssistRule, motion: int, elapsed: float) -> float:
    """Direction in which the stiffness moves: +1, 0 or -1 (Stroppa et al., Eq. (3), Errata SC-1, SC-5, SC-6).

    It moves once the reaction time has passed, tau >= xi; the printed tau < xi would assist at once and then
    freeze.
    """
    if motion == START:
        return 0.0
    delay = ARMED if rule.counter == PROGRAM else reaction_time(rule, motion)
    if elapsed < delay:
        return 0.0
    return 1.0 if motion in (STEADY, AWAY) else -1.0


@inlined
def assist_step(rule: AssistRule, state: AssistState, distance: float, samples: float) -> AssistState:
    """One iteration of assist-as-needed (Stroppa et al., Eq. (3) and Fig. 5).

    ``samples`` is the time since the last one in sample periods: 1 for a regular clock.
    """
    motion = classify_motion(rule, state.distance, distance, samples)
    elapsed = reaction_counter(rule, state.motion, motion, state.elapsed, samples)
    stiffness = state.stiffness + stiffness_change(rule, motion, elapsed) * rule.stiffness_step * samples
    return AssistState(
        stiffness=min(max(stiffness, 0.0), rule.maximum_stiffness),
        distance=distance,
        motion=motion,
        elapsed=elapsed,
    )


class AssistAsNeeded:
    """Guidance that grows while the operator does poorly and fades while he does well.

    Parameters
    ----------
    maximum_force : float
        f_MAX [N].
    maximum_stiffness : float
        k_MAX [N/m].
    stiffness_rate : float
        Delta as a rate [N/m per s]; one sample changes the stiffness by Delta / sample_rate (Erratum SC-4).
    near_distance : float
        th_D: the goal counts as reached at or below it [m].
    steady_speed : float
        th_M: the tip counts as steady while the distance changes at most this fast [m/s].
    steady_delay, approach_delay, away_delay : float
        Reaction times xi_S, xi_C, xi_A [s].
    sample_rate : float
        [Hz].
    counter : {"text", "caption", "program"}
        Reading of the counter tau (Erratum SC-2). "text" resets it whenever the state changes; "caption", of
        Fig. 5, lets it run on between steady and away; "program", the authors', does so too, and there a
        delay once reached stays reached, whichever of the two states follows.
    unit_direction : bool
        True: the printed law. False: the authors' program, direction not normalised (Erratum SC-9).

    Raises
    ------
    ValueError
        If a parameter is not finite or out of bounds; the message names it.

    Notes
    -----
    Stroppa et al., Eqs. (2), (3), Fig. 5 and Table 3.

    Examples
    --------
    >>> assistance = AssistAsNeeded()
    >>> for _ in range(152):
    ...     guidance = assistance.update((0.0, 0.0, 0.1), (0.0, 0.0, 0.6))
    >>> guidance.state, round(guidance.stiffness, 3), round(guidance.magnitude, 3)
    ('steady', 10.2, 5.1)
    """

    def __init__(
        self,
        maximum_force: float = 7.0,
        maximum_stiffness: float = 50.0,
        stiffness_rate: float = 20.0,
        near_distance: float = 0.03,
        steady_speed: float = 0.01,
        steady_delay: float = 1.0,
        approach_delay: float = 3.0,
        away_delay: float = 1.0,
        sample_rate: float = 100.0,
        counter: Literal["text", "caption", "program"] = "text",
        unit_direction: bool = True,
    ) -> None:
        one_of("counter", counter, COUNTERS)
        self.maximum_force = positive("maximum_force", maximum_force)
        self.sample_rate = positive("sample_rate", sample_rate)
        self.unit_direction = bool(unit_direction)
        self.rule = AssistRule(
            maximum_stiffness=positive("maximum_stiffness", maximum_stiffness),
            stiffness_step=positive("stiffness_rate", stiffness_rate) / self.sample_rate,
            near_distance=not_negative("near_distance", near_distance),
            steady_speed=not_negative("steady_speed", steady_speed),
            steady_delay=not_negative("steady_delay", steady_delay) * self.sample_rate,
            approach_delay=not_negative("approach_delay", approach_delay) * self.sample_rate,
            away_delay=not_negative("away_delay", away_delay) * self.sample_rate,
            counter=COUNTERS.index(counter),
            sample_time=1.0 / self.sample_rate,
        )
        self.reset()

    def reset(self) -> None:
        """Forget the past: no stiffness, no history."""
        self.state = ASSIST_START

    def update(self, end_effector: ArrayLike, goal: ArrayLike, elapsed: float | None = None) -> Guidance:
        """Take one sample and return the guidance.

        Parameters
        ----------
        end_effector, goal : array_like
            (3,) positions in the base frame [m].
        elapsed : float, optional
            Time since the last sample [s]; the sample period where left out. Thresholds, counters and the
            stiffness rate follow it, so an irregular clock does not change the law.

        Returns
        -------
        Guidance

        Raises
        ------
        ValueError
            If a position is not three finite numbers, or the elapsed time is not positive.
        """
        tip, aim = vector("end_effector", end_effector), vector("goal", goal)
        distance = distance_to_goal(tip, aim)
        self.state = assist_step(self.rule, self.state, distance, sample_count(elapsed, self.sample_rate))
        magnitude = hooke_magnitude(self.state.stiffness, distance, self.maximum_force)
        return Guidance(
            stiffness=self.state.stiffness,
            magnitude=magnitude,
            force=np.array(guidance_force(magnitude, tip, aim, self.unit_direction)),
            state=MOTIONS[self.state.motion],
        )
