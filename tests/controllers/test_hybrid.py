"""Hybrid controller of Wang et al., Eqs. (23)-(29): model-based law, compensator, readings, limits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from soro_lib.controllers.hybrid import (
    COMPENSATIONS,
    HybridController,
    HybridSettings,
    compensate,
    length_increment,
    limit_step,
    motion_error,
    right_inverse,
)
from soro_lib.robots.pneumatic import PneumaticArm

ARM = PneumaticArm()
lengths = st.lists(st.floats(0.085, 0.1), min_size=3, max_size=3).map(np.array)


def planar_jacobian(chambers):
    return ARM.jacobian(chambers)[..., :2, :]


@given(lengths)
def test_equation_23_jacobian_is_the_derivative_of_equation_22(chambers):
    step = 1e-7
    numeric = np.stack(
        [(ARM.tip(chambers + step * e) - ARM.tip(chambers - step * e))[:2] / (2 * step) for e in np.eye(3)],
        axis=1,
    )
    assert np.allclose(planar_jacobian(chambers), numeric, atol=1e-6)


@given(lengths)
def test_equation_24_is_the_moore_penrose_inverse(chambers):
    jacobian = planar_jacobian(chambers)
    assert np.allclose(right_inverse(jacobian), np.linalg.pinv(jacobian), atol=1e-8)


def test_straight_arm_needs_no_offset_of_the_chambers():
    """Erratum VS-9: the Jacobian is (l/(3d)) dv/du at the straight arm; adding 1e-5 only adds an error."""
    jacobian = planar_jacobian(ARM.home)
    exact = ARM.rest_length / (3 * ARM.chamber_distance)
    slopes = np.array([[0.0, np.sqrt(3) / 2, -np.sqrt(3) / 2], [-1.0, 0.5, 0.5]])
    assert np.allclose(jacobian, exact * slopes, rtol=1e-12)
    offset = planar_jacobian(ARM.home + np.array([1e-5, 0, 0]))
    assert 0.0 < np.abs(offset - jacobian).max() < 1e-2


def test_singular_jacobian_gives_a_bounded_inverse():
    """Bent by 133.5 deg, no chamber moves the tip radially; the damping bounds the answer."""
    singular = np.array([[0.0, 1.0, -1.0], [0.0, 0.0, 0.0]])
    inverse = right_inverse(singular)
    assert np.isfinite(inverse).all()
    assert np.allclose(inverse[:, 1], 0.0)


@given(lengths, st.floats(-1e-3, 1e-3), st.floats(-1e-3, 1e-3))
def test_equation_25_moves_the_tip_as_wanted_and_uses_the_rest_to_go_home(chambers, dx, dy):
    jacobian, wanted = planar_jacobian(chambers), np.array([dx, dy])
    increment = length_increment(jacobian, wanted, 0.5, ARM.home - chambers)
    assert np.allclose(jacobian @ increment, wanted, atol=1e-9)
    projector = np.eye(3) - np.linalg.pinv(jacobian) @ jacobian
    expected = np.linalg.pinv(jacobian) @ wanted + projector @ (0.5 * (ARM.home - chambers))
    assert np.allclose(increment, expected, atol=1e-9)


def test_equation_25_is_the_closest_increment_to_the_pull():
    """Against a brute-force minimum: of all increments that move the tip so, it is nearest to the pull."""
    chambers = ARM.home + np.array([2e-3, -1e-3, 3e-3])
    jacobian, wanted = planar_jacobian(chambers), np.array([1e-3, -5e-4])
    pull = 0.7 * (ARM.home - chambers)
    found = minimize(
        lambda x: 1e6 * np.sum((x - pull) ** 2),
        np.zeros(3),
        constraints={"type": "eq", "fun": lambda x: 1e3 * (jacobian @ x - wanted)},
        options={"ftol": 1e-15},
    )
    assert np.allclose(length_increment(jacobian, wanted, 0.7, ARM.home - chambers), found.x, atol=1e-7)


def test_null_space_is_common_elongation_and_the_one_of_equation_25_is_an_identity():
    """Erratum VS-10: the 1 in (25) is the 3x3 identity; read as a number it would move the tip."""
    chambers = ARM.home + 2e-3
    jacobian = planar_jacobian(chambers)
    pull = ARM.home - chambers
    assert np.allclose(length_increment(jacobian, np.zeros(2), 1.0, pull), pull, atol=1e-9)
    as_a_number = (1.0 - np.linalg.pinv(jacobian) @ jacobian) @ (np.array([1.0, 2.0, 4.0]) * 1e-3)
    assert np.abs(jacobian @ as_a_number).max() > 1e-3


@pytest.mark.parametrize(("product", "stable"), [(0.1, True), (1.9, True), (2.1, False)])
def test_gain_of_the_null_space_is_kp_times_beta(product, stable):
    """Erratum VS-10: K_p multiplies the pull home too, so K_p beta < 2 is the bound, not beta < 2."""
    offset = 1e-3
    for _ in range(300):
        jacobian = planar_jacobian(ARM.home)
        offset += product * length_increment(jacobian, np.zeros(2), 1.0, np.full(3, -offset))[0]
    assert (abs(offset) < 1e-3) == stable
    if not stable:
        with pytest.raises(ValueError, match="null_gain"):
            HybridSettings(proportional_gain=0.1, null_gain=product / 0.1)


def test_equation_28_is_desired_minus_actual():
    assert np.allclose(motion_error([3e-3, 0.0], [1e-3, 1e-3]), [2e-3, -1e-3])


def test_equation_29_as_printed_depends_on_the_unit_of_length():
    """Erratum VS-11: mm times mm is mm^2; in metres the same product is 1000 times smaller."""
    desired, error = np.array([2e-3, 0.0]), np.array([1e-3, 0.0])
    in_millimetres = compensate(desired, error, "literal")
    assert np.allclose(in_millimetres, [2e-3 + 2e-3, 0.0])
    in_metres = desired + error * np.linalg.norm(desired)
    assert np.allclose(in_metres - desired, (in_millimetres - desired) / 1000.0)
    relative = compensate(desired, error / np.linalg.norm(desired), "relative")
    assert np.allclose(relative, compensate(desired, error, "additive"))


def test_readings_of_equation_29():
    desired, error = np.array([0.0, 2e-3]), np.array([1e-3, 0.5e-3])
    expected = {
        "none": [0.0, 2e-3],
        "quadratic": [0.0, 6e-3],
        "literal": [2e-3, 3e-3],
        "additive": [1e-3, 2.5e-3],
    }
    for reading, value in expected.items():
        assert np.allclose(compensate(desired, error, reading), value)
    with pytest.raises(ValueError, match="one of"):
        compensate(desired, error, "magic")


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(1e-4, 1e-2))
def test_limited_step_keeps_its_direction(x, y, bound):
    limited = limit_step([x, y], bound)
    assert np.linalg.norm(limited) <= bound * (1 + 1e-12)
    assert abs(x * limited[1] - y * limited[0]) < 1e-12
    assert np.array_equal(limit_step([x, y], np.inf), [x, y])


def follow(settings, steps=400, gain_of_plant=1.0):
    """Let an ideal arm go to a point; return its last distance [m] and the controller."""
    controller, chambers = HybridController(ARM, settings), ARM.home
    for _ in range(steps):
        tip = ARM.tip(ARM.home + gain_of_plant * (chambers - ARM.home))[:2]
        chambers = controller.update(tip, [0.01, -0.015], chambers).actuation
    return float(np.linalg.norm(tip - [0.01, -0.015])), controller


@pytest.mark.parametrize("compensation", COMPENSATIONS)
def test_every_reading_converges_on_an_ideal_arm(compensation):
    distance, _ = follow(HybridSettings(proportional_gain=0.08, compensation=compensation))
    assert distance < 1e-4


def test_window_and_warm_up():
    _, controller = follow(HybridSettings(window=30, warm_up=10), steps=20)
    assert controller.samples == 19
    _, controller = follow(HybridSettings(window=30, warm_up=10), steps=100)
    assert controller.samples == 30
    _, controller = follow(HybridSettings(compensation="quadratic"), steps=20)
    assert controller.samples == 0


def test_training_on_actual_motion_asks_far_from_its_samples():
    """Erratum VS-12: actual steps are K_p of the desired ones, so queries at the desired step extrapolate."""
    settings = HybridSettings(proportional_gain=0.04, trained_on="actual")
    controller, chambers = HybridController(ARM, settings), ARM.home
    actual, desired, before = [], [], None
    for _ in range(60):
        tip = ARM.tip(chambers)[:2]
        if before is not None:
            actual.append(np.linalg.norm(tip - before))
        result = controller.update(tip, [0.03, 0.0], chambers, compensating=False)
        desired.append(np.linalg.norm(result.desired))
        chambers, before = result.actuation, tip
    assert max(actual) < 0.1 * min(desired)


def test_batch_is_so_many_single_controllers():
    rng = np.random.default_rng(1)
    gains = np.array([0.04, 0.1])
    together = HybridController(ARM, HybridSettings(proportional_gain=gains, warm_up=3), batch=(2,))
    alone = HybridController(ARM, HybridSettings(proportional_gain=0.1, warm_up=3))
    for _ in range(10):
        tips, chambers = rng.uniform(-0.01, 0.01, (2, 2)), ARM.home + rng.uniform(0, 1e-3, (2, 3))
        both = together.update(tips, [0.01, 0.0], chambers)
        one = alone.update(tips[1], [0.01, 0.0], chambers[1])
        assert np.allclose(both.actuation[1], one.actuation, atol=1e-12)


def test_chambers_stop_at_their_limits_and_say_so():
    arm = PneumaticArm(minimum_length=0.0899, maximum_length=0.0901)
    result = HybridController(arm, HybridSettings(proportional_gain=2.0)).update([0, 0], [0.03, 0], arm.home)
    assert result.saturated
    assert (result.actuation <= arm.upper).all()
    assert (result.actuation >= arm.lower).all()


@pytest.mark.parametrize(
    ("position", "goal", "chambers", "message"),
    [
        ([np.nan, 0.0], [0.0, 0.0], ARM.home, "end_effector"),
        ([0.0, 0.0], [0.0, np.inf], ARM.home, "goal"),
        ([0.0, 0.0, 0.0], [0.0, 0.0], ARM.home, "end_effector"),
        ([0.0, 0.0], [0.0, 0.0], [0.09, np.nan, 0.09], "actuation"),
        ([0.0, 0.0], [0.0, 0.0], [-0.09, 0.09, 0.09], "chamber 1"),
    ],
)
def test_bad_input_is_refused_and_teaches_nothing(position, goal, chambers, message):
    controller = HybridController(ARM)
    controller.update([0.0, 0.0], [0.01, 0.0], ARM.home)
    with pytest.raises(ValueError, match=message):
        controller.update(position, goal, chambers)
    assert controller.samples == 0


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"proportional_gain": 0.0}, "proportional_gain"),
        ({"maximum_step": 0.0}, "maximum_step"),
        ({"compensation": "magic"}, "compensation"),
        ({"trained_on": "both"}, "trained_on"),
        ({"warm_up": 200}, "warm_up"),
    ],
)
def test_bad_settings_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        HybridSettings(**settings)
