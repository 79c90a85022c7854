"""One period of the operator: look, believe, move, press."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from soro_lib.jit import inlined
from soro_lib.papers.shared_control.world import vectors
from soro_lib.papers.shared_control.world.belief import Belief, belief_error, new_belief, scaled_belief
from soro_lib.papers.shared_control.world.decision import DECIDED_NOTHING, Decision, decide
from soro_lib.papers.shared_control.world.hand import Hand, Movement, hand_step, intend, plan_submovement
from soro_lib.papers.shared_control.world.people import DEVICE_SCALE, SAMPLE_TIME, Operator, Vector

RESTING_SPEED = 0.02
"""Speed below which a tip looks at rest [m/s]."""

RESIGNED_OFFSET = 0.05
"""Largest offset at which an operator presses for want of anything better [m]: the side of a cube."""

LOOK_PERIOD = 0.2
"""Time between two glances at the depth [s]."""


APPROACH_FAR, APPROACH_NEAR = 0.12, 0.06
"""Horizontal errors [m] at which the approach from above begins and has ended its descent."""


class View(NamedTuple):
    """What there is to see and feel: tip, desired position and next place to go [m], force [N], item held."""

    tip: Vector
    desired: Vector
    wanted: Vector
    force: Vector
    held: bool
    automation: Vector


class OperatorState(NamedTuple):
    """Everything an operator carries from one period to the next."""

    sample: int
    think_until: float
    last_held: bool
    resting: float
    belief: Belief
    movement: Movement
    hand: Hand
    decision: Decision


def operator_start(tip: Vector) -> OperatorState:
    """An operator whose hand rests where the device commands the tip to stay."""
    rest = (tip[0] / DEVICE_SCALE[0], tip[1] / DEVICE_SCALE[1], tip[2] / DEVICE_SCALE[2])
    return OperatorState(
        sample=0,
        think_until=0.0,
        last_held=True,
        resting=0.0,
        belief=Belief(0.0, 0.0, 0.0, 0.0, vectors.ZERO),
        movement=Movement(vectors.ZERO, -10.0, 1.0, rest),
        hand=Hand(rest, vectors.ZERO, vectors.ZERO),
        decision=DECIDED_NOTHING,
    )


def picture_buffer(rule: Operator, tip: Vector) -> NDArray[np.float64]:
    """Ring buffer of the pictures on their way through the eye, filled with the tip at rest."""
    return vectors.delay_line(tip, round(rule.reaction_delay / SAMPLE_TIME))


@inlined
def delayed_picture(pictures: NDArray[np.float64], sample: int, tip: Vector) -> tuple[Vector, float]:
    """The tip one reaction delay ago [m] and its speed then [m/s]; the new picture is stored."""
    count = len(pictures)
    seen, following = vectors.row(pictures, sample % count), vectors.row(pictures, (sample + 1) % count)
    vectors.set_row(pictures, sample % count, tip)
    return seen, vectors.size(vectors.difference(following, seen)) / SAMPLE_TIME if count > 1 else 0.0


@inlined
def heed_force(rule: Operator, belief: Belief, force: Vector) -> Belief:
    """Take a felt force for a hint and move the belief along it."""
    step = rule.cue_gain * SAMPLE_TIME
    if step == 0.0 or vectors.size(force) <= rule.felt_force:
        return belief
    shift = vectors.moved(belief.shift, step, force)
    return Belief(belief.right, belief.up, belief.depth, belief.glance, shift)


@inlined
def approach_rise(rule: Operator, goal: Vector, seen: Vector) -> float:
    """How much higher to aim while the tip is horizontally far from the goal [m]."""
    across = vectors.size((goal[0] - seen[0], goal[1] - seen[1], 0.0))
    share = (across - APPROACH_NEAR) / (APPROACH_FAR - APPROACH_NEAR)
    return rule.approach_height * min(max(share, 0.0), 1.0)


@inlined
def believed_goal(rule: Operator, belief: Belief, view: View) -> Vector:
    """Where the operator takes the goal to be [m]."""
    wrong, shift, machine = belief_error(rule, belief, view.automation), belief.shift, view.automation
    return (
        view.wanted[0] + wrong[0] + (1.0 - machine[0]) * shift[0],
        view.wanted[1] + wrong[1] + (1.0 - machine[1]) * shift[1],
        view.wanted[2] + wrong[2] + (1.0 - machine[2]) * shift[2],
    )


@inlined
def seen_error(rule: Operator, view: View, goal: Vector, seen: Vector) -> Vector:
    """What is left to steer [m]: from where the tip is expected to settle to the goal, approached from above.

    Axes that the machine steers alone are left to it.
    """
    foreseen, machine = rule.lag_model, view.automation
    z = goal[2] - approach_rise(rule, goal, seen)
    return (
        goal[0] - seen[0] - foreseen * (view.desired[0] - seen[0]) if machine[0] < 1.0 else 0.0,
        goal[1] - seen[1] - foreseen * (view.desired[1] - seen[1]) if machine[1] < 1.0 else 0.0,
        z - seen[2] - foreseen * (view.desired[2] - seen[2]) if machine[2] < 1.0 else 0.0,
    )


@inlined
def operator_step(
    rule: Operator, state: OperatorState, pictures: NDArray[np.float64], view: View, rng: np.random.Generator
) -> OperatorState:
    """One period of 10 ms: look, believe, move, press.

    The command to the arm is the hand's position times `DEVICE_SCALE`; the buttons stand in the decision.
    """
    time = SAMPLE_TIME * state.sample
    seen, speed = delayed_picture(pictures, state.sample, view.tip)

    belief, think_until, decision = state.belief, state.think_until, state.decision
    if view.held != state.last_held or state.sample == 0:
        belief, think_until = new_belief(rule, belief, rng), time + rule.think
    elif state.sample % round(LOOK_PERIOD / SAMPLE_TIME) == 0:
        glance = rule.look_noise * rng.standard_normal()
        belief = Belief(belief.right, belief.up, belief.depth, glance, belief.shift)

    goal = believed_goal(rule, belief, view)
    offset = vectors.size(vectors.difference(goal, seen))
    machine = max(view.automation[0], view.automation[1], view.automation[2])
    resting = state.resting + SAMPLE_TIME if speed < RESTING_SPEED and machine > 0.0 else 0.0
    resigned = resting > rule.resignation and offset < RESIGNED_OFFSET
    looks_right = offset < 1.5 * rule.tolerance or resigned
    if looks_right:
        belief = heed_force(rule, belief, view.force)

    movement = state.movement
    pause = rule.refractory / (1.0 - rule.passivity)
    ready = time >= movement.start + movement.duration + pause and time >= think_until
    if ready and speed <= rule.wait_speed:
        error = seen_error(rule, view, goal, seen)
        if vectors.size(error) > rule.tolerance:
            movement = plan_submovement(rule, movement, error, time, rng)

    movement = intend(rule, movement, state.hand, time)
    hand = hand_step(rule, state.hand, movement.intention, view.force, time, rng)
    pulled = rule.cue_gain > 0.0 and vectors.size(view.force) > rule.felt_force
    decided = decide(rule, decision, looks_right and time >= think_until, pulled, view.held)
    if decision.closed and not decided.closed and not view.held:
        belief = scaled_belief(belief, 1.0 - rule.learn)
    return OperatorState(state.sample + 1, think_until, view.held, resting, belief, movement, hand, decided)
