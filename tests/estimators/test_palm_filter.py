"""Palm filter against a textbook recursion, spherical interpolation against SciPy, and their errata."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation, Slerp

from soro_lib.estimators import PalmFilter
from soro_lib.estimators.palm_filter import (
    MEASURED,
    PAPER_SETTINGS,
    DirectionFilter,
    PalmFilterSettings,
    ReadablePalmFilter,
    angular_distance,
    direction_quaternion,
    low_pass_share,
    quaternion_direction,
    slerp,
    transition_matrix,
)

unit = st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1)


def normalised(values):
    return np.array(values) / np.linalg.norm(values)


# --- Kalman filter, Eqs. (6)-(12) ---------------------------------------------------------------------------


@given(st.floats(1e-4, 1.0))
def test_transition_is_the_matrix_exponential(interval):
    generator = np.kron(np.eye(3), np.eye(3, k=1))
    np.testing.assert_allclose(transition_matrix(interval), expm(generator * interval), atol=1e-14)


def test_position_and_velocity_are_observed():
    state = np.arange(9.0)
    np.testing.assert_array_equal(MEASURED @ state, [0, 1, 3, 4, 6, 7])


def textbook(times, positions, velocities, settings):
    """Run Eqs. (6)-(12), corrected, with plain matrices; return the filtered positions."""
    state = np.zeros(9)
    state[::3] = positions[0]
    covariance = settings.initial_variance * np.eye(9)
    noise = np.diag([settings.position_sd**2, settings.velocity_sd**2] * 3)
    found = [positions[0]]
    for index in range(1, len(times)):
        interval = times[index] - times[index - 1]
        transition = transition_matrix(interval)
        process = np.kron(np.eye(3), np.diag([0, 0, settings.acceleration_density**2 * interval]))
        state, covariance = transition @ state, transition @ covariance @ transition.T + process
        measured = np.column_stack([positions[index], velocities[index]]).ravel()
        gain = covariance @ MEASURED.T @ np.linalg.inv(MEASURED @ covariance @ MEASURED.T + noise)
        state = state + gain @ (measured - MEASURED @ state)
        covariance = (np.eye(9) - gain @ MEASURED) @ covariance
        found.append(state[::3])
    return np.array(found)


def wave(count=200, seed=0):
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.008, 0.03, count))
    phase = times[:, None] * [1.0, 2.0, 3.0]
    return (
        times,
        0.1 * np.sin(phase) + 3e-4 * rng.standard_normal((count, 3)),
        0.1 * np.cos(phase) * [1, 2, 3],
    )


def test_filter_is_the_textbook_recursion():
    times, positions, velocities = wave()
    palm_filter = PalmFilter()
    ours = [palm_filter.update(*measurement) for measurement in zip(times, positions, velocities)]
    np.testing.assert_allclose(ours, textbook(times, positions, velocities, PalmFilterSettings()), atol=1e-9)


def test_covariance_recursion_starts_from_the_posterior():
    """Erratum GS-9: carried on from the a priori covariance, as printed, it never learns."""
    settings, transition = PalmFilterSettings(), transition_matrix(0.03)
    process = np.kron(np.eye(3), np.diag([0, 0, settings.acceleration_density**2 * 0.03]))
    noise = np.diag([settings.position_sd**2, settings.velocity_sd**2] * 3)
    printed = corrected = settings.initial_variance * np.eye(9)
    for _ in range(500):
        printed = transition @ printed @ transition.T + process
        prior = transition @ corrected @ transition.T + process
        gain = prior @ MEASURED.T @ np.linalg.inv(MEASURED @ prior @ MEASURED.T + noise)
        corrected = (np.eye(9) - gain @ MEASURED) @ prior
    assert printed[0, 0] > 1.0  # a variance of more than a square metre after 15 s
    assert np.sqrt(corrected[0, 0]) < 3 * settings.position_sd

    palm_filter, times = PalmFilter(settings), 0.03 * np.arange(500)
    for time in times:
        palm_filter.update(time, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    np.testing.assert_allclose(np.kron(np.eye(3), palm_filter.covariance), corrected, atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("adaptive", [False, True])
@pytest.mark.parametrize("noise", [PalmFilterSettings(), PAPER_SETTINGS], ids=["ours", "paper"])
def test_filter_of_one_axis_equals_the_readable_one(noise, adaptive, seed):
    """Irregular clock, holes of up to 0.2 s, velocity that comes and goes, a new start half way.

    After a longer hole the gate starts the filter anew; there filterpy's inverse would lose digits.
    """
    rng = np.random.default_rng(seed)
    settings = replace(noise, adaptive=adaptive)
    filters = PalmFilter(settings), ReadablePalmFilter(settings)
    time, known = 0.0, True
    for index in range(400):
        time += rng.uniform(0.05, 0.2) if rng.random() < 0.02 else rng.uniform(0.002, 0.03)
        known = known if rng.random() < 0.97 else not known  # long enough for the window of the adaptation
        rates = np.array([1.0, 2.0, 3.0])
        position = 0.1 * np.sin(time * rates) + 3e-4 * rng.standard_normal(3)
        velocity = 0.1 * rates * np.cos(time * rates) + 0.04 * rng.standard_normal(3) if known else None
        if index == 200:
            for palm_filter in filters:
                palm_filter.reset()
        ours, readable = (palm_filter.update(time, position, velocity) for palm_filter in filters)
        np.testing.assert_allclose(ours, readable, rtol=0, atol=1e-12)
        np.testing.assert_allclose(filters[0].state, filters[1].state, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(*(f.predicted(time + 0.05) for f in filters), rtol=0, atol=1e-11)
        assert filters[0].process_scale == pytest.approx(filters[1].process_scale, rel=1e-9)
    assert (filters[0].process_scale != 1.0) == adaptive


def test_axes_of_the_readable_filter_share_one_covariance():
    times, positions, velocities = wave()
    palm_filter = ReadablePalmFilter()
    for measurement in zip(times, positions, velocities):
        palm_filter.update(*measurement)
    whole = palm_filter.whole_covariance
    np.testing.assert_allclose(whole, np.kron(np.eye(3), whole[:3, :3]), rtol=1e-9, atol=1e-18)


def test_filter_without_velocity_still_follows():
    times, positions, _ = wave()
    palm_filter = PalmFilter()
    ours = np.array([palm_filter.update(time, position) for time, position in zip(times, positions)])
    assert np.abs(ours - positions)[50:].max() < 3e-3


def test_adaptive_noise_calms_a_hand_at_rest():
    rng = np.random.default_rng(1)
    fixed, adaptive = PalmFilter(), PalmFilter(PalmFilterSettings(adaptive=True))
    raw = 3e-5 * rng.standard_normal((600, 3))
    runs = [
        np.array([f.update(0.01 * i, p, (0.0, 0.0, 0.0)) for i, p in enumerate(raw)])
        for f in (fixed, adaptive)
    ]
    assert adaptive.process_scale < 0.1
    assert np.diff(runs[1][300:], axis=0).std() < np.diff(runs[0][300:], axis=0).std()


def test_velocity_that_lags_misleads_a_filter_that_trusts_it():
    """R = 0.7 for all, in mm and mm/s, trusts the tracker's late velocity."""
    times, positions, _ = wave()
    late = 0.1 * np.cos((times[:, None] - 0.018) * [1.0, 2.0, 3.0]) * [1, 2, 3]

    def error(settings):
        palm_filter = PalmFilter(settings)
        ours = np.array([palm_filter.update(*item) for item in zip(times, positions, late)])
        return np.abs(ours - positions)[50:].mean()

    assert error(PAPER_SETTINGS) > 3 * error(PalmFilterSettings())


