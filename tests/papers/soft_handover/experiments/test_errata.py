"""Every erratum of the handover thesis: the corrected form passes, the printed one fails."""

from dataclasses import replace

import numpy as np
import pytest

from soro_lib.arcs import arc_transform, backbone
from soro_lib.controllers import limit_state
from soro_lib.controllers.handover import HandoverController, goal_over
from soro_lib.controllers.virtual_stiffness import reach_goal, state_limits, step_towards
from soro_lib.estimators.handover_filters import FilterNoise, PointFilter, points_from_direction
from soro_lib.papers.soft_handover.calibration import plant_k, timestep
from soro_lib.papers.soft_handover.experiments import guidance, handover, variants
from soro_lib.papers.soft_handover.world.observer import NoisyObserver, load_vision_noise
from soro_lib.robots import HelixArm
from soro_lib.robots.helix import origin_from_arm_base

ARM = HelixArm()


def printed_rotation(phi, theta):
    """Eq. (1) as printed: the +1 of the second row in the first column."""
    cp, sp, ct, s_theta = np.cos(phi), np.sin(phi), np.cos(theta), np.sin(theta)
    return np.array(
        [
            [cp**2 * (ct - 1) + 1, sp * cp * (ct - 1), cp * s_theta],
            [sp * cp * (ct - 1) + 1, sp**2 * (ct - 1), sp * s_theta],
            [-cp * s_theta, -sp * s_theta, ct],
        ]
    )


def is_rotation(matrix):
    return np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-9) and np.linalg.det(matrix) > 0


def test_sh1_rotation_of_a_segment():
    assert np.linalg.det(printed_rotation(0.3, 0.0)) == pytest.approx(0.0)
    corrected = printed_rotation(0.3, 0.8)
    corrected[1, 0] -= 1
    corrected[1, 1] += 1
    assert is_rotation(corrected)
    np.testing.assert_allclose(
        corrected, arc_transform(0.8 * np.cos(0.3), 0.8 * np.sin(0.3), 0.24)[:3, :3], atol=1e-12
    )


def test_sh2_rotation_in_bending_components():
    dx, dy = 0.7, 0.9
    printed = printed_rotation(np.arctan2(dy, dx), 1.0)  # the argument Delta / Delta is 1
    assert not is_rotation(printed)
    assert is_rotation(arc_transform(dx, dy, 0.24)[:3, :3])


def test_sh3_translation_in_bending_components():
    bend, length = 1e-6, 0.24
    share = np.array([0.6, 0.8])
    sideways = length * share * (1 - np.cos(bend))
    printed = length / bend * np.array([*sideways, length / bend * np.sin(bend)])
    assert abs(printed[2] - length) > 1.0
    corrected = arc_transform(*(bend * share), length)[:3, 3]
    np.testing.assert_allclose(corrected, [0, 0, length], atol=1e-6)


def test_sh4_plane_of_bending():
    dx, dy = -0.6, -0.3
    bend = np.hypot(dx, dy)
    assert np.arccos(dx / bend) != pytest.approx(np.arcsin(dy / bend))
    tip = arc_transform(dx, dy, 0.24)[:3, 3]
    assert np.arctan2(tip[1], tip[0]) == pytest.approx(np.arctan2(dy, dx))


def test_sh5_straight_arm():
    with np.errstate(invalid="ignore"):
        assert np.isnan(np.float64(0.0) / np.float64(0.0) * (np.cos(0.0) - 1))
    np.testing.assert_allclose(ARM.tip_points(ARM.home), [0, 0, 0.6, 0, 0, 0.7])
    assert np.isfinite(ARM.tip_points_jacobian(ARM.home)).all()


def test_sh6_squared_norms():
    plant, eyes = plant_k(), NoisyObserver(load_vision_noise("joint"))
    read = variants.loop_variants(0.2)
    norm = handover.handovers(read["all 20 iterations"], plant, handover.Blocks(eyes, 1, 1), step_limit=80)[0]
    square = handover.handovers(
        read["squared norm in Eq. (16)"], plant, handover.Blocks(eyes, 1, 1), step_limit=80
    )[0]
    assert norm["success"].mean() >= 0.8
    assert square["success"].sum() == 0
    assert square["miss_mm"].min() > 100


def test_sh7_distance_of_wrist_and_gripper():
    wrist, gripper = ARM.tip_points(ARM.home).reshape(2, 3)
    assert np.linalg.norm(wrist - gripper) == pytest.approx(0.10)
    assert np.sum((wrist - gripper) ** 2) != pytest.approx(0.10)


