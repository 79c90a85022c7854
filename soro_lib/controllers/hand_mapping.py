"""From the hand over the tracker to a goal for the tip; Lai et al., Eqs. (4), (5), (19), (20).

Device axes: x right, y up, z toward the user. Robot axes: z along the straight arm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from soro_lib.checks import Vector, check_fields
from soro_lib.controllers.gestures import Gesture


class TipGoal(NamedTuple):
    """Where the tip shall be [m] and where it shall point (unit vector), in the frame {W}."""

    position: Vector
    direction: Vector


@dataclass(frozen=True)
class PalmMapping:
    """The scaling of hand motion, Gamma in Lai et al., Eq. (4).

    Read per axis (erratum GS-5), (4) scales the palm position by (c_x, c_y, 150/z_P + c_z) in mm, so that the
    height becomes ``offset + c_z * height``: a higher hand means a shorter reach. The paper's z_P is the
    device's height y, its y_P the device's z (erratum GS-6). The palm normal goes through the same signed
    permutation as the position (erratum GS-7), so that a flat palm means a straight arm.

    Parameters
    ----------
    scale_x, scale_y, scale_z : float
        c_x, c_y, c_z [-].
    offset : float
        The 150 mm of (4) [m].
    half_width : float
        Half the edge of the allowed box, right and toward the user [m].
    lowest, highest : float
        Heights of the allowed box above the device [m].
    maximum_tilt : float
        Largest angle of the commanded direction from straight, on the axis [rad].
    tilt_loss : float
        How much less tilt is allowed per distance of the tip from the axis [rad/m]; 0 is one limit
        everywhere. The arm itself loses about one degree per millimetre.
    """

    scale_x: float = 0.2
    scale_y: float = -0.2
    scale_z: float = -0.2
    offset: float = 0.150
    half_width: float = 0.150
    lowest: float = 0.100
    highest: float = 0.400
    maximum_tilt: float = math.radians(30.0)
    tilt_loss: float = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "scale_x", "scale_y", "scale_z", "offset")
        check_fields(self, "half_width", "highest", above=0)
        check_fields(self, "lowest", above=0, below=self.highest)
        check_fields(self, "maximum_tilt", above=0, below=math.pi / 2)
        check_fields(self, "tilt_loss", at_least=0)

    def in_box(self, palm: Vector) -> bool:
        """Return whether the palm [m, device frame] is where the paper allows it (Section IV-A)."""
        x, y, z = palm
        return abs(x) <= self.half_width and abs(z) <= self.half_width and self.lowest <= y <= self.highest

    def position(self, palm: Vector) -> Vector:
        """Return the tip position [m] that a palm position [m, device frame] asks for; Eqs. (4), (5)."""
        x, y, z = palm
        return self.scale_x * x, self.scale_y * z, self.offset + self.scale_z * y

    def palm(self, position: Vector) -> Vector:
        """Return the palm position [m, device frame] that asks for a tip position [m]: the inverse of (4)."""
        x, y, z = position
        return x / self.scale_x, (z - self.offset) / self.scale_z, y / self.scale_y

    def direction(self, normal: Vector) -> Vector:
        """Return the pointing direction that a palm normal [device frame] asks for."""
        x, y, z = normal
        return x, -z, -y

    def goal(self, palm: Vector, normal: Vector, mode: Gesture = Gesture.PALM) -> TipGoal:
        """Return the goal of a hand under a mode, with its tilt limited."""
        goal = constrained_goal(mode, TipGoal(self.position(palm), self.direction(normal)))
        return goal._replace(direction=limited_tilt(goal.direction, self.tilt_limit(goal.position)))

    def tilt_limit(self, position: Vector) -> float:
        """Return the largest tilt [rad] that is asked for at a tip position [m]."""
        return max(self.maximum_tilt - self.tilt_loss * math.hypot(position[0], position[1]), 0.0)

    def normal(self, direction: Vector) -> Vector:
        """Return the palm normal [device frame] that asks for a pointing direction."""
        x, y, z = direction
        return x, -z, -y


def limited_tilt(direction: Vector, maximum: float) -> Vector:
    """Return the unit vector nearest to ``direction`` that is at most ``maximum`` [rad] away from e_z."""
    x, y, z = direction
    lateral = math.hypot(x, y)
    if math.atan2(lateral, z) <= maximum:
        return direction
    if lateral < 1e-9:  # straight down: no azimuth to keep
        return 0.0, 0.0, 1.0
    scale = math.sin(maximum) / lateral
    return x * scale, y * scale, math.cos(maximum)


def constrained_goal(mode: Gesture, goal: TipGoal) -> TipGoal:
    """Apply the constraint of a mode to a goal; G_sign in Lai et al., Eqs. (19), (20).

    The printed matrices do not do what the text says (erratum GS-13); the text is followed: V-sign and
    thumbs-up keep only the height, thumbs-up points straight. Palm and fist leave the goal as it is.
    """
    if mode is Gesture.V_SIGN:
        return TipGoal((0.0, 0.0, goal.position[2]), goal.direction)
    if mode is Gesture.THUMBS_UP:
        return TipGoal((0.0, 0.0, goal.position[2]), (0.0, 0.0, 1.0))
    return goal
