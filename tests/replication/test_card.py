"""The replication card says what is covered and what is not, or says what it lacks."""

import pytest

from soro_lib.replication.card import load_card
from soro_lib.replication.tabular import TableError


def test_card_is_read(write_paper):
    write_paper()
    card = load_card("paper")
    assert card.authors == ("A. Author", "B. Author")
    assert card.not_covered == (("the force", "needs a sensor"),)
    assert card.doi == ""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('title = "A paper"', "", "field title: missing"),
        ("number = 5", 'number = "5"', "field number: must be a whole number"),
        ('title = "A paper"', "title = 3", "field title: must be text"),
        ('covered = ["the error"]', "covered = []", "field covered: missing"),
        ('covered = ["the error"]', "covered = [1]", "field covered: must be a list of texts"),
        ('[["the force", "needs a sensor"]]', '["the force"]', "must be a list of \\[what, why\\]"),
        ('[["the force", "needs a sensor"]]', '[["the force", ""]]', "must be a list of \\[what, why\\]"),
        ('title = "A paper"', 'title = "A paper"\nyear = 2020', "field year: unknown"),
        ('title = "A paper"', "title = A paper", "not valid TOML"),
    ],
)
def test_bad_card_is_refused(write_paper, paper_files, old, new, said):
    assert old in paper_files["card.toml"]
    write_paper(card_toml=paper_files["card.toml"].replace(old, new))
    with pytest.raises(TableError, match=f"card.toml.*{said}"):
        load_card("paper")


def test_missing_card_is_named():
    with pytest.raises(TableError, match=r"data/nothing/card\.toml: no such file"):
        load_card("nothing")


def test_card_of_each_paper_is_valid(slug):
    assert load_card(slug).not_covered
