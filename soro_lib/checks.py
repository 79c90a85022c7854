"""Bounds of the arguments; every error names what is wrong, where, and the bound."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vector = tuple[float, float, float]
"""A position or force inside the compiled rules: three floats."""


def finite_vector(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Three finite numbers, or a ValueError that names the argument and the component."""
    array = np.asarray(value, dtype=float)
    if array.shape != (3,):
        raise ValueError(f"{name} must have shape (3,), got {array.shape}")
    if not np.all(np.isfinite(array)):
        axis = "xyz"[int(np.argmin(np.isfinite(array)))]
        raise ValueError(f"{name} must be finite, but its {axis} is {array['xyz'.index(axis)]}")
    return array


def vector(name: str, value: ArrayLike) -> Vector:
    """`finite_vector` as a triple of floats."""
    x, y, z = finite_vector(name, value).tolist()
    return x, y, z


def positive(name: str, value: float) -> float:
    """A finite number above zero, or a ValueError that names it."""
    if not (math.isfinite(value) and value > 0):
        raise ValueError(f"{name} must be a finite number above 0, got {value!r}")
    return float(value)


def not_negative(name: str, value: float) -> float:
    """A finite number not below zero, or a ValueError that names it."""
    if not (math.isfinite(value) and value >= 0):
        raise ValueError(f"{name} must be a finite number not below 0, got {value!r}")
    return float(value)


def sample_count(elapsed: float | None, sample_rate: float) -> float:
    """Time since the last sample in sample periods; one where no time is given."""
    return 1.0 if elapsed is None else positive("elapsed", elapsed) * sample_rate


def goal_points(name: str, value: ArrayLike, reach: float) -> tuple[Vector, ...]:
    """Goals (n, 3) as a tuple of points, each finite, below the base and within reach."""
    array = np.asarray(value, dtype=float)
    if array.ndim != 2 or array.shape[1] != 3 or len(array) == 0:
        raise ValueError(f"{name} must have shape (n, 3) with n >= 1, got {array.shape}")
    points = tuple(vector(f"{name}[{index}]", point) for index, point in enumerate(array))
    for index, point in enumerate(points):
        distance = math.hypot(*point)
        if point[2] <= 0:
            raise ValueError(f"{name}[{index}] must lie below the base (z > 0), got z = {point[2]} m")
        if distance > reach:
            raise ValueError(
                f"{name}[{index}] is out of reach: {distance:.3f} m from the base, bound {reach} m"
            )
    return points
