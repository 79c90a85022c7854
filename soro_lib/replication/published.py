"""The published numbers of a paper, read from ``data/<slug>/published.csv`` and checked.

Only the scorecard and a paper's declared calibration may import this module.
"""

import math
from dataclasses import dataclass
from pathlib import Path

from soro_lib.project import data_directory
from soro_lib.replication.tabular import Row, raise_all, read_rows, shown, suggestion

COLUMNS = ("id", "location", "quantity", "value", "unit", "kind", "role", "tolerance", "note")
"""The header of ``published.csv``."""

KINDS = ("definition", "arithmetic", "simulated", "ordering", "hardware")
"""What a published number rests on."""

ROLES = ("calibration", "prediction")
"""Whether a simulated plant was fitted to the number."""

UNITS = frozenset(
    """
    - % count probability ratio dB bit bytes MB
    samples steps iterations seeds points trials items turns px pixels px/mm mm/px mm/frame mm/axis mm/step
    m mm cm um nm pm m^2 mm^2 m^3 1/m 1/mm
    rad deg rad/m deg/m m/rad mm/rad mm/deg deg/mm
    s ms us ns min h Hz kHz MHz fps rpm 1/s
    m/s mm/s cm/s rad/s deg/s m/s^2 mm/s^2 rad/s^2 deg/s^2
    N mN N/m N/mm N/rad N/deg N/s Ns/m Nm Nmm Nm/rad Nmm/rad Nm/deg Nmm/deg Nms/rad
    Pa kPa MPa GPa bar kPa/s
    g kg g/m kg/m kg/m^2 kg/m^3 J mJ W V mV A mA K degC
    strain microstrain nm/microstrain pm/microstrain
    """.split()  # noqa: SIM905 (reads better in columns of kind)
)
"""Every unit a published number may carry; ``-`` is a pure number."""


@dataclass(frozen=True)
class PublishedNumber:
    """One printed number or claim.

    Attributes
    ----------
    id, location, quantity
        Its short name, where in the paper it stands, what it measures.
    value, tolerance
        In `unit`; the tolerance is absolute (a percentage is already resolved), NaN for ``hardware`` rows
        without one.
    unit, kind, role
        One of `UNITS`, `KINDS`, `ROLES`.
    note
        Remarks; the reason where the row is not attempted.
    """

    id: str
    location: str
    quantity: str
    value: float
    unit: str
    kind: str
    role: str
    tolerance: float
    note: str


def load_published(slug: str) -> dict[str, PublishedNumber]:
    """Load the published numbers of one paper, keyed by id, in file order.

    Raises
    ------
    TableError
        As `read_published`.
    """
    return read_published(data_directory(slug) / "published.csv")


def read_published(path: Path) -> dict[str, PublishedNumber]:
    """Read and check one ``published.csv``.

    Raises
    ------
    TableError
        If anything is wrong: every problem with its file, line, column, value and what is allowed.
    """
    problems: list[str] = []
    numbers: dict[str, PublishedNumber] = {}
    for row in read_rows(path, COLUMNS, key="id"):
        found = _problems(row)
        problems += [f"{shown(path)}, line {row.line}, column {column}: {what}" for column, what in found]
        if not found:
            numbers[row["id"]] = _number(row)
    raise_all(problems)
    return numbers


def parse_tolerance(text: str, value: float) -> float:
    """Return the absolute tolerance written as a number in the row's unit, or as a percentage of the value.

    Raises
    ------
    ValueError
        If it is neither, negative, infinite, or a percentage of zero.

    Examples
    --------
    >>> parse_tolerance("10%", -4.0)
    0.4
    """
    percentage = text.endswith("%")
    tolerance = float(text.removesuffix("%"))
    if percentage and value == 0:
        raise ValueError("a percentage of 0 is no tolerance")
    if not math.isfinite(tolerance) or tolerance < 0:
        raise ValueError("must be finite and >= 0")
    return tolerance / 100.0 * abs(value) if percentage else tolerance


def _number(row: Row) -> PublishedNumber:
    value = float(row["value"])
    tolerance = parse_tolerance(row["tolerance"], value) if row["tolerance"] else math.nan
    return PublishedNumber(**{**row.cells, "value": value, "tolerance": tolerance})  # type: ignore[arg-type]


def _problems(row: Row) -> list[tuple[str, str]]:
    """Return (column, what is wrong and what is allowed) for every bad cell of one row."""
    problems = [(column, "missing") for column in ("location", "quantity", "value") if not row[column]]
    for column, allowed in (("unit", UNITS), ("kind", KINDS), ("role", ROLES)):
        if row[column] not in allowed:
            words = ", ".join(sorted(allowed) if column == "unit" else allowed)
            hint = suggestion(row[column], allowed)
            problems.append((column, f"{row[column]!r} is not allowed{hint}; allowed: {words}"))
    problems += _value_problems(row) + _tolerance_problems(row)
    if row["kind"] == "hardware" and not row["note"]:
        problems.append(("note", "missing; a hardware row says here why it cannot be had"))
    return problems


def _value_problems(row: Row) -> list[tuple[str, str]]:
    if not row["value"]:
        return []
    if not _is_finite_number(row["value"]):
        return [("value", f"{row['value']!r} is not a finite number")]
    if row["kind"] == "ordering" and float(row["value"]) != 1.0:
        return [("value", f"{row['value']!r}; an ordering row is 1, the probability that the claim holds")]
    return []


def _tolerance_problems(row: Row) -> list[tuple[str, str]]:
    allowed = "allowed: a number >= 0 in the row's unit, or a percentage of the value such as 10%"
    if not row["tolerance"]:
        return [] if row["kind"] == "hardware" else [("tolerance", f"missing; {allowed}")]
    value = float(row["value"]) if _is_finite_number(row["value"]) else 1.0
    try:
        parse_tolerance(row["tolerance"], value)
    except ValueError as error:
        return [("tolerance", f"{row['tolerance']!r}: {error}; {allowed}")]
    return []


def _is_finite_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
