"""The loader of published numbers: every wrong cell is named with its file, line, column, value and bound."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soro_lib.replication.published import UNITS, load_published, parse_tolerance, read_published
from soro_lib.replication.tabular import TableError

HEADER = "id,location,quantity,value,unit,kind,role,tolerance,note\n"
GOOD = "a,Table I,error,1.5,mm,simulated,prediction,0.1,\n"


def load(folder: Path, text: str | bytes):
    path = folder / "published.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_published(path)


def test_good_rows_are_read_with_types_and_absolute_tolerance(tmp_path):
    rows = load(
        tmp_path, HEADER + GOOD + 'b,"Fig. 3, left",speed,-20,mm/s,arithmetic,calibration,5%,"a, b"\n'
    )
    assert list(rows) == ["a", "b"]
    assert rows["a"].value == 1.5
    assert rows["a"].tolerance == 0.1
    assert rows["b"].tolerance == pytest.approx(1.0)
    assert rows["b"].location == "Fig. 3, left"


def test_hardware_row_needs_no_tolerance_but_a_reason(tmp_path):
    row = "h,Fig. 1,force,3,N,hardware,prediction,,"
    assert math.isnan(load(tmp_path, HEADER + row + "no sensor\n")["h"].tolerance)
    with pytest.raises(TableError, match=r"line 2, column note: missing"):
        load(tmp_path, HEADER + row + "\n")


@pytest.mark.parametrize(
    ("row", "column", "said"),
    [
        ("a,T,q,1,mm,simulated,prediction,0.1,", "id", "'a' is already on line 2"),
        (",T,q,1,mm,simulated,prediction,0.1,", "id", "missing"),
        ("b,,q,1,mm,simulated,prediction,0.1,", "location", "missing"),
        ("b,T,,1,mm,simulated,prediction,0.1,", "quantity", "missing"),
        ("b,T,q,,mm,simulated,prediction,0.1,", "value", "missing"),
        ("b,T,q,one,mm,simulated,prediction,0.1,", "value", "'one' is not a finite number"),
        ("b,T,q,inf,mm,simulated,prediction,0.1,", "value", "'inf' is not a finite number"),
        ("b,T,q,nan,mm,simulated,prediction,0.1,", "value", "'nan' is not a finite number"),
        ("b,T,q,2,probability,ordering,prediction,0.1,", "value", "an ordering row is 1"),
        ("b,T,q,1,furlong,simulated,prediction,0.1,", "unit", "'furlong' is not allowed"),
        ("b,T,q,1,Mm/s,simulated,prediction,0.1,", "unit", "did you mean 'mm/s'"),
        ("b,T,q,1,,simulated,prediction,0.1,", "unit", "'' is not allowed"),
        ("b,T,q,1,mm,simulatd,prediction,0.1,", "kind", "did you mean 'simulated'"),
        ("b,T,q,1,mm,simulated,guess,0.1,", "role", "allowed: calibration, prediction"),
        ("b,T,q,1,mm,simulated,prediction,,", "tolerance", "missing"),
        ("b,T,q,1,mm,simulated,prediction,-0.1,", "tolerance", "must be finite and >= 0"),
        ("b,T,q,1,mm,simulated,prediction,nan,", "tolerance", "must be finite and >= 0"),
        ("b,T,q,1,mm,simulated,prediction,ten,", "tolerance", "a number >= 0 in the row's unit"),
        ("b,T,q,0,mm,simulated,prediction,10%,", "tolerance", "a percentage of 0 is no tolerance"),
    ],
)
def test_bad_cell_is_named(tmp_path, row, column, said):
    with pytest.raises(TableError) as error:
        load(tmp_path, HEADER + GOOD + row + "\n")
    assert f"published.csv, line 3, column {column}:" in str(error.value)
    assert said in str(error.value)


def test_all_problems_are_told_at_once(tmp_path):
    with pytest.raises(TableError) as error:
        load(
            tmp_path,
            HEADER + "a,T,q,x,mm,simulated,prediction,0.1,\nb,T,q,1,parsec,simulated,prediction,0.1,\n",
        )
    assert "line 2, column value" in str(error.value)
    assert "line 3, column unit" in str(error.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (b"", "empty; expected the header id,location"),
        (b"\n\n", "empty; expected the header id,location"),
        (b"id,value\n", "line 1: header id,value, expected id,location"),
        (HEADER.encode("utf-16"), "not UTF-8 at byte 0"),
        (HEADER.encode() + b"a,Table \xe9,", "not UTF-8 at byte"),
        (HEADER.encode() + b"a,Table I,error,1.5\n", "line 2: 4 cells, expected 9"),
        (HEADER.encode() + b'a,"Table I,error\n', "unexpected end of data"),
    ],
)
def test_unreadable_file_is_refused(tmp_path, text, said):
    with pytest.raises(TableError, match=r"published\.csv") as error:
        load(tmp_path, text)
    assert said in str(error.value)


def test_missing_file_is_named(tmp_path):
    with pytest.raises(TableError, match=r"published\.csv: no such file"):
        read_published(tmp_path / "published.csv")


def test_byte_order_mark_and_blank_lines_are_skipped_and_lines_counted(tmp_path):
    assert list(load(tmp_path, b"\xef\xbb\xbf" + (HEADER + "\n" + GOOD).encode())) == ["a"]
    with pytest.raises(TableError, match="line 4, column unit"):
        load(tmp_path, HEADER + "\n\n" + GOOD.replace("mm", "ell"))


@given(st.floats(-1e6, 1e6).filter(lambda value: value != 0), st.floats(0, 200))
def test_percentage_is_that_share_of_the_value(value, percent):
    assert parse_tolerance(f"{percent}%", value) == pytest.approx(abs(value) * percent / 100)
    assert parse_tolerance(repr(percent), value) == percent


def test_units_are_words_without_spaces():
    assert all(unit and not any(letter.isspace() for letter in unit) for unit in UNITS)


def test_published_numbers_of_each_paper_are_valid(slug):
    assert load_published(slug)
