"""Numbers are written to the resolution of their unit, the same on every processor."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soro_lib.replication.resolution import OTHERWISE, RESOLUTION, rounded, rounded_table, unit_of

UNITS = st.sampled_from(["", *RESOLUTION])


@pytest.mark.parametrize(
    ("column", "unit"),
    [
        ("error_mm", "mm"),
        ("tip_speed_mm_s", "mm/s"),
        ("time_s", "s"),
        ("rate_hz", "Hz"),
        ("assistance_n", "N"),
        ("needed_scaled_N", "N"),
        ("held_percent", "percent"),
        ("desired [m]", "m"),
        ("share [%]", "%"),
        ("mm", ""),
        ("condition", ""),
        ("xi_s_path", ""),
    ],
)
def test_unit_of_a_column(column, unit):
    assert unit_of(column) == unit


@given(st.floats(-1e300, 1e300), UNITS)
def test_six_digits_and_never_below_the_resolution(value, unit):
    step = RESOLUTION.get(unit, OTHERWISE)
    written = float(rounded(value, unit))
    assert abs(written - value) <= 0.5001 * step + 5.001e-6 * abs(value)
    assert written == float(f"{written:.6g}")
    assert written == 0 or abs(written) > 0.999 * step
    assert str(written) != "-0.0"


@given(st.integers(-(10**6), 10**6), st.floats(-1e-12, 1e-12), UNITS)
def test_noise_decides_no_tie(halves, noise, unit):
    step = RESOLUTION.get(unit, OTHERWISE)
    middle = (halves + 0.5) * step
    assert rounded(middle * (1 + noise), unit) == rounded(middle, unit)
    # The digits run out in the middle of two numbers, too: 1.0000005.
    middle = 1 + (halves + 0.5) * 1e-5
    assert rounded(middle * (1 + noise), unit) == rounded(middle, unit)


def test_what_is_not_finite_stays():
    assert np.isnan(rounded(np.nan))
    assert rounded([np.inf, -np.inf]).tolist() == [np.inf, -np.inf]
    assert rounded([]).shape == (0,)


def test_only_numbers_of_a_table_are_rounded():
    table = pd.DataFrame(
        {
            "arm": ["a", "b"],
            "count": [3, 4],
            "held": [True, False],
            "error_mm": [2.8e-14, 1 / 3],
            "mixed": ["diverged", 1 / 3],
        },
        index=[7, 8],
    )
    written = rounded_table(table)
    expected = table.assign(error_mm=[0.0, 0.333333], mixed=["diverged", 0.333333])
    pd.testing.assert_frame_equal(written, expected)


def test_columns_of_the_same_name_and_levels_stay_apart():
    table = pd.DataFrame([[1e-12, 2.0]], columns=pd.MultiIndex.from_tuples([("a", "x"), ("a", "y")]))
    assert rounded_table(table).to_numpy().tolist() == [[0.0, 2.0]]
    twice = pd.DataFrame([[1e-12, 2.0]], columns=["x", "x"])
    assert rounded_table(twice).to_numpy().tolist() == [[0.0, 2.0]]
