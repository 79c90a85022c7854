"""What differs between two output folders: ``python -m soro_lib.workbook compare A B``.

Tables are compared row by row: text to the letter, numbers by `policy.same_number`. Pictures are compared by
the digest of what they draw, which every picture of ours carries.
"""

import csv
import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from soro_lib.replication import policy
from soro_lib.replication.picture import stored_digest
from soro_lib.replication.tabular import TableError, read_rows

EXCEPTION_COLUMNS = ("file", "row", "column", "reason")


@dataclass(frozen=True)
class Difference:
    """One thing that is not the same in two output folders.

    Parameters
    ----------
    file
        Path below the output folder, such as ``soft_handover/table1.csv``.
    row
        First cell of the row, or ``line 7`` where first cells repeat; empty for a whole file.
    column
        Name of the column; empty for a whole row or file.
    before, after
        What stands there in the first and in the second folder.
    """

    file: str
    row: str = ""
    column: str = ""
    before: str = ""
    after: str = ""

    def __str__(self) -> str:
        place = ", ".join(part for part in (self.file, self.row, self.column) if part)
        return f"{place}: {self.before or 'nothing'} became {self.after or 'nothing'}"


@dataclass(frozen=True)
class StatedException:
    """A difference that is wanted, with the reason; in each field ``*`` stands for anything."""

    file: str
    row: str
    column: str
    reason: str

    def covers(self, difference: Difference) -> bool:
        """Tell whether a difference is the one that is stated."""
        stated = (self.file, self.row, self.column)
        found = (difference.file, difference.row, difference.column)
        return all(
            word == other or fnmatchcase(other, word) for word, other in zip(stated, found, strict=True)
        )


def load_exceptions(path: Path) -> list[StatedException]:
    """Read the stated exceptions: a CSV file with the columns file, row, column, reason.

    Raises
    ------
    TableError
        If the file is missing or has other columns, or an exception has no file or no reason.
    """
    stated = []
    for row in read_rows(path, EXCEPTION_COLUMNS, key=None):
        if not row["file"] or not row["reason"]:
            raise TableError(f"{path}, line {row.line}: an exception needs a file and a reason")
        stated.append(StatedException(*(row[column] for column in EXCEPTION_COLUMNS)))
    return stated


def outputs(place: Path, quick: bool = False) -> Path:
    """Return the folder with one folder of outputs per notebook that is meant by a place.

    Parameters
    ----------
    place
        A checkout or a golden copy, in which ``figures`` (or, for `quick`, ``build/quick`` or ``quick``) is
        looked for, or the folder itself.

    Raises
    ------
    FileNotFoundError
        If there is no such folder or nothing in it.
    """
    inside = ("build/quick", "quick") if quick else ("figures",)
    found = next((place / name for name in inside if (place / name).is_dir()), place)
    if (found / "pyproject.toml").is_file() or not _files(found):
        raise FileNotFoundError(f"no tables or pictures in {found}; run the notebooks first")
    return found


def differences(before: Path, after: Path, exact: bool = False) -> list[Difference]:
    """Return what differs between two output folders, sorted by file.

    Parameters
    ----------
    before, after
        Folders with one folder per notebook.
    exact
        Compare numbers to the last digit, too.
    """
    old, new = _files(before), _files(after)
    found = [Difference(name, before="a file") for name in old.keys() - new.keys()]
    found += [Difference(name, after="a file") for name in new.keys() - old.keys()]
    for name in old.keys() & new.keys():
        found += _file_differences(name, old[name], new[name], exact)
    return sorted(found, key=lambda difference: difference.file)


def digests(folder: Path) -> dict[str, str]:
    """Return the digest of every table and of what every picture draws, by path below the folder."""
    return {
        name: stored_digest(path) or hashlib.sha256(path.read_bytes()).hexdigest()
        for name, path in sorted(_files(folder).items())
    }


def without(found: Iterable[Difference], stated: Sequence[StatedException]) -> list[Difference]:
    """Return the differences that no stated exception covers."""
    return [
        difference for difference in found if not any(exception.covers(difference) for exception in stated)
    ]


def _files(folder: Path) -> dict[str, Path]:
    """Return what the notebooks have written, by path below the folder."""
    return {
        f"{path.parent.name}/{path.name}": path
        for path in folder.glob("*/*")
        if path.suffix in {".csv", ".png"} and path.is_file()
    }


def _file_differences(name: str, before: Path, after: Path, exact: bool) -> list[Difference]:
    if before.read_bytes() == after.read_bytes():
        return []
    if name.endswith(".csv"):
        return _table_differences(name, _table(before), _table(after), exact)
    old, new = stored_digest(before), stored_digest(after)
    if old is not None and old == new:
        return []
    return [Difference(name, before="a picture", after="another one")]


def _table(path: Path) -> list[list[str]]:
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.reader(file))
    except UnicodeDecodeError as error:
        raise TableError(f"{path}: not UTF-8 at byte {error.start}") from None
    for line, row in enumerate(rows, start=1):
        if len(row) != len(rows[0]):
            raise TableError(f"{path}, line {line}: {len(row)} cells, the header has {len(rows[0])}")
    return rows


def _table_differences(
    name: str, before: list[list[str]], after: list[list[str]], exact: bool
) -> list[Difference]:
    """Compare two tables row by row; where rows are missing or new, name those alone."""
    header = before[0] if before else []
    if not before or not after or after[0] != header:
        return [Difference(name, "header", "", ",".join(header), ",".join(after[0] if after else []))]
    old, new = before[1:], after[1:]
    if len(old) != len(new):
        return _missing_rows(name, old, new)
    labels = _labels(old)
    return [
        Difference(name, label, column, one, other)
        for label, *rows in zip(labels, old, new, strict=True)
        for column, one, other in zip(header, *rows, strict=True)
        if one != other and (exact or not _same_number(one, other))
    ]


def _missing_rows(name: str, before: list[list[str]], after: list[list[str]]) -> list[Difference]:
    """Return the rows that only one of two tables has; a row is known by as few first cells as tell apart."""
    widths = range(1, len(before[0] if before else after[0]) + 1)
    width = next(
        (width for width in widths if all(_distinct(rows, width) for rows in (before, after))), len(widths)
    )
    old, new = ({tuple(row[:width]): row for row in rows} for rows in (before, after))
    lost = [Difference(name, ", ".join(key), before=",".join(old[key])) for key in old if key not in new]
    gained = [Difference(name, ", ".join(key), after=",".join(new[key])) for key in new if key not in old]
    count = Difference(name, "number of rows", "", str(len(before)), str(len(after)))
    return [count, *lost, *gained]


def _distinct(rows: list[list[str]], width: int) -> bool:
    return len({tuple(row[:width]) for row in rows}) == len(rows)


def _labels(rows: list[list[str]]) -> list[str]:
    """Return what a row is called: its first cell where that tells rows apart, else its line."""
    if _distinct(rows, 1):
        return [row[0] if row else "" for row in rows]
    return [f"line {line}" for line in range(2, len(rows) + 2)]


def _same_number(one: str, other: str) -> bool:
    try:
        return policy.same_number(float(one), float(other))
    except ValueError:
        return False
