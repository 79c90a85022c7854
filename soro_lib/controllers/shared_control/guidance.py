"""The pull towards the goal: magnitude, direction and what an assistance renders.

Source: Stroppa et al., Eqs. (2) and (4).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soro_lib.checks import Vector, positive
from soro_lib.jit import inlined


@inlined
def distance_to_goal(end_effector: Vector, goal: Vector) -> float:
    """Euclidean distance m = |g - ee| [m] (Stroppa et al., Section 4)."""
    x, y, z = goal[0] - end_effector[0], goal[1] - end_effector[1], goal[2] - end_effector[2]
    return math.sqrt(x * x + y * y + z * z)


@inlined
def hooke_magnitude(stiffness: float, distance: float, maximum_force: float) -> float:
    """Magnitude of the guidance force [N], capped (Stroppa et al., Eq. (2))."""
    return min(stiffness * distance, maximum_force)


@inlined
def damped_magnitude(
    stiffness: float, damping: float, distance: float, distance_rate: float, maximum_force: float
) -> float:
    """Magnitude of the fixed assistance [N] (Stroppa et al., Eq. (4), Erratum SC-8).

    The damper acts on the rate of the distance, negative while the tip approaches, and the force never
    repels. The printed velocity vector cannot be added to a scalar.
    """
    return min(max(stiffness * distance + damping * distance_rate, 0.0), maximum_force)


@inlined
def guidance_force(magnitude: float, end_effector: Vector, goal: Vector, unit_direction: bool) -> Vector:
    """Force along the line from the end-effector to the goal [N] (Stroppa et al., Eqs. (2) and (4)).

    Parameters
    ----------
    magnitude : float
        |f| [N].
    end_effector, goal : tuple of float
        Base frame [m].
    unit_direction : bool
        True for the printed unit vector; False for the authors' program, which multiplies by g - ee in metres
        (Erratum SC-9). At zero distance the force is zero under both.
    """
    scale = magnitude
    if unit_direction:
        distance = distance_to_goal(end_effector, goal)
        scale = magnitude / distance if distance > 0.0 else 0.0
    return (
        scale * (goal[0] - end_effector[0]),
        scale * (goal[1] - end_effector[1]),
        scale * (goal[2] - end_effector[2]),
    )


@dataclass(frozen=True)
class Guidance:
    """What an assistance renders in one sample.

    Attributes
    ----------
    stiffness : float
        k [N/m].
    magnitude : float
        |f| [N], of Eq. (2) or of the filtered Eq. (4).
    force : numpy.ndarray
        (3,) force on the hand, base frame [N].
    state : str
        One of "start", "reached", "steady", "away", "closer".
    """

    stiffness: float
    magnitude: float
    force: NDArray[np.float64]
    state: str


def sample_count(elapsed: float | None, sample_rate: float) -> float:
    """Return the time since the last sample [s] in sample periods; one where no time is given."""
    return 1.0 if elapsed is None else positive("elapsed", elapsed) * sample_rate
