"""Fusion of Wang et al., Eq. (18): printed against corrected, bounds, quaternions, missing sensors."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from soro_lib.estimators.pose_fusion import (
    InverseVarianceFusion,
    blend_poses,
    fibre_weight,
    fuse_poses,
    inlier_weighted_error,
)

LOWER, UPPER = 1.2, 2.4


def random_pose(rng):
    return np.concatenate([rng.uniform(-0.04, 0.04, 3), Rotation.random(rng=rng).as_quat()])


def printed_equation_18(camera, fibre, error):
    """Eq. (18) with the sign as printed."""
    share = (error - LOWER) / (UPPER - LOWER)
    return share * fibre - (1.0 - share) * camera


def test_printed_equation_18_jumps_and_the_corrected_one_does_not():
    """Erratum VS-1: just above E_L the printed form gives -z_c, a jump of twice the pose."""
    camera, fibre = np.array([0.03, -0.01, 0.02]), np.array([0.031, -0.011, 0.02])
    just_above = LOWER + 1e-9
    assert np.linalg.norm(printed_equation_18(camera, fibre, just_above) - camera) > 1.99 * np.linalg.norm(
        camera
    )
    poses = [np.concatenate([p, [0, 0, 0, 1]]) for p in (camera, fibre)]
    fused = fuse_poses(*poses, just_above, lower=LOWER, upper=UPPER)
    assert np.allclose(fused[:3], camera, atol=1e-9)


def test_adjusting_factor_is_not_free():
    """Erratum VS-1: any other K_S than 1/(E_U - E_L) leaves a jump at E_U."""
    below = np.nextafter(UPPER, 0.0)
    for factor in (0.5, 2.0):
        assert abs(factor / (UPPER - LOWER) * (below - LOWER) - 1.0) > 0.4
    assert np.isclose(fibre_weight(below, LOWER, UPPER), fibre_weight(UPPER, LOWER, UPPER))


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 4.0))
def test_fused_position_lies_between_the_two_and_the_quaternion_is_a_unit(seed, error):
    rng = np.random.default_rng(seed)
    camera, fibre = random_pose(rng), random_pose(rng)
    fused = fuse_poses(camera, fibre, error)
    assert (fused[:3] >= np.minimum(camera, fibre)[:3] - 1e-15).all()
    assert (fused[:3] <= np.maximum(camera, fibre)[:3] + 1e-15).all()
    assert np.isclose(np.linalg.norm(fused[3:]), 1.0)


def test_maximum_of_a_convex_combination_is_below_both_maxima():
    """Erratum VS-18: Table V prints a fusion maximum of 25.975 where the inputs reach 19.081 and 9.833."""
    rng = np.random.default_rng(1)
    camera, fibre = rng.normal(0, 0.01, (500, 7)), rng.normal(0, 0.01, (500, 7))
    fused = fuse_poses(camera, fibre, rng.uniform(0, 4, 500))
    worst = [np.linalg.norm(p[:, :3], axis=1).max() for p in (camera, fibre, fused)]
    assert worst[2] <= max(worst[:2])
    assert not max(19.081, 9.833) >= 25.975


def test_sign_of_a_quaternion_does_not_matter():
    rng = np.random.default_rng(2)
    camera = random_pose(rng)
    fibre = camera + np.concatenate([np.full(3, 1e-3), np.full(4, 1e-3)])
    flipped = np.concatenate([fibre[:3], -fibre[3:]])
    assert np.allclose(fuse_poses(camera, fibre, 1.8), fuse_poses(camera, flipped, 1.8))


def test_opposite_quaternions_do_not_cancel():
    camera = np.array([0, 0, 0, 0, 0, 0, 1.0])
    assert np.allclose(blend_poses(camera, -camera, 0.5)[3:], camera[3:])


@pytest.mark.parametrize("error", [np.nan, np.inf, 99.0])
def test_lost_frame_leaves_the_fibre_alone(error):
    rng = np.random.default_rng(3)
    camera, fibre = random_pose(rng), random_pose(rng)
    assert np.allclose(fuse_poses(camera, fibre, error)[:3], fibre[:3])


def test_pose_that_is_not_finite_is_replaced_by_the_other():
    rng = np.random.default_rng(4)
    pose, broken = random_pose(rng), np.full(7, np.nan)
    for fused in (fuse_poses(pose, broken, 99.0), fuse_poses(broken, pose, 0.0)):
        assert np.allclose(fused[:3], pose[:3])
    with pytest.raises(ValueError, match="neither"):
        fuse_poses(broken, broken, 1.0)


@pytest.mark.parametrize("bounds", [(2.0, 1.0), (1.0, 1.0), (-1.0, 1.0), (0.0, np.inf)])
def test_bounds_must_increase(bounds):
    with pytest.raises(ValueError, match=r"lower must be in \[0, .*\)|upper must be finite"):
        fibre_weight(1.0, *bounds)


def test_wrong_shape_is_named():
    with pytest.raises(ValueError, match="fibre_pose"):
        fuse_poses(np.zeros(7), np.zeros(6), 1.0)


def test_few_inliers_raise_the_error_and_none_makes_it_infinite():
    assert np.allclose(inlier_weighted_error(1.0, [800.0, 200.0, 50.0]), [1.0, 1.0, 2.0])
    assert np.isinf(inlier_weighted_error([1.0, np.nan], 0.0)).all()


def simulate_fusion(rng, camera_sd=0.5e-3, fibre_sd=0.4e-3, outlier=None, steps=600):
    """Follow a slow circle with two honest sensors; return errors and claimed standard deviations."""
    fusion = InverseVarianceFusion()
    errors, claims = [], []
    for step in range(steps):
        truth = np.array([0.03 * np.cos(0.01 * step), 0.03 * np.sin(0.01 * step), 0.0, 0, 0, 0, 1])
        camera, fibre = truth.copy(), truth.copy()
        camera[:3] += rng.normal(0, camera_sd, 3)
        fibre[:3] += rng.normal(0, fibre_sd, 3)
        if outlier is not None and step % 50 == 49:
            camera[:3] += outlier
        pose = fusion.update(camera, camera_sd**2, fibre, fibre_sd**2)
        errors.append(pose[:3] - truth[:3])
        claims.append(np.sqrt(np.diag(fusion.covariance)))
    return np.array(errors), np.array(claims)


def test_inverse_variance_filter_is_better_than_either_sensor_and_knows_how_good_it_is():
    errors, claims = simulate_fusion(np.random.default_rng(5))
    assert errors[50:].std() < 0.4e-3
    assert 0.9 < np.mean(np.abs(errors[50:]) < 1.96 * claims[50:]) <= 1.0


def test_gate_keeps_outliers_out():
    clean, _ = simulate_fusion(np.random.default_rng(6))
    dirty, _ = simulate_fusion(np.random.default_rng(6), outlier=np.array([0.02, 0, 0]))
    assert np.abs(dirty).max() < 1.2 * np.abs(clean).max()


def test_filter_reacquires_after_a_jump_and_survives_the_loss_of_both_sensors():
    fusion = InverseVarianceFusion(reacquire=5)
    here, there = np.array([0, 0, 0, 0, 0, 0, 1.0]), np.array([0.03, 0, 0, 0, 0, 0, 1.0])
    lost = np.full(7, np.nan)
    for _ in range(20):
        fusion.update(here, 1e-7, here, 1e-7)
    held = fusion.update(lost, 1e-7, here, np.inf)
    assert np.allclose(held, here, atol=1e-4)
    assert np.isclose(np.linalg.norm(held[3:]), 1.0)
    for _ in range(10):
        pose = fusion.update(there, 1e-7, there, 1e-7)
    assert np.allclose(pose, there, atol=1e-3)


def filterpys_fusion(samples, period, acceleration, gate, reacquire):
    """The readable reference: filterpy's filter of the six states; positions and their covariances."""
    reference, refused = KalmanFilter(dim_x=6, dim_z=3), 0
    reference.F[:3, 3:], reference.H[:, :3] = period * np.eye(3), np.eye(3)
    effect = np.vstack([0.5 * period**2 * np.eye(3), period * np.eye(3)])
    reference.Q = acceleration**2 * effect @ effect.T

    def start(pose, variance):
        reference.x = np.concatenate([pose[:3], np.zeros(3)])[:, None]
        reference.P = np.diag([variance] * 3 + [1e-4] * 3)

    for step, pair in enumerate(samples):
        usable = [(pose, variance) for pose, variance in pair if variance < np.inf]
        if step == 0:
            start(*usable[0])
        reference.predict()
        accepted = 0
        for pose, variance in usable:
            innovation, spread = pose[:3, None] - reference.x[:3], reference.P[:3, :3] + variance * np.eye(3)
            if (innovation.T @ np.linalg.inv(spread) @ innovation).item() <= gate:
                reference.update(pose[:3, None], R=variance * np.eye(3))
                accepted += 1
        refused = 0 if accepted else refused + 1
        if refused >= reacquire and usable:
            start(*usable[0])
            refused = 0
        yield reference.x[:3, 0], reference.P[:3, :3]


