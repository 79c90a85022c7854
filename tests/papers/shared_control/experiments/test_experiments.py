"""Factorial, claims, sweeps, stability and findings."""

from itertools import product

import numpy as np
import pandas as pd
import pytest

from soro_lib.papers.shared_control.experiments import (
    claims,
    demonstrations,
    factorial,
    sensitivity,
    stability,
    sweeps,
)
from soro_lib.papers.shared_control.experiments.simulation import simulate
from soro_lib.papers.shared_control.findings import PRINTED_F, findings, printed_p_values
from soro_lib.papers.shared_control.world import EXPERT, NAIVE
from soro_lib.papers.shared_control.world.hand import pull_axis
from soro_lib.papers.shared_control.world.plant import simulated_tip
from soro_lib.replication.equations import index_problems
from soro_lib.replication.scorecard import build_scorecard

OPERATORS = demonstrations.draw_operators("naive", 2, 1)


@pytest.fixture(scope="module")
def tuning():
    return factorial.run_factorial(OPERATORS, 1)


@pytest.fixture(scope="module")
def crowd():
    return demonstrations.run_demonstrations(3, 1, trials=2)


def made_up(effect):
    """192 trials whose time has a known effect of f_max and noise by repetition and trial."""
    rng = np.random.default_rng(1)
    rows = []
    for levels in product((0, 1), repeat=6):
        for repetition in range(3):
            time = 40 + effect * levels[0] + 3 * repetition + rng.normal()
            labels = dict(zip(factorial.FACTORS, levels))
            rows.append({**labels, "operator": 0, "repetition": repetition, "time_s": time})
    return pd.DataFrame(rows)


def test_repeated_measures_find_a_known_effect_with_two_error_degrees_of_freedom():
    trials = made_up(-5.0)
    table = factorial.repeated_measures_anova(trials, "time_s").set_index("effect")
    assert len(table) == 63
    assert set(table["df"]) == {1}
    assert set(table["df_error"]) == {2}
    assert table.loc["f_max", "p"] < 0.01
    assert table["p"].idxmin() == "f_max"
    assert table.loc["f_max", "p"] == pytest.approx(factorial.printed_p_value(table.loc["f_max", "f"]))


def test_a_contrast_squared_over_its_error_is_the_f_of_statsmodels(tuning):
    first = tuning[tuning["operator"] == 0]
    table = factorial.repeated_measures_anova(first, "path_m").set_index("effect")
    contrast = next(contrast for contrast in factorial.CONTRASTS if contrast.name == "xi_s_path")
    ours = factorial.blocked_f(factorial.contrast_samples(first, contrast))[0]
    assert ours == pytest.approx(table.loc["xi_s", "f"], rel=1e-6)
    interaction = factorial.blocked_f(factorial.interaction_samples(first, "path_m", "xi_c", "xi_s"))[0]
    assert interaction == pytest.approx(table.loc["xi_s:xi_c", "f"], rel=1e-6)


def test_printed_p_need_two_error_degrees_of_freedom(tuning):
    """All eight printed p follow from F(1, 2); with the 170 of a plain analysis none does."""
    values = {name: finding.value for name, finding in printed_p_values().items()}
    assert values["p_fmax_path"] == pytest.approx(0.014, abs=5e-4)
    assert values["p_interaction"] == pytest.approx(0.022, abs=5e-4)
    assert all(factorial.printed_p_value(f, 1, 170) < 1e-5 for f in PRINTED_F.values())
    plain = factorial.plain_anova(tuning[tuning["operator"] == 0], "time_s")
    assert set(plain["df_error"]) == {170}
    assert len(plain) == 21


def test_printed_assistance_effect_is_impossible(tuning):
    """H is a mean of forces up to 7 N: no effect of 9.2 N; and a scatter of at most half the range."""
    assert tuning["assistance_n"].between(0, 7).all()
    assert tuning["peak_force_n"].max() <= 7 + 1e-9
    assert 9.237 > 7
    assert factorial.implied_trial_deviation(9.237, PRINTED_F["kmax_assistance"]) > 7 / 2


def test_tuning_study_has_every_setting_once_and_does_not_depend_on_jobs(tuning):
    assert len(tuning) == 2 * 192
    counts = tuning.groupby([*factorial.FACTORS, "operator", "repetition"]).size()
    assert (counts == 1).all()
    again = factorial.run_factorial(OPERATORS, 1, jobs=2)
    pd.testing.assert_frame_equal(tuning, again)


def test_a_missing_setting_is_noticed(tuning):
    first = tuning[tuning["operator"] == 0]
    for analysis in (factorial.repeated_measures_anova, factorial.plain_anova):
        with pytest.raises(ValueError, match=r"192 trials of one operator\), got 191"):
            analysis(first.iloc[1:], "time_s")


def test_readings_of_delta():
    assert factorial.stiffness_rate(2.0, 50.0, "seconds") == 25.0
    assert factorial.stiffness_rate(2.0, 50.0, "per_second") == 2.0
    assert factorial.stiffness_rate(2.0, 50.0, "per_sample") == 200.0
    with pytest.raises(ValueError, match="reading must be one of"):
        factorial.stiffness_rate(2.0, 50.0, "per_minute")


