"""The soft-growing arm: its pose, the motor space of the supplement, redistribution, and the errata."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soro_lib.robots import ActuationError, SoftGrowingArm, redistribute_actuation
from soro_lib.robots.soft_growing import (
    MOTOR_ANGLES,
    STEERING_FROM_MOTORS,
    eversion_length,
    eversion_proxy,
    redistribution_required,
    steering_coordinates,
)

ARM = SoftGrowingArm()
SIN60, TAN60 = np.sin(np.pi / 3), np.tan(np.pi / 3)
reach = st.floats(-1.0, 1.0)
points = st.tuples(reach, reach).map(np.array)
tips = st.tuples(reach, reach, st.floats(0.01, 1.0)).map(np.array)


@given(tips)
def test_tip_is_the_actuation_and_points_along_the_body(tip):
    pose = ARM.forward(tip)
    np.testing.assert_allclose(pose[:3, 3], tip, rtol=0, atol=1e-14)
    np.testing.assert_allclose(pose[:3, 2], tip / np.linalg.norm(tip), rtol=0, atol=1e-13)


@given(tips)
def test_tip_frame_is_the_shortest_turn_of_the_base_frame(tip):
    rotation = ARM.forward(tip)[:3, :3]
    turn = np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1, 1))
    assert turn == pytest.approx(np.arctan2(np.hypot(tip[0], tip[1]), tip[2]), abs=1e-7)
    assert ARM.configuration(tip)[0, 2] == 0.0


@pytest.mark.parametrize("scale", [0.0, 1e-300, 1e-12, 1e-6])
def test_hanging_straight_is_regular(scale):
    tip = np.array([scale, -scale, 0.5])
    expected = [[0, -1 / 0.5, 0], [1 / 0.5, 0, 0], [0, 0, 0]]
    np.testing.assert_allclose(ARM.jacobian(tip)[3:], expected, rtol=0, atol=1e-5)
    np.testing.assert_allclose(ARM.jacobian(tip)[:3], np.eye(3), rtol=0, atol=1e-15)


@given(tips)
def test_jacobian_is_the_swing_of_the_body_less_its_spin(tip):
    """In closed form: [p]x / L^2, less the spin about the body that keeps the frame the shortest turn."""
    (x, y, z), length = tip, np.linalg.norm(tip)
    swing = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    spin = np.outer(tip, [-y, x, 0.0]) / (length + z)
    expected = np.vstack([np.eye(3), (swing - spin) / length**2])
    np.testing.assert_allclose(ARM.jacobian(tip), expected, rtol=0, atol=1e-12 / length)


@given(points)
def test_steering_coordinates_solve_equation_1(point):
    pulls = steering_coordinates(point)
    np.testing.assert_allclose(STEERING_FROM_MOTORS @ pulls, point, rtol=0, atol=1e-15)
    assert pulls.min() == 0.0
    directions = np.stack([np.cos(MOTOR_ANGLES), np.sin(MOTOR_ANGLES)])
    np.testing.assert_allclose(directions, STEERING_FROM_MOTORS, rtol=0, atol=1e-15)


@given(points, st.floats(-1.0, 1.0))
def test_a_common_amount_does_not_steer(point, amount):
    """Eq. (1) has one free dimension: the same amount of all three motors."""
    pulls = steering_coordinates(point)
    np.testing.assert_allclose(STEERING_FROM_MOTORS @ (pulls + amount), point, rtol=0, atol=1e-15)


@pytest.mark.parametrize("motor", [0, 1, 2])
def test_along_its_axis_one_motor_pulls_alone(motor):
    point = 0.3 * STEERING_FROM_MOTORS[:, motor]
    np.testing.assert_allclose(steering_coordinates(point), 0.3 * np.eye(3)[motor], rtol=0, atol=1e-16)


@given(tips)
def test_motor_coordinates_are_inverted_below_the_base(tip):
    motors = ARM.motor_coordinates(tip)
    assert motors[3] == pytest.approx(np.linalg.norm(tip), rel=1e-15)
    np.testing.assert_allclose(ARM.point_from_motors(motors), tip, rtol=0, atol=1e-7)


def test_motor_coordinates_of_a_batch():
    tips_ = np.random.default_rng(1).uniform(0.1, 0.6, (4, 5, 3))
    motors = ARM.motor_coordinates(tips_)
    assert motors.shape == (4, 5, 4)
    np.testing.assert_array_equal(motors[1, 2], ARM.motor_coordinates(tips_[1, 2]))


@given(tips, tips)
def test_proxy_keeps_the_length_and_takes_the_direction(actual, desired):
    """Eqs. (6)-(7): steering toward the proxy needs no eversion."""
    proxy = eversion_proxy(actual, desired)
    assert eversion_length(proxy) == pytest.approx(eversion_length(actual), rel=1e-14)
    np.testing.assert_allclose(
        proxy / eversion_length(proxy), desired / eversion_length(desired), rtol=0, atol=1e-14
    )


@given(st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3).map(np.array), st.floats(0.0, 1.0))
def test_redistribution_steers_to_the_same_point(commands, epsilon):
    redistributed = redistribute_actuation(commands, epsilon=epsilon)
    np.testing.assert_allclose(
        STEERING_FROM_MOTORS @ redistributed, STEERING_FROM_MOTORS @ commands, rtol=0, atol=1e-15
    )
    assert redistributed.max() == pytest.approx((1 - epsilon) * commands.max(), abs=1e-15)


def test_redistribution_of_the_paper():
    np.testing.assert_allclose(redistribute_actuation([10.0, 0.0, 4.0]), [7.0, -3.0, 1.0], rtol=1e-15)
    np.testing.assert_array_equal(redistribute_actuation([10.0, 0.0, 4.0], epsilon=0.0), [10.0, 0.0, 4.0])


def test_redistribution_is_required_when_the_idle_motor_changes():
    """Eq. (10): the same sector twice needs none, another sector does."""
    right, lower, upper = (steering_coordinates(p) for p in ([0.3, 0.1], [0.3, -0.1], [-0.1, 0.3]))
    assert not redistribution_required(right, lower)
    assert redistribution_required(right, upper)


# Errata of the printed equations


@given(points)
def test_corrected_equations_2_to_4_are_the_steering_coordinates(point):
    (x, y), theta = point, np.arctan2(point[1], point[0])
    if abs(theta) <= np.pi / 3:
        corrected = [x - y / TAN60, x + y / TAN60, 0.0]
    elif theta > np.pi / 3:
        corrected = [0.0, y / SIN60, y / TAN60 - x]
    else:
        corrected = [-y / SIN60, 0.0, -x - y / TAN60]
    np.testing.assert_allclose(steering_coordinates(point), corrected, rtol=0, atol=1e-15)


def test_printed_equation_2_is_right():
    """Its coefficients 1 / (2 cos 60) and 1 / (2 sin 60) are 1 and 1 / sqrt(3)."""
    x, y = 0.3, 0.1
    printed = np.array(
        [x / (2 * np.cos(np.pi / 3)) + sign * y / (2 * np.sin(np.pi / 3)) for sign in (-1, 1)] + [0.0]
    )
    np.testing.assert_allclose(printed, steering_coordinates([x, y]), rtol=0, atol=1e-16)


@pytest.mark.parametrize("equation", [3, 4])
def test_printed_equations_3_and_4_reach_half_of_y(equation):
    """Errata of the supplement: put into Eq. (1), the printed pulls return (x, y / 2)."""
    x, y = (-0.1, 0.3) if equation == 3 else (-0.1, -0.3)
    if equation == 3:
        printed = np.array([0.0, y / (2 * SIN60), y / (2 * TAN60) - x])
    else:
        printed = np.array([-y / (2 * SIN60), 0.0, -x - y / (2 * TAN60)])
    np.testing.assert_allclose(STEERING_FROM_MOTORS @ printed, [x, y / 2], rtol=0, atol=1e-15)
    np.testing.assert_allclose(STEERING_FROM_MOTORS @ steering_coordinates([x, y]), [x, y], atol=1e-15)


def test_printed_equation_3_breaks_equation_8_at_its_border():
    """At 60 degrees only motor 2 pulls; printed, s3 is negative there and s2 half of Eq. (2)'s."""
    x, y = 0.5 * np.cos(np.pi / 3), 0.5 * np.sin(np.pi / 3)
    assert y / (2 * TAN60) - x < -0.1
    assert y / (2 * SIN60) == pytest.approx(0.5 * steering_coordinates([x, y])[1])


