"""The merged scorecard counts every row once and reads back what was written."""

import pandas as pd
import pytest

from soro_lib.replication.findings import Finding
from soro_lib.replication.scorecard import build_scorecard
from soro_lib.replication.summary import (
    README_BEGIN,
    README_END,
    load_scorecards,
    read_scorecard,
    readme_block,
    split_readme,
    verdict_counts,
)
from soro_lib.replication.tabular import TableError


@pytest.fixture
def scorecard(write_paper):
    write_paper()
    return build_scorecard("paper", {"error": Finding([1.2, 1.4]), "stiffness": Finding(40.0)})


def test_scorecard_survives_writing_and_reading(scorecard, tmp_path):
    folder = tmp_path / "figures" / "shared_control"
    folder.mkdir(parents=True)
    scorecard.to_csv(folder / "scorecard.csv", index=False)
    loaded = load_scorecards(tmp_path / "figures")
    assert list(loaded) == ["shared_control"]
    pd.testing.assert_frame_equal(loaded["shared_control"], scorecard, check_dtype=False)


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", "id,location\n1,2,3,4\n5\n"])
def test_other_file_is_no_scorecard(tmp_path, text):
    path = tmp_path / "scorecard.csv"
    path.write_text(text)
    with pytest.raises(TableError, match=r"scorecard\.csv"):
        read_scorecard(path)


def test_counts_per_paper_and_kind_add_up(scorecard):
    counts = verdict_counts({"one": scorecard, "two": scorecard.iloc[:1]})
    assert counts.set_index("paper")["rows"].to_dict() == {"one": 4, "two": 1}
    assert counts.set_index("paper").loc["one", "not attempted"] == 2
    by_kind = verdict_counts({"one": scorecard}, by="kind")
    assert by_kind["rows"].sum() == 4
    assert list(by_kind["kind"]) == ["simulated", "ordering", "hardware"]
    assert verdict_counts({}).empty


def test_readme_block_holds_every_row_and_is_found_again(scorecard):
    block = readme_block({"paper": scorecard})
    assert all(text in block for text in scorecard["quantity"])
    before, found, after = split_readme(f"# Title\n\n{block}\n\nend\n")
    assert (before, found, after) == ("# Title\n\n", block, "\n\nend\n")


@pytest.mark.parametrize("text", ["", README_BEGIN, README_END + README_BEGIN, README_BEGIN * 2 + README_END])
def test_readme_without_its_markers_is_refused(text):
    with pytest.raises(ValueError, match=r"README\.md"):
        split_readme(text)
