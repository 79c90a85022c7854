"""How the tip of the soft-growing arm follows its command, simulated and real, and how its gripper holds.

The simulated tip is that of the authors' program: a first-order lag per axis. The real one runs the
closed loop of the supplement (steering and eversion apart) on a body with stated imperfections. Like the
control rules, these are functions of plain numbers that the simulator compiles and `SoftGrowingPlant` calls.

Source: Stroppa et al., Sections 3.1, 3.2 and supplement, Sections 4 and 5.
"""

import math
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import Vector, check_fields, number, vector
from soro_lib.jit import inlined
from soro_lib.papers.shared_control.world import vectors
from soro_lib.papers.shared_control.world.people import SAMPLE_TIME
from soro_lib.robots.soft_growing import (
    eversion_length,
    eversion_proxy,
    redistribute_actuation,
    redistribution_required,
    steering_coordinates,
)

TRACKING_RATE = 270.0
"""Rate of the motion capture [Hz] (Stroppa et al., Section 3.3.1)."""

REFERENCE_LENGTH = 0.65
"""Length at which the gains and lags of the real arm are stated [m]: tip at the items."""


@dataclass(frozen=True)
class PlantParameters:
    """The arm from command to tip. The defaults are the simulator's; `real_arm` gives the real variant.

    Parameters
    ----------
    real : bool
        Whether the closed loop of the supplement drives an imperfect body; else the tip is a first-order lag.
    tip_lag : float
        Time constant of the simulated tip [s]; the program closes 1 % of the gap per 10 ms.
    command_delay : float
        From the hand to the arm and back to the eye [s].
    steering_gain, steering_damping : float
        Proportional [1/s] and derivative [-] gain of the steering, both scaled with the length.
    steering_lag : float
        Lag of the bending body at the reference length [s]; it grows in proportion to the length.
    cable_friction : float
        Steering error that the cables' Coulomb friction swallows at the reference length [rad].
    eversion_gain : float
        Proportional gain of the growth [1/s].
    feed_forward, passive_growth : float
        Retraction commanded against, and growth caused by, the pressure [m/s].
    eversion_lag : float
        Lag of the growth at the reference length [s]; the tail's friction grows with the length.
    maximum_speed : float
        Of the tip, along and across the body each [m/s].
    maximum_tilt : float
        Largest angle between body and vertical [rad].
    minimum_length, maximum_length : float
        Of the body [m].
    floor : float
        Height z at which the table stops the tip [m]; the simulator has none.
    tracking_noise : float
        Standard deviation of the tracked tip per axis and 10 ms sample [m].

    Raises
    ------
    ValueError
        If a parameter is out of bounds; the message names it.
    """

    real: bool = False
    tip_lag: float = 0.99 / 0.01 * SAMPLE_TIME
    command_delay: float = 0.0
    steering_gain: float = 1.4
    steering_damping: float = 0.1
    steering_lag: float = 0.3
    cable_friction: float = 0.012
    eversion_gain: float = 1.4
    feed_forward: float = 0.016
    passive_growth: float = 0.020
    eversion_lag: float = 0.2
    maximum_speed: float = 0.2
    maximum_tilt: float = 1.1
    minimum_length: float = 0.1
    maximum_length: float = 1.5
    floor: float = math.inf
    tracking_noise: float = 0.0

    def __post_init__(self) -> None:
        check_fields(self, at_least=0, at_most=math.inf)
        check_fields(self, *ABOVE_ZERO, above=0, at_most=math.inf)
        check_fields(self, "maximum_tilt", below=math.pi / 2)
        number("minimum_length", self.minimum_length, below=self.maximum_length)

    def rule(self) -> Any:
        """The same fields as a named tuple, which the compiled rules can take; command delay in samples."""
        values = {name: float(value) for name, value in vars(self).items()}
        delay = round(self.command_delay / SAMPLE_TIME)
        return PlantRule(**values | {"real": bool(self.real), "command_delay": delay})


ABOVE_ZERO = (
    *("tip_lag", "steering_gain", "steering_lag", "eversion_gain", "eversion_lag"),
    *("maximum_speed", "maximum_tilt", "minimum_length", "maximum_length", "floor"),
)
PlantRule: Any = NamedTuple("PlantRule", [(field.name, float) for field in fields(PlantParameters)])  # type: ignore[misc]


def real_arm(tracking_noise: float | None = None) -> PlantParameters:
    """The real variant, its imperfections stated one by one.

    Commands and video take 0.15 s; the bending body lags by 0.3 s and the growth by 0.2 s at 0.65 m, in
    proportion to the length; cable friction swallows 8 mm at the tip, for which the controller has no
    integral term; the feed-forward counters 80 % of the growth by pressure; a table stands 25 mm below the
    centres of the items. The tracker is taken to see a marker within 0.1 mm per frame; the centroid of 8
    markers, averaged over the 2.7 frames of a control period (270 Hz to 100 Hz), leaves 0.02 mm.
    """
    centroid = 1e-4 / math.sqrt(8 * TRACKING_RATE * SAMPLE_TIME) if tracking_noise is None else tracking_noise
    return PlantParameters(real=True, command_delay=0.15, floor=0.67, tracking_noise=centroid)


