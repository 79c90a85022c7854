"""The fitted actuation map: round trip, ends, bad sweeps."""

import numpy as np
import pytest

from soro_lib.controllers.actuation_map import ActuationMap

MOTOR = np.linspace(0.085, 0.1, 31)
MAP = ActuationMap(MOTOR, 0.09 + 3.0 * (MOTOR - 0.09) + 20.0 * (MOTOR - 0.085) ** 2)


def test_round_trip():
    assert np.allclose(MAP.motor_lengths(MAP.chamber_lengths(MOTOR)), MOTOR, atol=1e-12)
    between = np.linspace(0.086, 0.099, 100)
    assert np.allclose(MAP.motor_lengths(MAP.chamber_lengths(between)), between, atol=1e-6)


def test_beyond_the_sweep_its_end_counts():
    assert MAP.chamber_lengths(0.2) == MAP.chamber_lengths(MOTOR[-1])
    assert MAP.motor_lengths(0.0) == MOTOR[0]


def test_map_is_monotone_between_its_points():
    assert (np.diff(MAP.chamber_lengths(np.linspace(0.085, 0.1, 1000))) > 0).all()


@pytest.mark.parametrize(
    ("motor", "chamber", "message"),
    [
        ([1.0], [1.0], r"motor_lengths must have shape \(n >= 2,\), got \(1,\)"),
        ([1.0, 2.0], [2.0, 1.0], "chamber_lengths"),
        ([1.0, np.nan], [1.0, 2.0], "motor"),
    ],
)
def test_bad_sweep_is_refused(motor, chamber, message):
    with pytest.raises(ValueError, match=message):
        ActuationMap(motor, chamber)
