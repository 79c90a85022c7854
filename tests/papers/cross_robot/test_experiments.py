"""The contest of controllers and arms: resized arms, disturbed plants, what is carried over, the tables."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy.stats import t as student

from soro_lib.controllers.virtual_stiffness import weighted_pseudo_inverse
from soro_lib.papers.cross_robot.experiments.contest import contest, interval, track
from soro_lib.papers.cross_robot.experiments.ideas import guidance, redundancy
from soro_lib.papers.cross_robot.experiments.laws import (
    NotApplicable,
    VirtualStiffness,
    actuator_stiffness,
    controllers,
    palm_mapping,
    stiff_step,
)
from soro_lib.papers.cross_robot.world.benches import (
    HELIX_LENGTH,
    MOUNT_TILT,
    STIFFER,
    Bench,
    benches,
    disturbed_and_not,
    resized,
)
from soro_lib.robots import HelixArm

BENCHES = benches()
arms = pytest.mark.parametrize("bench", BENCHES.values(), ids=BENCHES)


def some_actuations(bench: Bench, count: int, seed: int = 0) -> np.ndarray:
    """Return actuations within a fifth of the range around the start."""
    span = 0.1 * (bench.robot.upper - bench.robot.lower)
    shift = np.random.default_rng(seed).uniform(-span, span, (count, len(span)))
    return bench.robot.clip(bench.start + shift).actuation


@arms
def test_resized_arm_is_the_arm_in_another_unit_of_length(bench: Bench) -> None:
    arm = resized(bench, 0.25)
    actuation = some_actuations(bench, 5)
    shown, pose = arm.forward(actuation / arm.units), bench.robot.forward(actuation)
    assert_allclose(shown[:, :3, 3] * bench.length / 0.25, pose[:, :3, 3], atol=1e-12)
    assert_allclose(shown[:, :3, :3], pose[:, :3, :3], atol=1e-12)
    assert_allclose(arm.pose_and_jacobian(actuation / arm.units)[0], shown, atol=1e-14)
    assert_allclose(
        arm.pose_and_jacobian(actuation / arm.units)[1], arm.jacobian(actuation / arm.units), atol=1e-12
    )


@arms
def test_resized_jacobian_is_the_derivative(bench: Bench) -> None:
    arm = resized(bench, 0.25)
    actuation, step = some_actuations(bench, 1)[0] / arm.units, 1e-7
    for index, column in enumerate(arm.jacobian(actuation)[:3].T):
        shift = step * np.eye(len(actuation))[index]
        difference = (arm.tip(actuation + shift) - arm.tip(actuation - shift)) / (2 * step)
        assert_allclose(column, difference, atol=1e-6)


@arms
def test_every_actuator_of_a_resized_arm_moves_the_tip_alike(bench: Bench) -> None:
    arm = resized(bench, 0.25, sensitivity=3.0)
    assert_allclose(np.linalg.norm(arm.jacobian(bench.start / arm.units)[:3], axis=0), 3.0)


@arms
def test_first_half_of_the_plants_is_the_model_and_the_second_stiffer_and_askew(bench: Bench) -> None:
    plants = disturbed_and_not(bench.robot, 3, np.random.default_rng(0))
    actuation = some_actuations(bench, 1)[0]
    tips, directions = plants.tip_and_direction(np.tile(actuation, (6, 1)))
    pose = bench.robot.forward(actuation)
    assert_allclose(tips[:3], np.tile(pose[:3, 3], (3, 1)), atol=1e-14)
    assert_allclose(directions[:3], np.tile(pose[:3, 2], (3, 1)), atol=1e-14)
    _, straight = plants.tip_and_direction(np.tile(bench.start, (6, 1)))
    assert_allclose(np.arccos(straight[3:, 2]), MOUNT_TILT, atol=1e-9)
    assert_allclose(plants.compliance[3:] * (1.0 + STIFFER), 1.0)


def test_virtual_stiffness_on_the_helix_is_the_one_of_the_thesis() -> None:
    helix = HelixArm()
    rng = np.random.default_rng(1)
    q, error = some_actuations(BENCHES["helix"], 1)[0], rng.normal(0.0, 0.01, 6)
    stiffness = actuator_stiffness(helix, q, 0.1, 1.0)
    diagonal = np.tile([0.1, 0.1, 1.0], 3)
    assert_allclose(stiffness, np.diag(diagonal))
    jacobian = helix.tip_points_jacobian(q)
    assert_allclose(
        stiff_step(jacobian, stiffness, error),
        weighted_pseudo_inverse(jacobian, 1.0 / diagonal) @ error,
        atol=1e-10,
    )


def test_stiff_step_moves_the_tip_with_the_least_energy() -> None:
    bench = BENCHES["cable-driven"]
    arm = resized(bench, HELIX_LENGTH)
    actuation = some_actuations(bench, 1)[0] / arm.units
    jacobian, stiffness = arm.jacobian(actuation)[:3], actuator_stiffness(arm, actuation, 0.1, 1.0)
    error = np.array([0.01, -0.02, 0.005])
    step = stiff_step(jacobian, stiffness, error)
    assert_allclose(jacobian @ step, error, atol=1e-10)
    free = np.linalg.svd(jacobian)[2][3:]
    assert_allclose(free @ stiffness @ step, 0.0, atol=1e-9 * np.abs(stiffness @ step).max())


@arms
def test_virtual_stiffness_keeps_the_limits_even_for_a_goal_out_of_reach(bench: Bench) -> None:
    arm = resized(bench, HELIX_LENGTH)
    law = VirtualStiffness(arm, bench.start / arm.units, 1, np.random.default_rng(0))
    for _ in range(60):
        pose = arm.forward(law.actuation)
        law.update(pose[:, :3, 3], pose[:, :3, 2], np.array([0.5, 0.3, 0.9]))
        bench.robot.check(law.actuation * arm.units)
        assert np.isfinite(law.actuation).all()


@arms
def test_a_loop_closed_over_the_tip_removes_what_an_open_one_leaves(bench: Bench) -> None:
    laws = controllers()
    plants = disturbed_and_not(bench.robot, 2, np.random.default_rng(2))
    held = {
        name: track(laws[name], bench, plants, 60, 60, np.random.default_rng(3)).error[-10:, 2:].mean()
        for name in ("gesture steering", "model-based", "virtual stiffness")
    }
    assert held["gesture steering"] > 0.02 * bench.length
    assert held["model-based"] < 0.005 * bench.length
    assert held["virtual stiffness"] < 0.005 * bench.length


def test_a_large_arm_asks_more_than_the_box_over_the_tracker_holds() -> None:
    bench = BENCHES["helix"]
    plants = disturbed_and_not(bench.robot, 1, np.random.default_rng(0))
    steering = controllers()["gesture steering"]
    with pytest.raises(NotApplicable, match="out of the box"):
        track(steering, bench, plants, 40, 0, np.random.default_rng(0), scaled=False)


def test_palm_mapping_asks_for_the_height_from_a_quarter_metre() -> None:
    assert_allclose(palm_mapping(0.6).position((0.0, 0.25, 0.0)), (0.0, 0.0, 0.6))


@pytest.fixture(scope="module")
def small_contest() -> pd.DataFrame:
    return contest(np.random.default_rng(4), seeds=2, moving=20, holding=8)[0]


def test_contest_has_a_result_or_a_reason_in_every_cell(small_contest: pd.DataFrame) -> None:
    scaled = small_contest.query("constants == 'scaled'")
    assert len(scaled) == 2 * len(controllers()) * len(BENCHES)
    assert not scaled["median_mm"].isna().any()
    refused = small_contest[small_contest["median_mm"].isna()]
    assert set(refused["controller"]) == {"gesture steering"}
    assert refused["why_not"].str.len().gt(10).all()
    assert (small_contest.dropna(subset="p95_mm").eval("p95_mm >= median_mm")).all()


def test_direction_is_reported_where_five_actuators_can_steer_it(small_contest: pd.DataFrame) -> None:
    pointed = small_contest.dropna(subset="direction_deg")
    assert set(pointed["arm"]) == {"cable-driven", "helix"}
    assert set(pointed["controller"]) == {"gesture steering", "virtual stiffness"}


def test_same_seed_same_contest(small_contest: pd.DataFrame) -> None:
    again, _ = contest(np.random.default_rng(4), seeds=2, moving=20, holding=8)
    pd.testing.assert_frame_equal(small_contest, again)


def test_interval_is_students() -> None:
    samples = np.array([1.0, 2.0, 4.0, 7.0])
    low, high = student.interval(0.95, 3, samples.mean(), samples.std(ddof=1) / 2.0)
    assert_allclose(interval(samples), (3.5, low, high))


def test_fist_locks_the_middle_of_redundant_arms_only() -> None:
    table = redundancy().set_index("arm")
    redundant = table["free_tip"] >= 3
    assert list(table.index[redundant]) == ["cable-driven", "helix"]
    assert (table.loc[redundant, "fist_percent"] < 1.0).all()
    assert (table.loc[redundant, "palm_percent"] > 10.0).all()
    assert table.loc["pneumatic", "undone_percent"] > 20.0
    assert (table["stiff_stretch"] <= table["unit_stretch"] + 1e-9).all()


def test_guidance_is_out_of_range_on_short_arms_and_with_noise() -> None:
    table = guidance(np.random.default_rng(0), runs=2).set_index(["arm", "away_percent"])
    assert table.loc[("pneumatic", 20.0), "needed_printed_N"] == 0.0
    assert table.loc[("pneumatic", 20.0), "needed_scaled_N"] > 1.0
    assert_allclose(table.loc[("pneumatic", 10.0), "fixed_printed_N"], 10.0 * 0.009, rtol=1e-9)
    assert (table["needed_noisy_N"] < 0.1 * table["needed_scaled_N"].clip(lower=1e-3)).all()
