"""Scorecards, indices and cards as HTML for notebooks and as Markdown for the README."""

import html
import math
import re
from collections.abc import Sequence

import pandas as pd

from soro_lib.replication.card import ReplicationCard

VERDICT_COLORS = {
    "reproduced": "#0a7f5a",
    "close": "#3b7ea1",
    "differs": "#c2571a",
    "calibrated": "#5b6b8c",
    "not attempted": "#808080",
}
"""Background of each verdict's badge."""

_STYLE = """<style>
.soro-table {border-collapse: collapse; font-size: 0.86em; width: 100%}
.soro-table th, .soro-table td {text-align: left; vertical-align: top; padding: 4px 8px}
.soro-table th {border-bottom: 1.5px solid currentColor; white-space: nowrap}
.soro-table td {border-bottom: 1px solid rgba(128,128,128,.25)}
.soro-table td:first-child {min-width: 4.5em}
.soro-table code {white-space: normal}
.soro-table td.number {text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap}
.soro-badge {color: white; border-radius: 3px; padding: 1px 7px; white-space: nowrap; font-size: 0.92em}
.soro-card {border-left: 4px solid #0072B2; padding: 2px 0 2px 16px; margin: 4px 0 12px 0}
.soro-card ul {margin: 2px 0 8px 0}
</style>"""


def number_text(value: float, digits: int = 4) -> str:
    """Return a number as tables show it: four significant digits, empty for NaN.

    Examples
    --------
    >>> number_text(0.0012345), number_text(84.0), number_text(float("nan"))
    ('0.001234', '84', '')
    """
    return "" if math.isnan(value) else f"{value:.{digits}g}"


def interval_text(low: float, high: float) -> str:
    """Return ``[low, high]``, or nothing where there is no interval."""
    return "" if math.isnan(low) or math.isnan(high) else f"[{number_text(low)}, {number_text(high)}]"


def _badge(verdict: str) -> str:
    color = VERDICT_COLORS[verdict]
    return f'<span class="soro-badge" style="background:{color}">{html.escape(verdict)}</span>'


def html_table(header: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int] = ()) -> str:
    """Return an HTML table of cells that are HTML already; the columns in `numbers` are set flush right."""
    head = "".join(f"<th>{html.escape(name)}</th>" for name in header)
    body = "".join(
        "<tr>"
        + "".join(
            f'<td class="number">{cell}</td>' if index in numbers else f"<td>{cell}</td>"
            for index, cell in enumerate(row)
        )
        + "</tr>"
        for row in rows
    )
    return f'{_STYLE}<table class="soro-table"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table; a pipe inside a cell is escaped, a line break becomes a space."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(_markdown_cell(cell) for cell in line) + " |" for line in lines)


def _markdown_cell(cell: str) -> str:
    return " ".join(cell.split()).replace("|", "\\|")


SCORECARD_HEADER = (
    *("where", "quantity", "kind", "unit", "published", "ours", "95 % interval", "seeds"),
    *("verdict", "why"),
)
"""The columns of a scorecard as shown; the CSV holds more."""


VERDICT_COLUMN = SCORECARD_HEADER.index("verdict")


def scorecard_cells(scorecard: pd.DataFrame) -> list[list[str]]:
    """Return the shown cells of a scorecard, as plain text, in the order of `SCORECARD_HEADER`."""
    return [
        [
            row["location"],
            row["quantity"],
            row["kind"],
            row["unit"],
            number_text(row["published"]),
            number_text(row["ours"]),
            interval_text(row["low"], row["high"]),
            "" if pd.isna(row["seeds"]) else str(int(row["seeds"])),
            row["verdict"],
            "" if pd.isna(row["reason"]) else row["reason"],
        ]
        for _, row in scorecard.iterrows()
    ]


def scorecard_html(scorecard: pd.DataFrame) -> str:
    """Return a scorecard as an HTML table, the verdicts as coloured badges."""
    rows = [[html.escape(cell) for cell in cells] for cells in scorecard_cells(scorecard)]
    for cells in rows:
        cells[VERDICT_COLUMN] = _badge(cells[VERDICT_COLUMN])
    return html_table(SCORECARD_HEADER, rows, numbers=(4, 5, 6, 7))


def scorecard_markdown(scorecard: pd.DataFrame) -> str:
    """Return a scorecard as a Markdown table."""
    return markdown_table(SCORECARD_HEADER, scorecard_cells(scorecard))


def frame_html(frame: pd.DataFrame, code: Sequence[str] = ()) -> str:
    """Return a table of any columns as HTML: numbers flush right, the columns in `code` in typewriter."""
    numeric = [
        index for index, name in enumerate(frame.columns) if pd.api.types.is_numeric_dtype(frame[name])
    ]
    rows = [
        [
            _code(str(value)) if name in code else _cell(value)
            for name, value in zip(frame.columns, record, strict=True)
        ]
        for record in frame.itertuples(index=False, name=None)
    ]
    return html_table([str(name) for name in frame.columns], rows, numbers=numeric)


def _code(path: str) -> str:
    """Return a dotted path or test name in typewriter that may break after any of its separators."""
    breakable = re.sub(r"([._/:]+)", r"\1<wbr>", html.escape(path))
    return f"<code>{breakable}</code>"


def _cell(value: object) -> str:
    if isinstance(value, bool | str):
        return html.escape(str(value))
    if value is None or value is pd.NA:
        return ""
    if isinstance(value, float):
        return number_text(value)
    return html.escape(str(value))


def card_html(card: ReplicationCard) -> str:
    """Return a replication card as HTML."""
    doi = (
        f' <a href="https://doi.org/{html.escape(card.doi)}">doi:{html.escape(card.doi)}</a>'
        if card.doi
        else ""
    )
    covered = "".join(f"<li>{html.escape(item)}</li>" for item in card.covered)
    missing = "".join(
        f"<li>{html.escape(what)}: <em>{html.escape(why)}</em></li>" for what, why in card.not_covered
    )
    return (
        f'{_STYLE}<div class="soro-card"><strong>{html.escape(card.title)}</strong><br>'
        f"{html.escape(', '.join(card.authors))}<br><small>{html.escape(card.citation)}{doi}</small>"
        f"<p><strong>Replicated here</strong></p><ul>{covered}</ul>"
        f"<p><strong>Not replicated, and why</strong></p><ul>{missing}</ul></div>"
    )
