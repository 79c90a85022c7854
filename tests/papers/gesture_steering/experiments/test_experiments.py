"""The experiments: what they must show, that they repeat themselves, and the errata of tables and claims."""

import numpy as np
import pytest

from soro_lib.papers.gesture_steering import beyond
from soro_lib.papers.gesture_steering import findings as results
from soro_lib.papers.gesture_steering.calibration import POINTS, printed_positions, table2_poses
from soro_lib.papers.gesture_steering.experiments import avoidance, hands, prototype, steering, tables
from soro_lib.papers.gesture_steering.world.hand import QUIET
from soro_lib.project import data_directory
from soro_lib.replication.datacards import DataCardError
from soro_lib.replication.equations import index_problems
from soro_lib.replication.scorecard import build_scorecard
from soro_lib.robots import CableDrivenArm


def rng(seed=0):
    return np.random.default_rng(seed)


# --- tables -------------------------------------------------------------------------------------------------


def test_upper_ends_of_table1():
    """Erratum GS-21: a length of 45 mm explains the upper K_T to four digits, but not the upper K_a."""
    table = tables.table1().set_index("quantity")
    assert table.loc["K_T", "unloaded"] == pytest.approx(5.0211, abs=5e-5)
    assert table.loc["K_T", "compressed"] == pytest.approx(5.5790, abs=5e-5)
    assert table.loc["K_a", "unloaded"] == pytest.approx(0.8550, abs=5e-5)
    assert abs(table.loc["K_a", "compressed"] - 0.9907) > 0.03
    strain, poisson = 0.110, 0.45
    thickened = table.loc["K_a", "unloaded"] * (1 + poisson * strain) ** 2 / (1 - poisson * strain)
    assert thickened == pytest.approx(0.9907, abs=1e-3)


def test_chord_of_configuration_1_is_longer_than_its_segment():
    """Erratum GS-22: no actuation of a compressible segment of 50 mm spans 51.6 mm."""
    chords = tables.segment_chords().set_index(["configuration", "segment"])["sim_chord_mm"]
    assert chords[1, "distal"] == pytest.approx(51.63, abs=0.01)
    arm = CableDrivenArm()
    actuations = rng().uniform(arm.lower, arm.upper, size=(2000, 7))
    spans = np.linalg.norm(arm.tip(actuations) - arm.mid_point(actuations), axis=1)
    assert spans.max() <= arm.segment_length
    residuals = [pose.mid_residual + pose.tip_residual for pose in table2_poses(arm)]
    assert residuals[1] > 2 * max(residuals[0], residuals[2], residuals[3])


def test_rigid_caps_explain_configurations_2_and_3_but_not_1():
    fits = tables.cap_study((0.0, 3e-3)).set_index(["coupling_sign", "cap_mm", "configuration"])
    assert (fits.loc[(-1, 3.0)].loc[[2, 3], "tip_residual_mm"] < 0.2).all()
    assert (fits.loc[(-1, 0.0)].loc[[2, 3], "tip_residual_mm"] > 1.0).all()
    assert fits.loc[(-1, 3.0, 1), "tip_residual_mm"] > 1.5


def test_one_sign_of_table2_is_wrong():
    """Erratum GS-23: -4.397 + 5 is positive."""
    table = tables.table2_errors().set_index(["configuration", "point"])
    assert table.loc[(2, "tip"), "error_y_mm"] == pytest.approx(0.603)
    assert table.loc[(2, "tip"), "norm_mm"] == pytest.approx(1.080, abs=1e-3)


def test_experiment_error_is_the_norm():
    """Lai et al., Eq. (28)."""
    assert prototype.experiment_error([1.0, 2.0, 3.0], [1.0, 5.0, 7.0]) == pytest.approx(5.0)
    assert prototype.experiment_error(printed_positions("sim"), printed_positions("exp")).shape == (4, 3)


# --- steering -----------------------------------------------------------------------------------------------


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


def test_fist_leaves_the_direction_free():
    """Erratum GS-19: (27) has no direction term, and the direction is off; a weight on it helps."""
    table = beyond.fist_direction(np.random.SeedSequence(1), (0.0, 20.0)).set_index("weight")
    assert table.loc[0.0, "direction_error_deg"] > 10.0
    assert table.loc[20.0, "direction_error_deg"] < 0.6 * table.loc[0.0, "direction_error_deg"]
    assert table.loc[20.0, "position_error_mm"] > table.loc[0.0, "position_error_mm"]


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
    table = hands.load_recording("hover")
    full, slow = (steering.steered(table.head(400), interval=interval) for interval in (0.0, 0.09))
    assert len(full) == 400
    assert 30 < len(slow) < 42


# --- prototype ----------------------------------------------------------------------------------------------


def test_prototype_sessions_repeat_themselves():
    first, second = (prototype.table2_sessions(rng(4), 20) for _ in range(2))
    assert first.equals(second)


def test_errors_of_the_prototype_are_of_the_papers_size_without_any_fit():
    sessions = prototype.table2_sessions(rng(1), 200)
    placed = prototype.printed_percentiles(sessions).set_index(["configuration", "point"])
    assert (placed.loc[(slice(None), ["base", "mid"]), "percentile"].between(2.5, 97.5)).all()
    assert 0.0 <= prototype.within_claim(sessions).mean() < 0.5


