"""The experiments of the handover study: reproducible, judged by the truth."""

import numpy as np
import pandas as pd
import pytest

from soro_lib.controllers.handover import HandoverController, Mode
from soro_lib.papers.soft_handover.calibration import plant_k
from soro_lib.papers.soft_handover.experiments import (
    faults,
    handover,
)
from soro_lib.papers.soft_handover.world.observer import NoisyObserver, load_vision_noise
from soro_lib.papers.soft_handover.world.plant import ElasticPlant, Gripper
from soro_lib.robots import HelixArm

ARM = HelixArm()
EYES = NoisyObserver(load_vision_noise("thesis"))
PLANTS = {"K": plant_k(), "E": ElasticPlant()}


def test_same_seed_same_runs_whatever_ran_before():
    first = handover.handovers(handover.thesis_parameters(0.4), PLANTS["E"], handover.Blocks(EYES, 1, 7))
    handover.handovers(handover.thesis_parameters(0.2), PLANTS["E"], handover.Blocks(EYES, 1, 8))
    second = handover.handovers(handover.thesis_parameters(0.4), PLANTS["E"], handover.Blocks(EYES, 1, 7))
    pd.testing.assert_frame_equal(first[0], second[0])
    pd.testing.assert_frame_equal(first[1], second[1])
    longer = handover.handovers(handover.thesis_parameters(0.4), PLANTS["E"], handover.Blocks(EYES, 2, 7))[0]
    pd.testing.assert_frame_equal(first[0], longer.iloc[:8])


def test_success_is_judged_by_the_true_ball_in_the_true_gripper():
    controller = HandoverController(handover.thesis_parameters(0.2))
    ball = handover.HOLDER.ball("front", np.random.default_rng(0))
    for offset, caught in ((0.0, True), (0.1, False)):
        change = faults.wrong_calibration(offset)
        eyes = faults.FaultyObserver(EYES, change)
        run = handover.run_handover(controller, PLANTS["K"], eyes, ball, np.random.default_rng(1))
        assert run.mode is Mode.GRASP
        assert run.success is caught
        assert run.success == Gripper().holds(ARM.tip_points(run.state), run.ball)
        miss = np.linalg.norm(ARM.tip_points(run.state)[3:] - run.ball)
        assert run.trace["miss_mm"][-1] == pytest.approx(1e3 * miss)


def test_traces_have_one_row_per_look():
    runs, traces = handover.handovers(
        handover.thesis_parameters(0.4), PLANTS["K"], handover.Blocks(EYES, 1, 1), plant="K"
    )
    assert traces.groupby("run")["step"].max().tolist() == runs["steps"].tolist()
    gaps = {"commanded_gap_mm", "estimated_gap_mm", "estimate_residual_mm", "miss_mm", "descending"}
    assert {"error_mm", "measured_mm", "commanded_mm", "estimated_mm", "true_mm"} | gaps <= set(traces)
    assert (traces["estimate_residual_mm"].dropna() <= 5.0 + 1e-6).all()


def test_block_times_are_those_of_the_runs():
    runs = pd.DataFrame(
        {"plant": "K", "alpha": 0.1, "block": 0, "steps": [10, 20, 60], "success": [True, True, False]}
    )
    times = handover.block_times(runs, {0.1: 2.0}).iloc[0]
    assert (times["min_s"], times["median_s"], times["max_s"], times["mean_s"]) == (20, 40, 120, 60)
    assert times["successes"] == 2


def test_a_wider_gripper_never_catches_less():
    runs = handover.handovers(
        handover.thesis_parameters(0.4), PLANTS["E"], handover.Blocks(EYES, 1, 1), plant="E", alpha=0.4
    )[0]
    assert handover.success_over_opening(runs)["success"].is_monotonic_increasing
