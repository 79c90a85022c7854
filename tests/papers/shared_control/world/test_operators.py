"""The simulated human: belief, movement, compliant hand, decision."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soro_lib.papers.shared_control.world import ATTITUDES, EXPERT, NAIVE, POPULATIONS, Operator
from soro_lib.papers.shared_control.world.belief import Belief, belief_error, new_belief
from soro_lib.papers.shared_control.world.decision import DECIDED_NOTHING, decide
from soro_lib.papers.shared_control.world.hand import (
    Hand,
    Movement,
    felt_force,
    hand_step,
    intend,
    minimum_jerk,
    plan_submovement,
)
from soro_lib.papers.shared_control.world.loop import View, operator_start, operator_step, picture_buffer

ZERO = (0.0, 0.0, 0.0)
STILL = replace(EXPERT, wander=0.0, tremor=0.0, motor_noise=0.0)


def push(operator, force, seconds):
    hand = Hand(ZERO, ZERO, ZERO)
    rng = np.random.default_rng(1)
    path = []
    for sample in range(round(100 * seconds)):
        hand = hand_step(operator, hand, ZERO, force, 0.01 * sample, rng)
        path.append(hand.position)
    return np.array(path)


def test_a_pushed_hand_rests_where_its_stiffness_balances_the_force():
    path = push(STILL, (3.2, 0.0, 0.0), 3.0)
    np.testing.assert_allclose(path[-1], [3.0 / 150.0, 0.0, 0.0], atol=1e-6)


def test_the_hand_is_a_damped_oscillator():
    """Against the closed form of mass, damper and spring under a step force."""
    path = push(replace(STILL, device_friction=0.0), (1.0, 0.0, 0.0), 0.6)[:, 0]
    time = 0.01 * np.arange(1, 61)
    decay, natural = 6.5 / (2 * 0.6), math.sqrt(150 / 0.6)
    damped = math.sqrt(natural**2 - decay**2)
    expected = (
        1 - np.exp(-decay * time) * (np.cos(damped * time) + decay / damped * np.sin(damped * time))
    ) / 150
    np.testing.assert_allclose(path, expected, atol=3e-4)


@given(st.tuples(*[st.floats(-5, 5)] * 3))
def test_friction_only_takes_away(force):
    left, size = np.linalg.norm(felt_force(force, 0.2)), np.linalg.norm(force)
    assert left == pytest.approx(max(size - 0.2, 0.0), abs=1e-12)


def test_minimum_jerk_starts_and_ends_at_rest():
    grid = np.linspace(0, 1, 10001)
    position = np.array([minimum_jerk(share) for share in grid])
    assert position[0] == 0
    assert position[-1] == 1
    for order in (1, 2):
        derivative = np.diff(position, order) * 10000**order
        assert abs(derivative[0]) < 1e-2
        assert abs(derivative[-1]) < 1e-2
    assert [minimum_jerk(share) for share in (-1.0, 2.0)] == [0.0, 1.0]


def test_a_submovement_covers_its_gain_of_the_error():
    rng = np.random.default_rng(1)
    movement = plan_submovement(STILL, Movement(ZERO, 0.0, 1.0, ZERO), (0.1, 0.0, 0.3), 0.0, rng)
    np.testing.assert_allclose(movement.change, [0.92 * 0.1 / 10, 0.0, 0.92 * 0.3 / 15])
    for sample in range(200):
        movement = intend(STILL, movement, Hand(ZERO, ZERO, ZERO), 0.01 * sample)
    np.testing.assert_allclose(movement.intention, movement.change, atol=1e-12)


def test_yielding_lets_the_intention_follow_the_hand():
    giving = replace(STILL, **ATTITUDES["yield"])
    movement, hand = Movement(ZERO, -10.0, 1.0, ZERO), Hand((0.01, 0.0, 0.0), ZERO, ZERO)
    for sample in range(200):
        movement = intend(giving, movement, hand, 0.01 * sample)
    assert movement.intention[0] == pytest.approx(0.01 * (1 - math.exp(-1.0)), rel=5e-3)


@pytest.mark.parametrize("automation", [(0, 0, 0), (1, 1, 0), (0, 0, 1), (1, 1, 1)])
def test_only_the_free_depth_axis_suffers_the_depth_error(automation):
    belief = Belief(right=0.0, up=0.0, depth=0.05, glance=0.0, shift=ZERO)
    error = np.array(belief_error(EXPERT, belief, tuple(map(float, automation))))
    if automation == (0, 0, 0):
        np.testing.assert_allclose(error, 0.05 * np.array([math.cos(math.pi / 6), 0.0, 0.5]))
    else:
        np.testing.assert_array_equal(np.abs(error), 0.0)


def test_beliefs_have_their_stated_spread_and_correlation():
    rng = np.random.default_rng(1)
    belief, depths, ups = Belief(0.0, 0.0, 0.0, 0.0, ZERO), [], []
    for _ in range(20000):
        belief = new_belief(NAIVE, belief, rng)
        depths.append(belief.depth)
        ups.append(belief.up)
    assert np.std(depths) == pytest.approx(0.05, rel=0.05)
    assert np.corrcoef(depths[1:], depths[:-1])[0, 1] == pytest.approx(0.6, abs=0.03)
    assert np.std(ups) == pytest.approx(0.004, rel=0.05)


def test_the_button_is_pressed_after_dwell_and_latency():
    decision, samples = DECIDED_NOTHING, 0
    while not decision.closed:
        decision = decide(EXPERT, decision, True, False, False)
        samples += 1
    assert samples == pytest.approx(100 * (0.4 + 0.25), abs=2)


def test_a_grasp_that_caught_nothing_is_given_up():
    decision = DECIDED_NOTHING
    closed = [(decision := decide(EXPERT, decision, True, False, False)).closed for _ in range(400)]
    first = closed.index(True)
    assert closed[first : first + 98] == [True] * 98
    assert not closed[first + 102]


def test_a_heeded_force_keeps_the_finger_off_the_button():
    decision = DECIDED_NOTHING
    for _ in range(300):
        decision = decide(EXPERT, decision, True, True, False)
    assert not decision.closed


def test_an_operator_without_errors_steers_to_the_goal():
    perfect = replace(STILL, lateral_error=0.0, depth_error=0.0, look_noise=0.0, approach_height=0.0)
    start, goal = (0.0, 0.0, 0.1), (0.2, -0.1, 0.6)
    state, pictures = operator_start(start), picture_buffer(perfect, start)
    rng, tip = np.random.default_rng(1), np.array(start)
    for _ in range(1000):
        command = np.array(state.hand.position) * [10.0, 10.0, 15.0]
        tip = tip + 0.01 * (command - tip)
        view = View(tuple(tip.tolist()), tuple(command.tolist()), goal, ZERO, False, ZERO)
        state = operator_step(perfect, state, pictures, view, rng)
    assert np.linalg.norm(tip - goal) < perfect.tolerance


def test_populations_scatter_about_their_typical_person():
    rng = np.random.default_rng(1)
    people = [POPULATIONS["naive"].draw(rng) for _ in range(2000)]
    assert np.median([person.depth_error for person in people]) == pytest.approx(0.05, rel=0.05)
    assert np.std(np.log([person.hand_stiffness for person in people])) == pytest.approx(0.4, rel=0.1)
    assert all(0 <= person.lag_model <= 1 for person in people)
    assert np.std([person.mapping_angle for person in people]) == pytest.approx(math.radians(15), rel=0.1)


@pytest.mark.parametrize("name", [field.name for field in fields(Operator)])
def test_every_parameter_is_checked(name):
    with pytest.raises(ValueError, match=name):
        Operator(**{name: math.nan})
    if name != "mapping_angle":
        with pytest.raises(ValueError, match=name):
            Operator(**{name: -1.0})


@pytest.mark.parametrize(("name", "value"), [("lag_model", 1.5), ("passivity", 1.0), ("view_elevation", 2.0)])
def test_bounds_above_are_checked(name, value):
    with pytest.raises(ValueError, match=name):
        Operator(**{name: value})
