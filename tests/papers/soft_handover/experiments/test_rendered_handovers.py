"""A whole handover through rendered images."""

from soro_lib.papers.soft_handover.calibration import plant_k
from soro_lib.papers.soft_handover.experiments import rendered_handovers


def test_a_handover_through_rendered_images_ends_with_the_ball_in_the_gripper():
    best = rendered_handovers.BEST
    runs, traces = rendered_handovers.rendered_block("K", plant_k(), "joint", 0, 1, best)
    assert len(runs) == 8
    assert runs["success"].mean() >= 0.75
    assert traces.groupby("run")["step"].max().tolist() == runs["steps"].tolist()
    assert rendered_handovers.run_summary(runs).loc[0, "runs"] == 8