def test_sh8_filtered_direction_is_normalised():
    mean = (np.array([0, 0, 1.0]) + np.array([np.sin(1.0), 0, np.cos(1.0)])) / 2
    assert np.linalg.norm(0.1 * mean) < 0.09
    points = points_from_direction(np.zeros(3), mean, 0.1)
    assert np.linalg.norm(points[3:] - points[:3]) == pytest.approx(0.1)


def test_sh9_jacobian_has_rank_five():
    rng = np.random.default_rng(0)
    for q in [ARM.home, *rng.uniform(ARM.lower, ARM.upper, (50, 9))]:
        singular = np.linalg.svd(ARM.tip_points_jacobian(q))[1]
        assert singular[5] < 1e-14
        assert singular[4] > 0.01


def test_sh10_early_exit_differs():
    q = np.array([0.3, -0.2, 0.11, 0.5, 0.4, 0.22, -0.6, 0.1, 0.24])
    measured = ARM.tip_points(q)
    goal = step_towards(measured, measured + 0.1, 0.4)
    softness = 1 / np.array([0.2, 0.2, 2.0, 0.1, 0.1, 1.0, 0.1, 0.1, 1.0])
    shared = (q, q, goal, measured, softness, *state_limits(ARM), 0.005, 20)
    all_iterations = reach_goal(*shared, False, False, 0.1)
    early = reach_goal(*shared, True, False, 0.1)
    assert early[3] < all_iterations[3] == 20
    assert np.abs(early[0] - all_iterations[0]).max() > 1e-5


def test_sh11_stiffness_is_returned():
    _, softness = limit_state([0, 0, 0.3, 0, 0, 0.24, 0, 0, 0.24], np.ones(9))
    assert softness[2] == pytest.approx(0.01)


def printed_crop(x, y, bound):
    """Lines 15 to 19 of Algorithm 2 as printed."""
    with np.errstate(invalid="ignore"):
        return (np.sqrt(bound**2 - y**2), y) if x > y else (x, np.sqrt(bound**2 - x**2))


@pytest.mark.parametrize(("x", "y"), [(-2.0, 0.1), (0.5, -1.6), (-1.5, -1.0)])
def test_sh12_signs_in_algorithm_2(x, y):
    printed = printed_crop(x, y, np.pi / 2)
    q, _ = limit_state([0, 0, 0.12, x, y, 0.24, 0, 0, 0.24], np.ones(9))
    assert np.hypot(q[3], q[4]) == pytest.approx(np.pi / 2)
    assert np.sign(q[3:5]).tolist() == np.sign([x, y]).tolist()
    assert np.isnan(printed).any() or np.sign(printed).tolist() != np.sign([x, y]).tolist()


def test_sh13_both_components_too_large():
    assert np.isnan(printed_crop(1.8, 1.7, np.pi / 2)).any()
    q, _ = limit_state([0, 0, 0.12, 1.8, 1.7, 0.24, 0, 0, 0.24], np.ones(9))
    np.testing.assert_allclose(q[3:5], np.pi / 2 * np.array([1.8, 1.7]) / np.hypot(1.8, 1.7))


def test_sh14_threshold_of_algorithm_3():
    ball = np.array([0.15, 0.0, 0.64])
    error = np.linalg.norm(goal_over(ball, 0.05, 0.1) - ARM.tip_points(ARM.home))
    assert error > 0.05
    closed = 0.8 * error  # a fifth of the way there
    assert closed**2 < 0.05 < closed


def test_sh15_mixed_pose_is_too_short():
    turn = np.deg2rad(60)
    upright = points_from_direction(np.zeros(3), np.array([0, 0, 1.0]), 0.1)
    tilted = points_from_direction(np.zeros(3), np.array([np.sin(turn), 0, np.cos(turn)]), 0.1)
    mixed = step_towards(tilted, upright, 0.4)
    short = 0.1 - np.linalg.norm(mixed[3:] - mixed[:3])
    assert short == pytest.approx(0.0128, abs=1e-4)
    assert short / np.sqrt(2) > 0.005


def test_sh16_calibrated_pose():
    printed = [0, 0, 0.6, 0, 0, 0, 0.7]
    assert len(printed) != 6
    np.testing.assert_allclose(ARM.tip_points(ARM.home), [0, 0, 0.6, 0, 0, 0.7])


def test_sh17_two_frames():
    np.testing.assert_allclose(origin_from_arm_base(ARM.tip_points(ARM.home)[3:]), [0, 0, -0.7])


