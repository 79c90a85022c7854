"""Reading the hand-written CSV tables under ``data/`` with errors that say file, line, column and bound."""

import csv
import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from soro_lib.project import ROOT


class TableError(ValueError):
    """A hand-written table is wrong; the message names file, line, column, value and what is allowed."""


@dataclass(frozen=True)
class Row:
    """One record of a table: the line it ends on (counted from 1) and its cells by column name, stripped."""

    line: int
    cells: dict[str, str]

    def __getitem__(self, column: str) -> str:
        return self.cells[column]


def shown(path: Path) -> str:
    """Return the path as seen from the project folder, where it lies inside."""
    return str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else str(path)


def suggestion(word: str, vocabulary: Iterable[str]) -> str:
    """Return ``" (did you mean 'x' or 'y'?)"``, or nothing where no word of the vocabulary is close."""
    spelling = {item.lower(): item for item in vocabulary}
    close = [spelling[item] for item in difflib.get_close_matches(word.lower(), list(spelling))]
    return f" (did you mean {' or '.join(map(repr, close))}?)" if close else ""


def read_rows(path: Path, columns: Sequence[str], key: str | None) -> list[Row]:
    """Read a UTF-8 CSV file with exactly the given header; a byte-order mark is skipped, blank lines too.

    Parameters
    ----------
    path
        The file.
    columns
        The header, in order.
    key
        The column whose cells must be filled and unique, None if there is none.

    Returns
    -------
    list of Row
        One per record.

    Raises
    ------
    TableError
        If the file is missing, not UTF-8 or empty, has another header, or a record is ragged or its key is
        missing or repeated.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise TableError(
            f"{shown(path)}: no such file; expected a CSV with columns {','.join(columns)}"
        ) from None
    except UnicodeDecodeError as error:
        raise TableError(f"{shown(path)}: not UTF-8 at byte {error.start}; save the file as UTF-8") from None
    reader = csv.reader(text.splitlines(keepends=True), strict=True)
    try:
        records = [(reader.line_num, record) for record in reader if any(cell.strip() for cell in record)]
    except csv.Error as error:
        raise TableError(f"{shown(path)}, line {reader.line_num}: {error}") from None
    if not records:
        raise TableError(f"{shown(path)}: empty; expected the header {','.join(columns)}")
    header = [cell.strip() for cell in records[0][1]]
    if header != list(columns):
        raise TableError(f"{shown(path)}, line 1: header {','.join(header)}, expected {','.join(columns)}")
    problems: list[str] = []
    rows: list[Row] = []
    first_line: dict[str, int] = {}
    for line, record in records[1:]:
        if len(record) != len(columns):
            problems.append(f"{shown(path)}, line {line}: {len(record)} cells, expected {len(columns)}")
            continue
        row = Row(line, dict(zip(columns, (cell.strip() for cell in record), strict=True)))
        name = str(line) if key is None else row[key]
        if not name:
            problems.append(f"{shown(path)}, line {line}, column {key}: missing, every row needs one")
        elif name in first_line:
            where = f"{shown(path)}, line {line}, column {key}"
            problems.append(f"{where}: {name!r} is already on line {first_line[name]}")
        first_line.setdefault(name, line)
        rows.append(row)
    raise_all(problems)
    return rows


def raise_all(problems: Sequence[str]) -> None:
    """Raise one `TableError` that lists every problem; do nothing where there is none."""
    if problems:
        raise TableError("\n".join(problems))