class PlantState(NamedTuple):
    """Tip [m]; steering direction, its rate [1/s] and last error; length [m] and growth rate [m/s].

    Direction, rate and error lie in the plane of the steering: their z is 0.
    """

    tip: Vector
    direction: Vector
    rate: Vector
    error: Vector
    length: float
    growth: float
    sample: int


def plant_start(tip: Vector) -> PlantState:
    """The arm at rest with its tip at a point below the base."""
    length = math.hypot(*tip)
    direction = (tip[0] / length, tip[1] / length, 0.0)
    return PlantState(tip, direction, vectors.ZERO, vectors.ZERO, length, 0.0, 0)


def control_error(
    actual: ArrayLike, desired: ArrayLike, previous_steering: ArrayLike = (0.0, 0.0, 0.0)
) -> tuple[NDArray[np.float64], float]:
    """Error psi of the closed loop: steering commands as angles and growth (supplement, Section 4).

    The proxy of Eqs. (6), (7) is taken relative to the tip, put in motor space, redistributed by Eq. (9)
    where the rule (10) asks for it, and divided by the length (small angles; the paper prints no formula).

    Parameters
    ----------
    actual, desired : array_like
        (3,) tip and desired position, base frame [m].
    previous_steering : array_like
        (3,) steering commands of the last period, before redistribution [m].

    Returns
    -------
    steering : numpy.ndarray
        (3,) rotation commands of the three motors [rad], positive pulls.
    growth : float
        L_d - L_a [m].

    Raises
    ------
    ValueError
        If a position is malformed, or at the base, where no direction exists.
    """
    tip, aim = np.array(vector("actual", actual)), np.array(vector("desired", desired))
    length = float(eversion_length(tip))
    if length == 0:
        raise ValueError("actual must not be the base: the body has no direction there")
    steering = steering_coordinates((eversion_proxy(tip, aim) - tip)[:2])
    if redistribution_required(previous_steering, steering):
        steering = redistribute_actuation(steering)
    return steering / length, float(eversion_length(aim)) - length


@inlined
def simulated_tip(tip: Vector, desired: Vector, lag: float) -> Vector:
    """One period of the simulator's first-order tip, exact for the authors' step of 1 % per 10 ms."""
    return vectors.towards(tip, SAMPLE_TIME / (lag + SAMPLE_TIME), desired)


@inlined
def eversion_command(gain: float, feed_forward: float, length_error: float) -> float:
    """Commanded growth rate [m/s]: proportional, less what counters the passive growth (supplement, 5)."""
    return gain * length_error - feed_forward


@inlined
def steering_command(gain: float, damping: float, length: float, error: float, error_rate: float) -> float:
    """Commanded steering rate [1/s]: proportional-derivative, scaled with the length (supplement, 5)."""
    return length / REFERENCE_LENGTH * (gain * error + damping * error_rate)


@inlined
def limited(a: Vector, bound: float) -> Vector:
    """A vector, shortened to the bound where it is longer."""
    length = vectors.size(a)
    return vectors.scaled(bound / length if length > bound else 1.0, a)


@inlined
def real_tip(rule: PlantParameters, state: PlantState, desired: Vector) -> PlantState:
    """One period of the real arm: steer toward the proxy, evert the rest (supplement, Sections 4 and 5).

    The steering error is that of the proxy p = d L_a / L_d of Eqs. (6), (7) against the tip, divided by
    L_a, in the plane: the angle for small errors. The motors are left out: Eq. (1) maps their commands back
    to this plane without loss.
    """
    wanted = max(vectors.size(desired), rule.minimum_length)
    tilt_bound = math.sin(rule.maximum_tilt)
    aim = limited((desired[0] / wanted, desired[1] / wanted, 0.0), tilt_bound)
    error = vectors.difference(aim, state.direction)
    change = vectors.difference(error, state.error if state.sample > 0 else error)
    length, gain, damping = state.length, rule.steering_gain, rule.steering_damping
    x = steering_command(gain, damping, length, error[0], change[0] / SAMPLE_TIME)
    y = steering_command(gain, damping, length, error[1], change[1] / SAMPLE_TIME)
    command = vectors.after_friction((x, y, 0.0), gain * rule.cable_friction)

    scale = length / REFERENCE_LENGTH
    share = SAMPLE_TIME / (rule.steering_lag * scale + SAMPLE_TIME)
    rate = vectors.towards(state.rate, share, (command[0] / scale, command[1] / scale, 0.0))
    rate = limited(rate, rule.maximum_speed / length)
    direction = limited(vectors.moved(state.direction, SAMPLE_TIME, rate), tilt_bound)

    growth_command = eversion_command(rule.eversion_gain, rule.feed_forward, wanted - length)
    share = SAMPLE_TIME / (rule.eversion_lag * scale + SAMPLE_TIME)
    growth = state.growth + share * (growth_command + rule.passive_growth - state.growth)
    growth = min(max(growth, -rule.maximum_speed), rule.maximum_speed)
    down = math.sqrt(1.0 - direction[0] * direction[0] - direction[1] * direction[1])
    longest = min(rule.maximum_length, rule.floor / down)
    length = min(max(length + SAMPLE_TIME * growth, rule.minimum_length), longest)
    tip = vectors.scaled(length, (direction[0], direction[1], down))
    return PlantState(tip, direction, rate, error, length, growth, state.sample + 1)


