"""The arithmetic of triples against numpy's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soro_lib.papers.shared_control.world import vectors

triple = st.tuples(*[st.floats(-1e3, 1e3)] * 3)


@given(triple, triple, st.floats(-10, 10))
def test_triples_are_numpy_arrays_without_the_arrays(a, b, factor):
    first, second = np.array(a), np.array(b)
    np.testing.assert_array_equal(vectors.difference(a, b), first - second)
    np.testing.assert_array_equal(vectors.moved(a, factor, b), first + factor * second)
    np.testing.assert_array_equal(vectors.towards(a, factor, b), first + factor * (second - first))
    np.testing.assert_array_equal(vectors.scaled(factor, a), factor * first)
    np.testing.assert_array_equal(vectors.product(a, b), first * second)
    assert vectors.size(a) == pytest.approx(np.linalg.norm(first), rel=1e-12)


def test_scatter_draws_once_per_axis():
    drawn = vectors.scattered((1.0, 2.0, 3.0), 0.5, np.random.default_rng(1))
    np.testing.assert_array_equal(drawn, [1, 2, 3] + 0.5 * np.random.default_rng(1).standard_normal(3))


def test_delay_line_holds_what_is_on_its_way():
    line = vectors.delay_line((1.0, 2.0, 3.0), 4)
    assert line.shape == (4, 3)
    vectors.set_row(line, 2, (4.0, 5.0, 6.0))
    assert vectors.row(line, 2) == (4.0, 5.0, 6.0)
    assert vectors.row(line, 3) == (1.0, 2.0, 3.0)
    assert vectors.delay_line((0.0, 0.0, 0.0), 0).shape == (1, 3)
