"""The Helix arm: tip points, tendon and motor maps, limits, and the errata of Vervloet's Eqs. (1)-(5)."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from soro_lib.arcs import arc_transform, chain_transform
from soro_lib.robots import ActuationError, ActuationWarning, HelixArm
from soro_lib.robots.helix import origin_from_arm_base

ARM = HelixArm()
states = hnp.arrays(float, 9, elements=st.floats(-1.0, 1.0)).map(lambda s: ARM.clip(ARM.home + s).actuation)


@given(states)
def test_tip_points_are_wrist_and_gripper(q):
    wrist = chain_transform(q.reshape(3, 3))
    expected = [*wrist[:3, 3], *(wrist @ [0.0, 0.0, 0.1, 1.0])[:3]]
    np.testing.assert_allclose(ARM.tip_points(q), expected, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(ARM.forward(q), wrist)


def test_calibrated_pose_is_x_0():
    np.testing.assert_allclose(ARM.tip_points(ARM.home), [0, 0, 0.6, 0, 0, 0.7], rtol=0, atol=1e-16)


@given(states)
def test_tip_points_jacobian_agrees_with_differences(q):
    jacobian, step = ARM.tip_points_jacobian(q), 1e-6
    for index in range(9):
        nudge = step * np.eye(9)[index]
        slope = (ARM.tip_points(q + nudge) - ARM.tip_points(q - nudge)) / (2 * step)
        np.testing.assert_allclose(jacobian[:, index], slope, rtol=0, atol=1e-9)


@given(states)
def test_tip_points_jacobian_has_rank_5(q):
    """Wrist and gripper keep their distance, so [-u; u] along the pointing direction u is out of reach."""
    jacobian = ARM.tip_points_jacobian(q)
    values = np.linalg.svd(jacobian, compute_uv=False)
    assert values[5] < 1e-15 * 10
    assert values[4] > 1e-3
    u = ARM.forward(q)[:3, 2]
    np.testing.assert_allclose(np.concatenate([-u, u]) @ jacobian, 0.0, rtol=0, atol=1e-15)


def test_tip_points_accept_any_finite_state_in_batches():
    """Estimates of the state are not commands: the limits do not apply to them, finiteness and shape do."""
    rng = np.random.default_rng(1)
    q = rng.normal(0.0, 2.0, (3, 2, 9))
    points, jacobians = ARM.tip_points_and_jacobian(q)
    assert points.shape == (3, 2, 6)
    assert jacobians.shape == (3, 2, 6, 9)
    np.testing.assert_allclose(points[2, 1], ARM.tip_points(q[2, 1]), rtol=0, atol=1e-14)
    np.testing.assert_allclose(jacobians[2, 1], ARM.tip_points_jacobian(q[2, 1]), rtol=0, atol=1e-13)
    with pytest.raises(ActuationError, match=r"q must have shape \(\.\.\., 9\), got \(3, 3\)"):
        ARM.tip_points(np.zeros((3, 3)))
    with pytest.raises(ActuationError, match=r"q must be finite, got nan at index \(4,\)"):
        ARM.tip_points(np.where(np.arange(9) == 4, np.nan, 0.1))


@given(
    hnp.arrays(float, 9, elements=st.floats(-2.0, 2.0)), hnp.arrays(float, 3, elements=st.floats(-3.0, 3.0))
)
def test_tendon_lengths_are_inverted(q, offsets):
    arm = HelixArm(tendon_offsets=tuple(offsets))
    np.testing.assert_allclose(arm.state_from_tendons(arm.tendon_lengths(q)), q, rtol=0, atol=1e-13)


def test_tendon_lengths_at_calibration_and_when_bent():
    np.testing.assert_allclose(ARM.tendon_lengths(ARM.home), [0.12] * 3 + [0.24] * 6, rtol=0, atol=1e-16)
    q = ARM.home.copy()
    q[3] = 1.0
    expected = 0.24 - 0.03 * np.cos(2 * np.pi / 3 * np.arange(3))
    np.testing.assert_allclose(ARM.tendon_lengths(q)[3:6], expected, rtol=0, atol=1e-16)


def test_a_straight_chord_between_the_end_plates_is_another_map():
    """The thesis calls g nonlinear; with straight tendons it would be, by 10 % at the largest bend."""
    ends = arc_transform([0.0, np.pi / 2], 0.0, 0.24) @ np.array([0.0, 0.03, 0.0, 1.0])
    chord = np.linalg.norm(ends[:, :3] - [0.0, 0.03, 0.0], axis=-1)
    np.testing.assert_allclose(chord / 0.24, [1.0, np.sin(np.pi / 4) / (np.pi / 4)], rtol=1e-12)
    assert chord[1] / 0.24 == pytest.approx(0.9, abs=1e-3)


@given(states)
def test_motor_angles_are_inverted(q):
    lengths = ARM.tendon_lengths(q)
    np.testing.assert_allclose(
        ARM.tendons_from_motors(ARM.motor_angles(lengths)), lengths, rtol=0, atol=1e-16
    )


def test_pulling_a_centimetre_turns_a_motor_by_one_radian():
    lengths = ARM.tendon_lengths(ARM.home) - 0.01
    np.testing.assert_allclose(ARM.motor_angles(lengths), [-1] * 6 + [1] * 3, rtol=0, atol=1e-13)


def test_frames_differ_by_a_half_turn_about_x():
    """The pair that the arm's public description documents."""
    np.testing.assert_array_equal(origin_from_arm_base([0.0, -0.25, 0.4]), [0.0, 0.25, -0.4])
    np.testing.assert_array_equal(origin_from_arm_base([0.0, -1.0, 0.0]), [0.0, 1.0, 0.0])
    points = np.random.default_rng(1).normal(size=(4, 3))
    np.testing.assert_array_equal(origin_from_arm_base(origin_from_arm_base(points)), points)


