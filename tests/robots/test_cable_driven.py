"""The compressible curvature model of Lai et al., its reference values and the errata of its equations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soro_lib.arcs import arc_transform, chain_jacobian, chain_transform
from soro_lib.robots import CableDrivenArm
from soro_lib.robots.cable_driven import CABLE_ANGLES

# Slide [mm], six commands [-N], tip [mm], end of the proximal segment [mm], by an independent implementation.
REFERENCE = np.loadtxt(
    """\
50.00    0     0     0     0     0     0     0.000000   0.000000 150.000000    0.000000   0.000000 100.000000
40.00 -0.80 -0.80 -0.80 -0.80 -0.80 -0.80    0.000000   0.000000 131.579104    0.000000   0.000000  84.386069
18.57 -0.56 -1.75 -0.43 -0.55 -1.61 -0.54   -7.171279  20.025229 104.161058   -0.059662   2.583424  62.105361
47.97 -0.54 -0.14 -0.93 -0.53 -1.78 -0.57   14.693165 -47.915746 120.356205    7.457300 -19.871420  85.095029
59.75 -1.55 -0.97 -0.94 -1.93 -1.80 -0.16   -0.016124 -27.716065 138.811109   -3.643388 -14.309800  97.404768
 8.53 -0.49 -0.37 -1.81 -1.11 -0.74 -1.67  -18.313924 -25.385281  89.023697   -5.730513  -5.011906  50.372976
 4.72 -0.70 -1.36 -0.46 -0.05 -1.39 -0.67   15.440133  14.317363  92.387678    9.448831   1.912892  47.883452
