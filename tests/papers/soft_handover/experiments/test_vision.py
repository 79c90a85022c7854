"""The vision study: poses where handovers happen, tables as stored, claims by their own rule."""

import numpy as np
import pandas as pd
import pytest

from soro_lib.papers.soft_handover import recordings as record
from soro_lib.papers.soft_handover.calibration import plant_k
from soro_lib.papers.soft_handover.experiments import rendered_handovers, vision, vision_limits
from soro_lib.papers.soft_handover.world.observer import VisionNoise, load_vision_noise
from soro_lib.papers.soft_handover.world.scene import STEREO, HandoverScene
from soro_lib.robots import HelixArm

ERRORS = (("wrist", "_mm"), ("direction", ""), ("ball", "_mm"))
NOISE = ("wrist_jitter", "wrist_bias", "direction_jitter", "direction_bias", "ball_jitter", "ball_bias")


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


def test_visible_share_is_one_for_a_free_ball_and_small_behind_the_palm():
    scene = HandoverScene()
    view = STEREO[0]
    free = vision_limits.visible_share(scene.arm.home, np.array([-0.15, 0.0, 0.75]), view)
    palm = np.array([0.0, 0.0, 0.625])
    away = palm - view.pose[:3, 3]
    covered = palm + 0.06 * away / np.linalg.norm(away)
    hidden = vision_limits.visible_share(scene.arm.home, covered, view)
    assert free > 0.95
    assert hidden < 0.5


def test_parallel_cameras_see_together_what_neither_misses():
    table = vision_limits.workspace(toe_in=0.0, step=0.05)
    level = table[(table["y_mm"] == 0) & np.isclose(table["z_mm"], 700)]
    assert vision_limits.limiting_camera(level) == "right"
    mirrored = level.assign(x_mm=-level["x_mm"]).sort_values("x_mm")
    assert mirrored["right"].tolist() == level.sort_values("x_mm")["left"].tolist()


def test_a_wider_lens_sees_more():
    limits = vision_limits.workspace_limits(step=0.05)
    areas = limits.pivot_table(index="cameras", columns="field_of_view", values="area_m2")
    assert (areas["90 deg"] > areas["78 deg"]).all()
    assert (areas["78 deg"] > areas["65 deg"]).all()


def test_faults_of_the_pictures_are_refused_or_survived_but_not_believed():
    table = vision_limits.image_faults(1, 5)
    joint = table[table["estimator"] == "joint"]
    assert (joint[["gripper", "ball"]] != "wrong").all().all()
    swapped = table[table["fault"] == "cameras swapped"]
    assert (swapped[["gripper", "ball"]] == "refused").all().all()


def test_a_handover_through_rendered_images_ends_with_the_ball_in_the_gripper():
    best = rendered_handovers.BEST
    runs, traces = rendered_handovers.rendered_block("K", plant_k(), "joint", 0, 1, best)
    assert len(runs) == 8
    assert runs["success"].mean() >= 0.75
    assert traces.groupby("run")["step"].max().tolist() == runs["steps"].tolist()
    assert rendered_handovers.run_summary(runs).loc[0, "runs"] == 8


def test_recordings_are_whole_and_every_column_is_explained(tmp_path):
    table = vision.accuracy(1, 3, vision.CAUSES[:1])
    path = record.write_table("vision_accuracy", table, tmp_path)
    assert not list(tmp_path.glob("*.part"))
    again = path.read_bytes()
    record.write_table("vision_accuracy", table, tmp_path)
    assert path.read_bytes() == again
    record.write_noise({"three cameras": dict.fromkeys(NOISE, 0.001)}, 4, tmp_path)
    assert load_vision_noise("three cameras", tmp_path / "vision_noise.toml").wrist_bias == 0.001


def test_jobs_cover_all_recordings_and_shrink_in_the_small_form():
    names = [job.name for job in record.jobs()]
    assert len(names) == len(set(names))
    assert set(record.STUDIES) <= set(names)
    assert len(record.jobs(small=True)) < len(names)
