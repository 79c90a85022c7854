"""Fusing a stored flight: who wins where, that the same seed repeats, and what is refused."""

import numpy as np
import pytest

from soro_lib.papers.visual_strain_fusion.experiments import fusion_runs as fusion
from soro_lib.papers.visual_strain_fusion.experiments.camera_runs import load_flight


@pytest.fixture(scope="module")
def obstacles(runs):
    return runs[runs["flight"] == "scene1_obstacles"].reset_index(drop=True)


def test_the_fusion_is_a_mixture_of_its_parts(obstacles):
    for axis in "xyz":
        parts = obstacles[[f"camera_{axis}_mm", f"fibre_{axis}_mm"]]
        for name in ("fused", "printed"):
            assert (obstacles[f"{name}_{axis}_mm"] <= parts.max(axis=1) + 1e-9).all()
            assert (obstacles[f"{name}_{axis}_mm"] >= parts.min(axis=1) - 1e-9).all()
    assert obstacles["weight"].between(0, 1).all()
    np.testing.assert_allclose(
        np.linalg.norm(obstacles[[f"fused_{axis}" for axis in ("qx", "qy", "qz", "qw")]], axis=1), 1
    )


def test_a_lost_camera_leaves_everything_to_the_fibre(obstacles):
    lost = obstacles[(obstacles["tracked"] == 0) & (obstacles["time_s"] > 60)]
    assert len(lost) > 100
    assert (lost["weight"] == 1).all()
    np.testing.assert_allclose(lost["fused_mm"], lost["fibre_mm"])


def test_under_cover_the_fusion_beats_the_camera_that_holds_its_pose(obstacles):
    covered = obstacles[obstacles["phase"] == 4]
    assert covered["camera_mm"].max() > 8
    assert covered["fused_mm"].max() < 4
    assert covered["filter_mm"].max() < 4


def test_inlier_weighting_removes_the_worst_frames_of_the_printed_reading(obstacles):
    hand = obstacles[obstacles["phase"].isin([2, 3])]
    assert hand["fused_mm"].max() < 0.6 * hand["printed_mm"].max() < 0.6 * hand["camera_mm"].max()


def test_same_generator_same_numbers(motion, runs):
    again = fusion.fuse_flights(["scene1_obstacles"], np.random.default_rng(1), seeds=1)
    first = runs[runs["flight"] == "scene1_obstacles"]
    np.testing.assert_array_equal(again["fused_mm"], first["fused_mm"])


def test_another_motion_is_refused(motion):
    frames = load_flight("scene1_light")
    frames["true_x_mm"] += 0.01
    with pytest.raises(ValueError, match="not the one that was flown"):
        fusion.fuse_flight(frames, motion, np.random.default_rng(1))


def test_ten_seconds_without_the_camera_cost_the_fusion_little(motion):
    frames = fusion.blind(load_flight("scene1_obstacles").iloc[:1600], 65.0, 10.0)
    run = fusion.fuse_flight(frames, motion, np.random.default_rng(2))
    away = run[run["time_s"].between(65, 75, inclusive="left")]
    assert (away["tracked"] == 0).all()
    assert away["camera_mm"].max() > 15
    assert away["fused_mm"].mean() < 5
    assert run["fused_mm"].iloc[-50:].max() < 2.5
    assert np.isfinite(run).all(axis=None)


def test_a_flight_without_any_camera_stays_finite(motion):
    frames = fusion.blind(load_flight("scene1_light").iloc[:100], 0.0, 10.0)
    with pytest.raises(ValueError, match="neither sensor"):
        fusion.fuse_flight(frames, motion, np.random.default_rng(1))


def test_window_errors_and_tables(runs):
    errors = fusion.window_errors(runs)
    clean = errors[(errors["window"] == "clean (0-100 s)") & (errors["estimate"] == "camera")]
    assert (clean["mean_mm"] <= clean["rmse_mm"]).all()
    assert (clean["rmse_mm"] <= clean["max_mm"]).all()
    table = fusion.fusion_table(errors, "max_mm")
    assert list(table.columns) == ["flight", "window", *fusion.ESTIMATES]


def test_drift_is_missing_from_the_filter_s_own_covariance(runs):
    table = fusion.coverage(runs)
    assert (table["own_covariance"] < 0.9).all()
    assert (table["with_drift"] > table["own_covariance"]).all()


def test_the_inliers_find_the_worst_frames_better_than_their_error_does():
    table = fusion.error_against_confidence("scene1_obstacles").set_index("sign")
    printed, inliers = table.loc["mean error of the inliers (printed e_S)"], table.loc["fewer inliers"]
    assert inliers["finds_worst"] > 0.9 > printed["finds_worst"] > 0.5
    assert table["rank_correlation"].between(0.2, 0.8).all()