10.85 -0.68 -0.55 -0.50 -1.14 -0.67 -0.85   -3.528945   5.601841 102.169369   -2.834568   2.509359  55.501923
21.58 -0.40 -1.01 -1.17 -0.84 -0.81 -1.89  -12.806292  15.862727 106.365222   -2.039584   9.027916  63.058847
10.18 -0.10 -0.65 -1.04 -1.20 -0.08 -0.48  -49.894405  -4.524522  85.892184  -20.328663   0.105737  49.332347
""".splitlines()
)
THIRD = np.array([0.01857, *REFERENCE[2, 1:7]])

commands = st.lists(st.floats(-2.0, 0.0), min_size=6, max_size=6).map(np.array)
slides = st.floats(0.0, 0.06)


def angle_model(arm, actuation):
    """Return magnitude and angle of both moments, and both lengths, in the angles and forces of the paper."""
    forces = -np.asarray(actuation)[1:].reshape(2, 3)
    magnitude = np.sqrt((forces**2).sum(-1) - (forces * np.roll(forces, 1, -1)).sum(-1)) * arm.cable_radius
    pull = forces @ np.stack([np.cos(CABLE_ANGLES), np.sin(CABLE_ANGLES)], axis=-1)
    angle = np.arctan2(pull[:, 1], pull[:, 0])
    total = np.array([forces.sum(), forces[1].sum()])
    return magnitude, angle, arm.segment_length - total / arm.axial_stiffness


def test_reference_positions():
    actuation = REFERENCE[:, :7] * np.array([1e-3] + 6 * [1.0])
    arm = CableDrivenArm()
    np.testing.assert_allclose(arm.tip(actuation) * 1e3, REFERENCE[:, 7:10], rtol=0, atol=1e-6)
    np.testing.assert_allclose(arm.mid_point(actuation) * 1e3, REFERENCE[:, 10:], rtol=0, atol=1e-6)


def test_reference_positions_with_additive_coupling():
    arm = CableDrivenArm(coupling_sign=1)
    tip, mid = [-32.472645, 62.331186, 50.716440], [-10.993098, 21.567319, 51.356336]
    np.testing.assert_allclose(arm.tip(THIRD) * 1e3, tip, rtol=0, atol=1e-6)
    np.testing.assert_allclose(arm.mid_point(THIRD) * 1e3, mid, rtol=0, atol=1e-6)


def test_reference_direction_and_jacobian_rows():
    arm = CableDrivenArm()
    direction = arm.forward(THIRD)[:3, 2]
    np.testing.assert_allclose(direction, [-0.290931, 0.601964, 0.743639], rtol=0, atol=1e-6)
    jacobian = arm.jacobian(THIRD)
    row = [0, -35.476596, 17.718089, 17.739666, 22.022265, -11.858557, -11.203338]
    np.testing.assert_allclose(jacobian[0] * 1e3, row, rtol=0, atol=1e-5)
    slope = np.cross(jacobian[3:].T, direction)[:, 2]
    row = [0, -0.160871, 0.362975, -0.207906, -0.019666, 0.014052, -0.031426]
    np.testing.assert_allclose(slope, row, rtol=0, atol=1e-6)


def test_stiffnesses_of_table_1():
    arm = CableDrivenArm()
    assert arm.axial_stiffness == pytest.approx(855.016, abs=1e-3)
    assert arm.bending_stiffness(0.050) == pytest.approx(5.021081e-3, abs=1e-9)
    assert arm.bending_stiffness(0.045) == pytest.approx(5.579e-3, abs=1e-7)


@given(slides, commands)
def test_caps_continue_each_segment_straight(slide, pulls):
    actuation = [slide, *pulls]
    plain, capped = CableDrivenArm(), CableDrivenArm(cap_length=0.004)
    proximal, distal = plain.segments(actuation)
    cap = [0.0, 0.0, 0.004]
    expected = chain_transform([[0.0, 0.0, slide], proximal, cap, distal, cap])
    np.testing.assert_allclose(capped.forward(actuation), expected, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(capped.segments(actuation), plain.segments(actuation))
    mid = chain_transform([[0.0, 0.0, slide], proximal, cap])[:3, 3]
    np.testing.assert_allclose(capped.mid_point(actuation), mid, rtol=0, atol=1e-15)


@given(slides, commands, st.sampled_from([-1, 1]))
def test_turning_the_cables_turns_the_arm(slide, pulls, sign):
    """Shifting both triples of commands by one cable turns the tip by 120 degrees."""
    arm = CableDrivenArm(coupling_sign=sign)
    shifted = np.roll(pulls.reshape(2, 3), 1, axis=-1).ravel()
    turn = arc_transform(0, 0, 0)[:3, :3].copy()
    turn[:2, :2] = [[-0.5, -np.sqrt(0.75)], [np.sqrt(0.75), -0.5]]
    tip, turned = arm.tip([slide, *pulls]), arm.tip([slide, *shifted])
    np.testing.assert_allclose(turned, turn @ tip, rtol=0, atol=1e-14)


@given(commands)
def test_compression_is_linear_in_the_total_tension(pulls):
    """Distal cables compress both segments, proximal cables only their own (cascade compression)."""
    arm = CableDrivenArm()
    lengths = arm.segments([0.0, *pulls])[:, 2]
    total = np.array([pulls.sum(), pulls[3:].sum()])
    np.testing.assert_allclose(lengths, 0.05 + total / arm.axial_stiffness, rtol=0, atol=1e-15)


def test_proximal_cables_leave_the_distal_segment_alone():
    arm = CableDrivenArm()
    slopes = arm.configuration_jacobian(THIRD)
    np.testing.assert_array_equal(slopes[6:9, :4], 0.0)
    np.testing.assert_array_equal(slopes[3:6, 0], 0.0)


@pytest.mark.parametrize("cap_length", [0.0, 0.002])
def test_mid_jacobian_agrees_with_differences(cap_length):
    arm, step = CableDrivenArm(cap_length=cap_length), 1e-7
    for index in range(7):
        nudge = step * np.eye(7)[index]
        slope = (arm.mid_point(THIRD + nudge) - arm.mid_point(THIRD - nudge)) / (2 * step)
        np.testing.assert_allclose(arm.mid_jacobian(THIRD)[:3, index], slope, rtol=0, atol=1e-8)


# Errata of the printed equations


@given(commands)
def test_corrected_equation_1_is_the_proximal_bend(pulls):
    """Eq. (1) with the root over the whole sum, and its angle, is the vector sum of the moments."""
    arm = CableDrivenArm()
    (m1, m2), (phi1, phi2), (s1, s2) = angle_model(arm, [0.0, *pulls])
    zeta = np.pi
    stiffness1, stiffness2 = arm.bending_stiffness([s1, s2])
    theta2 = m2 / stiffness2
    square = m1**2 + (stiffness2 * theta2) ** 2
    root = np.sqrt(max(square + 2.0 * m1 * stiffness2 * theta2 * np.cos(phi1 - phi2 + zeta), 0.0))
    bend = np.hypot(*arm.segments([0.0, *pulls])[0, :2])
    assert root / stiffness1 == pytest.approx(bend, abs=2e-8)


def test_printed_equation_1_is_not_the_proximal_bend():
    """Erratum GS-1: printed, the root covers only the last term, which mixes moments with their squares."""
    arm = CableDrivenArm()
    (m1, m2), (phi1, phi2), (s1, _) = angle_model(arm, THIRD)
    last = 2.0 * m1 * m2 * np.cos(phi1 - phi2 + np.pi)
    printed = (m1**2 + m2**2 + np.sqrt(abs(last))) / arm.bending_stiffness(s1)
    assert abs(printed - np.hypot(*arm.segments(THIRD)[0, :2])) > 0.5


@given(commands)
def test_corrected_equation_2_is_the_direction_of_the_proximal_bend(pulls):
    arm = CableDrivenArm()
    (m1, m2), (phi1, phi2), _ = angle_model(arm, [0.0, *pulls])
    zeta = np.pi
    sine, cosine = (m1 * f(phi1) + m2 * f(phi2 - zeta) for f in (np.sin, np.cos))
    dx, dy = arm.segments([0.0, *pulls])[0, :2]
    magnitude = np.hypot(dx, dy)
    phi = np.arctan2(sine, cosine)
    np.testing.assert_allclose(magnitude * np.array([np.cos(phi), np.sin(phi)]), [dx, dy], rtol=0, atol=1e-12)


@pytest.mark.parametrize("order", ["y before x", "x before y"])
def test_printed_equation_2_does_not_return_the_cable_direction(order):
    """Erratum GS-2: with the distal cables slack the bend must point along phi1; neither reading gives it."""
    phi1 = 0.4
    cosine, sine = np.cos(phi1), np.sin(phi1)
    angle = np.arctan2(cosine, sine) if order == "y before x" else np.arctan2(sine, cosine)
    printed = np.pi - angle
    assert abs(np.angle(np.exp(1j * (printed - phi1)))) > 0.5
    dx, dy = CableDrivenArm().segments([0.0, *-pulls_toward(phi1), 0.0, 0.0, 0.0])[0, :2]
    assert np.arctan2(dy, dx) == pytest.approx(phi1, abs=1e-12)


def pulls_toward(angle):
    """Return three tensions, the smallest zero, that bend toward an angle."""
    tension = np.cos(CABLE_ANGLES - angle)
    return tension - tension.min()


def test_printed_equations_3_and_23_fail_at_the_straight_arm():
    """Erratum: curvature and 1 / curvature are 0 and infinite there; the arc form has the limit."""
    theta, length = 0.0, 0.05
    curvature = theta / length
    with np.errstate(divide="ignore", invalid="ignore"):
        printed = (1.0 / np.float64(curvature)) * np.array([0.0, 0.0, np.sin(theta)])
    assert np.isnan(printed[2])
    np.testing.assert_allclose(arc_transform(0.0, 0.0, length)[:3, 3], [0.0, 0.0, length], rtol=0, atol=0)


@given(st.floats(1e-3, 3.0), st.floats(-np.pi, np.pi))
def test_equations_23_and_24_are_the_arc(theta, phi):
    """Rot(z, phi) Rot(y, theta) Rot(z, -phi) and the printed position, wherever they are defined."""
    length = 0.05
    c, s, ct, s_t = np.cos(phi), np.sin(phi), np.cos(theta), np.sin(theta)
    about_z = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    about_y = np.array([[ct, 0, s_t], [0, 1, 0], [-s_t, 0, ct]])
    pose = arc_transform(theta * c, theta * s, length)
    np.testing.assert_allclose(pose[:3, :3], about_z @ about_y @ about_z.T, rtol=0, atol=1e-14)
    printed = length / theta * np.array([c * (1 - ct), s * (1 - ct), s_t])
    np.testing.assert_allclose(pose[:3, 3], printed, rtol=0, atol=1e-13)


def test_equation_25_jacobian_is_wide():
    """Three rows, seven columns, rank 3 at rest: the arm is redundant."""
    arm = CableDrivenArm()
    jacobian = arm.jacobian(arm.home)[:3]
    assert jacobian.shape == (3, 7)
    assert np.linalg.matrix_rank(jacobian) == 3
    np.testing.assert_array_equal(
        jacobian, chain_jacobian(arm.configuration(arm.home))[:3] @ arm.configuration_jacobian(arm.home)
    )


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"young_modulus": -1.0}, "young_modulus must be a finite number above 0, got -1.0"),
        ({"cable_radius": np.nan}, "cable_radius must be a finite number above 0, got nan"),
        ({"inner_radius": 5e-3}, r"inner_radius must be in \[0, 0.0045\), got 0.005"),
        ({"coupling_sign": 0}, "coupling_sign must be one of -1, 1; got 0"),
        ({"cap_length": -1e-3}, "cap_length must be a finite number not below 0, got -0.001"),
        ({"maximum_tension": 10.0}, "maximum_tension 10.0 N on six cables shortens"),
    ],
)
def test_bad_parameters_are_refused(parameters, message):
    with pytest.raises(ValueError, match=message):
        CableDrivenArm(**parameters)
