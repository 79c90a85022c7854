"""Goal selection: the state machine that follows the task and says where to go.

Source: Stroppa et al., Fig. 4.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import Vector, finite, positive, vector
from soro_lib.jit import inlined

PHASES = ("start", "grasping", "lifting with item", "placing", "lifting empty", "end")
BEGIN, GRASPING, LIFTING_WITH_ITEM, PLACING, LIFTING_EMPTY, END = range(6)
LIFT_MARGIN = 0.02
"""How far above the lifted height the mended machine aims [m], so that the test is passed in finite time."""


class GoalRule(NamedTuple):
    """Constants of the goal machine; items and targets are tuples of points [m]."""

    items: tuple[Vector, ...]
    targets: tuple[Vector, ...]
    lift: bool
    lift_offset: float
    lifted_height: float
    printed: bool


class GoalState(NamedTuple):
    """Phase (index into ``PHASES``), item, current goal and the place where the item is fetched [m]."""

    phase: int
    item: int
    goal: Vector
    pick: Vector


@inlined
def lift_goal(rule: GoalRule, end_effector: Vector) -> Vector:
    """Proxy above the tip: retract along the ray from the base until z is smaller by the offset.

    The printed machine tests an absolute height, which its own proxy misses where the tip hangs lower than
    height + offset (Erratum SC-11); the mended one aims above that height wherever it starts.
    """
    height = end_effector[2] - rule.lift_offset
    if not rule.printed:
        height = min(height, rule.lifted_height - LIFT_MARGIN)
    scale = height / end_effector[2] if end_effector[2] > 0.0 else 1.0
    return (scale * end_effector[0], scale * end_effector[1], scale * end_effector[2])


@inlined
def fetch(rule: GoalRule, item: int) -> GoalState:
    """Turn to an item, or end where none is left."""
    if item >= len(rule.items):
        last = rule.targets[len(rule.targets) - 1]
        return GoalState(END, item, last, last)
    place = rule.items[item]
    return GoalState(GRASPING, item, place, place)


@inlined
def goal_step(rule: GoalRule, state: GoalState, end_effector: Vector, item_held: bool) -> GoalState:
    """One call of Goal Selection; several transitions may happen in it (Stroppa et al., Fig. 4, SC-35).

    An item lost while it is lifted sends the mended machine back to fetch it, straight below the place of the
    loss. The printed machine has no such arrow: it lifts on, then takes the empty gripper for a delivery.
    """
    if state.phase == BEGIN:
        state = fetch(rule, 0)
    if state.phase == GRASPING and item_held:
        if rule.lift:
            state = GoalState(LIFTING_WITH_ITEM, state.item, lift_goal(rule, end_effector), state.pick)
        else:
            state = GoalState(PLACING, state.item, rule.targets[state.item], state.pick)
    if state.phase == LIFTING_WITH_ITEM:
        if not item_held and not rule.printed:
            lost = (end_effector[0], end_effector[1], rule.items[state.item][2])
            state = GoalState(GRASPING, state.item, lost, lost)
        elif end_effector[2] <= rule.lifted_height:
            state = GoalState(PLACING, state.item, rule.targets[state.item], state.pick)
    if state.phase == PLACING and not item_held:
        if rule.lift:
            state = GoalState(LIFTING_EMPTY, state.item, lift_goal(rule, end_effector), state.pick)
        else:
            state = fetch(rule, state.item + 1)
    if state.phase == LIFTING_EMPTY and end_effector[2] <= rule.lifted_height:
        state = fetch(rule, state.item + 1)
    if state.phase == END:
        state = GoalState(END, state.item, end_effector, state.pick)
    return state


@dataclass(frozen=True)
class GoalResult:
    """Current goal (3,), base frame [m], its phase (one of ``PHASES``) and the number of the item."""

    goal: NDArray[np.float64]
    phase: str
    item: int


class GoalSelection:
    """Follows the task and says where to go: item, proxy above it, target, proxy, next item.

    Parameters
    ----------
    items, targets : array_like
        (n, 3) positions, base frame [m], z down; item i belongs on target i, in this order.
    lift : bool
        Whether the tip is lifted between goals: in the paradigms that automate the eversion.
    lift_offset : float
        Height by which the proxy lies above the tip [m].
    lifted_height : float
        The tip counts as lifted once its z is at or above this height (z <= lifted_height) [m].
    reach : float
        Longest distance from the base that the arm reaches [m].
    printed : bool
        True for the machine of Fig. 4 without the two mends (lost item, proxy below the lifted height).

    Raises
    ------
    ValueError
        If the points are not finite (n, 3) arrays of equal length, a goal is out of reach or not below the
        base, or the lifted height lies below an item.

    Notes
    -----
    Stroppa et al., Section 4 and Fig. 4.
    """

    def __init__(
        self,
        items: ArrayLike,
        targets: ArrayLike,
        lift: bool = True,
        lift_offset: float = 0.15,
        lifted_height: float = 0.55,
        reach: float = 1.5,
        printed: bool = False,
    ) -> None:
        positive("reach", reach)
        pick, place = goal_points("items", items, reach), goal_points("targets", targets, reach)
        if len(pick) != len(place):
            raise ValueError(
                f"items and targets must be as many, got {len(pick)} items and {len(place)} targets"
            )
        positive("lift_offset", lift_offset)
        positive("lifted_height", lifted_height)
        lowest = float(min(point[2] for point in (*pick, *place)))
        if lift and lifted_height >= lowest:
            raise ValueError(
                f"lifted_height = {lifted_height} m must be above every goal (z < {lowest} m, z points down)"
            )
        self.rule = GoalRule(pick, place, bool(lift), float(lift_offset), float(lifted_height), bool(printed))
        self.reset()

    def reset(self) -> None:
        """Return to the first item."""
        first = self.rule.items[0]
        self.state = GoalState(BEGIN, 0, first, first)

    def update(self, end_effector: ArrayLike, item_held: bool) -> GoalResult:
        """Take one sample: the tip (3,), base frame [m], and whether the gripper holds an item.

        Raises
        ------
        ValueError
            If the position is not three finite numbers.
        """
        self.state = goal_step(self.rule, self.state, vector("end_effector", end_effector), bool(item_held))
        return GoalResult(np.array(self.state.goal), PHASES[self.state.phase], self.state.item)


def goal_points(name: str, value: ArrayLike, reach: float) -> tuple[Vector, ...]:
    """Return goals (n, 3) as a tuple of points, each finite, below the base and within reach."""
    points = tuple((x, y, z) for x, y, z in finite(name, value, ("n", 3)).tolist())
    for index, point in enumerate(points):
        distance = math.hypot(*point)
        if point[2] <= 0:
            raise ValueError(f"{name}[{index}] must lie below the base (z > 0), got z = {point[2]} m")
        if distance > reach:
            raise ValueError(
                f"{name}[{index}] is out of reach: {distance:.3f} m from the base, bound {reach} m"
            )
    return points
