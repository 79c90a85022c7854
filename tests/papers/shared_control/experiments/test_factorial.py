"""The tuning study and its two analyses."""

from itertools import product

import numpy as np
import pandas as pd
import pytest

from soro_lib.papers.shared_control.experiments import demonstrations, factorial
from soro_lib.papers.shared_control.findings import PRINTED_F, printed_p_values
from soro_lib.papers.shared_control.world.people import EXPERT, NAIVE

OPERATORS = demonstrations.draw_operators("naive", 2, 1)


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


def test_typical_naive_operator_is_slower_than_the_typical_expert():
    times = {
        kind: factorial.run_factorial([operator], 1, repetitions=1)["time_s"].mean()
        for kind, operator in (("expert", EXPERT), ("naive", NAIVE))
    }
    assert times["naive"] > 1.5 * times["expert"]
