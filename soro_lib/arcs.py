r"""Constant-curvature arcs, and chains of them, without a singularity at the straight arm.

An arc is three numbers: ``dx`` and ``dy``, the components of its bending angle [rad] (its end tilts toward +x
and +y), and its ``length`` [m]. It is the motion along the constant body twist with angular part
``(-dy, dx, 0)`` and linear part ``(0, 0, length)``. With :math:`D^2 = d_x^2 + d_y^2`,
:math:`S = \sin D / D` and :math:`C = (1 - \cos D) / D^2`,

.. math::

    R = \begin{bmatrix} 1 - C d_x^2 & -C d_x d_y & S d_x \\ -C d_x d_y & 1 - C d_y^2 & S d_y \\
        -S d_x & -S d_y & \cos D \end{bmatrix}, \qquad
    t = \ell \begin{bmatrix} C d_x \\ C d_y \\ S \end{bmatrix} = \ell g .

The first two columns of :math:`R` are :math:`e_1 - d_x g` and :math:`e_2 - d_y g`. So a frame is carried
along an arc with a dozen products per row, and no generic 4 x 4 product is ever formed; the same few lines
serve plain floats (one arm) and arrays (many arms at once).

In the code :math:`S` is ``sinc`` and :math:`C` is ``versinc``. Their slopes enter the Jacobian,
:math:`S'(D) / D = (\cos D - S) / D^2` and :math:`C'(D) / D = (S - 2 C) / D^2`; only these need a power series
near zero.

Sources: Webster and Jones, IJRR 2010, for the arc; Della Santina et al., 2020, for the coordinates
``(dx, dy, length)``; here the angle form of Vervloet, Eqs. (1)-(6), and of Lai et al., Eqs. (22)-(24).
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import finite, number

FloatArray = NDArray[np.float64]

# Below this squared bend the derivatives of S and C are summed as power series: there the closed forms would
# lose digits to cancellation, above it seven terms would leave more than the rounding error.
_SERIES_BOUND = 0.25
_SERIES_TERMS = range(1, 8)
_DS_SERIES = tuple((-1) ** k * 2 * k / math.factorial(2 * k + 1) for k in reversed(_SERIES_TERMS))
_DC_SERIES = tuple((-1) ** k * 2 * k / math.factorial(2 * k + 2) for k in reversed(_SERIES_TERMS))

_IDENTITY_ROWS: tuple[tuple[Any, ...], ...] = (
    (1.0, 0.0, 0.0, 0.0),
    (0.0, 1.0, 0.0, 0.0),
    (0.0, 0.0, 1.0, 0.0),
)
_LAST_ROW = (0.0, 0.0, 0.0, 1.0)

ARCS = (..., "n >= 0", 3)
"""Shape of a chain of arcs, or of many: n times (dx, dy, length)."""


def arc_transform(dx: ArrayLike, dy: ArrayLike, length: ArrayLike) -> FloatArray:
    """Return the pose of the end of an arc in the frame of its start.

    Parameters
    ----------
    dx, dy : array_like, shape (...)
        Components of the bending angle [rad]; the end tilts toward +x and +y.
    length : array_like, shape (...)
        Arc length [m]. The three arguments are broadcast against each other.

    Returns
    -------
    ndarray, shape (..., 4, 4)
        Homogeneous transform; the z axis is the tangent, the straight arm points along +z.

    Raises
    ------
    ValueError
        If an argument is not finite, or the shapes do not broadcast.

    Notes
    -----
    Vervloet, Eqs. (1)-(5), as corrected (errata SH-1 to SH-4); Lai et al., Eqs. (23)-(24); Wang et al.,
    Eq. (22).

    Examples
    --------
    A quarter circle of 0.1 m toward +x ends at its radius in x and in z:

    >>> import numpy as np
    >>> arc_transform(np.pi / 2, 0.0, 0.1)[:3, 3].round(4)
    array([0.0637, 0.    , 0.0637])
    """
    named = {"dx": dx, "dy": dy, "length": length}
    arrays = [finite(name, value) for name, value in named.items()]
    try:
        arc = np.stack(np.broadcast_arrays(*arrays), axis=-1)
    except ValueError:
        shapes = ", ".join(f"{name} {np.shape(value)}" for name, value in named.items())
        raise ValueError(f"the shapes of dx, dy and length must broadcast, got {shapes}") from None
    return chain_transform(arc[..., np.newaxis, :])


def chain_transform(configuration: ArrayLike) -> FloatArray:
    """Return the pose of the end of a chain of arcs in the frame of its start.

    Parameters
    ----------
    configuration : array_like, shape (..., n, 3)
        The arcs from base to tip, each as (dx [rad], dy [rad], length [m]).

    Returns
    -------
    ndarray, shape (..., 4, 4)
        Homogeneous transform from the tip frame to the base frame.

    Raises
    ------
    ValueError
        If the shape is not (..., n, 3), or a value is not finite.

    Notes
    -----
    Vervloet, Eq. (6); Lai et al., Eq. (22). Any finite length is accepted, a negative one too: the formulas
    continue smoothly, which iterative solvers rely on. Physical limits belong to the robots.

    Examples
    --------
    >>> chain_transform([[0.0, 0.0, 0.12], [0.0, 0.0, 0.24]])[:3, 3]
    array([0.  , 0.  , 0.36])
    """
    arcs = finite("configuration", configuration, ARCS)
    if arcs.ndim == 2:
        rows = _IDENTITY_ROWS
        for arc in _scalar_arcs(arcs):
            rows = tuple(carry(row, arc) for row in rows)
        return np.array((*rows, _LAST_ROW))
    frame: tuple[Any, ...] = _identity_frame(arcs)
    for arcs_of_segment in _batch_arcs(arcs):
        frame = carry(frame, arcs_of_segment)
    return _pack_transform(frame, arcs.shape[:-2])


def chain_jacobian(configuration: ArrayLike) -> FloatArray:
    """Return the Jacobian of the end of a chain of arcs with respect to all its arc coordinates.

    Parameters
    ----------
    configuration : array_like, shape (..., n, 3)
        The arcs from base to tip, each as (dx [rad], dy [rad], length [m]).

    Returns
    -------
    ndarray, shape (..., 6, 3 n)
        Rows: linear velocity of the tip, angular velocity of the tip frame, both in the base frame.
        Columns: dx, dy, length of the first arc, then of the second, and so on.

    Raises
    ------
    ValueError
        If the shape is not (..., n, 3), or a value is not finite.
    """
    return chain_transform_and_jacobian(configuration)[1]


def chain_transform_and_jacobian(configuration: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return :func:`chain_transform` and :func:`chain_jacobian` from one pass along the chain."""
    arcs = finite("configuration", configuration, ARCS)
    if arcs.ndim == 2:
        return _scalar_transform_and_jacobian(arcs)
    return _batch_transform_and_jacobian(arcs)