@given(states)
def test_bends_and_lengths_are_equation_9(q):
    matrix = np.zeros((6, 9))
    for segment in range(3):
        matrix[2 * segment, 3 * segment : 3 * segment + 2] = 1.0
        matrix[2 * segment + 1, 3 * segment + 2] = 1.0
    np.testing.assert_allclose(ARM.bends_and_lengths(q), np.sqrt(matrix @ q**2), rtol=0, atol=1e-15)


def test_limits_are_those_of_equation_11():
    lower, upper = (ARM.bends_and_lengths(q) for q in (ARM.home, ARM.upper))
    np.testing.assert_array_equal(lower[::2], 0.0)
    np.testing.assert_array_equal(ARM.lower[2::3], [0.08, 0.16, 0.16])
    np.testing.assert_array_equal(upper[1::2], [0.14, 0.26, 0.26])
    np.testing.assert_array_equal(ARM.upper[::3], [np.pi / 4, np.pi / 2, np.pi / 2])


def test_a_bend_beyond_its_limit_is_reported_even_if_its_components_are_not():
    q = ARM.home.copy()
    q[3:5] = 1.2
    with pytest.warns(ActuationWarning, match=r"segment 2 is 1.69706 rad, above its limit 1.5708"):
        ARM.forward(q)
    report = ARM.clip(q)
    np.testing.assert_array_equal(report.clipped, np.isin(np.arange(9), [3, 4]))
    np.testing.assert_allclose(report.actuation[3:5], np.pi / 2 / np.sqrt(2), rtol=1e-15)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ARM.forward(report.actuation)


# Errata of the printed equations


def printed_rotation(cosine_phi, sine_phi, theta):
    """Return Eq. (1) as printed: the 1 of the second row stands in the first column."""
    c, s, bend = cosine_phi, sine_phi, np.cos(theta) - 1
    return np.array(
        [
            [c * c * bend + 1, s * c * bend, c * np.sin(theta)],
            [s * c * bend + 1, s * s * bend, s * np.sin(theta)],
            [-c * np.sin(theta), -s * np.sin(theta), np.cos(theta)],
        ]
    )


@given(st.floats(1e-3, 3.0), st.floats(-np.pi, np.pi))
def test_corrected_equations_1_and_2_are_the_arc(theta, phi):
    rotation = printed_rotation(np.cos(phi), np.sin(phi), theta)
    rotation[1, :2] += [-1.0, 1.0]
    length = 0.24
    lateral = 1 - np.cos(theta)
    position = length / theta * np.array([np.cos(phi) * lateral, np.sin(phi) * lateral, np.sin(theta)])
    pose = arc_transform(theta * np.cos(phi), theta * np.sin(phi), length)
    np.testing.assert_allclose(pose[:3, :3], rotation, rtol=0, atol=1e-14)
    np.testing.assert_allclose(pose[:3, 3], position, rtol=0, atol=1e-13)


