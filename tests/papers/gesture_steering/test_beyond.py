"""Beyond the paper: reach, a fist that keeps its direction, delay against rate."""

import numpy as np
import pytest

from soro_lib.papers.gesture_steering import beyond


def test_fist_leaves_the_direction_free():
    """Erratum GS-19: (27) has no direction term, and the direction is off; a weight on it helps."""
    table = beyond.fist_direction(np.random.SeedSequence(1), (0.0, 20.0)).set_index("weight")
    assert table.loc[0.0, "direction_error_deg"] > 10.0
    assert table.loc[20.0, "direction_error_deg"] < 0.6 * table.loc[0.0, "direction_error_deg"]
    assert table.loc[20.0, "position_error_mm"] > table.loc[0.0, "position_error_mm"]


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