def backbone(configuration: ArrayLike, points_per_segment: int = 20) -> FloatArray:
    """Return points along the chain, for drawing it and for measuring distances to it.

    Parameters
    ----------
    configuration : array_like, shape (..., n, 3)
        The arcs from base to tip, each as (dx [rad], dy [rad], length [m]).
    points_per_segment : int
        Points on each arc beyond its start, at least 1.

    Returns
    -------
    ndarray, shape (..., n * points_per_segment + 1, 3)
        Positions [m] in the base frame, evenly spaced on each arc, the base first, the tip last.

    Raises
    ------
    ValueError
        If the configuration is malformed or `points_per_segment` is below 1.
    """
    number("points_per_segment", points_per_segment, at_least=1)
    arcs = finite("configuration", configuration, ARCS)
    frame = _identity_frame(arcs)
    points = [frame[3][..., np.newaxis]]
    fractions = np.arange(1, points_per_segment + 1) / points_per_segment
    for arc in np.moveaxis(_flat_batch(arcs), 1, 0):
        pieces = _batch_arc(*(arc.T[:, :, np.newaxis] * fractions))
        stretched = carry(tuple(column[..., np.newaxis] for column in frame), pieces)
        points.append(stretched[3])
        frame = tuple(column[..., -1] for column in stretched)
    return np.moveaxis(np.concatenate(points, axis=-1), 0, -1).reshape(*arcs.shape[:-2], -1, 3)


