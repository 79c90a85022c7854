"""People, crowds and conditions; means with bootstrap intervals."""

import tracemalloc
import warnings

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soro_lib.papers.shared_control.experiments import claims, demonstrations
from soro_lib.papers.shared_control.experiments.demonstrations import resampled_means, run_demonstrations


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


def test_the_first_people_are_the_same_however_many_there_are():
    few, many = run_demonstrations(1, 2, trials=1), run_demonstrations(2, 2, trials=1)
    same = many[many["operator"] == 0].reset_index(drop=True)
    pd.testing.assert_frame_equal(few, same)


def whole_means(values, resamples, rng):
    """The resampling in one piece, as anyone would write it."""
    picks = rng.integers(len(values), size=(resamples, len(values)))
    return np.nanmean(values[picks], axis=1)


@given(st.integers(2, 30), st.integers(1, 40), st.integers(1, 500), st.integers(0, 2**32 - 1))
def test_resampling_in_pieces_gives_the_same_bits(people, resamples, largest, seed):
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(people, 4))
    values[rng.random(values.shape) < 0.05] = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a sample may be of people without an error only
        pieces = resampled_means(values, resamples, np.random.default_rng(seed), largest)
        whole = whole_means(values, resamples, np.random.default_rng(seed))
    np.testing.assert_array_equal(pieces, whole)


def test_resampling_many_people_takes_little_memory():
    values = np.random.default_rng(1).normal(size=(3200, 4))
    tracemalloc.start()
    try:
        resampled_means(values, 200, np.random.default_rng(2))
        _, in_pieces = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        whole_means(values, 200, np.random.default_rng(2))
        _, whole = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert in_pieces < 10e6
    assert whole > 4 * in_pieces
