"""A data file that was changed without its card is a clear error."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soro_lib.replication.datacards import DataCardError, card_path, read_card, verified, write_card

COLUMNS = {"time": "[s] since the start", "error": "[mm] of the tip"}


@pytest.fixture
def recording(tmp_path):
    path = tmp_path / "run.csv.gz"
    path.write_bytes(b"time,error\n0,1\n")
    write_card(path, description='A "run"', columns=COLUMNS, generator="soro_lib.studies.x.run", seed=3)
    return path


def test_card_says_what_the_file_is(recording):
    card = read_card(recording)
    assert card["columns"] == COLUMNS
    assert card["seed"] == 3
    assert card["description"] == 'A "run"'
    assert card["licence"] == "BSD-3-Clause"
    assert verified(recording) == recording
    assert card_path(recording).name == "run.csv.gz.card.toml"


@given(st.text(st.characters(codec="utf-8"), max_size=40))
def test_any_text_survives_the_card(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("cards") / "x.npz"
    path.write_bytes(b"")
    write_card(path, description=text, columns={text: "[-] " + text}, generator="g", seed=None)
    card = read_card(path)
    assert card["description"] == text
    assert card["columns"] == {text: "[-] " + text}
    assert "seed" not in card


def test_changed_file_is_noticed(recording):
    recording.write_bytes(b"time,error\n0,2\n")
    with pytest.raises(
        DataCardError, match=r"run\.csv\.gz: SHA-256 \w+\.\.\. but its card says \w+\.\.\..*restore"
    ):
        verified(recording)


def test_missing_file_or_card_is_named(recording, tmp_path):
    recording.unlink()
    with pytest.raises(DataCardError, match=r"run\.csv\.gz: no such data file"):
        verified(recording)
    with pytest.raises(DataCardError, match=r"other\.npz\.card\.toml: no such card"):
        verified(tmp_path / "other.npz")


def test_card_must_be_whole(recording):
    card_path(recording).write_text('description = "x"\n')
    with pytest.raises(DataCardError, match="lacks columns, generator, licence, sha256"):
        verified(recording)
    card_path(recording).write_text("description = \n")
    with pytest.raises(DataCardError, match="not valid TOML"):
        verified(recording)


@pytest.mark.parametrize("meaning", ["time", "[s since start", ""])
def test_column_without_a_unit_is_refused(recording, meaning):
    with pytest.raises(DataCardError, match="columns time do not begin with a unit"):
        write_card(recording, description="x", columns={"time": meaning}, generator="g", seed=0)
