"""Shared control of a soft-growing arm (Stroppa et al., Section 4): the rules, as small functions of numbers.

- `paradigms`: who steers which axis (Table 1, Eqs. (1), (6)-(8));
- `guidance`: the pull towards the goal (Eqs. (2) and (4));
- `assist_as_needed`: guidance that follows the operator (Eq. (3), Fig. 5);
- `fixed_assistance`: guidance with constant gains (Eqs. (4)-(5));
- `goal_selection`: the machine that says where to go (Fig. 4).

The classes call a rule one sample at a time; the simulator compiles the very same function (inlined, for
speed), so that the two cannot drift apart. Vectors inside the rules are triples of floats, lengths in metres
in the base frame of the robot (x, y horizontal, z down). The people who are guided belong to
``soro_lib/papers/shared_control/world``.
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
