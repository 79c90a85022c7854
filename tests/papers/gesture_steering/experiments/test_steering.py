"""Steering in simulation: the paper's bounds, and the rate of the loop."""

import numpy as np
import pytest

from soro_lib.papers.gesture_steering.experiments import steering
from soro_lib.papers.gesture_steering.recordings import load_recording
from soro_lib.papers.gesture_steering.world.hand import QUIET


def rng(seed=0):
    return np.random.default_rng(seed)


def test_infinity_path_is_within_the_papers_bounds():
    table = steering.fig7a(rng(1), duration=8.0)
    assert table["position_error_mm"].max() < 1.0
    assert table["direction_error_deg"].max() < 2.0
    assert table["tip_x_mm"].max() > 20.0


def test_rotation_about_a_point_holds_inside_the_reach():
    table = steering.fig7b(rng(1), noise=QUIET, opening=np.deg2rad(12.0), duration=8.0)
    assert table["position_error_mm"].max() < 0.1
    assert table["direction_error_deg"].max() < 0.1
    assert np.ptp(table["alpha_deg"]) > 20.0


@pytest.mark.parametrize("panel", ["a", "b", "c", "d"])
def test_gesture_changes_are_seamless(panel):
    table = steering.fig8(rng(2), panel)
    assert steering.direction_steps(table).max() < 5.0
    changes = (table["mode"] != table["mode"].shift()).sum() - 1
    assert changes == (0 if panel == "d" else 2)


def test_loop_waits_for_frames_and_for_the_bus():
    stamps = np.arange(0, 1, 0.01)
    np.testing.assert_allclose(steering.loop_starts(stamps, 0.001), stamps)
    starts = steering.loop_starts(stamps, 0.034)
    np.testing.assert_allclose(np.diff(starts), 0.034, atol=1e-9)
    assert steering.ServoBus().period == pytest.approx(0.1121)


def test_a_slower_controller_sees_fewer_frames():
    table = load_recording("hover")
    full, slow = (steering.steered(table.head(400), interval=interval) for interval in (0.0, 0.09))
    assert len(full) == 400
    assert 30 < len(slow) < 42
