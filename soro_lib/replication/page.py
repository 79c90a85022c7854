"""The page a notebook writes: every figure and table is saved under the paper's name for it, and shown."""

import os
import re
from collections.abc import Mapping
from pathlib import Path

import pandas as pd
from IPython.display import HTML, Image, display
from matplotlib.figure import Figure

from soro_lib.project import figures_directory, output_directory
from soro_lib.replication import markup, policy, resolution
from soro_lib.replication.card import load_card
from soro_lib.replication.equations import load_equations, load_errata
from soro_lib.replication.findings import Finding
from soro_lib.replication.picture import stored_digest
from soro_lib.replication.recording import Recording
from soro_lib.replication.scorecard import build_scorecard

SHOWN_DPI = 110
"""Size at which a notebook shows a figure [CSS pixels per inch]; the file has `policy.DPI`."""


def as_image(figure: Figure, finished: Path | None = None) -> Image:
    """Return a figure as the PNG that notebooks show; the same figure gives the same bytes.

    Parameters
    ----------
    figure
        What to draw.
    finished
        Where an earlier run may have left this picture. If what it shows differs in nothing but the last bits
        of coordinates, its bytes are taken and nothing is drawn.
    """
    quick = os.environ.get("SORO_QUICK") == "1"
    recording = Recording.of(figure, policy.QUICK_DPI if quick else policy.DPI)
    if finished is not None and stored_digest(finished) == recording.digest:
        data = finished.read_bytes()
    else:
        data = recording.png()
    return Image(data=data, format="png", width=round(SHOWN_DPI * figure.get_size_inches()[0]))


class Page:
    """The page of one paper.

    Parameters
    ----------
    slug
        The paper, as in ``data/<slug>`` and ``figures/<slug>``.
    directory
        Where figures and tables are written; by default `soro_lib.project.output_directory`.

    Examples
    --------
    A notebook begins with ``page = Page("gesture_steering"); page.card()`` and ends with
    ``page.equations(); page.scorecard(findings); page.errata()``.
    """

    def __init__(self, slug: str, directory: Path | None = None) -> None:
        self.slug = slug
        self.directory = output_directory(slug) if directory is None else directory

    def card(self) -> None:
        """Show the replication card."""
        display(HTML(markup.card_html(load_card(self.slug))))

    def figure(self, figure: Figure, name: str) -> None:
        """Save a figure as ``<name>.png`` and show it; an unchanged one keeps the bytes of its last run.

        Raises
        ------
        ValueError
            If `name` has other characters than lower-case letters, digits and underscores.
        """
        path = self._path(name, "png")
        image = as_image(figure, figures_directory(self.slug) / path.name)
        partial = path.with_suffix(".png.partial")
        partial.write_bytes(image.data)
        os.replace(partial, path)
        display(image)

    def table(self, table: pd.DataFrame, name: str) -> None:
        """Save a table as ``<name>.csv`` without its index, rounded by the units of its columns, and show it.

        Raises
        ------
        ValueError
            As `figure`.
        """
        written = resolution.rounded_table(table)
        self._write(written, name)
        self.show(written)

    def show(self, table: pd.DataFrame) -> None:
        """Show a table without saving it."""
        display(HTML(markup.frame_html(table)))

    def equations(self) -> None:
        """Show which function is which equation, and which test holds it."""
        display(HTML(markup.frame_html(load_equations(self.slug), code=("function", "test"))))

    def errata(self) -> None:
        """Show what the paper prints wrongly, what is right, and why."""
        display(HTML(markup.frame_html(load_errata(self.slug), code=("test",))))

    def scorecard(self, findings: Mapping[str, Finding]) -> None:
        """Judge the findings, save ``scorecard.csv`` and show it.

        Raises
        ------
        TableError, ValueError
            As `build_scorecard`.
        """
        scorecard = build_scorecard(self.slug, findings)
        self._write(scorecard, "scorecard")
        display(HTML(markup.scorecard_html(scorecard)))

    def merged_scorecard(self, scorecards: Mapping[str, pd.DataFrame]) -> None:
        """Show the scorecards of all papers, each folded under its name."""
        for slug, scorecard in scorecards.items():
            table = markup.scorecard_html(scorecard)
            display(HTML(f"<details><summary>{slug}: {len(scorecard)} rows</summary>{table}</details>"))

    def _write(self, table: pd.DataFrame, name: str) -> None:
        path = self._path(name, "csv")
        partial = path.with_suffix(".csv.partial")
        table.to_csv(partial, index=False, float_format=policy.FLOAT_FORMAT, lineterminator="\n")
        os.replace(partial, path)

    def _path(self, name: str, suffix: str) -> Path:
        if not re.fullmatch(r"[a-z0-9_]+", name):
            raise ValueError(f"name {name!r}: only lower-case letters, digits and underscores")
        return self.directory / f"{name}.{suffix}"
