"""The map from a figure of a paper to its file follows what the notebooks have written."""

import pytest

from soro_lib.replication.figure_map import figure_map, place_in_paper


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("fig07a_infinity_path", "Fig. 7a"),
        ("fig10_hover", "Fig. 10"),
        ("fig5", "Fig. 5"),
        ("table1_parameters", "Table 1"),
        ("four_arms", ""),
        ("figure_of_merit", ""),
    ],
)
def test_place_is_read_off_the_name(name, place):
    assert place_in_paper(name) == place


def test_map_lists_figures_and_tables_with_what_they_show(tmp_path, monkeypatch):
    monkeypatch.setenv("SORO_FIGURES", str(tmp_path))
    folder = tmp_path / "cross_robot"
    folder.mkdir()
    for name in ("four_arms.png", "table3_sizes.csv", "scorecard.csv", "notes.txt"):
        (folder / name).touch()
    rows = figure_map(("cross_robot", "nothing_here"))
    assert rows["file"].tolist() == [
        "figures/cross_robot/four_arms.png",
        "figures/cross_robot/table3_sizes.csv",
    ]
    assert rows["shows"][0].startswith("Draw every arm on its way")
    assert rows["shows"][1] == "sizes"
    assert rows["place"].tolist() == ["", "Table 3"]
