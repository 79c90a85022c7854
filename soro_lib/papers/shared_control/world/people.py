"""Who sits at the controls: one person's parameters, and the population they are drawn from.

Mechanisms and values come from the literature on manual control; none is fitted to a result of the paper.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np

from soro_lib.checks import Vector, check_fields

SAMPLE_TIME = 0.01
"""Period of the control loop [s]."""


DEVICE_SCALE: Vector = (10.0, 10.0, 15.0)
"""Tip displacement per hand displacement along x, y, z [-], as in the authors' program."""


@dataclass(frozen=True)
class Operator:
    """One person. The defaults are those of a typical expert.

    Parameters
    ----------
    reaction_delay : float
        Of the visual loop [s]. 0.2 to 0.3 s in textbooks; the effective delay of McRuer's operator is alike.
    refractory : float
        Pause after a submovement [s]. van de Kamp et al. 2013: 0.25, 0.35, 0.55 s for order 0, 1, 2.
    submovement_time : float
        Shortest duration of a minimum-jerk submovement [s]; 0.3 to 0.6 s for corrections.
    primary_gain : float
        Share of the seen error that a submovement covers [-]; planned undershoot, Meyer et al. 1988.
    lag_model : float
        How much of the arm's lag the operator foresees [-]: 0 nothing, 1 all.
    wait_speed : float
        Moves only while the tip is slower than this [m/s]: move and wait, Ferrell 1965. Infinite: always.
    gain_factor : float
        Overestimate of the device's gain [-]; 1 is exact.
    mapping_angle : float
        Error of the felt frame about the vertical [rad].
    motor_noise : float
        Signal-dependent noise, share of the amplitude [-]; Harris and Wolpert 1998, van Beers et al. 2004.
    wander, tremor : float
        Drift (rms) and tremor (amplitude) of the hand [m].
    lateral_error, depth_error : float
        Standard deviation of the believed goal across and along the line of sight [m].
    look_noise : float
        Depth noise of one glance [m].
    tolerance : float
        Error below which nothing is corrected [m]; dead zone of about 0.8 deg at the eye, Miall et al. 1993.
    dwell : float
        Time the tip must look right before the button is pressed [s].
    press : float
        Latency of the button [s].
    think : float
        Pause before each phase [s].
    learn : float
        Share of the bias removed by a failed grasp [-].
    resignation : float
        Where the machine steers: time a resting tip is watched before the button is pressed although the
        place looks slightly wrong [s]; assumption, 3 s.
    hand_mass, hand_damping, hand_stiffness : float
        Hand with device [kg, N s/m, N/m]; van Beek et al. 2015.
    device_friction : float
        Friction of the device that a guidance force must overcome [N].
    felt_force : float
        Smallest force that is felt [N].
    cue_gain : float
        How fast a felt force moves the belief about the goal [m/(s N)]; 0: the force is no cue.
    yield_time : float
        Time constant with which the intention gives in to the hand's position [s]; infinite: never.
    passivity : float
        Reduces size and rate of voluntary submovements [-]: 0 active, towards 1 limp.
    view_elevation : float
        Of the line of sight above the horizontal [rad].
    approach_height : float
        How much higher the operator aims while horizontally far from the goal [m]; 0: straight line.

    Raises
    ------
    ValueError
        If a parameter is out of bounds; the message names it.
    """

    reaction_delay: float = 0.22
    refractory: float = 0.35
    submovement_time: float = 0.40
    primary_gain: float = 0.92
    lag_model: float = 0.9
    wait_speed: float = math.inf
    gain_factor: float = 1.0
    mapping_angle: float = 0.0
    motor_noise: float = 0.05
    wander: float = 0.0003
    tremor: float = 0.00005
    lateral_error: float = 0.005
    depth_error: float = 0.020
    look_noise: float = 0.005
    tolerance: float = 0.012
    dwell: float = 0.4
    press: float = 0.25
    think: float = 0.4
    learn: float = 0.5
    resignation: float = 3.0
    hand_mass: float = 0.6
    hand_damping: float = 6.5
    hand_stiffness: float = 150.0
    device_friction: float = 0.2
    felt_force: float = 0.3
    cue_gain: float = 0.0
    yield_time: float = math.inf
    passivity: float = 0.0
    view_elevation: float = math.radians(30.0)
    approach_height: float = 0.1

    def __post_init__(self) -> None:
        unsigned = [name for name in vars(self) if name != "mapping_angle"]
        check_fields(self, *unsigned, at_least=0, at_most=math.inf)
        check_fields(self, *ABOVE_ZERO, above=0, at_most=math.inf)
        check_fields(self, "lag_model", "learn", at_most=1)
        check_fields(self, "passivity", below=1)
        check_fields(self, "view_elevation", above=0, below=math.pi / 2)
        check_fields(self, "mapping_angle")

    def rule(self) -> Any:
        """The same fields as a named tuple of floats, which the compiled rules can take."""
        return OperatorRule(*(float(getattr(self, field.name)) for field in fields(self)))


