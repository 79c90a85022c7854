"""Pictures of the flights: found in the stored map, and hung in space where the camera looked."""

import numpy as np
import pytest

from soro_lib.papers.visual_strain_fusion.experiments.camera_views import FlightViewer, stitch, stitched_views
from soro_lib.papers.visual_strain_fusion.world.scene import ENDOSCOPE, ViewConditions, tip_camera
from soro_lib.worlds.rendering import render


@pytest.fixture(scope="module")
def viewer():
    return FlightViewer("scene2_undisturbed")


def test_any_frame_is_found_in_the_stored_map(viewer):
    for step in (100, 1500, 3900):
        view = viewer.view(step, np.random.default_rng(step))
        assert view.frame.tracked
        assert view.frame.inliers > 80
        assert 1e3 * np.linalg.norm(view.frame.pose[:3, 3] - viewer.motion.pose[step, :3]) < 3.5
        assert view.image.shape == (480, 640, 3)


def test_other_conditions_take_the_features_away(viewer):
    rng = np.random.default_rng(1)
    covered = viewer.view(1500, rng, ViewConditions(covered=True))
    assert not covered.frame.tracked
    np.testing.assert_array_equal(covered.frame.pose, tip_camera(viewer.motion.pose[1500]))


def test_a_hung_picture_seen_from_its_own_camera_is_the_picture(viewer):
    picture = viewer.photograph(700, np.random.default_rng(2))
    pose = viewer.motion.pose[700]
    again = render(ENDOSCOPE, tip_camera(pose), stitch([picture], pose[None]), background=(0, 0, 0))
    assert np.abs(again.astype(float) - picture).mean() < 1.0


def test_stitched_pictures_agree_where_they_overlap(viewer):
    steps = (0, 120)
    pictures = [viewer.photograph(step, np.random.default_rng(step)) for step in steps]
    hung = stitch(pictures, viewer.motion.pose[list(steps)], sight=0.125)
    views = [render(ENDOSCOPE, np.eye(4), [quad], background=(0, 0, 0)).astype(float) for quad in hung]
    both = (views[0].min(axis=2) > 0) & (views[1].min(axis=2) > 0)
    correlation = np.corrcoef(views[0][both].mean(axis=1), views[1][both].mean(axis=1))[0, 1]
    assert both.mean() > 0.5
    assert correlation > 0.5


def test_stitched_views_are_pictures_on_white(viewer):
    front, side = stitched_views(viewer, viewer.motion.pose, [0, 2000], np.random.default_rng(3))
    for image in (front, side):
        assert (image == 255).all(axis=2).any()
        assert (image < 255).any(axis=2).mean() > 0.05