def test_prediction_goes_on_in_a_straight_line():
    palm_filter = PalmFilter()
    for index in range(200):
        palm_filter.update(0.01 * index, (0.01 * index * 0.2, 0.0, 0.0), (0.2, 0.0, 0.0))
    before = palm_filter.position
    np.testing.assert_allclose(palm_filter.predicted(1.99 + 0.05)[0], before[0] + 0.01, atol=1e-4)
    np.testing.assert_array_equal(palm_filter.position, before)
    np.testing.assert_allclose(palm_filter.velocity, [0.2, 0.0, 0.0], atol=1e-3)


@pytest.mark.parametrize("bad", [(np.nan, 0, 0), (0, np.inf, 0), (0, 0)])
def test_bad_measurement_is_refused_and_changes_nothing(bad):
    palm_filter = PalmFilter()
    palm_filter.update(0.0, (0.1, 0.2, 0.3))
    with pytest.raises(ValueError, match="position"):
        palm_filter.update(0.01, bad)
    np.testing.assert_array_equal(palm_filter.position, (0.1, 0.2, 0.3))


@pytest.mark.parametrize("time", [0.0, -1.0, np.nan])
def test_time_must_advance(time):
    palm_filter = PalmFilter()
    palm_filter.update(0.0, (0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="does not follow"):
        palm_filter.update(time, (0.0, 0.0, 0.0))


def test_prediction_needs_a_measurement():
    with pytest.raises(ValueError, match="no measurement"):
        PalmFilter().predicted(0.0)


@pytest.mark.parametrize(
    "field", ["acceleration_density", "position_sd", "velocity_sd", "initial_variance", "window"]
)
@pytest.mark.parametrize("value", [0, -1, np.nan])
def test_bad_settings_name_the_field(field, value):
    with pytest.raises(ValueError, match=rf"PalmFilterSettings\.{field}"):
        PalmFilterSettings(**{field: value})


# --- spherical interpolation, Eqs. (13)-(16) ----------------------------------------------------------------


@settings(max_examples=100, deadline=None)
@given(unit, unit, st.floats(0, 1))
def test_slerp_agrees_with_scipy(first, second, share):
    start, end = normalised(first), normalised(second)
    if abs(abs(start @ end) - 1) < 1e-9 or abs(start @ end) < 1e-6:
        return
    reference = Slerp([0, 1], Rotation.from_quat([start, end]))(share)
    ours = Rotation.from_quat(slerp(start, end, share))
    assert (ours * reference.inv()).magnitude() < 1e-6


def test_printed_slerp_leaves_the_sphere():
    """Erratum GS-10: with q1 in place of the orthonormalised quaternion the result is no unit quaternion."""
    start, end = np.array([1.0, 0, 0, 0]), np.array([np.cos(0.4), np.sin(0.4), 0, 0])
    for share in (0.3, 1.0):
        printed = start * np.cos(share * 0.4) + end * np.sin(share * 0.4)
        assert np.linalg.norm(printed) ** 2 == pytest.approx(1 + np.sin(2 * share * 0.4) * np.cos(0.4))
        assert np.linalg.norm(slerp(start, end, share)) == pytest.approx(1.0)
    assert not np.allclose(printed, end)
    np.testing.assert_allclose(slerp(start, end, 1.0), end)


def test_slerp_takes_the_shorter_arc():
    """Erratum GS-11: q and -q are one rotation; as printed the interpolation turns the long way round."""
    start, end = np.array([1.0, 0, 0, 0]), -np.array([np.cos(0.2), np.sin(0.2), 0, 0])
    orthogonal = end - (start @ end) * start
    orthogonal /= np.linalg.norm(orthogonal)
    angle = np.arccos(start @ end)
    printed = start * np.cos(angle / 2) + orthogonal * np.sin(angle / 2)
    assert angular_distance(start, slerp(start, end, 0.5)) == pytest.approx(0.2)
    assert angular_distance(start, printed) > 2.5
    np.testing.assert_array_equal(slerp(start, start, 0.7), start)  # 0 / 0 as printed
    np.testing.assert_array_equal(slerp(start, -start, 0.7), start)


def test_share_is_clipped():
    """Erratum GS-12: (16) can exceed 1, which overshoots."""
    assert np.pi / np.pi * 1.0 + 0.2 > 1.0
    assert low_pass_share(np.pi, 1.0, 0.2) == 1.0
    assert low_pass_share(0.0, 0.4, 0.2) == pytest.approx(0.2)
    assert low_pass_share(np.pi / 2, 0.4, 0.2) == pytest.approx(0.4)


@settings(max_examples=50)
@given(st.floats(0, 3.0), st.floats(-np.pi, np.pi))
def test_direction_quaternion_is_twist_free_and_turns_e_z(tilt, azimuth):
    direction = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
    quaternion = np.array(direction_quaternion(direction))
    assert quaternion[3] == 0
    np.testing.assert_allclose(quaternion_direction(quaternion), direction, atol=1e-12)
    np.testing.assert_allclose(
        Rotation.from_quat(quaternion[[1, 2, 3, 0]]).apply([0, 0, 1]), direction, atol=1e-12
    )


@pytest.mark.parametrize("interval", [0.009, 0.03, 0.09])
def test_direction_filter_has_its_time_constant_at_any_rate(interval):
    direction_filter = DirectionFilter(time_constant=0.2, range_ratio=0.0)
    target = (np.sin(0.1), 0.0, np.cos(0.1))
    for _ in range(round(0.2 / interval)):
        found = direction_filter.update(interval, target)
    left = 1 - np.arcsin(found[0]) / 0.1
    assert left == pytest.approx(np.exp(-round(0.2 / interval) * interval / 0.2), abs=1e-6)


@settings(max_examples=50)
@given(st.floats(0.001, 1.0), st.floats(0.0, 2.5), st.floats(-3, 3))
def test_direction_filter_never_overshoots(interval, tilt, azimuth):
    target = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
    direction_filter = DirectionFilter()
    found = direction_filter.update(interval, target)
    assert np.arccos(np.clip(found @ target, -1, 1)) <= tilt + 1e-7
    assert np.linalg.norm(found) == pytest.approx(1.0)


def test_direction_filter_refuses_a_bad_time_constant():
    with pytest.raises(ValueError, match="time_constant"):
        DirectionFilter(0.0)
