"""Executed notebooks as web pages, with an index."""

from collections.abc import Mapping
from html import escape
from pathlib import Path

from soro_lib.workbook.display import VERDICTS
from soro_lib.workbook.notebooks import Notebook
from soro_lib.workbook.runner import Places
from soro_lib.workbook.staleness import Record

INDEX = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>soro-workbook</title>
<style>
body {{ font-family: sans-serif; max-width: 60em; margin: 3em auto; padding: 0 1em; }}
table {{ border-collapse: collapse; }}
td, th {{ padding: 0.4em 0.9em; border-bottom: 1px solid #ddd; text-align: right; }}
td:first-child, th:first-child {{ text-align: left; }}
</style>
<h1>soro-workbook</h1>
<table>
<tr><th>notebook</th><th>seconds</th>{headings}</tr>
{rows}
</table>
</html>
"""


def export(notebooks: Mapping[str, Notebook], places: Places) -> Path:
    """Write every executed notebook as HTML beside an index page, and return the index.

    Raises
    ------
    FileNotFoundError
        If no notebook has been executed yet.
    """
    folder = places.build / "html"
    rows = [
        _export_one(notebook, places, folder)
        for notebook in notebooks.values()
        if _executed(notebook, places).is_file()
    ]
    if not rows:
        raise FileNotFoundError(f"no executed notebook in {places.build / 'notebooks'}; run them first")
    headings = "".join(f"<th>{verdict}</th>" for verdict in VERDICTS)
    index = folder / "index.html"
    index.write_text(INDEX.format(headings=headings, rows="\n".join(rows)), encoding="utf-8")
    return index


def _executed(notebook: Notebook, places: Places) -> Path:
    return places.build / "notebooks" / notebook.path.name


def _export_one(notebook: Notebook, places: Places, folder: Path) -> str:
    """Write one page and return its row of the index."""
    from nbconvert import HTMLExporter  # half a second to import

    page = folder / f"{notebook.path.stem}.html"
    body, _ = HTMLExporter().from_filename(str(_executed(notebook, places)))
    page.parent.mkdir(parents=True, exist_ok=True)
    page.write_text(body, encoding="utf-8")
    record = Record.load(places.record(notebook.slug))
    seconds = f"{record.seconds:.0f}" if record else ""
    counts = [str(record.verdicts.get(verdict, "")) if record else "" for verdict in VERDICTS]
    link = f'<a href="{page.name}">{escape(notebook.title)}</a>'
    return f"<tr><td>{'</td><td>'.join([link, seconds, *counts])}</td></tr>"
