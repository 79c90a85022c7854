"""Reference paths of the experiments, as pure functions of how far along them one is.

Closed paths take ``turns``, the number of cycles travelled (any real number, any shape), and return points of
shape ``(..., d)``. Lengths are in whatever unit the caller gives; the plane is the caller's too.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from soro_lib.checks import finite, positive

FloatArray = NDArray[np.float64]

A4_PAPER = (0.297, 0.210)
"""Sides of an A4 sheet [m] (ISO 216), the tracing target of Lai et al., Fig. 5."""


def circle(turns: ArrayLike, radius: float) -> FloatArray:
    """Return points on a circle, counter-clockwise from +x, shape (..., 2): Wang et al., Section IV-D."""
    angle = 2.0 * np.pi * finite("turns", turns)
    return positive("radius", radius) * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def infinity(turns: ArrayLike, half_width: float) -> FloatArray:
    """Return points on Bernoulli's lemniscate, the infinity sign of Lai et al., Fig. 7(a), shape (..., 2).

    Parameters
    ----------
    turns : array_like, shape (...)
        Cycles travelled; 0 is the crossing, left toward +x and +y.
    half_width : float
        Distance from the crossing to the outermost point of either loop.
    """
    angle = 2.0 * np.pi * finite("turns", turns)
    x = positive("half_width", half_width) * np.sin(angle) / (1.0 + np.cos(angle) ** 2)
    return np.stack([x, x * np.cos(angle)], axis=-1)


def spiral(fraction: ArrayLike, radius: float, turns: float) -> FloatArray:
    """Return points on a spiral whose radius grows with the square root, shape (..., 2): equal area per time.

    Parameters
    ----------
    fraction : array_like, shape (...)
        Share of the whole spiral travelled, in [0, 1].
    radius : float
        Distance from the centre at the end.
    turns : float
        Cycles in the whole spiral, counter-clockwise if positive.
    """
    share = finite("fraction", fraction, at_least=0, at_most=1)
    angle = 2.0 * np.pi * turns * share
    reach = positive("radius", radius) * np.sqrt(share)
    return np.stack([reach * np.cos(angle), reach * np.sin(angle)], axis=-1)


def polygon(turns: ArrayLike, vertices: ArrayLike) -> FloatArray:
    """Return points on a closed polygon at constant speed, shape (..., d).

    Parameters
    ----------
    turns : array_like, shape (...)
        Cycles travelled; 0 is the first vertex.
    vertices : array_like, shape (n, d)
        Corners in order, the first not repeated; n >= 2.
    """
    corners = finite("vertices", vertices, ("n >= 2", "d"))
    closed = np.concatenate([corners, corners[:1]])
    travelled = np.concatenate([[0.0], np.linalg.norm(np.diff(closed, axis=0), axis=-1).cumsum()])
    if travelled[-1] == 0.0:
        raise ValueError("vertices must not all coincide")
    distance = np.mod(finite("turns", turns), 1.0) * travelled[-1]
    return np.stack([np.interp(distance, travelled, column) for column in closed.T], axis=-1)


def pentagram(turns: ArrayLike, radius: float) -> FloatArray:
    """Return points on a five-pointed star of straight lines, shape (..., 2): Wang et al., Fig. 9.

    The first point of the star is at +y, at distance `radius` from the centre.
    """
    angle = np.pi / 2.0 + 4.0 * np.pi / 5.0 * np.arange(5)
    return polygon(turns, positive("radius", radius) * np.stack([np.cos(angle), np.sin(angle)], axis=-1))


def rectangle(turns: ArrayLike, width: float = A4_PAPER[0], height: float = A4_PAPER[1]) -> FloatArray:
    """Return points on the border of a centred rectangle, by default an A4 sheet in metres, shape (..., 2).

    Counter-clockwise from the corner (-width/2, -height/2).
    """
    x, y = 0.5 * positive("width", width), 0.5 * positive("height", height)
    return polygon(turns, [(-x, -y), (x, -y), (x, y), (-x, y)])


def closed_curve(turns: ArrayLike, points: ArrayLike, samples: int = 4096) -> FloatArray:
    """Return points on the smooth closed curve through given points, at constant speed, shape (..., d).

    Parameters
    ----------
    turns : array_like, shape (...)
        Cycles travelled; 0 is the first point.
    points : array_like, shape (n, d)
        Points to pass through in order, the first not repeated; n >= 3, neighbours distinct.
    samples : int
        Pieces that the arc length is measured with; the speed is constant to about ``1 / samples``.

    Notes
    -----
    A periodic cubic spline over the chord lengths, reparametrised by arc length.
    """
    knots = finite("points", points, ("n >= 3", "d"))
    closed = np.concatenate([knots, knots[:1]])
    chords = np.linalg.norm(np.diff(closed, axis=0), axis=-1)
    if not (chords > 0.0).all():
        raise ValueError(f"points {int(chords.argmin())} and the next must be distinct")
    spline = CubicSpline(np.concatenate([[0.0], chords.cumsum()]), closed, bc_type="periodic")
    parameter = np.linspace(0.0, chords.sum(), samples + 1)
    steps = np.linalg.norm(np.diff(spline(parameter), axis=0), axis=-1)
    travelled = np.concatenate([[0.0], steps.cumsum()])
    distance = np.mod(finite("turns", turns), 1.0) * travelled[-1]
    return np.asarray(spline(np.interp(distance, travelled, parameter)), dtype=float)


def minimum_jerk(fraction: ArrayLike) -> FloatArray:
    """Return the share of the distance covered after a share of the time, shape (...): Flash and Hogan, 1985.

    Parameters
    ----------
    fraction : array_like, shape (...)
        Share of the movement time, in [0, 1].

    Returns
    -------
    ndarray, shape (...)
        ``10 t^3 - 15 t^4 + 6 t^5``: from 0 to 1, at rest and without acceleration at both ends.
    """
    t = finite("fraction", fraction, at_least=0, at_most=1)
    return t**3 * (10.0 + t * (-15.0 + 6.0 * t))
