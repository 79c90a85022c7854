"""Submovements and the compliant hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soro_lib.papers.shared_control.world.hand import (
    Hand,
    Movement,
    hand_step,
    intend,
    minimum_jerk,
    plan_submovement,
)
from soro_lib.papers.shared_control.world.people import ATTITUDES, EXPERT
from soro_lib.papers.shared_control.world.vectors import after_friction

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
    left, size = np.linalg.norm(after_friction(force, 0.2)), np.linalg.norm(force)
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
