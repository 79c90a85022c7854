"""Checks of what is given to the library: every error names what is wrong, where, and the bound.

Here belongs what every room needs to say about a number, an array, a field or a choice; a rule that only one
class has stays with that class.
"""

from collections.abc import Collection
from functools import lru_cache
from math import inf, isfinite
from types import EllipsisType
from typing import Any, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
"""Any array of floats; its shape is in the docstring."""

Vector = tuple[float, float, float]
"""A position or force inside the compiled rules: three floats."""

Shape = tuple[int | str | EllipsisType, ...]
"""A shape to have: sizes, ``"n"`` for any size from 1 or ``"n >= 3"``, and ``...`` in front for any axes."""


class Bounds(TypedDict, total=False):
    """Bounds of a number; without them it must be finite. ``at_most=inf`` admits infinity."""

    above: float
    at_least: float
    below: float
    at_most: float


def numbers(
    name: str, value: ArrayLike, shape: Shape | None = None, error: type[ValueError] = ValueError
) -> Array:
    """Return numbers of a shape, finite or not, as an array; see :func:`finite`."""
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as problem:
        of_shape = "" if shape is None else f" of shape {_written(shape)}"
        raise error(f"{name} must be numbers{of_shape}: {problem}") from None
    if shape is not None and not _fits(array.shape, shape):
        raise error(f"{name} must have shape {_written(shape)}, got {array.shape}")
    return array


def finite(
    name: str,
    value: ArrayLike,
    shape: Shape | None = None,
    error: type[ValueError] = ValueError,
    **bounds: Unpack[Bounds],
) -> Array:
    """Return finite numbers within bounds as an array.

    Parameters
    ----------
    name : str
        What they are called in the error.
    value : array_like
        The numbers.
    shape : tuple, optional
        Shape to have, as ``(3,)``, ``("n", 3)`` or ``(..., 4, 4)``; any, unless given.
    error : type of ValueError
        What is raised.
    **bounds
        ``above`` or ``at_least``, ``below`` or ``at_most``, for each number.

    Raises
    ------
    ValueError
        Naming the first number that is wrong, its index, and the bound; or the shape.

    Examples
    --------
    >>> finite("weights", [1.0, 0.0], (2,), above=0)
    Traceback (most recent call last):
    ...
    ValueError: weights must be a finite number above 0, got 0.0 at index (1,)
    """
    array = numbers(name, value, shape, error)
    if not bounds and array.size <= 16 and all(map(isfinite, array.ravel().tolist())):
        return array  # a single vector, as in every step of a controller: four times faster
    good = _within(array, bounds) if bounds else np.isfinite(array)
    if not good.all():
        index = tuple(np.argwhere(~good)[0].tolist())
        where = f" at index {index}" if index else ""
        raise error(f"{name} must be {_phrase(bounds)}, got {array[index]}{where}")
    return array


def number(name: str, value: float, **bounds: Unpack[Bounds]) -> float:
    """Return one finite number within bounds, or raise a ValueError that names it and the bound."""
    try:
        single = float(value) if not isinstance(value, str | bytes) else None
    except (TypeError, ValueError, OverflowError):
        single = None
    if single is None:
        raise ValueError(f"{name} must be a number, got {value!r}")
    if not _within(single, bounds):
        raise ValueError(f"{name} must be {_phrase(bounds)}, got {value}")
    return single


def positive(name: str, value: float) -> float:
    """Return a finite number above zero, or raise a ValueError that names it."""
    return number(name, value, above=0)


def not_negative(name: str, value: float) -> float:
    """Return a finite number not below zero, or raise a ValueError that names it."""
    return number(name, value, at_least=0)


def vector(name: str, value: ArrayLike) -> Vector:
    """Return three finite numbers as a triple of floats."""
    x, y, z = finite(name, value, (3,)).tolist()
    return x, y, z


def increasing(name: str, value: ArrayLike, shape: Shape = ("n",)) -> Array:
    """Return finite numbers (n,) that increase strictly, or name the first that does not."""
    array = finite(name, value, shape)
    falls = np.flatnonzero(np.diff(array) <= 0.0)
    if falls.size:
        before, after = array[falls[0] : falls[0] + 2]
        raise ValueError(f"{name} must increase strictly, got {after} after {before} at index {falls[0] + 1}")
    return array


def one_of(name: str, value: Any, choices: Collection[Any]) -> None:
    """Raise a ValueError that names the value and the choices, unless it is one of them."""
    if value not in choices:
        raise ValueError(f"{name} must be one of {', '.join(map(repr, choices))}; got {value!r}")


def check_fields(owner: Any, *names: str, shape: Shape = (), **bounds: Unpack[Bounds]) -> None:
    """Check fields of an object, all where none is named: finite numbers of a shape, within bounds.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> check_fields(SimpleNamespace(gain=0.0), "gain", above=0)
    Traceback (most recent call last):
    ...
    ValueError: SimpleNamespace.gain must be a finite number above 0, got 0.0
    """
    for name in names or vars(owner):
        title, value = f"{type(owner).__name__}.{name}", getattr(owner, name)
        if shape:
            finite(title, value, shape, **bounds)
        else:
            number(title, value, **bounds)


@lru_cache(maxsize=1024)
def _fits(actual: tuple[int, ...], shape: Shape) -> bool:
    if shape and shape[0] is ...:
        shape = shape[1:]
        actual = actual[max(0, len(actual) - len(shape)) :]
    if len(actual) != len(shape):
        return False
    for size, wanted in zip(actual, shape):
        if size != wanted and not (isinstance(wanted, str) and size >= int(wanted.partition(">=")[2] or 1)):
            return False
    return True


def _written(shape: Shape) -> str:
    sizes = ", ".join("..." if size is ... else str(size) for size in shape)
    return f"({sizes},)" if len(shape) == 1 else f"({sizes})"


def _within(value: Any, bounds: Bounds) -> Any:
    high = value >= bounds["at_least"] if "at_least" in bounds else value > bounds.get("above", -inf)
    low = value <= bounds["at_most"] if "at_most" in bounds else value < bounds.get("below", inf)
    return high & low


def _phrase(bounds: Bounds) -> str:
    closed_below, closed_above = "at_least" in bounds, "at_most" in bounds
    lower = bounds["at_least"] if closed_below else bounds.get("above", -inf)
    upper = bounds["at_most"] if closed_above else bounds.get("below", inf)
    if lower == -inf and upper == inf:
        return "finite"
    if lower > -inf and upper < inf:
        return f"in {'[' if closed_below else '('}{lower}, {upper}{']' if closed_above else ')'}"
    kind = "number" if closed_above and upper == inf else "finite number"
    if lower > -inf:
        return f"a {kind} {'not below' if closed_below else 'above'} {lower}"
    return f"a {kind} {'not above' if closed_above else 'below'} {upper}"
