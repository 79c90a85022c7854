"""Data cards: beside every ``<file>`` lies ``<file>.card.toml``, which says what it is and proves it whole.

A card holds a description, the meaning and unit of every column, the generator and seed (or the source) and
the SHA-256 of the file: a file that was changed without its card is noticed before anything is built on it.
"""

import argparse
import hashlib
import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any


class DataCardError(ValueError):
    """A data file and its card do not agree; the message says which file, what differs and how to mend it."""


def generator_options(description: str, output: Path) -> argparse.ArgumentParser:
    """Return the command line that every generator of data takes: where to write, and whether a small form.

    The small form goes through all of the code in little time; a comparison of its bytes before and after a
    change says whether the generator still does the same.

    Parameters
    ----------
    description
        What the generator makes.
    output
        The folder that it writes to if nothing else is asked for.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--output", type=Path, default=output, metavar="DIR", help="folder to write to")
    parser.add_argument("--small", action="store_true", help="all of the code, little of the data")
    return parser


def card_path(path: Path) -> Path:
    """Return where the card of a data file lies."""
    return path.with_name(path.name + ".card.toml")


def write_card(
    path: Path,
    *,
    description: str,
    columns: Mapping[str, str],
    generator: str,
    seed: int | None,
    licence: str = "BSD-3-Clause",
) -> Path:
    """Write the card of a data file as it is now.

    Parameters
    ----------
    path
        The data file.
    description
        What it holds, in a sentence.
    columns
        Meaning of every column or array, each beginning with its unit: ``{"time": "[s] since start"}``.
    generator
        What made it: dotted path of the function, or the source of a recording.
    seed
        Seed of the generator; None where chance played no part.
    licence
        SPDX identifier of the file's licence.

    Returns
    -------
    pathlib.Path
        The card.

    Raises
    ------
    DataCardError
        If the file is missing or a column states no unit.
    """
    without_unit = [
        name for name, meaning in columns.items() if not meaning.startswith("[") or "]" not in meaning
    ]
    if without_unit:
        raise DataCardError(
            f"{path}: columns {', '.join(without_unit)} do not begin with a unit such as [mm] or [-]"
        )
    lines = [
        f"description = {_quote(description)}",
        f"generator = {_quote(generator)}",
        *([] if seed is None else [f"seed = {int(seed)}"]),
        f"licence = {_quote(licence)}",
        f"sha256 = {_quote(_digest(path))}",
        "",
        "[columns]",
        *(f"{_quote(name)} = {_quote(meaning)}" for name, meaning in columns.items()),
    ]
    card = card_path(path)
    card.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return card


def read_card(path: Path) -> dict[str, Any]:
    """Return the card of a data file without looking at the file.

    Raises
    ------
    DataCardError
        If the card is missing, no TOML or lacks a field.
    """
    card = card_path(path)
    try:
        fields = tomllib.loads(card.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DataCardError(
            f"{card}: no such card; write it with soro_lib.replication.datacards.write_card"
        ) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise DataCardError(f"{card}: not valid TOML: {error}") from None
    missing = sorted({"description", "generator", "licence", "sha256", "columns"} - fields.keys())
    if missing:
        raise DataCardError(f"{card}: lacks {', '.join(missing)}")
    return fields


def verified(path: Path) -> Path:
    """Return the path of a data file after checking it against its card.

    Raises
    ------
    DataCardError
        If file or card is missing, or the file is not the one its card describes.

    Examples
    --------
    ``pandas.read_csv(verified(data_directory(slug) / "trials.csv.gz"))``
    """
    expected = read_card(path)["sha256"]
    found = _digest(path)
    if found != expected:
        raise DataCardError(
            f"{path}: SHA-256 {found[:12]}... but its card says {str(expected)[:12]}...; the file was "
            "changed without its card: restore the file, or run its generator again, which writes both"
        )
    return path


def _digest(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except FileNotFoundError:
        raise DataCardError(f"{path}: no such data file, though its card may exist") from None


def _quote(text: str) -> str:
    """Return a TOML basic string; JSON escapes the same characters."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
