"""The figures of the camera side: that they show the numbers they are given."""

import numpy as np
import pytest

from soro_lib.papers.visual_strain_fusion.experiments import fusion_runs
from soro_lib.papers.visual_strain_fusion.experiments.camera_runs import load_flight
from soro_lib.papers.visual_strain_fusion.experiments.camera_views import FlightViewer
from soro_lib.papers.visual_strain_fusion.figures import camera as figures
from soro_lib.papers.visual_strain_fusion.world.motion import spiral


@pytest.fixture(scope="module")
def frames():
    return load_flight("scene1_obstacles")


@pytest.fixture(scope="module")
def run(frames):
    return fusion_runs.fuse_flight(frames, spiral(), np.random.default_rng(1))


def test_mean_errors_are_written_beside_their_lines(frames):
    figure = figures.fig05a_camera_errors(frames)
    means = np.abs(fusion_runs.camera_errors(frames)).mean(axis=0)
    texts = [axes.texts[0].get_text() for axes in figure.axes]
    assert texts == [f"mean {mean:.3f} mm" for mean in means]


def test_trajectories_and_confidence_draw_every_kind(frames):
    assert len(figures.fig05b_trajectories(frames).axes) == 2
    assert len(figures.error_and_confidence(frames).axes) == 3


def test_deviations_show_the_largest_error_and_every_phase(run):
    figure = figures.fig06b_deviations(run, 40.2)
    upper = figure.axes[0]
    assert upper.get_ylim()[1] >= run["camera_mm"].max()
    assert {text.get_text() for text in upper.texts} == set("①②③④")
    names = [line.get_label() for line in figures.fig07b_deviations(run, 40.2).axes[0].lines]
    assert names[:3] == ["camera (SLAM)", "fibre (F-emp)", "fusion"]


def test_paths_and_comparison_cover_all_estimates(run):
    assert len(figures.fig06c_trajectories(run, spiral().pose[:, :3]).axes) == 3
    errors = fusion_runs.window_errors(run.assign(flight="scene1_obstacles", fibre_number=0))
    figure = figures.fusion_compared(errors, ["hand in view"], fusion_runs.ESTIMATES)
    assert len(figure.axes[0].containers) == len(fusion_runs.ESTIMATES)


def test_views_say_how_many_features_fit():
    viewer = FlightViewer("scene1_obstacles", color=False)
    views = [viewer.view(step, np.random.default_rng(step)) for step in (100, 3540)]
    figure = figures.fig06a_views(views)
    assert "features fit" in figure.axes[0].get_xlabel()
    assert figure.axes[1].get_xlabel() == "lost"
    marked = figures.annotated(views[0].image, views[0].frame)
    assert marked.shape == (480, 640, 3)
    assert (marked != views[0].image[..., None]).any()


def test_stitched_pictures_are_cut_to_their_content():
    picture = np.full((60, 80, 3), 255, np.uint8)
    picture[20:40, 30:70] = 10
    figure = figures.fig05c_stitched(picture, picture)
    assert figure.axes[0].images[0].get_array().shape[:2] == (20, 40)
    assert len(figures.fig08_reconstructions(picture, picture).axes) == 2
