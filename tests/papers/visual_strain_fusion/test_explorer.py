"""The fusion explorer: scrubbing, switches that take the view away, and the picture without a browser."""

import cv2
import numpy as np
import pytest
from IPython.display import Image

from soro_lib.papers.visual_strain_fusion.explorer import FusionExplorer, explore


@pytest.fixture(scope="module")
def explorer():
    return FusionExplorer()


def picture(explorer):
    return cv2.imdecode(np.frombuffer(explorer.picture.value, np.uint8), cv2.IMREAD_COLOR)


def test_scrubbing_shows_another_picture_with_features(explorer):
    explorer.time.value = 40.0
    first = picture(explorer)
    explorer.time.value = 55.0
    assert first.shape == (480, 640, 3)
    assert np.abs(picture(explorer).astype(float) - first).mean() > 10
    assert "of 600 features fit" in explorer.message.value
    assert explorer.plots.value[:4] == b"\x89PNG"


def test_covering_the_lens_loses_the_camera_and_the_fibre_takes_over(explorer):
    explorer.switch.value = "as flown"
    before = explorer.run["camera_mm"].iloc[1280]
    explorer.start.value, explorer.duration.value = 60.0, 5.0
    explorer.time.value = 64.0
    explorer.switch.value = "cover the lens"
    assert explorer.start.value == 60.0
    assert "lost" in explorer.message.value
    moment = explorer.run.iloc[1280]
    assert moment["weight"] == 1
    assert moment["camera_mm"] > 5 > 2.5 > moment["fused_mm"]
    assert before < 2
    assert picture(explorer).mean() < 60


def test_darkness_does_the_same_and_ends(explorer):
    explorer.time.value = 62.0
    explorer.switch.value = "turn off the light"
    assert "lost" in explorer.message.value
    explorer.time.value = 70.0
    assert explorer.conditions is None
    assert "features fit" in explorer.message.value
    explorer.switch.value = "as flown"


def test_a_switch_acts_on_the_moment_shown(explorer):
    explorer.time.value, explorer.start.value = 30.0, 100.0
    explorer.switch.value = "cover the lens"
    assert explorer.start.value == 29.0
    assert "lost" in explorer.message.value
    explorer.switch.value = "as flown"


def test_without_a_browser_a_picture_stands_in():
    assert isinstance(explore(), Image)
