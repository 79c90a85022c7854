"""Reference paths against their defining equations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soro_lib.paths import (
    circle,
    closed_curve,
    infinity,
    minimum_jerk,
    pentagram,
    polygon,
    rectangle,
    spiral,
)

CLOSED = {
    "circle": lambda turns: circle(turns, 30.0),
    "infinity": lambda turns: infinity(turns, 30.0),
    "pentagram": lambda turns: pentagram(turns, 30.0),
    "rectangle": lambda turns: rectangle(turns),
    "closed_curve": lambda turns: closed_curve(turns, [(0, 0), (3, 0), (3, 2), (1, 4)]),
}
closed = pytest.mark.parametrize("path", CLOSED.values(), ids=CLOSED.keys())


@closed
@given(turns=st.floats(-3.0, 3.0))
def test_closed_paths_repeat_every_turn(path, turns):
    np.testing.assert_allclose(path(turns + 1.0), path(turns), rtol=0, atol=1e-8)


@closed
def test_closed_paths_take_any_shape_and_are_continuous(path):
    turns = np.linspace(0.0, 1.0, 4001)
    points = path(turns)
    assert points.shape == (4001, 2)
    assert path(turns.reshape(1, -1, 1)).shape == (1, 4001, 1, 2)
    assert path(0.25).shape == (2,)
    length = np.linalg.norm(np.diff(points, axis=0), axis=-1)
    assert length.max() < 3.0 * length.mean()


@pytest.mark.parametrize("name", ["circle", "pentagram", "rectangle", "closed_curve"])
def test_paths_run_at_constant_speed(name):
    steps = np.linalg.norm(np.diff(CLOSED[name](np.linspace(0.0, 1.0, 10_001)), axis=0), axis=-1)
    assert np.percentile(steps, [1, 99]) == pytest.approx(steps.max(), rel=1e-2)


@given(st.floats(-2.0, 2.0))
def test_infinity_is_bernoullis_lemniscate(turns):
    x, y = infinity(turns, 30.0)
    assert (x**2 + y**2) ** 2 == pytest.approx(30.0**2 * (x**2 - y**2), abs=1e-6)


def test_infinity_crosses_twice_and_reaches_both_ends():
    np.testing.assert_allclose(infinity([0.0, 0.5, 1.0], 30.0), 0.0, rtol=0, atol=1e-13)
    np.testing.assert_allclose(infinity([0.25, 0.75], 30.0), [[30, 0], [-30, 0]], rtol=0, atol=1e-13)


def test_pentagram_has_five_points_joined_by_the_longest_diagonals():
    tips = pentagram(np.arange(5) / 5, 30.0)
    np.testing.assert_allclose(tips[0], [0.0, 30.0], rtol=0, atol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(tips, axis=-1), 30.0, rtol=1e-14)
    sides = np.linalg.norm(np.diff(tips, axis=0), axis=-1)
    np.testing.assert_allclose(sides, 2 * 30.0 * np.sin(2 * np.pi / 5), rtol=1e-14)
    # The star's length over 1000 steps: the step that follows from R = 30 mm in the visual-strain study.
    assert 5 * sides[0] / 1000 == pytest.approx(0.285, abs=1e-3)


def test_spiral_covers_equal_area_in_equal_time():
    fraction = np.linspace(0.0, 1.0, 101)
    points = spiral(fraction, radius=0.03, turns=4.7)
    area = (points**2).sum(axis=-1)
    np.testing.assert_allclose(np.diff(area), area[-1] / 100, rtol=1e-10)
    np.testing.assert_allclose(points[-1], 0.03 * circle(4.7, 1.0), rtol=1e-12)


def test_rectangle_is_an_a4_sheet():
    corners = rectangle([0.0, 0.297 / 1.014, 0.5, (0.5 * 1.014 + 0.297) / 1.014])
    np.testing.assert_allclose(
        corners, [[-0.1485, -0.105], [0.1485, -0.105], [0.1485, 0.105], [-0.1485, 0.105]], rtol=0, atol=1e-15
    )


def deviation(positions, path):
    """Return the distances (n,) of positions (n, d) from a path (m, d) of straight lines."""
    start, along = path[:-1], np.diff(path, axis=0)
    offset = positions[:, np.newaxis] - start
    share = (offset * along).sum(axis=-1) / (along**2).sum(axis=-1)
    return np.linalg.norm(offset - np.clip(share, 0, 1)[..., np.newaxis] * along, axis=-1).min(axis=-1)


def test_closed_curve_passes_through_its_points_smoothly():
    points = 10.0 * circle(np.arange(7) / 7, 1.0) + [[0.5, -0.2]]
    dense = closed_curve(np.linspace(0.0, 1.0, 20_001), points)
    np.testing.assert_allclose(deviation(points, dense), 0.0, rtol=0, atol=1e-5)
    turn = np.diff(np.unwrap(np.arctan2(*np.diff(dense, axis=0).T[::-1])))
    assert np.abs(turn).max() < 1e-3
    assert np.linalg.norm(np.diff(dense, axis=0), axis=-1).sum() == pytest.approx(20 * np.pi, rel=1e-2)


def test_minimum_jerk_starts_and_ends_at_rest():
    t = np.linspace(0.0, 1.0, 10_001)
    s = minimum_jerk(t)
    assert (s[0], s[5000], s[-1]) == (0.0, 0.5, 1.0)
    assert (np.diff(s) >= 0.0).all()
    speed = np.gradient(s, t, edge_order=2)
    np.testing.assert_allclose(speed[[0, -1]], 0.0, rtol=0, atol=1e-6)
    np.testing.assert_allclose(np.gradient(speed, t, edge_order=2)[[0, -1]], 0.0, rtol=0, atol=1e-2)
    assert speed.max() == pytest.approx(1.875, abs=1e-6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: circle(np.nan, 1.0), "turns must be finite"),
        (lambda: circle(0.0, -1.0), "radius must be a finite number above 0, got -1.0"),
        (lambda: infinity(0.0, np.inf), "half_width must be a finite number above 0, got inf"),
        (lambda: spiral([0.5, 1.5], 1.0, 2.0), r"fraction must be in \[0, 1\]"),
        (lambda: minimum_jerk(np.nan), r"fraction must be in \[0, 1\]"),
        (lambda: polygon(0.0, [(0.0, 0.0)]), r"vertices must have shape \(n >= 2, d\), got \(1, 2\)"),
        (lambda: polygon(0.0, [(1.0, 1.0), (1.0, 1.0)]), "vertices must not all coincide"),
        (lambda: closed_curve(0.0, [(0, 0), (1, 1)]), r"points must have shape \(n >= 3, d\), got \(2, 2\)"),
        (lambda: closed_curve(0.0, [(0, 0), (1, 1), (1, 1)]), "points 1 and the next must be distinct"),
    ],
)
def test_bad_input_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
