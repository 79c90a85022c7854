"""Two output folders differ in what `compare` says, and in nothing else."""

from pathlib import Path

import pytest

from soro_lib.replication import Page, page
from soro_lib.replication.plotting import new_figure
from soro_lib.replication.tabular import TableError
from soro_lib.workbook import compare
from soro_lib.workbook.__main__ import main

TABLE = "arm,error_mm,verdict\nlong,1.5,close\nshort,0.25,differs\n"


def write(folder: Path, table: str = TABLE, color: str = "red") -> Path:
    """Write the outputs of one notebook: a table and a picture."""
    (folder / "paper").mkdir(parents=True)
    (folder / "paper" / "table1.csv").write_text(table)
    figure, axes = new_figure(2.0, 1.5)
    axes.plot([0, 1, 3], color=color)
    Page("paper", folder / "paper").figure(figure, "fig01")
    return folder


@pytest.fixture
def before(tmp_path, monkeypatch) -> Path:
    monkeypatch.setattr(page, "display", lambda item: None)
    return write(tmp_path / "before")


def told(before: Path, after: Path, **options: bool) -> list[str]:
    return [str(difference) for difference in compare.differences(before, after, **options)]


def test_the_same_outputs_do_not_differ(before, tmp_path):
    assert told(before, write(tmp_path / "after")) == []


def test_a_picture_is_compared_by_what_it_draws(before, tmp_path):
    after = write(tmp_path / "after")
    path = after / "paper" / "fig01.png"
    recompressed(path)
    assert path.read_bytes() != (before / "paper" / "fig01.png").read_bytes()
    assert told(before, after) == []
    assert told(before, write(tmp_path / "blue", color="blue")) == [
        "paper/fig01.png: a picture became another one"
    ]


def recompressed(path: Path) -> None:
    """Save a picture again as another zlib would, with its texts."""
    from PIL import Image, PngImagePlugin

    with Image.open(path) as image:
        texts = PngImagePlugin.PngInfo()
        for name, text in image.info.items():
            if isinstance(text, str):
                texts.add_text(name, text)
        image.save(path, pnginfo=texts, compress_level=1)


def test_a_picture_without_a_digest_is_compared_by_its_bytes(before, tmp_path):
    after = write(tmp_path / "after")
    (before / "paper" / "fig01.png").write_bytes(b"old")
    (after / "paper" / "fig01.png").write_bytes(b"new")
    assert told(before, after) == ["paper/fig01.png: a picture became another one"]


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        (TABLE.replace("1.5", "1.6"), ["paper/table1.csv, long, error_mm: 1.5 became 1.6"]),
        (TABLE.replace("close", "differs"), ["paper/table1.csv, long, verdict: close became differs"]),
        (TABLE.replace("short", "thin"), ["paper/table1.csv, short, arm: short became thin"]),
        (TABLE.replace("1.5", ""), ["paper/table1.csv, long, error_mm: 1.5 became nothing"]),
        (TABLE.replace("1.5", "nan"), ["paper/table1.csv, long, error_mm: 1.5 became nan"]),
        (TABLE.replace("1.5", "1.50001").replace("0.25", "25e-2"), []),
        (
            TABLE.replace("long,1.5,close\n", ""),
            [
                "paper/table1.csv, number of rows: 2 became 1",
                "paper/table1.csv, long: long,1.5,close became nothing",
            ],
        ),
        (
            TABLE + "thin,3,close\n",
            [
                "paper/table1.csv, number of rows: 2 became 3",
                "paper/table1.csv, thin: nothing became thin,3,close",
            ],
        ),
        (
            TABLE.replace("_mm", "_cm"),
            ["paper/table1.csv, header: arm,error_mm,verdict became arm,error_cm,verdict"],
        ),
        ("", ["paper/table1.csv, header: arm,error_mm,verdict became nothing"]),
    ],
)
def test_what_changed_is_told(before, tmp_path, table, expected):
    assert told(before, write(tmp_path / "after", table)) == expected