def test_printed_sectors_overlap_and_leave_a_gap():
    """Printed: [-60, 60], [-60, 180], [180, 210] degrees; the motors are 120 degrees apart."""
    printed = [(-60, 60), (-60, 180), (180, 210)]
    corrected = [(-60, 60), (60, 180), (180, 300)]
    degrees = np.arange(-59.5, 300.0)

    def covers(sectors):
        return sum(((degrees > low) & (degrees < high)).astype(int) for low, high in sectors)

    assert (covers(corrected) == 1).all()
    assert (covers(printed) == 2).sum() == 120
    assert (covers(printed) == 0).sum() == 90


def test_two_motors_need_not_keep_pulling():
    """Erratum: the example of Fig. 4 holds only while the second command exceeds epsilon times the first."""
    assert (redistribute_actuation([10.0, 0.0, 4.0]) > 0).sum() == 2
    assert (redistribute_actuation([10.0, 0.0, 2.0]) > 0).sum() == 1


# Bad input


def test_bad_input_is_refused():
    with pytest.raises(ValueError, match=r"point must have shape \(\.\.\., 3\), got \(2,\)"):
        ARM.motor_coordinates([0.1, 0.2])
    with pytest.raises(ActuationError, match=r"point must be finite, got nan at index \(2,\)"):
        ARM.motor_coordinates([0.1, 0.2, np.nan])
    with pytest.raises(ValueError, match=r"epsilon must be in \[0, 1\], got 1.5"):
        redistribute_actuation([1.0, 0.0, 0.0], epsilon=1.5)
    with pytest.raises(ValueError, match=r"commands must have shape \(\.\.\., 3\), got \(4,\)"):
        redistribute_actuation([1.0, 0.0, 0.0, 2.0])
    with pytest.raises(ValueError, match="desired must not be the base"):
        eversion_proxy([0.0, 0.0, 0.1], [0.0, 0.0, 0.0])
    with pytest.raises(ActuationError, match="the eversion is shorter than the steering reaches out"):
        ARM.point_from_motors([0.3, 0.0, 0.0, 0.1])


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"lower_limit": (0.0, 0.0, 0.0)}, r"lower_limit\[2\] \(z\) must be above 0"),
        ({"upper_limit": (0.0, 0.0, 0.005)}, "lower_limit must be below upper_limit"),
        ({"upper_limit": (1.0, 1.0, np.nan)}, r"upper_limit must be finite, got nan at index \(2,\)"),
    ],
)
def test_bad_parameters_are_refused(parameters, message):
    with pytest.raises(ValueError, match=message):
        SoftGrowingArm(**parameters)
