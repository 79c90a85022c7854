"""The page writes the same bytes for the same content, under the paper's name, and shows what it wrote."""

import os
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from soro_lib.replication import Page, page, policy
from soro_lib.replication.findings import Finding
from soro_lib.replication.picture import DIGEST
from soro_lib.replication.plotting import (
    PAGE_WIDTH,
    SERIES,
    TRUTH,
    box_groups,
    equal_aspect,
    legend,
    new_figure,
)
from soro_lib.replication.summary import read_scorecard


@pytest.fixture
def shown(monkeypatch):
    """Collect what the page displays, as the text a browser would get."""
    texts: list[str] = []
    monkeypatch.setattr(page, "display", lambda item: texts.append(getattr(item, "data", "")))
    return texts


def make_figure():
    figure, axes = new_figure(columns=2)
    axes[0].plot([0, 1, 2], [1.0, 3.0, 2.0], **TRUTH, label="truth")
    box_groups(axes[1], {"A": [1.0, 2.0, 3.0], "B": np.linspace(0, 9, 10)})
    legend(figure)
    return figure


def test_figure_is_the_same_bytes_twice_and_has_the_stated_size(tmp_path, shown):
    for name in ("fig01_left", "fig01_right"):
        Page("paper", tmp_path).figure(make_figure(), name)
    assert (tmp_path / "fig01_left.png").read_bytes() == (tmp_path / "fig01_right.png").read_bytes()
    with Image.open(tmp_path / "fig01_left.png") as image:
        assert image.size == (round(PAGE_WIDTH * policy.DPI), round(3.6 * policy.DPI))
        assert "Software" not in image.info
        assert len(image.convert("RGB").getcolors(100_000)) > 20
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fig01_left.png", "fig01_right.png"]


def test_figure_is_the_same_bytes_in_another_process(tmp_path):
    script = (
        "import sys, pathlib; from soro_lib.replication import Page, plotting\n"
        "figure, axes = plotting.new_figure(); axes.plot([0, 1, 4], **plotting.ESTIMATE)\n"
        "Page('paper', pathlib.Path(sys.argv[1])).figure(figure, 'fig')"
    )
    for number in ("0", "1"):
        (tmp_path / number).mkdir()
        environment = {**os.environ, "PYTHONHASHSEED": number}
        command = [sys.executable, "-c", script, str(tmp_path / number)]
        subprocess.run(command, check=True, env=environment, capture_output=True)
    assert (tmp_path / "0" / "fig.png").read_bytes() == (tmp_path / "1" / "fig.png").read_bytes()


def test_table_has_six_significant_digits_and_no_index(tmp_path, shown):
    Page("paper", tmp_path).table(pd.DataFrame({"arm": ["a<b"], "error_mm": [1 / 3]}), "table1")
    assert (tmp_path / "table1.csv").read_bytes() == b"arm,error_mm\na<b,0.333333\n"
    assert "a&lt;b" in shown[0]
    assert "0.3333" in shown[0]


@pytest.mark.parametrize("name", ["../x", "Fig 1", "", "a/b"])
def test_name_outside_the_folder_is_refused(tmp_path, name):
    with pytest.raises(ValueError, match="only lower-case letters, digits and underscores"):
        Page("paper", tmp_path).table(pd.DataFrame({"a": [1]}), name)
    assert not list(tmp_path.iterdir())


def test_failing_figure_leaves_the_old_one(tmp_path, shown):
    here = Page("paper", tmp_path)
    here.figure(make_figure(), "fig")
    before = (tmp_path / "fig.png").read_bytes()
    figure = make_figure()
    figure.axes[0].set_title("$\\undefinedcommand$")
    with pytest.raises(ValueError, match="undefinedcommand"):
        here.figure(figure, "fig")
    assert (tmp_path / "fig.png").read_bytes() == before


@pytest.fixture
def finished(tmp_path, monkeypatch, shown):
    """Draw `make_figure` as a run before did, and return its file; the next run writes to another folder."""
    monkeypatch.setenv("SORO_FIGURES", str(tmp_path / "figures"))
    folder = tmp_path / "figures" / "paper"
    folder.mkdir(parents=True)
    (tmp_path / "staged").mkdir()
    Page("paper", folder).figure(make_figure(), "fig")
    return folder / "fig.png"


