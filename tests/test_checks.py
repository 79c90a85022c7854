"""The one vocabulary of checks: what passes, what is refused, and what the error says."""

from dataclasses import dataclass
from math import inf, nan

import numpy as np
import pytest

from soro_lib.checks import (
    check_fields,
    finite,
    increasing,
    not_negative,
    number,
    one_of,
    positive,
    vector,
)


@dataclass
class Settings:
    rate: float = 1.0
    share: float = 0.5
    weights: tuple[float, ...] = (1.0, 2.0)


@pytest.mark.parametrize(
    ("value", "shape"),
    [
        (1.0, ()),
        ([1, 2, 3], (3,)),
        (np.zeros((4, 5, 3)), (..., 3)),
        (np.zeros(3), (..., 3)),
        (np.zeros((0, 3)), (..., 3)),
        (np.zeros((7, 3)), ("n", 3)),
        (np.zeros((3, 3)), ("n >= 3", 3)),
        (np.zeros((2, 2)), None),
    ],
)
def test_what_has_the_shape_is_returned_as_floats(value, shape):
    array = finite("it", value, shape)
    assert array.dtype == float
    np.testing.assert_array_equal(array, value)


@pytest.mark.parametrize(
    ("value", "shape", "message"),
    [
        ([1.0, 2.0], (3,), r"it must have shape \(3,\), got \(2,\)"),
        (1.0, (..., 3), r"it must have shape \(\.\.\., 3\), got \(\)"),
        (np.zeros(3), ("n", 3), r"it must have shape \(n, 3\), got \(3,\)"),
        (np.zeros((0, 3)), ("n", 3), r"it must have shape \(n, 3\), got \(0, 3\)"),
        (np.zeros((2, 3)), ("n >= 3", 3), r"it must have shape \(n >= 3, 3\), got \(2, 3\)"),
        ("left", (3,), r"it must be numbers of shape \(3,\): could not convert"),
        ([[1.0], [2.0, 3.0]], None, r"it must be numbers: "),
        ([[0.0, 1.0], [inf, nan]], None, r"it must be finite, got inf at index \(1, 0\)"),
        (nan, (), r"it must be finite, got nan$"),
    ],
)
def test_wrong_shapes_and_values_are_named(value, shape, message):
    with pytest.raises(ValueError, match=message):
        finite("it", value, shape)


@pytest.mark.parametrize(
    ("bounds", "good", "bad", "message"),
    [
        ({"above": 0}, 1e-300, 0.0, "it must be a finite number above 0, got 0.0"),
        ({"above": 0}, 1.0, inf, "it must be a finite number above 0, got inf"),
        ({"at_least": 0}, 0.0, -1e-300, "it must be a finite number not below 0, got -1e-300"),
        ({"at_least": 0}, 0.0, nan, "it must be a finite number not below 0, got nan"),
        ({"above": 0, "at_most": inf}, inf, 0.0, "it must be a number above 0, got 0.0"),
        ({"below": 1}, -5.0, 1.0, "it must be a finite number below 1, got 1.0"),
        ({"at_most": 1}, 1.0, 2.0, "it must be a finite number not above 1, got 2.0"),
        ({"at_most": 1}, 1.0, -inf, "it must be a finite number not above 1, got -inf"),
        ({"at_least": 0, "below": 1}, 0.0, 1.0, r"it must be in \[0, 1\), got 1.0"),
        ({"above": 0, "at_most": 1}, 1.0, 0.0, r"it must be in \(0, 1\], got 0.0"),
    ],
)
def test_bounds(bounds, good, bad, message):
    assert number("it", good, **bounds) == good
    with pytest.raises(ValueError, match=message):
        number("it", bad, **bounds)
    with pytest.raises(ValueError, match=r"at index \(1,\)"):
        finite("it", [good, bad], (2,), **bounds)


def test_short_names_for_what_is_asked_most():
    assert (positive("it", 2), not_negative("it", 0), vector("it", np.arange(3))) == (
        2.0,
        0.0,
        (0.0, 1.0, 2.0),
    )
    with pytest.raises(ValueError, match="above 0"):
        positive("it", 0.0)
    with pytest.raises(ValueError, match="not below 0"):
        not_negative("it", -1.0)


def test_the_error_may_be_of_another_kind():
    class Refused(ValueError):
        pass

    for value in ("left", [1.0], [nan, 0.0]):
        with pytest.raises(Refused, match="it must"):
            finite("it", value, (2,), error=Refused)


def test_order():
    np.testing.assert_array_equal(increasing("it", [1, 2, 4]), [1.0, 2.0, 4.0])
    with pytest.raises(ValueError, match=r"it must increase strictly, got 2.0 after 2.0 at index 2"):
        increasing("it", [1.0, 2.0, 2.0])
    with pytest.raises(ValueError, match="finite"):
        increasing("it", [1.0, nan])


def test_choices():
    one_of("it", "b", ("a", "b"))
    with pytest.raises(ValueError, match="it must be one of 'a', 'b'; got 'c'"):
        one_of("it", "c", ("a", "b"))


def test_fields_are_named_with_their_class():
    settings = Settings()
    check_fields(settings, "rate", "share", above=0, at_most=1)
    check_fields(settings, "weights", shape=(2,), above=0)
    with pytest.raises(ValueError, match=r"Settings\.rate must be in \[0, 1\), got 1.0"):
        check_fields(settings, "share", "rate", at_least=0, below=1)
    with pytest.raises(ValueError, match=r"Settings\.weights must be a number, got \(1.0, 2.0\)"):
        check_fields(settings, above=0)