def test_exact_tells_the_last_digit(before, tmp_path):
    after = write(tmp_path / "after", TABLE.replace("1.5", "1.50001"))
    assert told(before, after, exact=True) == ["paper/table1.csv, long, error_mm: 1.5 became 1.50001"]


def test_rows_that_begin_alike_are_told_by_their_line(before, tmp_path):
    twice = "arm,mode,error_mm\na,x,1\na,y,2\na,z,3\n"
    (before / "paper" / "table1.csv").write_text(twice)
    assert told(before, write(tmp_path / "one", twice.replace("2", "5"))) == [
        "paper/table1.csv, line 3, error_mm: 2 became 5"
    ]
    assert told(before, write(tmp_path / "two", twice.replace("a,y,2\n", "")))[1:] == [
        "paper/table1.csv, a, y: a,y,2 became nothing"
    ]


def test_missing_and_new_files_are_told(before, tmp_path):
    after = write(tmp_path / "after")
    (after / "paper" / "table1.csv").rename(after / "paper" / "table2.csv")
    assert told(before, after) == [
        "paper/table1.csv: a file became nothing",
        "paper/table2.csv: nothing became a file",
    ]


def run(*arguments: object) -> int:
    return main(["compare", *map(str, arguments)])


def test_the_command_prints_what_differs_and_counts(before, tmp_path, capsys):
    assert run(before, write(tmp_path / "same")) == 0
    assert capsys.readouterr().out == "no differences\n"
    table = TABLE.replace("1.5", "1.6").replace("0.25", "0.5")
    assert run(before, write(tmp_path / "after", table)) == 1
    assert capsys.readouterr().out.endswith("0.25 became 0.5\n2 differences in 1 files\n")
    assert run(before, tmp_path / "nowhere") == 2
    assert "no tables or pictures in" in capsys.readouterr().err


def test_stated_exceptions_are_left_out(before, tmp_path, capsys):
    after = write(tmp_path / "after", TABLE.replace("1.5", "1.6").replace("0.25", "0.5"))
    stated = tmp_path / "exceptions.csv"
    stated.write_text("file,row,column,reason\npaper/table1.csv,long,error_mm,another rule\n")
    assert run(before, after, "--except", stated) == 1
    out = capsys.readouterr().out
    assert "long" not in out
    assert out.endswith("1 differences in 1 files but for 1 stated ones\n")
    stated.write_text("file,row,column,reason\npaper/table1.csv,*,error_mm,another rule\n")
    assert run(before, after, "--except", stated) == 0
    assert capsys.readouterr().out == "no differences but for 2 stated ones\n"
    stated.write_text("file,row,column,reason\npaper/*.csv,*,error_*,another rule\n")
    assert run(before, after, "--except", stated) == 0


def test_a_row_with_brackets_is_stated_as_it_is_written():
    difference = compare.Difference("t.csv", "[1, 2]", "x", "1", "2")
    assert compare.without([difference], [compare.StatedException("t.csv", "[1, 2]", "x", "why")]) == []
    assert compare.without([difference], [compare.StatedException("t.csv", "1", "x", "why")]) == [difference]


@pytest.mark.parametrize("text", ["file,row\n", "file,row,column,reason\na.csv,*,*,\n"])
def test_exceptions_need_a_file_and_a_reason(tmp_path, text):
    (tmp_path / "exceptions.csv").write_text(text)
    with pytest.raises(TableError):
        compare.load_exceptions(tmp_path / "exceptions.csv")


def test_a_place_is_a_checkout_a_golden_copy_or_the_folder_itself(tmp_path, before):
    for name in ("figures", "build/quick", "quick"):
        place = tmp_path / name.replace("/", "_")
        (place / name).parent.mkdir(parents=True)
        (place / name).symlink_to(before)
        assert compare.outputs(place, quick="quick" in name) == place / name
    assert compare.outputs(before) == before
