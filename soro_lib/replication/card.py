"""The replication card at the head of every notebook: paper, what is covered, what is not and why."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

from soro_lib.project import data_directory
from soro_lib.replication.tabular import TableError, shown


@dataclass(frozen=True)
class ReplicationCard:
    """What a notebook replicates.

    Attributes
    ----------
    number
        That of the notebook.
    title, authors, citation, doi
        The paper; `doi` is empty where unknown.
    covered
        What is replicated.
    not_covered
        Pairs of what is not, and why.
    """

    number: int
    title: str
    authors: tuple[str, ...]
    citation: str
    covered: tuple[str, ...]
    not_covered: tuple[tuple[str, str], ...]
    doi: str = ""


def load_card(slug: str) -> ReplicationCard:
    """Load ``data/<slug>/card.toml``.

    Raises
    ------
    TableError
        If the file is missing, no TOML, or a field is missing, unknown or of the wrong type.
    """
    return read_card(data_directory(slug) / "card.toml")


def read_card(path: Path) -> ReplicationCard:
    """Read and check one replication card.

    Raises
    ------
    TableError
        As `load_card`.
    """
    try:
        fields = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise TableError(f"{shown(path)}: no such file") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise TableError(f"{shown(path)}: not valid TOML: {error}") from None
    authors = fields.get("authors")
    fields["authors"] = [authors] if isinstance(authors, str) else authors
    needed, allowed = {"number", "title", "authors", "citation", "covered", "not_covered"}, {"doi"}
    problems = [f"{shown(path)}, field {name}: missing" for name in sorted(needed) if not fields.get(name)]
    problems += [f"{shown(path)}, field {name}: unknown" for name in sorted(fields.keys() - needed - allowed)]
    problems += [
        f"{shown(path)}, field {name}: must be text"
        for name in ("title", "citation", "doi")
        if not isinstance(fields.get(name, ""), str)
    ]
    problems += [
        f"{shown(path)}, field {name}: must be a list of texts"
        for name in ("authors", "covered")
        if not (isinstance(fields.get(name), list) and all(isinstance(item, str) for item in fields[name]))
    ]
    if fields.get("number") and type(fields["number"]) is not int:
        problems.append(f"{shown(path)}, field number: must be a whole number")
    pairs = fields.get("not_covered")
    if not (isinstance(pairs, list) and all(_is_pair(pair) for pair in pairs)):
        problems.append(f"{shown(path)}, field not_covered: must be a list of [what, why]")
    if problems:
        raise TableError("\n".join(problems))
    return ReplicationCard(
        number=fields["number"],
        title=fields["title"],
        authors=tuple(fields["authors"]),
        citation=fields["citation"],
        covered=tuple(fields["covered"]),
        not_covered=tuple((what, why) for what, why in fields["not_covered"]),
        doi=fields.get("doi", ""),
    )


def _is_pair(pair: object) -> bool:
    return isinstance(pair, list) and len(pair) == 2 and all(isinstance(text, str) and text for text in pair)
