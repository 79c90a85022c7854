"""The simulated and the real tip, the low-level controllers of the supplement and the gripper."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soro_lib.papers.shared_control.world.plant import (
    NOTHING,
    REAL_GRIPPER,
    SIMULATED_GRIPPER,
    GripperState,
    PlantParameters,
    SoftGrowingPlant,
    control_error,
    eversion_command,
    gripper_step,
    real_arm,
    steering_command,
)
from soro_lib.robots.soft_growing import STEERING_FROM_MOTORS

ITEMS = np.array([[-0.095, 0.117, 0.645], [-0.103, -0.175, 0.645]])
below = st.tuples(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(0.4, 0.8))


def settle(parameters, desired, seconds=12.0):
    plant = SoftGrowingPlant(parameters)
    return np.array([plant.step(desired) for _ in range(round(100 * seconds))])


def test_simulated_tip_closes_one_percent_per_sample():
    path = settle(PlantParameters(), (0.2, -0.1, 0.6), 3.0)
    gap = np.array([0.2, -0.1, 0.6]) - path
    expected = np.array([0.2, -0.1, 0.5]) * 0.99 ** np.arange(1, 301)[:, None]
    np.testing.assert_allclose(gap, expected, rtol=1e-9)


@settings(max_examples=20)
@given(below)
def test_real_arm_settles_within_its_stated_imperfections(desired):
    tip = settle(real_arm(), desired)[-1]
    wanted = np.array(desired)
    length = np.linalg.norm(wanted)
    tilt = np.linalg.norm(tip[:2] / np.linalg.norm(tip) - wanted[:2] / length)
    assert tilt <= 0.012 * 0.65 / min(np.linalg.norm(tip), 0.65) + 2e-3
    if tip[2] < 0.669:
        assert np.linalg.norm(tip) - length == pytest.approx(0.004 / 1.4, abs=2e-3)


def test_without_imperfections_the_real_arm_arrives():
    ideal = PlantParameters(real=True, cable_friction=0.0, passive_growth=0.0, feed_forward=0.0)
    np.testing.assert_allclose(settle(ideal, (0.2, -0.1, 0.6))[-1], [0.2, -0.1, 0.6], atol=1e-4)


def test_real_arm_is_late_limited_and_stopped_by_the_table():
    path = settle(real_arm(), (0.3, 0.0, 0.9), 6.0)
    speed = np.linalg.norm(np.diff(path, axis=0), axis=1) / 0.01
    assert np.all(path[:14, :2] == 0)
    assert speed.max() <= 0.2 * np.sqrt(2) + 1e-6
    assert path[:, 2].max() <= 0.67 + 1e-9


def test_friction_leaves_what_no_integral_term_removes():
    without = PlantParameters(real=True, cable_friction=0.0)
    errors = [
        np.hypot(*(settle(parameters, (0.006, 0.0, 0.6))[-1, :2] - [0.006, 0.0]))
        for parameters in (real_arm(), without)
    ]
    assert errors[0] > 0.004
    assert errors[1] < 1e-4


def test_a_longer_arm_steers_more_sluggishly():
    def lag(length):
        plant = SoftGrowingPlant(PlantParameters(real=True, cable_friction=0.0), (0.0, 0.0, length))
        aim = length * np.array([np.sin(0.05), 0.0, np.cos(0.05)])
        swing = np.array([plant.step(aim)[0] for _ in range(300)]) / aim[0]
        return np.argmax(swing > 0.3)

    assert lag(1.2) > lag(0.6) > lag(0.3)


def test_low_level_controllers():
    assert eversion_command(1.4, 0.016, 0.1) == pytest.approx(0.124)
    assert steering_command(1.4, 0.1, 1.3, 0.1, 0.2) == pytest.approx(2 * (0.14 + 0.02))


@given(below, below)
def test_control_error_leads_to_the_proxy_and_everts_the_rest(actual, desired):
    steering, growth = control_error(actual, desired)
    length = np.linalg.norm(actual)
    proxy = np.array(desired) * length / np.linalg.norm(desired)
    np.testing.assert_allclose(
        STEERING_FROM_MOTORS @ steering * length, proxy[:2] - np.array(actual)[:2], atol=1e-12
    )
    assert growth == pytest.approx(np.linalg.norm(desired) - length)


def test_redistribution_follows_a_change_of_the_idle_motor():
    actual, desired = (0.0, 0.0, 0.6), (0.05, 0.01, 0.6)
    fresh, _ = control_error(actual, desired, previous_steering=(1.0, 1.0, 0.0))
    turned, _ = control_error(actual, desired, previous_steering=(0.0, 1.0, 1.0))
    assert fresh.min() == 0.0
    assert turned.min() < 0.0


@given(st.floats(0.01, 0.3))
def test_ways_from_distance_to_angle_agree_for_small_steps(ratio):
    """The supplement prints no formula from distances to angles; the candidates differ by 1.2 % at most."""
    if ratio <= 0.26:
        candidates = [np.arcsin(ratio), ratio, 2 * np.arcsin(ratio / 2)]
        assert max(candidates) / min(candidates) < 1.012


def test_simulated_gripper_attracts_by_command_and_lets_go_at_once():
    rng = np.random.default_rng(1)
    open_hand = GripperState(NOTHING, -1.0)
    far, near = (0.0, 0.0, 0.1), tuple(ITEMS[0] + [0.03, 0.0, 0.0])
    held = gripper_step(SIMULATED_GRIPPER, open_hand, ITEMS, far, near, True, rng)
    assert held.item == 0
    assert gripper_step(SIMULATED_GRIPPER, open_hand, ITEMS, near, far, True, rng).item == NOTHING
    assert gripper_step(SIMULATED_GRIPPER, open_hand, ITEMS, near, near, False, rng).item == NOTHING
    assert gripper_step(SIMULATED_GRIPPER, held, ITEMS, near, near, False, rng).item == NOTHING


def test_real_gripper_attracts_at_the_tip_and_lets_go_late():
    rng = np.random.default_rng(1)
    near = tuple(ITEMS[1] + [0.0, 0.04, 0.0])
    held = gripper_step(REAL_GRIPPER, GripperState(NOTHING, -1.0), ITEMS, near, (0, 0, 1), True, rng)
    assert held.item == 1
    delays = []
    for _ in range(400):
        state, samples = held, 0
        while state.item != NOTHING:
            state, samples = gripper_step(REAL_GRIPPER, state, ITEMS, near, near, False, rng), samples + 1
        delays.append(0.01 * samples)
    assert min(delays) >= 0.2
    assert np.mean(delays) == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(
    ("name", "value"),
    [("tip_lag", 0.0), ("cable_friction", -0.1), ("maximum_tilt", 1.6), ("minimum_length", 2.0)],
)
def test_bad_parameters_are_named(name, value):
    with pytest.raises(ValueError, match=name):
        PlantParameters(**{name: value})


def test_bad_positions_are_named():
    with pytest.raises(ValueError, match="tip must hang below the base"):
        SoftGrowingPlant(PlantParameters(), (0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="desired must be finite"):
        SoftGrowingPlant(PlantParameters()).step((0.0, np.nan, 0.5))
    with pytest.raises(ValueError, match="actual must not be the base"):
        control_error((0.0, 0.0, 0.0), (0.0, 0.0, 0.5))
