"""The flights of the camera: what is stored is whole, and the generator makes it again."""

import numpy as np
import pytest

from soro_lib.papers.visual_strain_fusion import recordings as record
from soro_lib.papers.visual_strain_fusion.experiments import camera_runs
from soro_lib.papers.visual_strain_fusion.experiments.camera_runs import (
    COLUMNS,
    FLIGHTS,
    MAP_ARRAYS,
    SLUG,
    Flight,
    calibration_sweep,
    fly,
    load_flight,
    load_map,
)
from soro_lib.papers.visual_strain_fusion.world.motion import spiral
from soro_lib.papers.visual_strain_fusion.world.scene import undisturbed
from soro_lib.project import data_directory
from soro_lib.replication.datacards import read_card


@pytest.fixture(scope="module", params=list(FLIGHTS))
def flight(request):
    return request.param, load_flight(request.param)


def test_a_stored_flight_is_whole(flight):
    name, frames = flight
    assert list(frames.columns) == list(COLUMNS)
    assert len(frames) == 4000
    np.testing.assert_allclose(np.diff(frames["time_s"]), 0.05, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(frames[["qx", "qy", "qz", "qw"]], axis=1), 1, atol=2e-5)
    lost = frames["tracked"] == 0
    assert frames.loc[lost, "inlier_error_px"].isna().all()
    assert frames.loc[~lost, "inlier_error_px"].between(0.2, 4).all()
    assert (frames.loc[~lost, "inliers"] >= 15).all()
    assert (frames["inliers"] <= frames["matches"]).all()
    assert read_card(data_directory(SLUG) / f"{name}.csv.gz")["seed"] == record.SEED


def test_a_stored_flight_followed_the_spiral(flight):
    _, frames = flight
    truth = frames[["true_x_mm", "true_y_mm", "true_z_mm"]].to_numpy()
    np.testing.assert_allclose(truth, 1e3 * spiral().pose[:, :3], atol=1e-4)


def test_a_lost_camera_repeats_its_last_pose(flight):
    _, frames = flight
    lost = frames.index[(frames["tracked"] == 0) & (frames.index > 0)]
    places = frames[["x_mm", "y_mm", "z_mm", "qw"]].to_numpy()
    np.testing.assert_array_equal(places[lost], places[lost - 1])


def test_the_conditions_do_what_they_are_meant_to():
    obstacles, light = load_flight("scene2_obstacles"), load_flight("scene2_light")
    undisturbed_flight = load_flight("scene2_undisturbed")
    assert undisturbed_flight["tracked"].mean() > 0.999
    assert (obstacles.loc[obstacles["phase"] == 4, "tracked"] == 0).all()
    hand = obstacles[obstacles["phase"].isin([2, 3])]
    assert hand["inliers"].median() < 0.8 * obstacles.loc[obstacles["time_s"] < 100, "inliers"].median()
    assert (light.loc[light["phase"] == 2, "tracked"] == 0).sum() >= 80
    assert (light.loc[light["phase"] == 1, "tracked"] == 1).all()


def test_a_stored_map_is_metric_and_in_the_room():
    for name in FLIGHTS:
        point_map = load_map(name)
        assert set(point_map) == set(MAP_ARRAYS)
        inside = np.abs(point_map["positions"]) < [0.2, 0.2, 0.2]
        assert inside.all(axis=1).mean() > 0.97
        np.testing.assert_allclose(np.linalg.norm(point_map["directions"], axis=1), 1, atol=1e-5)


def test_a_room_without_light_gives_a_clear_error(monkeypatch):
    dark = np.zeros((480, 640), np.uint8)
    monkeypatch.setattr(camera_runs, "photograph", lambda *_: dark)
    with pytest.raises(RuntimeError, match="no map after the sweep"):
        fly(Flight(1, undisturbed, "nothing"), seed=1, steps=1)


def test_the_sweep_starts_and_ends_in_the_middle():
    sweep = calibration_sweep()
    np.testing.assert_allclose(sweep.pose[[0, -1], :3], 0, atol=1e-9)
    assert 0.012 < np.abs(sweep.pose[:, :2]).max() < 0.025


def test_unknown_flights_are_named():
    with pytest.raises(KeyError, match="scene1_light"):
        load_flight("scene3")
    with pytest.raises(KeyError, match="scene1_light"):
        load_map("scene3")
