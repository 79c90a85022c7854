"""Arcs and chains against the matrix exponential of their body twist, finite differences and geometry."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from soro_lib.arcs import (
    arc_transform,
    backbone,
    chain_jacobian,
    chain_transform,
    chain_transform_and_jacobian,
    routing_matrix,
)

# Straight, subnormal, tiny, both sides of the switch to the power series at 0.5, around pi, beyond 2 pi.
BENDS = [0.0, 1e-310, 1e-160, 1e-12, 1e-8, 1e-5, 1e-3, 0.1, 0.4999, 0.5, 0.5001, 1.5, 3.1, np.pi, 3.2, 7.0]


def exponential_chain(configuration):
    """Return the tip pose as a product of matrix exponentials of the body twists."""
    pose = np.eye(4)
    for dx, dy, length in configuration:
        twist = np.array([[0, 0, dx, 0], [0, 0, dy, 0], [-dx, -dy, 0, length], [0, 0, 0, 0]])
        pose = pose @ expm(twist)
    return pose


def velocity_of(poses_ahead, poses_behind, pose, step):
    """Return the linear and angular velocity (6,) of a pose by central differences, in the base frame."""
    slope = (poses_ahead - poses_behind) / (2 * step)
    spin = slope[:3, :3] @ pose[:3, :3].T
    return np.array([*slope[:3, 3], spin[2, 1], spin[0, 2], spin[1, 0]])


def difference_jacobian(configuration, step=1e-6):
    """Return the tip Jacobian of a chain (6, 3 n) by central differences."""
    pose = chain_transform(configuration)
    columns = []
    for index in np.ndindex(configuration.shape):
        nudge = np.zeros_like(configuration)
        nudge[index] = step
        ahead, behind = chain_transform(configuration + nudge), chain_transform(configuration - nudge)
        columns.append(velocity_of(ahead, behind, pose, step))
    return np.stack(columns, axis=-1)


def chains(segments=3, bend=6.0):
    """Strategy for configurations of shape (segments, 3) with finite bends and lengths."""
    bends = hnp.arrays(float, (segments, 2), elements=st.floats(-bend, bend))
    lengths = hnp.arrays(float, (segments, 1), elements=st.floats(0.01, 0.5))
    return st.tuples(bends, lengths).map(np.hstack)


@pytest.mark.parametrize("bend", BENDS)
@pytest.mark.parametrize("azimuth", [0.0, 0.7, np.pi / 2, 2.5, -1.2, np.pi])
def test_arc_is_the_exponential_of_its_twist(bend, azimuth):
    arc = bend * np.cos(azimuth), bend * np.sin(azimuth), 0.24
    np.testing.assert_allclose(arc_transform(*arc), exponential_chain([arc]), rtol=0, atol=1e-12)


@given(chains())
def test_chain_is_the_product_of_exponentials(configuration):
    np.testing.assert_allclose(
        chain_transform(configuration), exponential_chain(configuration), rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("bend", BENDS)
def test_arc_jacobian_agrees_with_differences(bend):
    configuration = np.array([[0.8 * bend, -0.6 * bend, 0.24]])
    np.testing.assert_allclose(
        chain_jacobian(configuration), difference_jacobian(configuration), rtol=0, atol=1e-8
    )


@given(chains(bend=3.0))
def test_chain_jacobian_agrees_with_differences(configuration):
    expected = difference_jacobian(configuration)
    np.testing.assert_allclose(chain_jacobian(configuration), expected, rtol=0, atol=1e-8)


def test_jacobian_is_exact_at_the_straight_arm():
    length = 0.3
    expected = [[length / 2, 0, 0], [0, length / 2, 0], [0, 0, 1], [0, -1, 0], [1, 0, 0], [0, 0, 0]]
    np.testing.assert_allclose(chain_jacobian([[0.0, 0.0, length]]), expected, rtol=0, atol=1e-16)


@pytest.mark.parametrize("azimuth", [0.0, 0.4, 1.9])
def test_series_and_closed_form_meet_to_1e_14(azimuth):
    """On either side of the switch the Jacobian moves by no more than its own slope over the gap."""
    direction, gap = np.array([np.cos(azimuth), np.sin(azimuth)]), 1e-13
    below = chain_jacobian([[*(direction * (0.5 - gap)), 1.0]])
    above = chain_jacobian([[*(direction * (0.5 + gap)), 1.0]])
    np.testing.assert_allclose(below, above, rtol=0, atol=1e-14 + 2 * gap)


def test_batch_and_scalar_agree():
    rng = np.random.default_rng(1)
    configurations = np.concatenate(
        [rng.uniform(-4, 4, (4, 5, 3, 2)), rng.uniform(0.05, 0.3, (4, 5, 3, 1))], -1
    )
    configurations[0, :, :, :2] *= 1e-9
    configurations[1, 0, :, :2] = 0.0
    configurations[2, :, :, :2] *= 0.05
    poses, jacobians = chain_transform_and_jacobian(configurations)
    assert poses.shape == (4, 5, 4, 4)
    assert jacobians.shape == (4, 5, 6, 9)
    for index in np.ndindex(4, 5):
        np.testing.assert_allclose(chain_transform(configurations[index]), poses[index], rtol=0, atol=1e-14)
        np.testing.assert_allclose(
            chain_jacobian(configurations[index]), jacobians[index], rtol=0, atol=1e-14
        )


def test_arguments_broadcast():
    assert arc_transform(np.zeros((5, 1)), np.zeros(3), 0.1).shape == (5, 3, 4, 4)
    assert chain_transform(np.zeros((0, 3, 3))).shape == (0, 4, 4)
    assert chain_jacobian(np.zeros((0, 2, 3))).shape == (0, 6, 6)
    np.testing.assert_array_equal(chain_transform(np.zeros((0, 3))), np.eye(4))
    np.testing.assert_array_equal(chain_transform(np.zeros((2, 0, 3))), [np.eye(4), np.eye(4)])


@given(chains(), st.floats(-np.pi, np.pi))
def test_turning_the_bend_planes_turns_the_tip(configuration, angle):
    turn = Rotation.from_euler("z", angle).as_matrix()
    turned = configuration.copy()
    turned[:, :2] = configuration[:, :2] @ turn[:2, :2].T
    pose, expected = chain_transform(turned), chain_transform(configuration)
    np.testing.assert_allclose(pose[:3, 3], turn @ expected[:3, 3], rtol=0, atol=1e-13)
    np.testing.assert_allclose(pose[:3, :3], turn @ expected[:3, :3] @ turn.T, rtol=0, atol=1e-13)


@given(chains())
def test_pose_is_a_rigid_motion_within_reach(configuration):
    pose = chain_transform(configuration)
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), rtol=0, atol=1e-13)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0, abs=1e-13)
    assert np.linalg.norm(pose[:3, 3]) <= configuration[:, 2].sum() + 1e-13


@given(chains(segments=1), st.floats(0.01, 0.99))
def test_an_arc_can_be_cut_anywhere(configuration, share):
    pieces = np.concatenate([configuration * share, configuration * (1.0 - share)])
    np.testing.assert_allclose(chain_transform(pieces), chain_transform(configuration), rtol=0, atol=1e-13)


@given(chains(bend=3.0))
def test_backbone_has_the_arc_length_and_ends_at_the_tip(configuration):
    points = backbone(configuration, 400)
    assert points.shape == (1201, 3)
    np.testing.assert_array_equal(points[0], 0.0)
    np.testing.assert_allclose(points[-1], chain_transform(configuration)[:3, 3], rtol=0, atol=1e-12)
    length = np.linalg.norm(np.diff(points, axis=0), axis=-1).sum()
    assert length == pytest.approx(configuration[:, 2].sum(), rel=1e-4)


def test_backbone_of_a_batch_is_that_of_each():
    rng = np.random.default_rng(2)
    configurations = rng.uniform(-1, 1, (2, 3, 2, 3))
    points = backbone(configurations, 7)
    assert points.shape == (2, 3, 15, 3)
    np.testing.assert_allclose(points[1, 2], backbone(configurations[1, 2], 7), rtol=0, atol=1e-15)
    joints = chain_transform(configurations[..., :1, :])[..., :3, 3]
    np.testing.assert_allclose(points[..., 7, :], joints, rtol=0, atol=1e-14)


@pytest.mark.parametrize("bend", [0.0, 0.3, 2.0])
def test_strand_length_is_the_length_of_the_offset_curve(bend):
    """The length of a strand, measured on the strand itself, is linear in the arc."""
    arc, radius, angle = np.array([0.8 * bend, -0.6 * bend, 0.24]), 0.03, 0.7
    share = np.linspace(0.0, 1.0, 2001)[:, np.newaxis]
    frames = arc_transform(*(arc * share).T)
    place = np.array([radius * np.cos(angle), radius * np.sin(angle), 0.0, 1.0])
    measured = np.linalg.norm(np.diff((frames @ place)[:, :3], axis=0), axis=-1).sum()
    assert measured == pytest.approx((routing_matrix(radius, [angle]) @ arc)[0], abs=1e-7)


@pytest.mark.parametrize(
    ("configuration", "message"),
    [
        ([0.1, 0.2, 0.3], r"configuration must have shape \(\.\.\., n >= 0, 3\), got \(3,\)"),
        (np.zeros((3, 4)), r"configuration must have shape .*got \(3, 4\)"),
        (0.1, r"configuration must have shape .*got \(\)"),
        ([[0.0, np.nan, 0.1]], r"configuration must be finite, got nan at index \(0, 1\)"),
        (np.full((2, 1, 3), np.inf), r"configuration must be finite, got inf at index \(0, 0, 0\)"),
        ([["a", 0.0, 0.1]], r"configuration must be numbers"),
        ([[0.0, 0.1], [0.0, 0.1, 0.2]], r"configuration must be numbers"),
    ],
)
@pytest.mark.parametrize("function", [chain_transform, chain_jacobian, backbone])
def test_malformed_configurations_are_refused(function, configuration, message):
    with pytest.raises(ValueError, match=message):
        function(configuration)


@pytest.mark.parametrize("function", [arc_transform])
def test_malformed_arcs_are_refused_by_name(function):
    with pytest.raises(ValueError, match="dy must be finite"):
        function(0.1, [0.0, np.nan], 0.1)
    with pytest.raises(ValueError, match="length must be finite"):
        function(0.1, 0.0, np.inf)
    with pytest.raises(ValueError, match=r"must broadcast, got dx \(2,\), dy \(3,\)"):
        function(np.zeros(2), np.zeros(3), 0.1)


def test_backbone_needs_a_point_per_segment():
    with pytest.raises(ValueError, match="points_per_segment must be a finite number not below 1, got 0"):
        backbone(np.zeros((1, 3)), 0)


def test_import_stays_light():
    """The kinematic core loads neither a compiler nor SciPy's subpackages."""
    code = (
        "import sys, soro_lib.arcs, soro_lib.robots.helix;"
        "print([m for m in ('numba', 'scipy', 'matplotlib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
