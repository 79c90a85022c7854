"""Where the cameras fail: hidden balls, the edge of the picture, faults of the pictures."""

import numpy as np

from soro_lib.papers.soft_handover.experiments import (
    vision_limits,
)
from soro_lib.papers.soft_handover.world.scene import STEREO, HandoverScene


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