def test_unchanged_figure_keeps_its_bytes_whatever_compressed_them(tmp_path, finished, monkeypatch):
    with Image.open(finished) as image:
        text = PngInfo()
        text.add_text(DIGEST, image.info[DIGEST])
        image.save(finished, compress_level=1, pnginfo=text)
    monkeypatch.setattr(page.Recording, "png", lambda recording: pytest.fail("drawn"))
    Page("paper", tmp_path / "staged").figure(make_figure(), "fig")
    assert (tmp_path / "staged" / "fig.png").read_bytes() == finished.read_bytes()


def test_unchanged_figure_is_shown_too(finished, tmp_path, shown):
    Page("paper", tmp_path / "staged").figure(make_figure(), "fig")
    assert shown == [finished.read_bytes()] * 2


def test_changed_figure_is_drawn_anew(tmp_path, finished):
    figure = make_figure()
    figure.axes[0].get_lines()[0].set_color("#1a1a1b")
    Page("paper", tmp_path / "staged").figure(figure, "fig")
    with Image.open(tmp_path / "staged" / "fig.png") as ours, Image.open(finished) as before:
        assert ours.info[DIGEST] != before.info[DIGEST]
        assert not np.array_equal(np.asarray(ours), np.asarray(before))


def test_damaged_picture_is_drawn_anew(tmp_path, finished):
    whole = finished.read_bytes()
    for damaged in (whole[:-500], whole[:2000] + b"?" + whole[2001:], b""):
        finished.write_bytes(damaged)
        Page("paper", tmp_path / "staged").figure(make_figure(), "fig")
        assert (tmp_path / "staged" / "fig.png").read_bytes() == whole


def test_scorecard_card_indices_are_shown_and_written(tmp_path, write_paper, shown):
    write_paper()
    here = Page("paper", tmp_path)
    here.card()
    here.equations()
    here.errata()
    here.scorecard({"error": Finding([1.2, 1.3, 1.4]), "faster": Finding([1, 1, 1])})
    card, equations, errata, scorecard = shown
    assert "A. Author, B. Author" in card
    assert "needs a sensor" in card
    assert "<code>soro_<wbr>lib.<wbr>arcs.<wbr>arc_<wbr>transform</code>" in equations
    assert "a rotation has determinant 1" in errata
    for word in ("reproduced", "not attempted", "needs the force sensor", "[1.2, 1.4]"):
        assert word in scorecard
    written = read_scorecard(tmp_path / "scorecard.csv")
    assert list(written["verdict"]) == ["reproduced", "not attempted", "reproduced", "not attempted"]


def test_equal_aspect_gives_one_scale_and_keeps_the_points_inside():
    _, axes = new_figure(projection="3d")
    points = np.random.default_rng(2).normal(size=(50, 3)) * [1.0, 5.0, 0.1]
    equal_aspect(axes, points)
    limits = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    assert (limits[:, 0] <= points.min(axis=0)).all()
    assert (limits[:, 1] >= points.max(axis=0)).all()
    extent = np.diff(limits, axis=1).ravel()
    assert axes._box_aspect / extent == pytest.approx(np.full(3, axes._box_aspect[0] / extent[0]))


def test_equal_aspect_of_a_single_point_is_a_small_box():
    _, axes = new_figure(projection="3d")
    equal_aspect(axes, np.zeros((1, 3)))
    assert axes.get_xlim()[0] < 0 < axes.get_xlim()[1]


def luminance(color: str) -> float:
    """Relative luminance of an sRGB colour (WCAG 2.1)."""
    parts = np.array([int(color[index : index + 2], 16) for index in (1, 3, 5)]) / 255
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def test_neighbouring_categories_differ_in_grey_too():
    values = [luminance(color) for color in SERIES]
    ratios = [(max(pair) + 0.05) / (min(pair) + 0.05) for pair in pairwise(values)]
    assert min(ratios) > 1.25
