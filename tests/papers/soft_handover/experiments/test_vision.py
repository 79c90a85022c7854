"""The vision study: poses where handovers happen, the same however many, and noise as measured."""

import numpy as np
import pandas as pd
import pytest

from soro_lib.papers.soft_handover.experiments import (
    vision,
)
from soro_lib.papers.soft_handover.world.observer import VisionNoise
from soro_lib.robots import HelixArm

ERRORS = (("wrist", "_mm"), ("direction", ""), ("ball", "_mm"))


def test_random_states_put_the_gripper_where_handovers_happen():
    states = vision.random_states(50, np.random.default_rng(1))
    points = HelixArm().tip_points(states)
    assert np.hypot(points[:, 3], points[:, 4]).max() < vision.LARGEST_OFFSET
    assert (points[:, 5] > vision.HEIGHTS[0]).all()
    assert (points[:, 5] < vision.HEIGHTS[1]).all()


def test_accuracy_repeats_and_does_not_depend_on_how_many_poses_follow():
    first = vision.accuracy(1, 3, vision.CAUSES[:1])
    more = vision.accuracy(2, 3, vision.CAUSES[:1])
    pd.testing.assert_frame_equal(first, more[more["pose"] == 0])
    assert set(first["estimator"]) == {"thesis", "gated", "joint"}
    assert first.set_index("estimator").loc["joint", "gripper_mm"] < 5


def test_noise_figures_are_those_of_a_known_sample():
    rng = np.random.default_rng(0)
    poses, looks = 300, 20
    bias = np.repeat(3.0 * rng.standard_normal((poses, 9)), looks, axis=0)
    values = bias + 0.5 * rng.standard_normal((poses * looks, 9))
    names = [f"{what}_{axis}{unit}" for what, unit in ERRORS for axis in "xyz"]
    still = pd.DataFrame(values, columns=names)
    still["pose"], still["camera_system"] = np.repeat(np.arange(poses), looks), "thesis"
    hidden = pd.DataFrame(
        {"rule": "largest piece", "visible": [0.5, 0.99], **{n: [2.0, 9.0] for n in names[6:]}}
    )
    figures = vision.noise_figures(still, hidden)["thesis"]
    assert figures["wrist_jitter"] == pytest.approx(0.0005, rel=0.05)
    assert figures["wrist_bias"] == pytest.approx(0.003, rel=0.1)
    assert figures["direction_jitter"] == pytest.approx(0.5, rel=0.05)
    assert figures["occluded_ball"] == pytest.approx(0.002)
    assert VisionNoise(**figures)