@pytest.mark.parametrize(("theta", "phi"), [(0.0, 0.0), (1.1, 0.9), (0.7, -2.0)])
def test_printed_equations_1_and_4_are_no_rotation(theta, phi):
    """Errata SH-1, SH-2: with the 1 in the wrong column it is not orthonormal, and singular at rest."""
    printed = printed_rotation(np.cos(phi), np.sin(phi), theta)
    assert np.abs(printed @ printed.T - np.eye(3)).max() > 0.5
    if theta == 0.0:
        assert np.linalg.det(printed) == 0.0


def test_printed_argument_of_equation_4_makes_every_bend_one_radian():
    """Erratum SH-2: the printed argument is a bend divided by itself."""
    pose = arc_transform(0.3, 0.0, 0.24)
    printed = np.cos(0.3 / 0.3)
    assert pose[2, 2] == pytest.approx(np.cos(0.3), abs=1e-15)
    assert abs(printed - pose[2, 2]) > 0.4


def test_printed_equation_5_has_the_length_squared():
    """Erratum SH-3: the prefactor l / theta repeats the length: a double arm reaches four times as far."""

    def printed(dx, length):
        bend = abs(dx)
        inner = np.array([length * dx / bend * (1 - np.cos(bend)), 0.0, length / bend * np.sin(bend)])
        return length / bend * inner

    def corrected(dx, length):
        bend = abs(dx)
        return length / bend * np.array([dx / bend * (1 - np.cos(bend)), 0.0, np.sin(bend)])

    np.testing.assert_allclose(corrected(0.8, 0.24), arc_transform(0.8, 0.0, 0.24)[:3, 3], rtol=1e-14)
    np.testing.assert_allclose(printed(0.8, 0.48), 4 * printed(0.8, 0.24), rtol=1e-14)
    assert np.abs(printed(0.8, 0.24) - arc_transform(0.8, 0.0, 0.24)[:3, 3]).max() > 0.05


@pytest.mark.parametrize(("dx", "dy", "agrees"), [(0.3, 0.4, True), (-0.3, 0.4, False), (0.3, -0.4, False)])
def test_printed_equation_3_holds_in_the_first_quadrant_only(dx, dy, agrees):
    """Erratum SH-4: arccos and arcsin differ elsewhere; only atan2(dy, dx) is the direction of the tip."""
    bend = np.hypot(dx, dy)
    tip = arc_transform(dx, dy, 0.24)[:3, 3]
    assert np.arctan2(tip[1], tip[0]) == pytest.approx(np.arctan2(dy, dx), abs=1e-14)
    assert (np.arccos(dx / bend) == pytest.approx(np.arcsin(dy / bend), abs=1e-12)) == agrees


def test_equation_13_holds_without_the_square():
    """Erratum: printed, the squared distance of wrist and gripper would be 0.10, a distance of 0.32 m."""
    points = ARM.tip_points(ARM.clip(np.linspace(-0.4, 0.5, 9)).actuation)
    distance = np.linalg.norm(points[3:] - points[:3])
    assert distance == pytest.approx(ARM.gripper_length, abs=1e-15)
    assert abs(distance**2 - ARM.gripper_length) > 0.08


def test_plus_dx_tilts_the_tip_toward_plus_x():
    """Erratum: the text calls dx a rotation along x; the arm turns about y."""
    pose = arc_transform(0.4, 0.0, 0.24)
    assert pose[0, 3] > 0.0
    assert pose[1, 3] == 0.0
    np.testing.assert_array_equal(pose[:3, 1], [0.0, 1.0, 0.0])


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"tendon_radius": -0.03}, "tendon_radius must be a finite number above 0"),
        ({"rest_lengths": (0.12, 0.24)}, r"rest_lengths must have shape \(3,\), got \(2,\)"),
        ({"rest_lengths": (0.2, 0.24, 0.24)}, r"rest_lengths\[0\] must be in \[0.08, 0.14\], got 0.2"),
        (
            {"maximum_bends": (0.0, 1.0, 1.0)},
            r"maximum_bends must be a .* above 0, got 0.0 at index \(0,\)",
        ),
        ({"tendon_offsets": (0.0, np.nan, 0.0)}, r"tendon_offsets must be finite, got nan at index \(1,\)"),
        ({"motor_orientations": (1,) * 8}, r"motor_orientations must be nine of -1 and \+1"),
    ],
)
def test_bad_parameters_are_refused(parameters, message):
    with pytest.raises(ValueError, match=message):
        HelixArm(**parameters)