@inlined
def plant_step(
    rule: PlantParameters, state: PlantState, delayed: NDArray[np.float64], desired: Vector
) -> PlantState:
    """One period of the arm; ``delayed`` (n, 3) is the ring buffer of commands on their way."""
    if not rule.real:
        tip = simulated_tip(state.tip, desired, rule.tip_lag)
        return PlantState(tip, vectors.ZERO, vectors.ZERO, vectors.ZERO, 0.0, 0.0, state.sample + 1)
    place = state.sample % len(delayed)
    arriving = vectors.row(delayed, place)
    vectors.set_row(delayed, place, desired)
    return real_tip(rule, state, arriving)


@inlined
def tracked_tip(tip: Vector, noise: float, rng: np.random.Generator) -> Vector:
    """The tip as motion capture reports it (Stroppa et al., Section 3.3.1)."""
    return vectors.scattered(tip, noise, rng) if noise > 0.0 else tip


class SoftGrowingPlant:
    """The arm, one command after the other.

    Parameters
    ----------
    parameters : PlantParameters
        `PlantParameters()` for the simulator's arm, `real_arm()` for the real variant.
    tip : array_like
        (3,) position at rest, base frame [m], z down.

    Raises
    ------
    ValueError
        If the start is not three finite numbers below the base.

    Examples
    --------
    >>> plant = SoftGrowingPlant(PlantParameters(), (0.0, 0.0, 0.1))
    >>> float(plant.step((0.0, 0.0, 0.6))[2].round(4))
    0.105
    """

    def __init__(self, parameters: PlantParameters, tip: ArrayLike = (0.0, 0.0, 0.1)) -> None:
        start = vector("tip", tip)
        if start[2] <= 0:
            raise ValueError(f"tip must hang below the base (z > 0), got z = {start[2]} m")
        self.rule = parameters.rule()
        self.state = plant_start(start)
        self.delayed = vectors.delay_line(start, self.rule.command_delay)

    def step(self, desired: ArrayLike) -> NDArray[np.float64]:
        """Command a position (3,) [m] for one period and return the tip (3,) [m] after it.

        Raises
        ------
        ValueError
            If the command is not three finite numbers.
        """
        self.state = plant_step(self.rule, self.state, self.delayed, vector("desired", desired))
        return np.array(self.state.tip)


# --- The soft magnetic gripper: Section 3.1, Fig. 3 ---------------------------------------------------------


class GripperRule(NamedTuple):
    """Range of the magnet [m], whether it is measured from the command, and delay of the release [s].

    The simulator attaches an item when the *commanded* tip comes near and lets go at once. The real magnet
    acts at the tip, and the inflated gripper lets go after ``shortest`` plus an exponential time of mean
    ``mean_extra``.
    """

    reach: float
    from_command: bool
    shortest: float
    mean_extra: float


SIMULATED_GRIPPER = GripperRule(reach=0.05, from_command=True, shortest=0.0, mean_extra=0.0)
REAL_GRIPPER = GripperRule(reach=0.045, from_command=False, shortest=0.2, mean_extra=0.3)
NOTHING = -1


class GripperState(NamedTuple):
    """Item held (-1: none) and time until a release takes effect [s] (negative: none under way)."""

    item: int
    letting_go: float


@inlined
def nearest_item(items: NDArray[np.float64], point: Vector) -> tuple[int, float]:
    """Number of the nearest item and its distance [m]."""
    best, least = NOTHING, math.inf
    for index in range(len(items)):
        distance = vectors.size(vectors.difference(vectors.row(items, index), point))
        if distance < least:
            best, least = index, distance
    return best, least


@inlined
def gripper_step(
    rule: GripperRule,
    state: GripperState,
    items: NDArray[np.float64],
    tip: Vector,
    desired: Vector,
    closed: bool,
    rng: np.random.Generator,
) -> GripperState:
    """One period of the gripper: attract, carry, or let go (Stroppa et al., Section 3.1)."""
    if state.item == NOTHING:
        if closed:
            item, distance = nearest_item(items, desired if rule.from_command else tip)
            if distance < rule.reach:
                return GripperState(item, -1.0)
        return state
    if closed:
        return GripperState(state.item, -1.0)
    waiting = state.letting_go
    if waiting < 0.0:
        waiting = rule.shortest
        if rule.mean_extra > 0.0:
            waiting += rng.exponential(rule.mean_extra)
    if waiting <= SAMPLE_TIME / 2:
        return GripperState(NOTHING, -1.0)
    return GripperState(state.item, max(waiting - SAMPLE_TIME, 0.0))
