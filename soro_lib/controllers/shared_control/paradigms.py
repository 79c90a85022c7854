"""The six paradigms: who steers which axis, and whether the hand is guided.

Source: Stroppa et al., Section 4, Table 1.
"""

from dataclasses import dataclass
from typing import Literal

from soro_lib.checks import Vector, finite, one_of
from soro_lib.jit import inlined

ASSISTANCES = ("none", "as needed", "fixed")


@dataclass(frozen=True)
class Paradigm:
    """Who steers what, and whether the hand is guided (Stroppa et al., Table 1).

    Parameters
    ----------
    title : str
        Name in the paper.
    automation : tuple of float
        Share of the machine in x, y (steering) and z (eversion), each in [0, 1]; the paper uses 0 and 1 only.
    assistance : {"none", "as needed", "fixed"}
        Force on the haptic device.

    Raises
    ------
    ValueError
        If a share lies outside [0, 1] or the assistance has no such name.
    """

    title: str
    automation: Vector
    assistance: Literal["none", "as needed", "fixed"] = "none"

    def __post_init__(self) -> None:
        finite("automation", self.automation, (3,), at_least=0, at_most=1)
        one_of("assistance", self.assistance, ASSISTANCES)

    @property
    def lifts(self) -> bool:
        """Whether the machine lifts the tip between goals: it does where it has the eversion."""
        return self.automation[2] >= 0.5


PARADIGMS = {
    "full_teleoperation": Paradigm("Full Teleoperation", (0.0, 0.0, 0.0)),
    "assist_as_needed": Paradigm("Assist-as-Needed", (0.0, 0.0, 0.0), "as needed"),
    "fixed_assistance": Paradigm("Fixed Assistance", (0.0, 0.0, 0.0), "fixed"),
    "msae": Paradigm("Manual Steering, Autonomous Eversion", (0.0, 0.0, 1.0)),
    "asme": Paradigm("Autonomous Steering, Manual Eversion", (1.0, 1.0, 0.0)),
    "mostly_autonomous": Paradigm("Mostly Autonomous", (1.0, 1.0, 1.0)),
}


@inlined
def desired_position(command: Vector, goal: Vector, automation: Vector) -> Vector:
    """Blend the operator's command with the goal, axis by axis.

    Shares of 0 and 1 give the paper's paradigms: full teleoperation d = c, Eq. (1); MSAE, Eq. (6); ASME,
    Eq. (7); mostly autonomous d = g, Eq. (8). What lies between is the continuous blend of its future work.

    Parameters
    ----------
    command, goal : tuple of float
        Position c commanded by the device and position g of the goal, base frame [m].
    automation : tuple of float
        Share of the machine per axis, 0 (manual) to 1 (automatic).

    Returns
    -------
    tuple of float
        Desired position d of the end-effector, base frame [m].
    """
    return (
        (1.0 - automation[0]) * command[0] + automation[0] * goal[0],
        (1.0 - automation[1]) * command[1] + automation[1] * goal[1],
        (1.0 - automation[2]) * command[2] + automation[2] * goal[2],
    )