def test_frame_at_the_straight_tip_explains_the_order_of_table2():
    plain = prototype.table2_sessions(rng(1), 200)
    registered = prototype.table2_sessions(rng(1), 200, registered_at_tip=True)
    norms = [t[t["configuration"] == 0].groupby("point")["norm_mm"].median() for t in (plain, registered)]
    assert norms[0]["tip"] > norms[0]["base"]
    assert norms[1]["tip"] < norms[1]["mid"] < norms[1]["base"]


def test_hover_is_longer_than_it_settles():
    commands = prototype.fig10_commands()
    assert set(commands) == {"a", "b", "c", "d"}
    assert commands["a"]["time_s"].max() == pytest.approx(hands.HOVER, abs=0.1)
    measured = prototype.fig10({"a": commands["a"]}, rng(1), sessions=4, every=20)
    assert prototype.steady_state(measured)["position_error_mm"].between(0.2, 10.0).all()


# --- obstacle -----------------------------------------------------------------------------------------------


def test_cost_of_eq29_does_not_guarantee_clearance():
    """Erratum GS-20: with eta = 10 the arm still collides; the inequality keeps it clear."""
    runs = {policy: avoidance.crossed(rng(1), "y 8, z 112", policy) for policy in avoidance.POLICIES}
    clearance = {policy: table["clearance_mm"].min() for policy, table in runs.items()}
    deviation = {
        policy: table[["deviation_x_mm", "deviation_y_mm", "deviation_z_mm"]].abs().max(axis=None)
        for policy, table in runs.items()
    }
    assert clearance["off"] < clearance["eta = 10"] < 0.0
    assert clearance["hard, 1 mm"] > 0.5
    assert deviation["hard, 1 mm"] < deviation["eta = 100"]


# --- beyond -------------------------------------------------------------------------------------------------


def test_reach_map_finds_what_it_must():
    table = beyond.reach_map(
        np.array([0.12]), np.array([0.0, 0.03, 0.2]), np.deg2rad([0.0, 10.0]), azimuths=4
    )
    assert table["tilt_deg"].tolist()[:2] == pytest.approx([10.0, 10.0])
    assert np.isnan(table["tilt_deg"].iloc[2])


def test_delay_grows_with_the_period_of_the_loop():
    table = beyond.delay_against_rate(np.random.SeedSequence(1), (115.0, 11.0)).set_index("loop")
    assert table.loc["115 Hz", "position_ms"] < 15.0
    assert table.loc["115 Hz", "position_ms"] < table.loc["11 Hz", "position_ms"] < 90.0
    assert table.loc["servo bus", "position_ms"] > 110.0


# --- recordings and reporting -------------------------------------------------------------------------------


def test_shipped_recordings_are_what_their_generator_makes(tmp_path):
    hands.write_recordings(tmp_path)
    shipped = data_directory("gesture_steering") / "recordings"
    for made in sorted(tmp_path.iterdir()):
        if made.suffix == ".gz":  # compressed bytes may differ between zlib versions, the table may not
            assert hands.load_hand_recording(made).equals(hands.load_hand_recording(shipped / made.name))
        else:
            assert made.read_text().split("sha256")[0] == (shipped / made.name).read_text().split("sha256")[0]


def test_timeline_knows_the_gestures():
    timeline = hands.timeline(hands.load_recording("hover"))
    assert timeline["mode"].unique().tolist() == ["palm", "v_sign"]
    assert (timeline.loc[timeline["mode"] == "v_sign", "goal_x_mm"] == 0.0).all()


def test_filters_are_compared_against_a_smoother():
    table = hands.filter_comparison({"a4_palm": hands.load_recording("a4_palm")}).set_index("filter")
    assert table.loc["R = 0.7 for all", "error_mm"] > 5 * table.loc["fixed noise", "error_mm"]
    assert abs(table.loc["fixed noise", "lag_ms"]) <= 3.0
    assert table.loc["fixed noise", "roughness"] < 1.0


def test_every_equation_has_function_and_test():
    assert index_problems("gesture_steering") == []


def test_arithmetic_of_the_scorecard():
    found = results.parameter_findings() | results.table1_findings() | results.table2_findings()
    card = build_scorecard("gesture_steering", found).set_index("id")
    arithmetic = card[card["kind"].isin(["arithmetic", "definition"]) & (card["verdict"] != "not attempted")]
    differs = set(arithmetic.index[arithmetic["verdict"] == "differs"])
    assert differs == {"table1_axial_stiffness_high", "s3d_gesture_combinations", "table2_c2_tip_error_y"}
    assert (card.loc[[f"table2_c1_{point}_sim_z" for point in POINTS], "verdict"] != "reproduced").all()


def test_a_missing_shipped_recording_is_named_with_its_place(monkeypatch, tmp_path):
    folder = tmp_path / "gesture_steering" / "recordings"
    folder.mkdir(parents=True)
    card = "steering_minute.csv.gz.card.toml"
    (folder / card).write_bytes((data_directory("gesture_steering") / "recordings" / card).read_bytes())
    monkeypatch.setattr(hands, "data_directory", lambda slug: tmp_path / slug)
    with pytest.raises(DataCardError, match=r"recordings/steering_minute\.csv\.gz: no such"):
        hands.load_recording("steering_minute")
