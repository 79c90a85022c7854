"""The three Kalman filters with the values of Appendix A."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from soro_lib.estimators.handover_filters import (
    APPENDIX_A,
    MEASURED_NOISE,
    FilterNoise,
    HandoverFilters,
    PointFilter,
)
from soro_lib.sensing.handover_observation import HandoverObservation

HOME = np.array([0, 0, 0.6, 0, 0, 0.7])


@pytest.mark.parametrize("noise", [APPENDIX_A.ball, APPENDIX_A.wrist, APPENDIX_A.direction])
def test_filter_follows_eqs_14_and_15(noise):
    rng = np.random.default_rng(3)
    point = PointFilter(noise, np.zeros(3))
    state, variance = np.zeros(3), noise.initial
    for measured in rng.standard_normal((12, 3)):
        point.predict(np.zeros(3))
        point.update(measured, claimed_deviation=np.nan)
        variance += noise.process
        gain = variance / (variance + noise.measurement)
        state = state + gain * (measured - state)
        variance -= gain * variance
        np.testing.assert_allclose(point.state, state, atol=1e-12)
        assert point.variance == pytest.approx(variance)


@pytest.mark.parametrize("noise", [APPENDIX_A.wrist, MEASURED_NOISE.ball, MEASURED_NOISE.direction])
def test_one_variance_for_three_components_is_filterpys_filter(noise):
    """The readable reference: filterpy with F = H = I, commanded moves and measurements that are missing."""
    rng = np.random.default_rng(4)
    start = rng.normal(size=3)
    point, reference = PointFilter(noise, start), KalmanFilter(dim_x=3, dim_z=3)
    reference.x, reference.P = start, noise.initial * np.eye(3)
    reference.F = reference.H = np.eye(3)
    for _ in range(300):
        move, measured, deviation = rng.normal(0, 0.01, 3), rng.normal(size=3), 10.0 ** rng.uniform(-5, 0)
        process = noise.process + noise.move_deviation**2 * (move @ move)
        point.predict(move)
        reference.predict(u=noise.expected_move * move, B=np.eye(3), Q=process * np.eye(3))
        if rng.random() < 0.7:
            point.update(measured, deviation)
            reference.update(measured, R=(noise.measurement or deviation**2) * np.eye(3))
        np.testing.assert_allclose(point.state, reference.x, rtol=0, atol=1e-12)
        np.testing.assert_allclose(point.variance * np.eye(3), reference.P, rtol=1e-12, atol=0)


def test_first_measurement_is_taken_nearly_whole():
    point = PointFilter(APPENDIX_A.wrist, np.zeros(3))
    point.predict(np.zeros(3))
    point.update(np.ones(3), np.nan)
    np.testing.assert_allclose(point.state, 1, atol=1e-4)


def test_claimed_deviation_is_used_where_the_variance_is_left_open():
    trusted, doubted = (PointFilter(FilterNoise(1e-6, None, initial=1e-4), np.zeros(3)) for _ in range(2))
    trusted.update(np.ones(3), 0.001)
    doubted.update(np.ones(3), 0.1)
    assert trusted.state[0] > 0.98
    assert doubted.state[0] < 0.02


def test_prediction_adds_a_share_of_the_commanded_move():
    filters = HandoverFilters(MEASURED_NOISE, HOME)
    filters.predict(np.array([0.1, 0, 0, 0.1, 0, 0]))
    np.testing.assert_allclose(filters.points[:3], [0.04, 0, 0.6])


def test_measured_points_keep_their_distance():
    filters = HandoverFilters(APPENDIX_A, HOME)
    for direction in ([0, 0, 1.0], [1.0, 0, 0], [0, -1.0, 0]):
        filters.predict(np.zeros(6))
        filters.update(HandoverObservation(np.array([0.1, 0.2, 0.5]), np.array(direction), None))
        assert np.linalg.norm(filters.points[3:] - filters.points[:3]) == pytest.approx(0.1)
    assert not filters.ball_seen


def test_what_is_not_seen_keeps_its_prediction():
    filters = HandoverFilters(APPENDIX_A, HOME)
    filters.predict(np.zeros(6))
    filters.update(HandoverObservation(None, None, None))
    np.testing.assert_allclose(filters.points, HOME)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [((0.0, 1.0), "process"), ((1.0, -1.0), "measurement"), ((1.0, 1.0, 0.0), "initial")],
)
def test_bad_variances_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        FilterNoise(*arguments)