def test_sh18_third_step_size():
    eyes = NoisyObserver(load_vision_noise("thesis"))
    runs, _ = handover.compare(
        handover.by_step_size((0.2, 0.3, 0.4)), {"K": plant_k()}, handover.Blocks(eyes, 2, 1)
    )
    medians = {a: runs.loc[runs["alpha"] == a, "steps"].median() * timestep(a) for a in (0.2, 0.3, 0.4)}
    printed = 39.6 / 22.3
    assert abs(medians[0.2] / medians[0.4] - printed) < abs(medians[0.2] / medians[0.3] - printed)


def test_sh19_only_the_ratio_of_variances_matters():
    rng = np.random.default_rng(0)
    ours, scaled = (
        PointFilter(FilterNoise(0.01, 0.1), np.zeros(3)),
        PointFilter(FilterNoise(0.01e-4, 0.1e-4, 2000e-4), np.zeros(3)),
    )
    for measured in rng.standard_normal((10, 3)):
        for point in (ours, scaled):
            point.predict(np.zeros(3))
            point.update(measured, np.nan)
    np.testing.assert_allclose(ours.state, scaled.state, atol=1e-9)


def test_sh20_dx_tilts_towards_x():
    q = ARM.home + np.array([0.5, 0, 0, 0, 0, 0, 0, 0, 0])
    points = ARM.tip_points(q)
    assert points[3] > 0.1
    assert points[4] == pytest.approx(0.0)


def test_sh21_tendon_map_is_linear():
    q = np.array([0.3, -0.2, 0.11, 0.5, 0.4, 0.22, -0.6, 0.1, 0.24])
    np.testing.assert_allclose(ARM.tendon_lengths(2.5 * q), 2.5 * ARM.tendon_lengths(q))
    first = q[:3].reshape(1, 3)
    path = np.array(
        [
            (arc_transform(*(s * first[0])) @ np.array([ARM.tendon_radius, 0, 0, 1]))[:3]
            for s in np.linspace(0, 1, 4001)
        ]
    )
    walked = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    assert walked == pytest.approx(ARM.tendon_lengths(q)[0], abs=1e-7)
    assert backbone(first, 10).shape[-1] == 3


def test_sh22_lengths_explain_the_error():
    shapes = variants.estimated_shapes({"K": plant_k()}, 30, 1, (1.0, 100.0))
    outside = shapes.groupby("length_weight")["outside"].mean()
    assert outside[1.0] > 0.4
    assert outside[100.0] < 0.1


def test_sh23_error_floor():
    floors = variants.error_floor(plant_k(), (0.1, 0.2, 0.4), (0.005,), steps=250)
    printed = floors[floors["loop"] == "all 20 iterations"]
    np.testing.assert_allclose(printed["floor_mm"], [50, 25, 12.5], rtol=0.02)
    assert floors.loc[floors["loop"] == "no error floor", "floor_mm"].max() < 1.0


def test_sh24_guidance_decreases_the_time():
    eyes = NoisyObserver(load_vision_noise("thesis"))
    plants = {"K": plant_k()}
    alone, _ = handover.compare(handover.by_step_size((0.1,)), plants, handover.Blocks(eyes, 1, 1))
    led, _ = handover.compare(
        handover.by_step_size((0.1,)), plants, handover.Blocks(eyes, 1, 1), guide=guidance.GuidingHand()
    )
    assert led["steps"].median() < alone["steps"].median()


def test_sh25_units_of_the_jacobian():
    q = np.array([0.3, -0.2, 0.11, 0.5, 0.4, 0.22, -0.6, 0.1, 0.24])
    twice = HelixArm(
        rest_lengths=(0.24, 0.48, 0.48),
        minimum_lengths=(0.16, 0.32, 0.32),
        maximum_lengths=(0.28, 0.52, 0.52),
        gripper_length=0.2,
    )
    large = twice.tip_points_jacobian(q * np.tile([1, 1, 2], 3))
    small = ARM.tip_points_jacobian(q)
    np.testing.assert_allclose(large, small * np.tile([2, 2, 1], 3), atol=1e-12)


def test_without_the_correction_of_sh14_the_gripper_closes_far_away():
    eyes = NoisyObserver(load_vision_noise("joint"))
    parameters = replace(handover.thesis_parameters(0.2), stop_threshold=0.05**0.5)
    controller = HandoverController(parameters)
    rng = np.random.default_rng(0)
    ball = handover.HOLDER.ball("front", rng)
    run = handover.run_handover(controller, plant_k(), eyes, ball, rng)
    assert run.mode == "grasp"
    assert not run.success