def test_false_positives_expected_without_correction():
    assert factorial.expected_false_positives() == pytest.approx(4.2)


# --- Claims --------------------------------------------------------------------------------------


def invented(times, errors, force=0.05):
    """Two operators of each kind in each environment with given mean times and errors by paradigm."""
    rows = [
        {
            **{"environment": environment, "kind": kind, "operator": operator, "paradigm": name},
            **{"time_s": time, "release_error_mm": error, "finished": 1.0, "path_m": 3.0},
            "assistance_n": force if name == "assist_as_needed" else 1.0,
        }
        for environment in ("simulated", "real")
        for kind in ("expert", "naive")
        for operator in range(2)
        for name, time, error in zip(claims_order(), times, errors)
    ]
    return pd.DataFrame(rows)


def claims_order():
    return [claims.FULL, claims.AAN, claims.FIXED, claims.MSAE, claims.ASME, claims.AUTO]


def test_claims_hold_where_they_are_built_to_hold_and_fail_where_not():
    good = claims.evaluate_claims(invented((60, 59, 51, 50, 40, 30), (20, 19, 16, 15, 10, 5)))
    held = good.groupby("claim")["holds"].mean()
    expected = {"aan_shorter_fixed", "aan_more_accurate_fixed", *claims.PAIR_CLAIMS, claims.ACROSS_CLAIM}
    assert set(held[held < 1].index) == expected
    bad = claims.evaluate_claims(invented((30, 60, 10, 50, 60, 70), (1, 5, 100, 9, 10, 15), force=2.0))
    failed = bad.groupby("claim")["holds"].mean()
    assert set(failed[failed > 0].index) == {
        "auto_error_not_zero",
        "stable",
        "fixed_less_accurate_msae",
        "aan_more_accurate_fixed",
    }


def test_every_claim_of_the_demonstrations_is_published_and_judged(crowd, tuning):
    scorecard = build_scorecard("shared_control", findings(crowd, tuning))
    missing = scorecard[(scorecard["verdict"] == "not attempted") & (scorecard["kind"] != "hardware")]
    assert missing.empty
    assert set(scorecard["verdict"]) <= {"reproduced", "close", "differs", "not attempted"}


def test_index_and_errata_are_complete():
    assert index_problems("shared_control") == []


def test_probabilities_lie_between_zero_and_one(crowd):
    probabilities = claims.claim_probabilities(claims.evaluate_claims(crowd))
    assert probabilities["probability"].between(0, 1).all()
    assert probabilities["id"].is_unique


def test_summary_brackets_its_mean(crowd):
    table = demonstrations.summary(crowd, resamples=200)
    assert ((table["low"] <= table["mean"] + 1e-9) & (table["mean"] <= table["high"] + 1e-9)).all()
    assert len(table) == 2 * 2 * 6 * 4


def test_effects_are_paired_differences(crowd):
    table = demonstrations.effects(crowd, resamples=200)
    assert len(table) == 2 * 2 * 5 * 4
    people = crowd.pivot_table(index=["environment", "kind", "operator"], columns="paradigm", values="time_s")
    expected = (people["msae"] - people["full_teleoperation"]).loc["real", "naive"].mean()
    row = table.query(
        "environment == 'real' and kind == 'naive' and paradigm == 'msae' and metric == 'time_s'"
    )
    assert row["mean"].item() == pytest.approx(expected)
    assert row["low"].item() <= expected <= row["high"].item()


def test_conditions_share_the_paradigms_without_a_force():
    trials = demonstrations.run_conditions(1, 1, trials=1)
    assert len(trials) == 3 * 2 * 2 * 24
    free = trials[trials["paradigm"] == "msae"].pivot_table(
        index=["approach", "environment", "kind"], columns=["attitude", "law"], values="time_s"
    )
    assert (free.nunique(axis=1) == 1).all()
    table = claims.condition_probabilities(trials)
    assert set(table["attitude"]) == {"ignore", "use", "yield"}


def test_unknown_kind_is_refused():
    with pytest.raises(ValueError, match="kind must be one of"):
        demonstrations.draw_operators("gifted", 1, 1)


# --- Stability -----------------------------------------------------------------------------------


def swings(stiffness, hand_stiffness, delay):
    """Whether a hand pushed by guidance of this stiffness ends swinging more widely than it began."""
    operator = EXPERT.__class__(hand_stiffness=hand_stiffness)
    position, velocity, tip = 0.001, 0.0, (0.0, 0.0, 0.0)
    waiting, path = [0.0] * (round(delay / 0.01) + 1), []
    for _ in range(3000):
        waiting.append(tip[2])
        force = -stiffness * waiting.pop(0)
        position, velocity, _ = pull_axis(operator, position, velocity, 0.0, force)
        tip = simulated_tip(tip, (0.0, 0.0, 15.0 * position), 0.99)
        path.append(position)
    return np.abs(path[-500:]).max() > np.abs(path[500:1000]).max()


