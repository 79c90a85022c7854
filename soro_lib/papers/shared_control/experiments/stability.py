"""How stiff the guidance may be before hand and arm swing against each other, with and without delay.

The guidance closes a loop: the force moves the hand, the hand's motion times the device's scale moves the tip
after its lag, and the tip changes the force. The hand is passive here (mass, damper, spring); a person who
corrects on top of it is in the simulations. The paper reports no instability and no bound.
"""

import math

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from soro_lib.papers.shared_control.world import EXPERT
from soro_lib.papers.shared_control.world.people import DEVICE_SCALE
from soro_lib.papers.shared_control.world.plant import PlantParameters

AXES = {"x": DEVICE_SCALE[0], "z": DEVICE_SCALE[2]}
"""Scale of steering and eversion [-]."""


def critical_stiffness(
    hand_stiffness: float,
    delay: float = 0.0,
    scale: float = DEVICE_SCALE[2],
    hand_mass: float = EXPERT.hand_mass,
    hand_damping: float = EXPERT.hand_damping,
    tip_lag: float = PlantParameters.tip_lag,
) -> float:
    """Guidance stiffness at which the passive hand starts to oscillate [N/m].

    The loop k G e^(-s tau) / ((m s^2 + b s + k_h) (T s + 1)) is cut where its phase is -180 degrees.

    Parameters
    ----------
    hand_stiffness : float
        k_h [N/m].
    delay : float
        tau, between hand and tip or tip and force [s].
    scale : float
        G, tip displacement per hand displacement [-].
    hand_mass, hand_damping : float
        m [kg], b [N s/m].
    tip_lag : float
        T [s].

    Raises
    ------
    ValueError
        If a parameter is not positive, or the delay negative.
    """
    values = {"hand_stiffness": hand_stiffness, "scale": scale, "hand_mass": hand_mass}
    values |= {"hand_damping": hand_damping, "tip_lag": tip_lag}
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be a finite number above 0, got {value!r}")
    if not (math.isfinite(delay) and delay >= 0):
        raise ValueError(f"delay must be a finite number not below 0, got {delay!r}")

    def phase_margin(frequency: float) -> float:
        hand = math.atan2(hand_damping * frequency, hand_stiffness - hand_mass * frequency**2)
        return math.pi - hand - math.atan(tip_lag * frequency) - delay * frequency

    crossover = brentq(phase_margin, 1e-6, 1e4)
    hand = complex(hand_stiffness - hand_mass * crossover**2, hand_damping * crossover)
    return abs(hand * complex(1.0, tip_lag * crossover)) / scale


def passive_stiffness(
    delay: float = 0.0,
    scale: float = DEVICE_SCALE[2],
    hand_damping: float = EXPERT.hand_damping,
    tip_lag: float = PlantParameters.tip_lag,
) -> float:
    """Guidance stiffness up to which hand and guidance together dissipate at every frequency [N/m].

    The guidance, seen from the hand, is k G e^(-s tau) / (s (T s + 1)): its real part is negative, most so at
    low frequencies, where it tends to -k G (T + tau). Passive while the hand's damping covers that.
    """
    return hand_damping / (scale * (tip_lag + delay))


def stability_map(hand_stiffness: ArrayLike, delays: ArrayLike) -> pd.DataFrame:
    """Critical stiffness over hand stiffness and delay for steering and eversion.

    Returns
    -------
    pandas.DataFrame
        Columns axis, delay_s, hand_stiffness_n_per_m, critical_stiffness_n_per_m, passive_stiffness_n_per_m.
    """
    rows = [
        {
            "axis": axis,
            "delay_s": float(delay),
            "hand_stiffness_n_per_m": float(hand),
            "critical_stiffness_n_per_m": critical_stiffness(float(hand), float(delay), scale),
            "passive_stiffness_n_per_m": passive_stiffness(float(delay), scale),
        }
        for axis, scale in AXES.items()
        for delay in np.atleast_1d(delays)
        for hand in np.atleast_1d(hand_stiffness)
    ]
    return pd.DataFrame(rows)
