"""Text becomes HTML and Markdown without breaking either."""

import pandas as pd
from hypothesis import given
from hypothesis import strategies as st

from soro_lib.replication.findings import Finding
from soro_lib.replication.markup import (
    SCORECARD_HEADER,
    VERDICT_COLORS,
    frame_html,
    interval_text,
    markdown_table,
    number_text,
    scorecard_html,
    scorecard_markdown,
)
from soro_lib.replication.scorecard import VERDICTS, build_scorecard


@given(st.lists(st.text(max_size=20), min_size=2, max_size=2))
def test_any_text_stays_in_its_markdown_cell(cells):
    line = markdown_table(("a", "b"), [cells]).split("\n")
    assert len(line) == 3
    assert line[2].replace("\\|", "").count("|") == 3


@given(st.text(max_size=30))
def test_text_cannot_become_markup(text):
    page = frame_html(pd.DataFrame({"name": [text + "<script>"]}), code=("name",))
    assert "<script>" not in page


def test_missing_and_whole_numbers():
    assert [number_text(value) for value in (84.0, 1 / 3, 1e-7, -0.5)] == ["84", "0.3333", "1e-07", "-0.5"]
    assert interval_text(float("nan"), float("nan")) == ""
    assert interval_text(1.0, 2.5) == "[1, 2.5]"
    page = frame_html(pd.DataFrame({"time_s": [0.5, None], "count": pd.array([1, None], dtype="Int64")}))
    assert page.count('<td class="number"></td>') == 2


def test_every_verdict_has_a_badge_readable_on_white_text():
    def luminance(color):
        parts = [int(color[index : index + 2], 16) / 255 for index in (1, 3, 5)]
        linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    assert set(VERDICT_COLORS) == set(VERDICTS)
    contrast = {verdict: 1.05 / (luminance(color) + 0.05) for verdict, color in VERDICT_COLORS.items()}
    assert min(contrast.values()) > 3.5, contrast


def test_scorecard_shows_the_same_in_both_forms(write_paper):
    write_paper()
    scorecard = build_scorecard("paper", {"error": Finding([1.2, 1.4], reason="a < b | c")})
    markdown, page = scorecard_markdown(scorecard), scorecard_html(scorecard)
    assert len(markdown.split("\n")) == 2 + len(scorecard)
    assert all(f"<th>{name}</th>" in page for name in SCORECARD_HEADER)
    assert "a < b \\| c" in markdown
    assert "a &lt; b | c" in page
    assert page.count("soro-badge") - 1 == len(scorecard)
