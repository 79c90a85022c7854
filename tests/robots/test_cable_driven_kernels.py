"""The compiled kinematics equal the robot's, which obeys the paper's equations as corrected."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from soro_lib.arcs import arc_transform
from soro_lib.robots import CableDrivenArm, HelixArm
from soro_lib.robots.cable_driven_kernels import compiled_kinematics, generic_kinematics

ARM = CableDrivenArm()
ACTUATIONS = st.builds(
    lambda slide, cables: np.array([slide, *cables]),
    st.floats(0.0, 0.06),
    st.lists(st.floats(-2.0, 0.0), min_size=6, max_size=6),
)
FACTS = np.array(
    [
        [18.57, -0.56, -1.75, -0.43, -0.55, -1.61, -0.54, -7.171279, 20.025229, 104.161058],
        [47.97, -0.54, -0.14, -0.93, -0.53, -1.78, -0.57, 14.693165, -47.915746, 120.356205],
        [59.75, -1.55, -0.97, -0.94, -1.93, -1.8, -0.16, -0.016124, -27.716065, 138.811109],
        [10.18, -0.1, -0.65, -1.04, -1.2, -0.08, -0.48, -49.894405, -4.524522, 85.892184],
    ]
)
"""Actuation (mm, then -N) and tip (mm), from an independent program of the same model."""


@pytest.mark.parametrize("cap", [0.0, 3e-3])
@pytest.mark.parametrize("sign", [-1, 1])
@settings(max_examples=25, deadline=None)
@given(actuation=ACTUATIONS, shrink=st.sampled_from([1.0, 1e-3, 1e-9, 0.0]))
def test_compiled_equals_the_robot(cap, sign, actuation, shrink):
    arm = CableDrivenArm(cap_length=cap, coupling_sign=sign)
    actuation[1:] *= shrink
    compiled, generic = compiled_kinematics(arm)(actuation), generic_kinematics(arm)(actuation)
    for ours, theirs in zip(compiled, generic):
        np.testing.assert_allclose(ours, theirs, atol=1e-12)
    pose, jacobian = arm.forward(actuation), arm.jacobian(actuation)
    np.testing.assert_allclose(compiled.tip, pose[:3, 3], atol=1e-13)
    np.testing.assert_allclose(compiled.tip_jacobian, jacobian[:3], atol=1e-12)
    np.testing.assert_allclose(
        compiled.direction_jacobian, np.cross(jacobian[3:].T, pose[:3, 2]).T, atol=1e-12
    )
    np.testing.assert_allclose(compiled.mid, arm.mid_point(actuation), atol=1e-13)


@settings(max_examples=25, deadline=None)
@given(ACTUATIONS.filter(lambda q: q[1:].max() < -1e-3 and q[1:].min() > -1.99 and 1e-4 < q[0] < 0.0599))
def test_jacobians_are_derivatives(actuation):
    kinematics = compiled_kinematics(ARM)
    pose, step = kinematics(actuation), 1e-6
    for column in range(7):
        nudge = np.zeros(7)
        nudge[column] = step
        above, below = kinematics(actuation + nudge), kinematics(actuation - nudge)
        for name in ("tip", "mid", "direction"):
            slope = (getattr(above, name) - getattr(below, name)) / (2 * step)
            np.testing.assert_allclose(getattr(pose, f"{name}_jacobian")[:, column], slope, atol=1e-7)


@pytest.mark.parametrize("row", FACTS)
def test_independent_values(row):
    actuation = row[:7] * [1e-3, *[1.0] * 6]
    np.testing.assert_allclose(compiled_kinematics(ARM)(actuation).tip * 1e3, row[7:], atol=1e-5)


def test_generic_kinematics_serve_another_robot():
    robot = HelixArm()
    pose = generic_kinematics(robot)(robot.home)
    np.testing.assert_allclose(pose.tip, robot.forward(robot.home)[:3, 3])
    assert pose.mid_jacobian.shape == (3, len(robot.home))


# --- the paper's equations ----------------------------------------------------------------------------------


def loads(actuation):
    """Return the moments of both segments in the paper's terms: magnitudes r F_k and directions phi_k."""
    tension = -actuation[1:].reshape(2, 3)
    first, second, third = tension.T
    # first**2 + second**2 + third**2 - first * second - first * third - second * third, without cancellation
    force = np.sqrt(0.5 * ((first - second) ** 2 + (second - third) ** 2 + (third - first) ** 2))
    angle = 2 * np.pi / 3 * np.arange(3)
    return ARM.cable_radius * force, np.arctan2(tension @ np.sin(angle), tension @ np.cos(angle))


