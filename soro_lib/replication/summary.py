"""All scorecards together: for the overview notebook and for the README."""

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from soro_lib.project import figures_directory, slugs
from soro_lib.replication import markup
from soro_lib.replication.scorecard import COLUMNS, VERDICTS
from soro_lib.replication.tabular import TableError, shown

README_BEGIN = "<!-- scorecard: begin (written by python -m soro_lib.workbook.check --update-readme) -->"
README_END = "<!-- scorecard: end -->"


def read_scorecard(path: Path) -> pd.DataFrame:
    """Read a ``scorecard.csv`` that a notebook wrote.

    Raises
    ------
    TableError
        If the file is not a scorecard.
    """
    try:
        scorecard = pd.read_csv(path, keep_default_na=False, na_values={name: [""] for name in _NUMERIC})
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeDecodeError) as error:
        raise TableError(f"{shown(path)}: no scorecard: {error}; run its notebook again") from None
    if list(scorecard.columns) != COLUMNS:
        raise TableError(
            f"{shown(path)}: columns {','.join(scorecard.columns)}, expected {','.join(COLUMNS)}"
        )
    return scorecard.astype({name: float for name in _NUMERIC if name != "seeds"} | {"seeds": "Int64"})


_NUMERIC = ("published", "ours", "low", "high", "seeds", "tolerance")


def load_scorecards(figures: Path | None = None) -> dict[str, pd.DataFrame]:
    """Load the scorecard of every paper that has been run, by slug, in the order of the papers.

    Parameters
    ----------
    figures
        Folder with one folder per slug; by default what the current run has written, else what is committed.
    """
    folders = {slug: figures_directory(slug) if figures is None else figures / slug for slug in slugs()}
    paths = {slug: folder / "scorecard.csv" for slug, folder in folders.items()}
    return {slug: read_scorecard(path) for slug, path in paths.items() if path.is_file()}


def verdict_counts(scorecards: Mapping[str, pd.DataFrame], by: str | None = None) -> pd.DataFrame:
    """Count verdicts per paper.

    Parameters
    ----------
    scorecards
        Scorecards by slug.
    by
        None counts all rows of a paper together; a column name (``kind``, ``role``) splits them.

    Returns
    -------
    pandas.DataFrame
        Columns ``paper``, `by`, one per verdict and ``rows``, the total [count].
    """
    index = ["paper"] if by is None else ["paper", by]
    cards = [card.assign(paper=slug) for slug, card in scorecards.items()]
    if not cards:
        return pd.DataFrame(columns=[*index, *VERDICTS, "rows"])
    counts = pd.concat(cards).groupby([*index, "verdict"], sort=False).size().unstack(fill_value=0)
    counts = counts.reindex(columns=list(VERDICTS), fill_value=0)
    counts.columns.name = None
    return counts.assign(rows=counts.sum(axis=1)).reset_index()


def readme_block(scorecards: Mapping[str, pd.DataFrame]) -> str:
    """Return the merged scorecard as the README shows it: counts, then every row, folded per paper."""
    counts = verdict_counts(scorecards)
    by_kind = (
        verdict_counts(scorecards, "kind").groupby("kind", sort=False).sum(numeric_only=True).reset_index()
    )
    parts = [README_BEGIN, _counts_markdown(counts), _counts_markdown(by_kind)]
    for slug, scorecard in scorecards.items():
        summary = f"<details><summary>{slug}: every row</summary>"
        parts.append("\n\n".join([summary, markup.scorecard_markdown(scorecard), "</details>"]))
    return "\n\n".join([*parts, README_END])


def _counts_markdown(counts: pd.DataFrame) -> str:
    cells = [[str(value) for value in record] for record in counts.itertuples(index=False, name=None)]
    return markup.markdown_table([str(name) for name in counts.columns], cells)


def split_readme(text: str) -> tuple[str, str, str]:
    """Return what stands before, between (markers included) and after the two markers of the README.

    Raises
    ------
    ValueError
        If the markers are not there exactly once and in order.
    """
    if text.count(README_BEGIN) != 1 or text.count(README_END) != 1:
        raise ValueError(f"README.md must hold each marker exactly once: {README_BEGIN} and {README_END}")
    before, rest = text.split(README_BEGIN)
    if README_END not in rest:
        raise ValueError(f"README.md: {README_END} stands before {README_BEGIN}")
    block, after = rest.split(README_END)
    return before, README_BEGIN + block + README_END, after
