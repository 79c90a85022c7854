"""The synthetic hand has the statistics that were measured on real ones."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soro_lib.papers.gesture_steering.world.hand import (
    QUIET,
    HandNoise,
    coloured_noise,
    synthetic_recording,
    tracing,
    tracker_clock,
    wandering,
)
from soro_lib.sensing.hand_tracking import FINGERS, NORMAL, PALM, hand_samples, timing_summary


def still(value):
    return lambda time: np.tile(value, (len(time), 1))


def hover(seed=0, duration=30.0, noise=None, gestures=((0.0, "palm"),)):
    rng = np.random.default_rng(seed)
    return synthetic_recording(rng, duration, still([0.0, 0.2, 0.0]), still([0.0, 0.0, 0.0]), gestures, noise)


def test_same_seed_same_recording():
    assert hover(3).equals(hover(3))
    assert not hover(3).equals(hover(4))


def test_clock_has_its_periodic_hole():
    interval = np.diff(tracker_clock(np.random.default_rng(0), 30.0, QUIET))
    holes = np.flatnonzero(interval > 2.5 * QUIET.period)
    assert set(np.diff(holes)) == {127}
    assert timing_summary(hover(noise=QUIET))["mean_rate_hz"] == pytest.approx(113.5, abs=0.5)


def test_tremor_is_coloured_and_has_its_size():
    time = np.arange(0, 120, 1 / 115)
    noise = coloured_noise(np.random.default_rng(1), time, 0.24)
    power = np.abs(np.fft.rfft(noise * np.hanning(len(noise)))) ** 2
    frequency = np.fft.rfftfreq(len(noise), 1 / 115)
    band = (frequency > 1) & (frequency < 15)
    slope = np.polyfit(np.log(frequency[band]), np.log(power[band]), 1)[0]
    assert slope == pytest.approx(-3.75, abs=0.5)
    windows = noise[: len(noise) // 115 * 115].reshape(-1, 115)
    trend = np.polynomial.polynomial.polyvander(np.linspace(-1, 1, 115), 2)
    residual = windows.T - trend @ np.linalg.lstsq(trend, windows.T, rcond=None)[0]
    assert np.median(residual.std(axis=0)) == pytest.approx(0.24, rel=0.1)


def test_hover_is_as_restless_as_a_real_hand():
    palm = hover(2, 60.0)[list(PALM)].to_numpy()
    windows = palm[: len(palm) // 115 * 115].reshape(-1, 115, 3)
    assert (np.median(windows.std(axis=1), axis=0) > 0.3).all()
    assert (np.median(windows.std(axis=1), axis=0) < 1.2).all()


def test_fingers_switch_one_after_another():
    table = hover(5, 4.0, QUIET, [(0.0, "palm"), (2.0, "fist")])
    vectors = table[list(FINGERS)].astype(int).astype(str).agg("".join, axis=1)
    assert vectors.iloc[0] == "11111"
    assert vectors.iloc[-1] == "00000"
    assert vectors.nunique() >= 5


def test_losses_bring_new_identities():
    table = hover(6, 60.0, HandNoise(losses=0.2))
    assert table["hand_id"].isna().sum() > 0
    assert table["hand_id"].dropna().is_monotonic_increasing
    assert table["hand_id"].nunique() > 3
    assert table.loc[table["hand_id"].isna(), list(PALM)].isna().all(axis=None)


def test_quiet_hand_follows_its_path():
    path, duration = tracing(np.array([[0.0, 0.2, 0.0], [0.1, 0.2, 0.0], [0.1, 0.2, 0.1]]), 0.2)
    assert duration == pytest.approx(1.0)
    table = synthetic_recording(np.random.default_rng(0), duration, path, still([0.0, 0.0, 0.0]), noise=QUIET)
    time = np.array([sample.time for sample in hand_samples(table)]) - 1.0
    np.testing.assert_allclose(table[list(PALM)].to_numpy() * 1e-3, path(time), atol=2e-6)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 1000))
def test_wandering_stays_in_its_box(seed):
    path = wandering(np.random.default_rng(seed), 20.0, [-1.0, 2.0], [1.0, 3.0])
    points = path(np.linspace(0, 20, 500))
    assert (points >= [-1.0 - 1e-9, 2.0 - 1e-9]).all()
    assert (points <= [1.0 + 1e-9, 3.0 + 1e-9]).all()


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 1000))
def test_normals_are_unit_vectors(seed):
    table = hover(seed, 3.0, HandNoise(flips=1.0))
    np.testing.assert_allclose(np.linalg.norm(table[list(NORMAL)], axis=1), 1.0, atol=1e-5)


@pytest.mark.parametrize("gestures", [[(0.0, "wave")], [(1.0, "palm")], [], [(0.0, "palm"), (0.0, "fist")]])
def test_bad_scripts_are_refused(gestures):
    with pytest.raises(ValueError, match=r"gesture"):
        hover(0, 1.0, None, gestures)


@pytest.mark.parametrize("field", [{"drift": -1.0}, {"period": 0.0}, {"tremor": (0.0, float("nan"), 0.0)}])
def test_bad_noise_is_refused(field):
    with pytest.raises(ValueError, match=rf"HandNoise\.{next(iter(field))}"):
        HandNoise(**field)
