"""The scene and its disturbances: geometry, determinism, and that each disturbance does what it says."""

import cv2
import numpy as np
import pytest

from soro_lib.papers.visual_strain_fusion.world.scene import (
    ENDOSCOPE,
    BrickScene,
    ViewConditions,
    add_lamp,
    disturb,
    moving_obstacles,
    photograph,
    printed_surfaces,
    tip_camera,
    undisturbed,
    varying_light,
)

HOME = np.array([0.0, 0, 0, 0, 0, 0, 1])
SHAPE = (ENDOSCOPE.height, ENDOSCOPE.width)


@pytest.fixture(scope="module")
def scene():
    return BrickScene(1)


@pytest.fixture(scope="module")
def view(scene):
    return scene.image(tip_camera(HOME))


def noise(seed=0):
    return np.random.default_rng(seed).standard_normal(SHAPE, dtype=np.float32)


def features(image):
    return len(cv2.ORB.create(600, fastThreshold=10).detect(image))


def test_the_camera_always_sees_a_printed_surface(scene):
    rng = np.random.default_rng(3)
    for tilt in rng.uniform(-0.9, 0.9, (6, 2)):
        half = np.linalg.norm(tilt) / 2
        axis = np.array([-tilt[1], tilt[0], 0]) / np.linalg.norm(tilt) * np.sin(half)
        pose = np.array([*0.04 * tilt, -0.005, *axis, np.cos(half)])
        assert (scene.image(tip_camera(pose)) == 0).mean() < 0.02


def test_same_seed_same_room_other_seed_other_room(scene, view):
    for again, surface in zip(printed_surfaces.__wrapped__(1, False), scene.quads, strict=True):
        np.testing.assert_array_equal(again.texture, surface.texture)
        np.testing.assert_array_equal(again.corners, surface.corners)
    assert np.abs(BrickScene(2).image(tip_camera(HOME)).astype(float) - view).mean() > 20


def test_a_room_is_printed_once(scene):
    assert BrickScene(1).quads is scene.quads
    assert BrickScene(1, color=True).quads is not scene.quads


def test_the_grey_room_is_the_coloured_room_in_grey(view):
    color = BrickScene(1, color=True).image(tip_camera(HOME))
    difference = cv2.cvtColor(color, cv2.COLOR_BGR2GRAY).astype(float) - view
    assert np.abs(difference).mean() < 1.0


def test_moving_the_tip_sideways_moves_near_things_more(scene, view):
    pose = HOME.copy()
    pose[0] = 0.004
    flow = cv2.calcOpticalFlowFarneback(
        view, scene.image(tip_camera(pose)), None, 0.5, 4, 31, 5, 7, 1.5, cv2.OPTFLOW_FARNEBACK_GAUSSIAN
    )
    sideways = -flow[60:-60, 60:-60, 0]
    assert np.median(np.abs(flow[60:-60, 60:-60, 1])) < 0.5
    assert 14 < np.percentile(sideways, 20) < 18
    assert np.percentile(sideways, 97) > 19


def test_full_light_gives_600_features_and_darkness_or_a_cover_only_noise(scene):
    clear = photograph(scene, HOME, ViewConditions(), noise())
    dark = photograph(scene, HOME, ViewConditions(light=0.0), noise())
    covered = photograph(scene, HOME, ViewConditions(covered=True), noise())
    assert features(clear) == 600
    assert features(dark) < 20
    assert features(covered) < 200
    assert dark.mean() < 5 < covered.mean() < 60


def test_a_hand_hides_a_part_and_is_soft(view):
    hidden = disturb(view, ViewConditions(hand=(0.2, 0.3, 0.5)))
    share = (np.abs(hidden.astype(float) - view) > 10).mean()
    assert 0.2 < share < 0.9
    np.testing.assert_array_equal(disturb(view, ViewConditions()), view)
    patch = hidden[100:180, 60:180]
    assert cv2.Laplacian(patch, cv2.CV_64F).std() < 3


def test_the_lamp_blinds_its_surroundings_and_dims_the_rest(view):
    seen = add_lamp(view, (0.25, 0.5))
    assert seen[240, 160] == 255
    assert seen[10:100, 560:].mean() < 0.85 * view[10:100, 560:].mean()


def test_colour_pictures_can_be_disturbed_too():
    scene = BrickScene(1, color=True)
    sensor = np.zeros((*SHAPE, 3), np.float32)
    for conditions in (
        ViewConditions(hand=(0.5, 0.5, 0.0)),
        ViewConditions(covered=True),
        ViewConditions(lamp=(0.5, 0.5)),
    ):
        image = photograph(scene, HOME, conditions, sensor)
        assert image.shape == (*SHAPE, 3)


def test_the_timelines_follow_the_paper():
    assert all(moving_obstacles(t).phase == 1 for t in np.arange(0, 100, 0.05))
    phases = [moving_obstacles(t).phase for t in np.arange(0, 200, 0.05)]
    assert set(phases) == {1, 2, 3, 4}
    starts = np.flatnonzero(np.diff(np.array(phases) == 4) & (np.array(phases[1:]) == 4))
    lengths = [next(n for n in range(1, 200) if k + 1 + n >= 4000 or phases[k + 1 + n] != 4) for k in starts]
    assert all(38 <= length <= 42 for length in lengths)
    light = np.array([varying_light(t).light for t in np.arange(0, 200, 0.05)])
    assert (light[:1500] == 1).all()
    assert (light[3000:] == 1).all()
    assert 0.05 * (light == 0).sum() == pytest.approx(4.0, abs=0.2)
    assert all((varying_light(t).lamp is None) == (t < 150) for t in np.arange(0, 200, 0.5))
    assert undisturbed(123.0) == ViewConditions()


@pytest.mark.parametrize("pose", [HOME[:6], np.full(7, np.nan)])
def test_bad_poses_are_refused(pose):
    with pytest.raises(ValueError, match="seven finite"):
        tip_camera(pose)


def test_negative_light_is_refused():
    with pytest.raises(ValueError, match="light"):
        ViewConditions(light=-0.1)
