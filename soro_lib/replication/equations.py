"""The equation index and the errata of a paper: which function is which equation, and which test holds it."""

import ast
import re
from collections.abc import Callable
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import pandas as pd

from soro_lib.project import ROOT, data_directory
from soro_lib.replication.tabular import raise_all, read_rows, shown

EQUATION_COLUMNS = ("equation", "title", "function", "test", "erratum")
"""The header of ``equations.csv``; ``function`` and ``test`` may name several, separated by semicolons."""

ERRATA_COLUMNS = ("id", "location", "printed", "corrected", "proof", "test")
"""The header of ``errata.csv``."""


def load_equations(slug: str) -> pd.DataFrame:
    """Load ``data/<slug>/equations.csv``: every numbered equation and algorithm of the paper.

    Raises
    ------
    TableError
        If the file is malformed, or an equation has no title, function or test.
    """
    return _load(data_directory(slug) / "equations.csv", EQUATION_COLUMNS, optional=("erratum",))


def load_errata(slug: str) -> pd.DataFrame:
    """Load ``data/<slug>/errata.csv``: what the paper prints, what is right, and the proof.

    Raises
    ------
    TableError
        If the file is malformed or a cell is empty.
    """
    return _load(data_directory(slug) / "errata.csv", ERRATA_COLUMNS, optional=())


def _load(path: Path, columns: tuple[str, ...], optional: tuple[str, ...]) -> pd.DataFrame:
    rows = read_rows(path, columns, key=columns[0])
    raise_all(
        [
            f"{shown(path)}, line {row.line}, column {column}: missing"
            for row in rows
            for column in columns
            if not row[column] and column not in optional
        ]
    )
    return pd.DataFrame([row.cells for row in rows], columns=list(columns))


def index_problems(slug: str) -> list[str]:
    """Return what is wrong with the indices of one paper; nothing where both are complete.

    Every function must exist in `soro_lib`, every test in ``tests/``, every erratum of an
    equation in ``errata.csv``.
    """
    equations, errata = load_equations(slug), load_errata(slug)
    problems = []
    for name, row in equations.set_index("equation").iterrows():
        where = f"data/{slug}/equations.csv, {name}"
        problems += _missing(where, row["function"], find_function) + _missing(where, row["test"], find_test)
        problems += [
            f"{where}: erratum {erratum!r} is not in data/{slug}/errata.csv"
            for erratum in _split(row["erratum"])
            if erratum not in set(errata["id"])
        ]
    for name, row in errata.set_index("id").iterrows():
        problems += _missing(f"data/{slug}/errata.csv, {name}", row["test"], find_test)
    return problems


def find_function(dotted_path: str) -> Any:
    """Return the function, class or method of `soro_lib` with this dotted path.

    Raises
    ------
    LookupError
        If it does not exist or lies outside `soro_lib`.
    """
    if not re.fullmatch(r"soro_lib(\.\w+)+", dotted_path):
        raise LookupError(f"function {dotted_path!r} must begin with soro_lib")
    try:
        found = resolve_name(dotted_path)
    except (ImportError, AttributeError) as error:
        raise LookupError(f"function {dotted_path!r}: {error}") from None
    if not callable(found):
        raise LookupError(f"function {dotted_path!r} cannot be called")
    return found


def find_test(node: str) -> None:
    """Check that a test ``tests/path.py::[Class::]name`` exists, by reading the file, without importing it.

    Raises
    ------
    LookupError
        If the file, class or function does not exist.
    """
    file, *names = node.split("::")
    path = ROOT / file
    if not names or not path.is_file():
        raise LookupError(
            f"test {node!r}: " + (f"no file {file}" if names else "expected tests/file.py::test_name")
        )
    scope: list[ast.stmt] = ast.parse(path.read_text(encoding="utf-8")).body
    for name in names:
        match = [
            item for item in scope if isinstance(item, ast.FunctionDef | ast.ClassDef) and item.name == name
        ]
        if not match:
            raise LookupError(f"test {node!r}: no {name!r} in {file}")
        scope = match[0].body
    if not names[-1].startswith("test"):
        raise LookupError(f"test {node!r}: pytest collects only names that begin with test")


def _split(cell: str) -> list[str]:
    return [part.strip() for part in cell.split(";") if part.strip()]


def _missing(where: str, cell: str, find: Callable[[str], object]) -> list[str]:
    problems = []
    for name in _split(cell):
        try:
            find(name)
        except LookupError as error:
            problems.append(f"{where}: {error.args[0]}")
    return problems