def routing_matrix(radius: float, angles: ArrayLike) -> FloatArray:
    """Return the matrix from an arc to the lengths of the tendons or chambers that run along it.

    A strand at distance `radius` from the backbone and at angle `angle` about z keeps its place in every
    cross-section, so its length is ``length - radius * (dx cos(angle) + dy sin(angle))``: linear in the arc,
    and invertible for three strands at different angles.

    Parameters
    ----------
    radius : float
        Distance of the strands from the backbone [m].
    angles : array_like, shape (m,)
        Their directions about z, from x toward y [rad].

    Returns
    -------
    ndarray, shape (m, 3)
        ``lengths = matrix @ (dx, dy, length)``.
    """
    angles = np.asarray(angles, dtype=float)
    return np.stack([-radius * np.cos(angles), -radius * np.sin(angles), np.ones_like(angles)], axis=-1)


def carry(row: Sequence[Any], arc: Sequence[Any]) -> tuple[Any, ...]:
    """Multiply a row (or the rows) of a 3 x 4 frame by the transform of an arc from the right."""
    x_axis, y_axis, z_axis, origin = row
    dx, dy, length, sinc, versinc, cosine = arc
    bend = dx * x_axis + dy * y_axis
    chord = versinc * bend + sinc * z_axis
    return x_axis - dx * chord, y_axis - dy * chord, sinc * bend + cosine * z_axis, origin + length * chord


def end_velocities(row: Sequence[Any], arc: Sequence[Any], slopes: Sequence[Any]) -> tuple[Any, ...]:
    """Return a row of an arc's end velocities: three linear (dx, dy, length), then two angular (dx, dy).

    The angular ones are the columns of the left Jacobian of SO(3), whose second coefficient
    (1 - S) / D^2 equals C + S'.
    """
    x_axis, y_axis, z_axis, _ = row
    dx, dy, length, sinc, versinc, _ = arc
    sinc_slope, versinc_slope = slopes
    bend = dx * x_axis + dy * y_axis
    chord_slope = length * (versinc_slope * bend + sinc_slope * z_axis)
    turn = (versinc + sinc_slope) * bend + versinc * z_axis
    stretch = length * versinc
    return (
        stretch * x_axis + dx * chord_slope,
        stretch * y_axis + dy * chord_slope,
        versinc * bend + sinc * z_axis,
        y_axis - dy * turn,
        dx * turn - x_axis,
    )


def _cross(a: Any, b: Any) -> tuple[Any, Any, Any]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


# One chain: plain floats, which at this size are ten times faster than arrays. The functions of one row and
# one arc are also compiled, as they stand, by `soro_lib.arc_kernels` (njit).


def _scalar_arcs(arcs: FloatArray) -> list[tuple[float, ...]]:
    """Return (dx, dy, length, sinc, versinc, cosine) of every arc of one chain, as floats."""
    return [arc_numbers(dx, dy, length) for dx, dy, length in arcs.tolist()]


def arc_numbers(dx: float, dy: float, length: float) -> tuple[float, ...]:
    """Return (dx, dy, length, S, C, cos D) of one arc, as floats."""
    half = 0.5 * math.hypot(dx, dy)
    half_sine = math.sin(half)
    half_sinc = half_sine / half if half > 0.0 else 1.0
    return (
        dx,
        dy,
        length,
        half_sinc * math.cos(half),
        0.5 * half_sinc * half_sinc,
        1.0 - 2.0 * half_sine * half_sine,
    )


def arc_slopes(arc: Sequence[float]) -> tuple[float, float]:
    """Return S' and C', the derivatives of S and C by D, each over D."""
    dx, dy, _, sinc, versinc, cosine = arc
    square = dx * dx + dy * dy
    if square >= _SERIES_BOUND:
        return (cosine - sinc) / square, (sinc - 2.0 * versinc) / square
    sinc_slope = versinc_slope = 0.0
    for sinc_term, versinc_term in zip(_DS_SERIES, _DC_SERIES):
        sinc_slope = sinc_slope * square + sinc_term
        versinc_slope = versinc_slope * square + versinc_term
    return sinc_slope, versinc_slope


