"""Verdicts follow the rules that stand in the design, whatever the numbers."""

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soro_lib.replication import policy
from soro_lib.replication.findings import STATISTICS, Finding
from soro_lib.replication.scorecard import (
    COLUMNS,
    build_scorecard,
    confidence_interval,
    stale_verdicts,
    verdict,
)

finite = st.floats(-1e6, 1e6)


@pytest.mark.parametrize(
    ("role", "ours", "expected"),
    [
        ("prediction", 10.0, "reproduced"),
        ("prediction", 11.0, "reproduced"),
        ("prediction", 9.0, "reproduced"),
        ("prediction", 11.001, "close"),
        ("prediction", 12.0, "close"),
        ("prediction", 8.0, "close"),
        ("prediction", 12.001, "differs"),
        ("prediction", -10.0, "differs"),
        ("prediction", None, "not attempted"),
        ("calibration", 10.0, "calibrated"),
        ("calibration", 11.0, "calibrated"),
        ("calibration", 12.0, "calibrated"),
        ("calibration", 12.001, "differs"),
        ("calibration", None, "not attempted"),
    ],
)
def test_verdict_of_ten_with_tolerance_one(role, ours, expected):
    assert verdict(role, 10.0, ours, 1.0) == expected


def test_edge_of_the_tolerance_survives_binary_fractions():
    assert abs(1.30 - 1.25) > 0.05
    assert verdict("prediction", 1.25, 1.30, 0.05) == "reproduced"
    assert verdict("prediction", 0.1, 0.1 + 0.2 - 0.2, 0.0) == "reproduced"


def test_zero_tolerance_asks_for_the_number_itself():
    assert verdict("prediction", 8.0, 8.0, 0.0) == "reproduced"
    assert verdict("prediction", 8.0, 9.0, 0.0) == "differs"


@given(finite, finite, st.floats(0, 1e6))
def test_what_was_fitted_never_counts_as_reproduced(ours, published, tolerance):
    assert verdict("calibration", published, ours, tolerance) in ("calibrated", "differs")


@given(finite, finite, st.floats(0, 1e6), st.floats(1, 10))
def test_verdict_only_worsens_with_distance(ours, published, tolerance, factor):
    near = verdict("prediction", published, ours, tolerance)
    far = verdict("prediction", published, published + factor * (ours - published), tolerance)
    order = ("reproduced", "close", "differs")
    assert order.index(far) >= order.index(near)


@given(
    st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=12), st.sampled_from(["mean", "median", "max", "rms"])
)
def test_interval_is_deterministic_ordered_and_inside_the_samples(samples, statistic):
    finding = Finding(samples, statistic=statistic)
    low, high = confidence_interval(finding)
    assert (low, high) == confidence_interval(Finding(samples, statistic=statistic))
    reach = np.abs(samples) if statistic == "rms" else np.asarray(samples)
    assert reach.min() - 1e-6 <= low <= high <= reach.max() + 1e-6


def test_interval_of_the_mean_covers_as_often_as_it_says():
    rng = np.random.default_rng(4)
    trials = [confidence_interval(Finding(rng.normal(3.0, 1.0, 40))) for _ in range(150)]
    covered = np.mean([low <= 3.0 <= high for low, high in trials])
    assert 0.88 <= covered <= 0.99


def test_one_sample_has_no_interval_and_equal_samples_have_none_to_speak_of():
    assert np.isnan(confidence_interval(Finding(1.0))).all()
    assert confidence_interval(Finding([2.0, 2.0, 2.0])) == (2.0, 2.0)


@pytest.mark.parametrize("statistic", STATISTICS)
def test_statistics_agree_with_their_definition_along_an_axis(statistic):
    samples = np.random.default_rng(1).normal(size=(3, 20))
    along = STATISTICS[statistic](samples, axis=-1)
    assert along == pytest.approx([Finding(row, statistic=statistic).value for row in samples])
    pandas_name = {"p05": 0.05, "p25": 0.25, "p75": 0.75, "p95": 0.95}
    series = pd.Series(samples[0])
    expected = (
        math.sqrt((series**2).mean())
        if statistic == "rms"
        else series.quantile(pandas_name[statistic])
        if statistic in pandas_name
        else getattr(series, statistic)()
    )
    assert Finding(samples[0], statistic=statistic).value == pytest.approx(expected)


def test_finding_refuses_what_it_cannot_judge():
    with pytest.raises(ValueError, match="at least one seed"):
        Finding([])
    with pytest.raises(ValueError, match=r"shape \(2, 2\)"):
        Finding(np.ones((2, 2)))
    with pytest.raises(ValueError, match="'mode' is not one of mean, median"):
        Finding(1.0, statistic="mode")


def test_scorecard_sets_ours_beside_published(write_paper):
    write_paper()
    findings = {
        "error": Finding([1.26, 1.30, 1.28]),
        "stiffness": Finding(41.0, "fitted to the table"),
        "faster": Finding([1, 1, 0, 0, 0], "the gap is smaller than the spread"),
    }
    card = build_scorecard("paper", findings)
    assert list(card.columns) == COLUMNS
    assert list(card["verdict"]) == ["reproduced", "calibrated", "differs", "not attempted"]
    assert card["ours"][0] == 1.28
    assert card["seeds"].tolist()[:3] == [3, 1, 5]
    assert card["tolerance"][1] == pytest.approx(4.0)
    assert card["reason"][3] == "needs the force sensor"
    assert np.isnan(card["ours"][3])
    pd.testing.assert_frame_equal(card, build_scorecard("paper", findings))


@pytest.mark.parametrize(
    ("findings", "said"),
    [
        ({"eror": Finding(1.0)}, r"'eror' has no row in data/paper/published.csv \(did you mean 'error'"),
        ({"error": Finding([1.0, math.nan])}, "finding 'error'.*must be finite"),
        ({"error": Finding(math.inf)}, "finding 'error'.*must be finite"),
        ({"error": Finding(1.0, statistic="std")}, "finding 'error'.*must be finite"),
        ({"force": Finding(1.0)}, "finding 'force'.*kind hardware"),
        ({"faster": Finding(1.5)}, "finding 'faster': 1.5 is no probability"),
    ],
)
@pytest.mark.filterwarnings("ignore:Degrees of freedom", "ignore:invalid value encountered")
def test_bad_finding_is_named(write_paper, findings, said):
    write_paper()
    with pytest.raises(ValueError, match=said):
        build_scorecard("paper", findings)


def test_stale_scorecard_is_noticed(write_paper):
    write_paper()
    card = build_scorecard("paper", {"error": Finding(2.0, "physics"), "stiffness": Finding(41.0)})
    assert stale_verdicts("paper", card) == ["row 'faster' not attempted without a reason"]
    card.loc[0, "verdict"] = "reproduced"
    card.loc[3, "id"] = "fource"
    problems = "\n".join(stale_verdicts("paper", card))
    assert "row 'error' says 'reproduced', the rules say 'differs'" in problems
    assert "row 'fource' is not in published.csv" in problems
    assert "row 'force' of published.csv is missing" in problems


def test_policy_of_the_same_number():
    assert policy.same_number(1.0, 1.00005)
    assert not policy.same_number(1.0, 1.001)
    assert policy.same_number(0.0, 1e-12)
    assert policy.same_number(math.nan, math.nan)
    assert not policy.same_number(math.nan, 1.0)