@settings(max_examples=50, deadline=None)
@given(ACTUATIONS)
def test_bending_angle_of_eq1_needs_the_root_over_all_terms(actuation):
    """Erratum GS-1: as printed, the root covers only the mixed term (and is not even of one unit)."""
    moment, phi = loads(actuation)
    (dx, dy, length), distal = ARM.segments(actuation)
    stiffness, distal_moment = (
        ARM.bending_rigidity / length,
        np.hypot(*distal[:2]) * ARM.bending_rigidity / distal[2],
    )
    assert distal_moment == pytest.approx(moment[1], abs=1e-12)
    mixed = 2 * moment[0] * moment[1] * np.cos(phi[0] - phi[1] + np.pi)
    corrected = np.sqrt(max(moment[0] ** 2 + moment[1] ** 2 + mixed, 0.0)) / stiffness
    assert np.hypot(dx, dy) == pytest.approx(corrected, abs=1e-7)
    if mixed > 1e-7:
        printed = (moment[0] ** 2 + moment[1] ** 2 + np.sqrt(mixed)) / stiffness
        assert abs(printed - corrected) > 1e-4


@settings(max_examples=50, deadline=None)
@given(ACTUATIONS)
def test_bending_direction_of_eq2_has_no_half_turn(actuation):
    """Erratum GS-2: without a distal moment the bend must point along phi; as printed it is turned."""
    actuation[4:] = -0.5  # three equal tensions: no distal moment
    moment, phi = loads(actuation)
    if moment[0] < 1e-5:
        return
    dx, dy, _ = ARM.segments(actuation)[0]
    x, y = moment[0] * np.cos(phi[0]), moment[0] * np.sin(phi[0])
    assert np.exp(1j * np.arctan2(dy, dx)) == pytest.approx(np.exp(1j * np.arctan2(y, x)), abs=1e-6)
    as_printed = np.pi - np.arctan2(x, y)
    assert np.exp(1j * as_printed) == pytest.approx(np.exp(1j * (phi[0] + np.pi / 2)), abs=1e-6)


def test_installation_angle_is_the_coupling_sign():
    """Erratum GS-3: zeta = pi is a minus sign; a distal cable then bends the segments opposite ways."""
    actuation = np.array([0.0, 0, 0, 0, -1.0, 0, 0])
    for zeta, sign in ((np.pi, -1), (0.0, 1)):
        assert round(np.cos(zeta)) == sign
        proximal, distal = CableDrivenArm(coupling_sign=sign).segments(actuation)
        assert np.sign(proximal[0]) == sign * np.sign(distal[0])


def test_straight_arm_is_regular():
    """Erratum GS-4: (3) and (23) divide by the curvature, which is zero where the robot starts."""
    straight = np.array([0.05, 0, 0, 0, 0, 0, 0])
    pose = compiled_kinematics(ARM)(straight)
    np.testing.assert_allclose(pose.tip, [0.0, 0.0, 0.15], rtol=1e-15)
    assert np.isfinite(pose.tip_jacobian).all()
    with np.errstate(invalid="ignore", divide="ignore"):
        theta = np.float64(0.0)
        assert not np.isfinite((1 - np.cos(theta)) / (theta / 0.05))
    bent = straight.copy()
    bent[1] = -1e-9
    np.testing.assert_allclose(compiled_kinematics(ARM)(bent).tip, pose.tip, atol=1e-9)


@settings(max_examples=50, deadline=None)
@given(st.floats(1e-3, 2.5), st.floats(-np.pi, np.pi), st.floats(0.03, 0.05))
def test_segment_is_eq23_and_eq24(theta, phi, length):
    curvature = theta / length
    end = (
        np.array([np.cos(phi) * (1 - np.cos(theta)), np.sin(phi) * (1 - np.cos(theta)), np.sin(theta)])
        / curvature
    )
    rotation = Rotation.from_euler("ZYZ", [phi, theta, -phi]).as_matrix()
    pose = arc_transform(theta * np.cos(phi), theta * np.sin(phi), length)
    np.testing.assert_allclose(pose[:3, 3], end, atol=1e-12)
    np.testing.assert_allclose(pose[:3, :3], rotation, atol=1e-12)
