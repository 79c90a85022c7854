"""Shared control of a soft-growing arm: six paradigms, two haptic assistances and the goal machine.

Every rule of the paper is a small function of plain numbers. The classes call it one sample at a time; the
simulator compiles the very same function (inlined, for speed), so that the two cannot drift apart. Vectors
inside the rules are triples of floats, lengths in metres in the base frame of the robot (x, y horizontal,
z down).

Source: Stroppa et al., Shared-Control Teleoperation Paradigms on a Soft-Growing Robot Manipulator, Section 4.
"""

from soro_lib.controllers.shared_control.assist_as_needed import AssistAsNeeded
from soro_lib.controllers.shared_control.fixed_assistance import FixedAssistance
from soro_lib.controllers.shared_control.goal_selection import GoalSelection
from soro_lib.controllers.shared_control.guidance import Guidance
from soro_lib.controllers.shared_control.paradigms import PARADIGMS, Paradigm, desired_position

__all__ = [
    "PARADIGMS",
    "AssistAsNeeded",
    "FixedAssistance",
    "GoalSelection",
    "Guidance",
    "Paradigm",
    "desired_position",
]