def fusion_samples(rng, steps):
    """Random walk seen by two sensors of changing quality, sometimes absent, with outliers and a jump."""
    truth = np.cumsum(rng.normal(0, 2e-4, (steps, 3)), axis=0)
    truth[steps // 2 :] += 0.05
    samples = []
    for position in truth:
        pair = []
        for present in 0.9, 0.95:
            deviation = 10.0 ** rng.uniform(-4, -3)
            pose = np.concatenate([position + rng.normal(0, deviation, 3), [0, 0, 0, 1]])
            if rng.random() < 0.05:
                pose[:3] += 0.02
            pair.append((pose, deviation**2) if rng.random() < present else (np.full(7, np.nan), np.inf))
        samples.append(pair)
    samples[0] = [(np.array([0, 0, 0, 0, 0, 0, 1.0]), 1e-7)] * 2
    return samples


@pytest.mark.parametrize("seed", range(3))
def test_one_covariance_for_three_axes_is_filterpys_filter(seed):
    parameters = {"period": 0.05, "acceleration": 0.05, "gate": 16.3, "reacquire": 5}
    samples = fusion_samples(np.random.default_rng([7, seed]), 400)
    fusion = InverseVarianceFusion(**parameters)
    for pair, (position, covariance) in zip(samples, filterpys_fusion(samples, **parameters)):
        fused = fusion.update(*pair[0], *pair[1])
        assert np.allclose(fused[:3], position, rtol=0, atol=1e-12)
        assert np.allclose(fusion.covariance, covariance, rtol=1e-12, atol=1e-18)


def test_filter_without_any_sensor_says_so():
    with pytest.raises(ValueError, match="neither sensor"):
        InverseVarianceFusion().update(np.full(7, np.nan), 1.0, np.zeros(7), np.inf)
