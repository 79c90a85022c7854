"""Fixed assistance: a spring and damper to the goal with constant gains.

Source: Stroppa et al., Eqs. (4) and (5).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import not_negative, positive, vector
from soro_lib.controllers.shared_control.guidance import (
    Guidance,
    damped_magnitude,
    distance_to_goal,
    guidance_force,
    sample_count,
)
from soro_lib.jit import inlined


class FixedRule(NamedTuple):
    """Constants of the fixed assistance; k and b never change, which is Eq. (5)."""

    stiffness: float
    damping: float
    maximum_force: float
    near_distance: float
    sample_time: float


class FixedState(NamedTuple):
    """Last distance [m], place in the filter's ring buffer and filtered magnitude [N]."""

    distance: float
    place: int
    magnitude: float


FIXED_START = FixedState(distance=-1.0, place=0, magnitude=0.0)


@inlined
def fixed_step(
    rule: FixedRule, state: FixedState, window: NDArray[np.float64], distance: float, samples: float
) -> FixedState:
    """One iteration of the fixed assistance (Stroppa et al., Eqs. (4) and (5)); ``window`` is overwritten."""
    rate = 0.0
    if state.distance >= 0.0:
        rate = (distance - state.distance) / (samples * rule.sample_time)
    magnitude = 0.0
    if distance >= rule.near_distance:
        magnitude = damped_magnitude(rule.stiffness, rule.damping, distance, rate, rule.maximum_force)
    window[state.place] = magnitude
    total = 0.0
    for value in window:
        total += value
    return FixedState(distance, (state.place + 1) % len(window), total / len(window))


class FixedAssistance:
    """A spring and damper to the goal with constant gains, smoothed by a moving average.

    Parameters
    ----------
    stiffness : float
        k [N/m].
    damping : float
        b on the rate of the distance [N s/m] (Erratum SC-8); zero as in the authors' program.
    maximum_force : float
        f_MAX [N].
    window : int
        Samples of the moving average over |f|; it starts filled with zeros, so the force fades in.
    sample_rate : float
        [Hz].
    near_distance : float
        No force below this distance [m]; 0 as printed, 0.03 in the authors' program.
    unit_direction : bool
        As in `AssistAsNeeded`.

    Raises
    ------
    ValueError
        If a parameter is not finite or out of bounds; the message names it.

    Notes
    -----
    Stroppa et al., Eqs. (4), (5) and Table 3. The magnitude is filtered, the direction is not.
    """

    def __init__(
        self,
        stiffness: float = 10.0,
        damping: float = 0.1,
        maximum_force: float = 7.0,
        window: int = 50,
        sample_rate: float = 100.0,
        near_distance: float = 0.0,
        unit_direction: bool = True,
    ) -> None:
        if int(window) != window or window < 1:
            raise ValueError(f"window must be a whole number of samples, at least 1, got {window!r}")
        self.sample_rate = positive("sample_rate", sample_rate)
        self.unit_direction = bool(unit_direction)
        self.rule = FixedRule(
            stiffness=positive("stiffness", stiffness),
            damping=not_negative("damping", damping),
            maximum_force=positive("maximum_force", maximum_force),
            near_distance=not_negative("near_distance", near_distance),
            sample_time=1.0 / self.sample_rate,
        )
        self.window = np.zeros(int(window))
        self.reset()

    def reset(self) -> None:
        """Forget the past: the filter is filled with zeros again."""
        self.state = FIXED_START
        self.window[:] = 0.0

    def update(self, end_effector: ArrayLike, goal: ArrayLike, elapsed: float | None = None) -> Guidance:
        """Take one sample and return the guidance; arguments and errors as in `AssistAsNeeded.update`.

        The moving average counts samples, whatever their spacing.
        """
        tip, aim = vector("end_effector", end_effector), vector("goal", goal)
        samples = sample_count(elapsed, self.sample_rate)
        previous = self.state.distance
        self.state = fixed_step(self.rule, self.state, self.window, distance_to_goal(tip, aim), samples)
        motion = "start"
        if previous >= 0.0:
            change = self.state.distance - previous
            motion = "steady" if change == 0.0 else "away" if change > 0.0 else "closer"
        return Guidance(
            stiffness=self.rule.stiffness,
            magnitude=self.state.magnitude,
            force=np.array(guidance_force(self.state.magnitude, tip, aim, self.unit_direction)),
            state=motion,
        )
