"""The pictures of the handover: true to geometry, complete, and spoilt only as asked."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soro_lib.papers.soft_handover.world.scene import (
    BRIO,
    STEREO,
    WEBCAM,
    Extras,
    HandoverScene,
    photograph,
    stereo_pair,
)
from soro_lib.robots import HelixArm
from soro_lib.sensing.camera import invert_pose, transform_points
from soro_lib.sensing.marker_ring import MarkerRing
from soro_lib.sensing.stereo_vision import MarkerDetector
from soro_lib.worlds.rendering import Photometry, render

CLEAN = Photometry(read_noise=0.0, shot_noise=0.0)
BALL = np.array([-0.10, 0.05, 0.68])


@pytest.fixture(scope="module")
def scene():
    return HandoverScene()


def test_ring_stands_around_the_wrist_with_its_markers_upright():
    ring = MarkerRing()
    assert ring.apothem == pytest.approx(0.0400, abs=1e-4)
    outward, up = ring.marker_poses[:, :3, 2], ring.marker_poses[:, :3, 1]
    np.testing.assert_allclose(ring.marker_poses[:, :3, 3], ring.apothem * outward, atol=1e-15)
    np.testing.assert_allclose(up, np.tile([0, 0, -1], (10, 1)), atol=1e-15)
    assert np.allclose(np.linalg.det(ring.marker_poses[:, :3, :3]), 1)
    sides = np.linalg.norm(np.diff(ring.marker_corners, axis=1), axis=-1)
    np.testing.assert_allclose(sides, 0.020)
    for i in range(10):
        nearest = np.linalg.norm(ring.facets[i, :, None] - ring.facets[i - 1], axis=-1).min(axis=1)
        assert np.sum(nearest < 1e-12) == 2, "neighbouring facets share an edge"


@pytest.mark.parametrize(
    ("fields", "message"),
    [({"sides": 2}, "sides"), ({"marker": 0.03}, "marker"), ({"marker": 0.0}, "marker")],
)
def test_impossible_rings_are_refused(fields, message):
    with pytest.raises(ValueError, match=message):
        MarkerRing(**fields)


@pytest.mark.parametrize("view", STEREO)
def test_rendered_markers_are_found_where_they_are(scene, view):
    state = scene.arm.home.copy()
    state[[3, 4]] = -0.3, 0.2
    image = photograph(scene.items(state, BALL), view, WEBCAM, np.random.default_rng(1))
    seen = MarkerDetector(scene.ring).detect(image)
    assert len(seen) >= 3
    errors = []
    for number, corners in seen.items():
        in_camera = invert_pose(view.pose) @ scene.wrist(state)
        truth = view.camera.project(transform_points(in_camera, scene.ring.marker_corners[number]))
        assert np.abs(corners - truth).max() < 2.0
        errors.append(corners - truth)
    assert np.median(np.abs(errors)) < 0.25


def test_cameras_stand_half_a_metre_apart_and_both_see_the_hanging_gripper():
    left, right = (view.pose[:3, 3] for view in STEREO)
    assert np.linalg.norm(left - right) == pytest.approx(0.5)
    for view in STEREO:
        gripper = transform_points(invert_pose(view.pose), [[0.0, 0.0, 0.7]])
        x, y = view.camera.project(gripper)[0]
        assert 0 < x < 1279
        assert 0 < y < 719
    parallel = stereo_pair(toe_in=0.0)
    np.testing.assert_allclose(parallel[0].pose[:3, :3], parallel[1].pose[:3, :3], atol=1e-12)


def test_left_camera_is_on_the_left_and_down_is_down():
    view = STEREO[0]
    right = transform_points(invert_pose(view.pose), [[0.1, 0.0, 0.7], [-0.1, 0.0, 0.7], [0.0, 0.0, 0.8]])
    pixels = view.camera.project(right)
    assert pixels[0, 0] > pixels[2, 0] > pixels[1, 0]
    assert pixels[2, 1] > pixels[:2, 1].max()
    assert STEREO[0].pose[0, 3] < STEREO[1].pose[0, 3]


def test_the_gripper_hides_a_ball_behind_it(scene):
    gripper = scene.arm.tip_points(scene.arm.home)[3:]
    toward = STEREO[0].pose[:3, 3] - gripper
    toward /= np.linalg.norm(toward)
    palm = gripper - [0.0, 0.0, 0.07]

    def green(ball):
        image = photograph(scene.items(scene.arm.home, ball, Extras(hand=False)), STEREO[0], CLEAN, None)
        hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
        return int(cv2.inRange(hsv, (40, 120, 45), (80, 255, 255)).sum() / 255)

    assert green(palm + 0.10 * toward) > 400
    assert green(palm - 0.06 * toward) < 0.5 * green(palm + 0.06 * toward)


def test_hidden_markers_are_cloth_and_a_second_ball_is_another_green_spot(scene):
    rng = np.random.default_rng(2)
    covered = Extras(hidden_markers=frozenset(range(10)))
    image = photograph(scene.items(scene.arm.home, BALL, covered), STEREO[0], WEBCAM, rng)
    assert MarkerDetector(scene.ring).detect(image) == {}
    items = scene.items(scene.arm.home, BALL)
    more = scene.items(scene.arm.home, BALL, Extras(second_ball=(0.2, 0.0, 0.6)))
    assert len(more) == len(items) + 1


def test_the_same_seed_gives_the_same_picture_and_noise_is_as_declared(scene):
    items = scene.items(scene.arm.home, BALL)
    first, again, other = (
        photograph(items, STEREO[0], WEBCAM, np.random.default_rng(seed)) for seed in (3, 3, 4)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    quiet = photograph(items, STEREO[0], replace(WEBCAM, read_noise=0.0), np.random.default_rng(3))
    noise = first.astype(float) - quiet
    assert noise.std() == pytest.approx(3.0, rel=0.05)
    assert abs(noise.mean()) < 0.1


def test_light_and_motion_act_on_the_picture(scene):
    items = scene.items(scene.arm.home, BALL)
    bright, dark, moved = (
        photograph(items, STEREO[0], p, None)
        for p in (CLEAN, replace(CLEAN, gain=0.5), replace(CLEAN, motion=(9.0, 0.0)))
    )
    assert np.abs(dark.astype(float) - 0.5 * bright).max() <= 1.0
    assert (
        np.abs(np.diff(moved.astype(int), axis=1)).sum() < np.abs(np.diff(bright.astype(int), axis=1)).sum()
    )


@pytest.mark.parametrize("ball", [[0, 0], [0, 0, np.nan], [np.inf, 0, 0]])
def test_a_ball_nowhere_is_refused(scene, ball):
    with pytest.raises(ValueError, match="ball"):
        scene.items(scene.arm.home, ball)


def test_a_state_of_another_size_is_refused(scene):
    with pytest.raises(ValueError, match="nine"):
        scene.wrist(np.zeros(6))


def test_a_true_state_past_the_limits_of_the_commands_is_drawn(scene):
    state = scene.arm.home.copy()
    state[5] = 0.2605
    assert len(scene.items(state, BALL)) > 10


@settings(max_examples=25)
@given(st.lists(st.floats(-1.2, 1.2), min_size=6, max_size=6), st.floats(-0.5, 0.9), st.floats(0.1, 1.2))
def test_any_arm_and_ball_can_be_drawn(bends, y, z):
    scene = HandoverScene()
    state = HelixArm().home.reshape(3, 3).copy()
    state[:, :2] = np.array(bends).reshape(3, 2)
    items = scene.items(state.ravel(), [0.1, y, z])
    image = render(BRIO, STEREO[1].pose, items, background=(160, 160, 160))
    assert image.shape == (720, 1280, 3)