@pytest.mark.parametrize(
    ("hand_stiffness", "delay"), [(50.0, 0.0), (150.0, 0.0), (150.0, 0.15), (300.0, 0.3)]
)
def test_critical_stiffness_divides_calm_from_swinging(hand_stiffness, delay):
    critical = stability.critical_stiffness(hand_stiffness, delay)
    assert not swings(0.85 * critical, hand_stiffness, delay)
    assert swings(1.15 * critical, hand_stiffness, delay)


def test_critical_stiffness_without_delay_is_that_of_routh():
    mass, damping, hand, lag, scale = 0.6, 6.5, 150.0, 0.99, 15.0
    routh = ((mass + damping * lag) * (damping + hand * lag) / (lag * mass) - hand) / scale
    assert stability.critical_stiffness(hand) == pytest.approx(routh, rel=1e-9)


@pytest.mark.parametrize("delay", [0.0, 0.15])
def test_passive_stiffness_is_where_the_least_real_part_is_covered(delay):
    frequency = np.logspace(-4, 3, 4000)
    s = 1j * frequency
    stiffness = stability.passive_stiffness(delay)
    impedance = stiffness * 15.0 * np.exp(-s * delay) / (s * (0.99 * s + 1)) + 6.5
    assert impedance.real.min() == pytest.approx(0.0, abs=1e-3)
    assert np.all(impedance.real > -1e-6)


def test_stability_map_covers_its_grid_and_refuses_nonsense():
    table = stability.stability_map([50, 500], [0.0, 0.1, 0.2])
    assert len(table) == 12
    assert (table.groupby(["axis", "delay_s"])["critical_stiffness_n_per_m"].diff().dropna() > 0).all()
    with pytest.raises(ValueError, match="hand_stiffness"):
        stability.critical_stiffness(0.0)
    with pytest.raises(ValueError, match="delay"):
        stability.critical_stiffness(100.0, -0.1)


# --- Sweeps --------------------------------------------------------------------------------------


def test_blend_has_the_paradigms_in_its_corners():
    blend = sweeps.blend_surface(1, 3, (0.0, 1.0), ("expert",))
    people = demonstrations.draw_operators("expert", 1, 3)
    cases = {
        (0.0, 0.0): "full_teleoperation",
        (0.0, 1.0): "msae",
        (1.0, 0.0): "asme",
        (1.0, 1.0): "mostly_autonomous",
    }
    for (steering, eversion), name in cases.items():
        settings = sweeps.TaskSettings(sweeps.PARADIGMS[name])
        alone = simulate(sweeps.person_plans(settings, people, 3, 1, {}))
        cell = blend[(blend["steering"] == steering) & (blend["eversion"] == eversion)]
        assert cell["time_s"].item() == alone["time_s"].item()


def test_a_wrong_goal_costs_only_where_the_machine_steers():
    table = sweeps.misdetection_cost(2, 1, (0.0, 0.03))
    cost = table.pivot_table(index=["kind", "operator", "paradigm"], columns="offset_mm", values="time_s")
    change = (cost[30.0] - cost[0.0]).unstack()
    assert (change[["full_teleoperation", "msae"]] == 0).all(axis=None)
    assert (change["mostly_autonomous"] > 1).all()


def test_noise_dwell_and_lifts():
    noise = sweeps.tracking_noise_effect(3, 1, (0.0, 0.0005)).groupby("noise_mm")["assistance_n"].mean()
    assert noise[0.5] < 0.1 * noise[0.0]
    dwell = sweeps.dwell_effect(1, 1, (0.4, 1.5)).groupby("dwell_s")["time_s"].mean()
    assert dwell[1.5] > dwell[0.4]
    lifts = sweeps.lift_effect(2, 1).groupby("case")["time_s"].mean()
    assert lifts["without lifts"] < lifts["Mostly autonomous"] - 2


def test_passive_operators_are_slow():
    table = sweeps.passivity_effect(1, (0.0, 0.8), 1 + 1)
    assert table.groupby("passivity")["mean_time_s"].first().diff().iloc[-1] > 30
    assert (table["low"] <= table["high"]).all()


def test_hypercube_fills_its_ranges():
    people = sensitivity.draw_anyone(64, 1)
    for name, (low, high) in sensitivity.RANGES.items():
        values = np.sort([getattr(person, name) for person in people])
        assert low <= values[0] < low + (high - low) / 64
        assert high - (high - low) / 64 < values[-1] <= high
    correlations, held = sensitivity.sensitivity(8, 1, trials=1)
    assert correlations.shape == (len(sensitivity.RANGES), 10)
    assert held["probability"].between(0, 1).all()


def test_typical_naive_operator_is_slower_than_the_typical_expert():
    times = {
        kind: factorial.run_factorial([operator], 1, repetitions=1)["time_s"].mean()
        for kind, operator in (("expert", EXPERT), ("naive", NAIVE))
    }
    assert times["naive"] > 1.5 * times["expert"]
