"""Arithmetic of triples of floats inside the compiled rules: positions, changes and forces along x, y, z."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import Vector
from soro_lib.jit import inlined

ZERO: Vector = (0.0, 0.0, 0.0)


@inlined
def difference(a: Vector, b: Vector) -> Vector:
    """From b to a."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@inlined
def moved(place: Vector, factor: float, change: Vector) -> Vector:
    """A place after a change times a factor."""
    return (place[0] + factor * change[0], place[1] + factor * change[1], place[2] + factor * change[2])


@inlined
def towards(place: Vector, share: float, goal: Vector) -> Vector:
    """The point that lies at a share of the way from a place to a goal."""
    return moved(place, share, difference(goal, place))


@inlined
def scaled(factor: float, a: Vector) -> Vector:
    """A vector times a number."""
    return (factor * a[0], factor * a[1], factor * a[2])


@inlined
def product(a: Vector, b: Vector) -> Vector:
    """Two vectors multiplied axis by axis."""
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])


@inlined
def size(a: Vector) -> float:
    """Euclidean norm."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@inlined
def after_friction(force: Vector, friction: float) -> Vector:
    """What Coulomb friction leaves of a force or command: nothing below it, the excess above."""
    pull = size(force)
    return scaled(1.0 - friction / pull if pull > friction else 0.0, force)


@inlined
def scattered(mean: Vector, deviation: float, rng: np.random.Generator) -> Vector:
    """Normally distributed about a mean, with the same standard deviation along every axis."""
    return (
        mean[0] + deviation * rng.standard_normal(),
        mean[1] + deviation * rng.standard_normal(),
        mean[2] + deviation * rng.standard_normal(),
    )


@inlined
def row(table: NDArray[np.float64], index: int) -> Vector:
    """One row of an array (n, 3)."""
    return (table[index, 0], table[index, 1], table[index, 2])


@inlined
def set_row(table: NDArray[np.float64], index: int, value: Vector) -> None:
    """Overwrite one row of an array (n, 3)."""
    for axis in range(3):
        table[index, axis] = value[axis]


def delay_line(place: ArrayLike, samples: int) -> NDArray[np.float64]:
    """Ring buffer (samples, 3) of what is on its way, at least one row, filled with a place of rest."""
    return np.tile(np.asarray(place, dtype=float), (max(samples, 1), 1))
