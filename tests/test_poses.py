"""Operations on poses against SciPy's rotations and rigid transforms."""

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from soro_lib.arcs import arc_transform
from soro_lib.poses import (
    align_quaternion,
    angle_between,
    invert_transform,
    make_transform,
    pointing_direction,
    pose_error,
    require_rotation,
    transform_points,
)


def random_poses(count, seed=1):
    rng = np.random.default_rng(seed)
    return make_transform(Rotation.random(count, rng).as_matrix(), rng.normal(size=(count, 3)))


def test_inverse_and_points_agree_with_scipy():
    poses, points = random_poses(20), np.random.default_rng(2).normal(size=(20, 3))
    reference = RigidTransform.from_matrix(poses)
    np.testing.assert_allclose(invert_transform(poses), reference.inv().as_matrix(), rtol=0, atol=1e-14)
    np.testing.assert_allclose(transform_points(poses, points), reference.apply(points), rtol=0, atol=1e-14)
    np.testing.assert_allclose(
        transform_points(invert_transform(poses), transform_points(poses, points)), points, rtol=0, atol=1e-14
    )


def test_one_pose_moves_many_points_and_many_poses_one_point():
    poses, points = random_poses(4), np.random.default_rng(2).normal(size=(5, 7, 3))
    assert transform_points(poses[0], points).shape == (5, 7, 3)
    assert transform_points(poses, [0.0, 0.0, 0.1]).shape == (4, 3)
    assert transform_points(poses[:, np.newaxis], points[0]).shape == (4, 7, 3)


def test_pose_error_carries_one_pose_into_the_other():
    actual, desired = random_poses(20, seed=1), random_poses(20, seed=2)
    translation, vector = pose_error(actual, desired)
    np.testing.assert_allclose(actual[:, :3, 3] + translation, desired[:, :3, 3], rtol=0, atol=1e-15)
    carried = Rotation.from_rotvec(vector).as_matrix() @ actual[:, :3, :3]
    np.testing.assert_allclose(carried, desired[:, :3, :3], rtol=0, atol=1e-14)
    for error in pose_error(actual, actual):
        np.testing.assert_allclose(error, 0.0, rtol=0, atol=1e-14)
    assert [error.shape for error in pose_error(actual[0], desired)] == [(20, 3), (20, 3)]


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, np.pi - 1e-9, np.pi])
def test_angle_is_exact_near_zero_and_near_pi(angle):
    """The arc cosine of the dot product would return 0 for 1e-9."""
    turned = [np.sin(angle), 0.0, np.cos(angle)]
    assert angle_between([0.0, 0.0, 2.0], turned) == pytest.approx(angle, abs=1e-15)


def test_pointing_direction_is_the_tangent():
    pose = arc_transform(0.6, 0.0, 0.1)
    np.testing.assert_allclose(pointing_direction(pose), [np.sin(0.6), 0.0, np.cos(0.6)], rtol=0, atol=1e-15)


def test_aligned_quaternions_are_the_same_rotations_in_one_hemisphere():
    quaternions = Rotation.random(50, np.random.default_rng(1)).as_quat()
    aligned = align_quaternion(quaternions, quaternions[0])
    assert (aligned @ quaternions[0] >= 0.0).all()
    apart = (Rotation.from_quat(aligned) * Rotation.from_quat(quaternions).inv()).magnitude()
    np.testing.assert_allclose(apart, 0.0, rtol=0, atol=1e-14)


def test_rotations_are_told_from_other_matrices():
    rotation = random_poses(3)[:, :3, :3]
    np.testing.assert_array_equal(require_rotation(rotation), rotation)
    with pytest.raises(ValueError, match=r"orthonormal to 1e-06, R R\^T - I reaches 0.21"):
        require_rotation(1.1 * rotation)
    with pytest.raises(ValueError, match=r"determinant \+1, got a reflection"):
        require_rotation(-rotation)
    with pytest.raises(ValueError, match="orthonormal"):
        require_rotation(np.full((3, 3), np.nan))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: invert_transform(np.eye(3)), r"transform must have shape \(\.\.\., 4, 4\), got \(3, 3\)"),
        (lambda: invert_transform(np.full((4, 4), np.nan)), "transform must be finite"),
        (
            lambda: transform_points(np.eye(4), [0.0, 1.0]),
            r"points must have shape \(\.\.\., 3\), got \(2,\)",
        ),
        (lambda: angle_between([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]), "a must be finite and not zero"),
        (lambda: angle_between([0.0, 0.0, 1.0], [0.0, np.inf, 1.0]), "b must be finite and not zero"),
        (lambda: make_transform(np.eye(2), np.zeros(3)), r"got \(2, 2\) and \(3,\)"),
        (lambda: pose_error(np.eye(4), np.eye(2)), r"desired must have shape"),
        (lambda: require_rotation(np.eye(2)), r"rotation must have shape \(\.\.\., 3, 3\), got \(2, 2\)"),
    ],
)
def test_malformed_poses_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