ABOVE_ZERO = (
    *("submovement_time", "primary_gain", "gain_factor", "tolerance", "wait_speed", "yield_time"),
    *("hand_mass", "hand_damping", "hand_stiffness"),
)
OperatorRule: Any = NamedTuple("OperatorRule", [(field.name, float) for field in fields(Operator)])  # type: ignore[misc]

EXPERT = Operator()
NAIVE_AND_SPREAD: Mapping[str, tuple[float, float]] = {
    "reaction_delay": (0.28, 0.15),
    "refractory": (0.55, 0.2),
    "submovement_time": (0.55, 0.15),
    "wait_speed": (0.03, 0.3),
    "motor_noise": (0.10, 0.3),
    "wander": (0.0006, 0.3),
    "tremor": (0.00005, 0.3),
    "lateral_error": (0.008, 0.3),
    "depth_error": (0.050, 0.4),
    "look_noise": (0.012, 0.3),
    "tolerance": (0.020, 0.2),
    "dwell": (0.8, 0.3),
    "press": (0.35, 0.15),
    "think": (1.0, 0.3),
    "hand_stiffness": (150.0, 0.4),
}
"""Median of naive users; standard deviation of the logarithm over people of either kind."""

MEDIANS = {name: median for name, (median, _) in NAIVE_AND_SPREAD.items()}
NAIVE = Operator(primary_gain=0.80, lag_model=0.4, learn=0.3, **MEDIANS)

ATTITUDES: Mapping[str, Mapping[str, float]] = {
    "ignore": {},
    "use": {"cue_gain": 0.03},
    "yield": {"yield_time": 2.0},
}
"""What an operator makes of a guidance force; none of the three is fitted."""


@dataclass(frozen=True)
class Population:
    """People of one kind, scattered about a typical one.

    Parameters
    ----------
    typical : Operator
        Medians.
    gain_spread : float
        Standard deviation of the logarithm of the gain factor [-].
    mapping_spread : float
        Standard deviation of the mapping angle [rad].
    """

    typical: Operator
    gain_spread: float
    mapping_spread: float

    def draw(self, rng: np.random.Generator) -> Operator:
        """One person: log-normal about the medians, normal for lag model and learning (clipped to [0, 1])."""
        changes = {
            name: getattr(self.typical, name) * math.exp(spread * rng.standard_normal())
            for name, (_, spread) in NAIVE_AND_SPREAD.items()
        }
        for name in ("lag_model", "learn"):
            value = getattr(self.typical, name) + 0.1 * rng.standard_normal()
            changes[name] = min(max(value, 0.0), 1.0)
        changes["gain_factor"] = math.exp(self.gain_spread * rng.standard_normal())
        changes["mapping_angle"] = self.mapping_spread * rng.standard_normal()
        return replace(self.typical, **changes)


POPULATIONS = {
    "expert": Population(EXPERT, gain_spread=0.05, mapping_spread=math.radians(3.0)),
    "naive": Population(NAIVE, gain_spread=0.25, mapping_spread=math.radians(15.0)),
}
