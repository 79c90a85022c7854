"""When the operator presses the button: once the tip has looked right for a while."""

from typing import NamedTuple

from soro_lib.jit import inlined
from soro_lib.papers.shared_control.world.people import SAMPLE_TIME, Operator

ATTACH_PATIENCE = 1.0
"""Time after which an operator notices that the gripper caught nothing [s]."""


class Decision(NamedTuple):
    """Button (closed), time it has looked right, time until a decided press, time closed, reported item."""

    closed: bool
    settled: float
    pressing: float
    waited: float
    reporting: float
    reported: bool


NOT_PRESSING = -1.0
DECIDED_NOTHING = Decision(False, 0.0, NOT_PRESSING, 0.0, 0.0, False)


@inlined
def decide(rule: Operator, decision: Decision, looks_right: bool, pulled: bool, held: bool) -> Decision:
    """Press once the tip has looked right long enough; give a grasp up that caught nothing; report an item.

    ``pulled``: a force that the operator heeds says that the place is not yet right.
    """
    settled = decision.settled + SAMPLE_TIME if looks_right and not pulled else 0.0
    closed, pressing = decision.closed, decision.pressing
    if pressing > 0.0:
        pressing -= SAMPLE_TIME
        if pressing <= 0.0:
            closed, pressing, settled = not closed, NOT_PRESSING, 0.0
    elif settled >= rule.dwell and closed == held:
        pressing = rule.press
    waited = decision.waited + SAMPLE_TIME if closed and not held else 0.0
    if waited > ATTACH_PATIENCE:
        closed, waited, settled = False, 0.0, 0.0
    reporting = decision.reporting + SAMPLE_TIME if held != decision.reported else 0.0
    reported = held if reporting >= rule.press else decision.reported
    return Decision(closed, settled, pressing, waited, reporting, reported)
