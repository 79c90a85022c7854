"""How finely a number is written: never below the resolution of its unit, never with more than six digits.

What is smaller than the resolution is rounding noise, another value on every processor; it is written as 0.
With six digits and a resolution, the same run gives the same table whatever computes its sums of products.
"""

import re

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from soro_lib.replication import policy

RESOLUTION = {
    **{"m": 1e-9, "cm": 1e-7, "mm": 1e-6, "nm": 1e-9},
    **{"rad": 1e-9, "deg": 1e-6},
    **{"s": 1e-9, "ms": 1e-6, "m/s": 1e-9, "mm/s": 1e-6, "Hz": 1e-6},
    **{"N": 1e-6, "N/m": 1e-6, "N/mm": 1e-6, "%": 1e-6, "percent": 1e-6},
}
"""The smallest difference that means anything, by unit, in that unit: a nanometre, a microdegree, ..."""

OTHERWISE = 1e-9
"""The resolution where a column has no unit, or one that is not listed [-]."""

TIE = 1e-10
"""What decides a value that lies between two steps: it is moved away from zero by this share first [-].

A sum that is exactly 2.5 steps would else be rounded up on one processor and down on another.
"""


def of_unit(unit: str) -> float:
    """Return the resolution of numbers with a unit, in that unit."""
    return RESOLUTION.get(unit, OTHERWISE)


def unit_of(column: str) -> str:
    """Return the unit that the name of a column ends with, nothing where there is none.

    Examples
    --------
    >>> unit_of("tip_error_mm"), unit_of("tip_speed_mm_s"), unit_of("desired [m]"), unit_of("condition")
    ('mm', 'mm/s', 'm', '')
    """
    bracket = re.search(r"\[([^\]]+)\]$", column)
    words = column.split("_")[1:]
    endings = [bracket[1]] if bracket else ["/".join(words[-2:]), *words[-1:]]
    spelling = {unit.lower(): unit for unit in RESOLUTION}
    return next((spelling[ending.lower()] for ending in endings if ending.lower() in spelling), "")


def rounded(values: ArrayLike, unit: str = "") -> NDArray[np.float64]:
    """Return numbers as tables write them.

    Parameters
    ----------
    values
        Numbers of any shape, in `unit`; what is not finite stays as it is.
    unit
        As in `RESOLUTION`.

    Returns
    -------
    ndarray
        Multiples of the resolution with the digits of `policy.FLOAT_FORMAT`, of the shape of `values`.

    Examples
    --------
    >>> rounded([1 / 3, 2.8e-14, -3e-17, 1234567.8], "mm").tolist()
    [0.333333, 0.0, 0.0, 1234570.0]
    """
    step = of_unit(unit)
    numbers = np.array(values, dtype=float)
    numbers *= 1.0 + TIE
    small = np.abs(numbers) < 1e9 * step  # of larger ones the six digits say less than the resolution
    # Adding zero turns -0.0, which would be written with its sign, into 0.0.
    numbers[small] = np.round(numbers[small] / step) * step + 0.0
    return np.array([float(policy.FLOAT_FORMAT % number) for number in numbers.flat]).reshape(numbers.shape)


def rounded_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table whose numbers are rounded, each column by the unit that its name ends with.

    Whole numbers, truth values, labels and texts stay; so do numbers among texts, but for the rounding.
    """
    columns = {}
    for position, name in enumerate(table.columns):
        column, unit = table.iloc[:, position], unit_of(str(name))
        if pd.api.types.is_float_dtype(column.dtype):
            columns[position] = pd.Series(rounded(column.to_numpy(float), unit), column.index)
        elif column.dtype == object:
            columns[position] = column.map(
                lambda cell, unit=unit: float(rounded(cell, unit)) if isinstance(cell, float) else cell
            )
        else:
            columns[position] = column
    return pd.DataFrame(columns, index=table.index).set_axis(table.columns, axis=1)