def _scalar_transform_and_jacobian(arcs: FloatArray) -> tuple[FloatArray, FloatArray]:
    rows = _IDENTITY_ROWS
    ends = []
    for arc in _scalar_arcs(arcs):
        slopes = arc_slopes(arc)
        columns = list(zip(*[end_velocities(row, arc, slopes) for row in rows]))
        rows = tuple(carry(row, arc) for row in rows)
        ends.append((columns, (rows[0][3], rows[1][3], rows[2][3])))
    tip = ends[-1][1] if ends else (0.0, 0.0, 0.0)
    jacobian: list[tuple[float, ...]] = []
    for (along_x, along_y, along, turn_x, turn_y), end in ends:
        lever = (tip[0] - end[0], tip[1] - end[1], tip[2] - end[2])
        swing_x, swing_y = _cross(turn_x, lever), _cross(turn_y, lever)
        jacobian += (
            (along_x[0] + swing_x[0], along_x[1] + swing_x[1], along_x[2] + swing_x[2], *turn_x),
            (along_y[0] + swing_y[0], along_y[1] + swing_y[1], along_y[2] + swing_y[2], *turn_y),
            (*along, 0.0, 0.0, 0.0),
        )
    return np.array((*rows, _LAST_ROW)), np.array(jacobian).reshape(-1, 6).T


# Many chains: every number above becomes an array over the chains, every vector one of shape (3, chains).


def _batch_arcs(arcs: FloatArray) -> list[tuple[FloatArray, ...]]:
    """Return (dx, dy, length, sinc, versinc, cosine) of every arc, each an array over the chains."""
    columns = np.ascontiguousarray(_flat_batch(arcs).T)
    return [_batch_arc(*arc) for arc in columns.transpose(1, 0, 2)]


def _flat_batch(arcs: FloatArray) -> FloatArray:
    return arcs.reshape(math.prod(arcs.shape[:-2]), *arcs.shape[-2:])


def _batch_arc(dx: FloatArray, dy: FloatArray, length: FloatArray) -> tuple[FloatArray, ...]:
    half = 0.5 * np.hypot(dx, dy)
    half_sine = np.sin(half)
    half_sinc = np.divide(half_sine, half, out=np.ones_like(half), where=half > 0.0)
    return dx, dy, length, half_sinc * np.cos(half), 0.5 * half_sinc**2, 1.0 - 2.0 * half_sine**2


def _batch_slopes(arc: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    dx, dy, _, sinc, versinc, cosine = arc
    square = dx * dx + dy * dy
    small = square < _SERIES_BOUND
    divisor = np.where(small, 1.0, square)
    near = square[small]
    slopes = (cosine - sinc) / divisor, (sinc - 2.0 * versinc) / divisor
    slopes[0][small] = _horner(_DS_SERIES, near)
    slopes[1][small] = _horner(_DC_SERIES, near)
    return slopes


def _horner(coefficients: Sequence[float], x: Any) -> Any:
    value = coefficients[0]
    for coefficient in coefficients[1:]:
        value = value * x + coefficient
    return value


def _identity_frame(arcs: FloatArray) -> tuple[FloatArray, ...]:
    """Return the columns of an identity frame, each of shape (3, number of chains)."""
    chains = math.prod(arcs.shape[:-2])
    return tuple(np.broadcast_to(column[:, np.newaxis], (3, chains)) for column in np.eye(4)[:, :3])


def _pack_transform(frame: Sequence[FloatArray], batch_shape: tuple[int, ...]) -> FloatArray:
    transform = np.empty((frame[0].shape[1], 4, 4))
    for index, column in enumerate(frame):
        transform[:, :3, index] = column.T
    transform[:, 3] = _LAST_ROW
    return transform.reshape(*batch_shape, 4, 4)


def _batch_transform_and_jacobian(arcs: FloatArray) -> tuple[FloatArray, FloatArray]:
    batch_shape, count = arcs.shape[:-2], arcs.shape[-2]
    frame = _identity_frame(arcs)
    ends = []
    for arc in _batch_arcs(arcs):
        velocities = end_velocities(frame, arc, _batch_slopes(arc))
        frame = carry(frame, arc)
        ends.append((velocities, frame[3]))
    jacobian = np.zeros((frame[0].shape[1], 6, 3 * count))
    for index, ((along_x, along_y, along, turn_x, turn_y), end) in enumerate(ends):
        lever = frame[3] - end
        columns = jacobian[:, :, 3 * index : 3 * index + 3]
        columns[:, :3, 0] = (along_x + _cross(turn_x, lever)).T
        columns[:, :3, 1] = (along_y + _cross(turn_y, lever)).T
        columns[:, :3, 2] = along.T
        columns[:, 3:, 0] = turn_x.T
        columns[:, 3:, 1] = turn_y.T
    return _pack_transform(frame, batch_shape), jacobian.reshape(*batch_shape, 6, 3 * count)
