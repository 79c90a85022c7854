"""The equation index: no equation without a function and a test that exist."""

import pytest

from soro_lib.replication.equations import (
    find_function,
    find_test,
    index_problems,
    load_equations,
    load_errata,
)
from soro_lib.replication.tabular import TableError


class TestNested:
    def test_inside(self):
        """Stands here to be found by name."""
        find_test("tests/replication/test_equations.py::TestNested::test_inside")


def test_index_is_complete(write_paper):
    write_paper()
    assert index_problems("paper") == []


def test_index_of_each_paper_is_complete(slug):
    assert index_problems(slug) == []


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "arcs.arc_transform",
            "arcs.ark_transform",
            "equations.csv, Eq. (1): function 'soro_lib.arcs.ark_transform'",
        ),
        ("soro_lib.arcs.arc_transform", "numpy.cos", "must begin with soro_lib"),
        ("soro_lib.arcs.arc_transform", "soro_lib.arcs", "cannot be called"),
        (
            "soro_lib.arcs.",
            "soro_lib.archs.",
            "module 'soro_lib' has no attribute 'archs'",
        ),
        ("::test_index_is_complete", "::test_index_is_done", "no 'test_index_is_done' in tests/replication"),
        ("::test_index_is_complete", "", "expected tests/file.py::test_name"),
        ("tests/replication/test_equations.py", "tests/nowhere.py", "no file tests/nowhere.py"),
        ("XX-1", "XX-2", "erratum 'XX-2' is not in data/paper/errata.csv"),
    ],
)
def test_hole_in_the_index_is_named(write_paper, paper_files, old, new, said):
    write_paper(equations_csv=paper_files["equations.csv"].replace(old, new))
    problems = index_problems("paper")
    assert len(problems) == 1
    assert said in problems[0]


def test_erratum_needs_a_test_that_exists(write_paper, paper_files):
    write_paper(errata_csv=paper_files["errata.csv"].replace("test_index_is_complete", "test_gone"))
    assert "errata.csv, XX-1: test" in index_problems("paper")[0]


def test_several_functions_are_separated_by_semicolons(write_paper, paper_files):
    both = "soro_lib.arcs.arc_transform; soro_lib.arcs.chain_transform"
    write_paper(equations_csv=paper_files["equations.csv"].replace("soro_lib.arcs.arc_transform", both))
    assert index_problems("paper") == []


@pytest.mark.parametrize("column", ["title", "function", "test"])
def test_missing_cell_is_named(write_paper, column):
    cells = {"title": "t", "function": "f", "test": "x", column: ""}
    text = "equation,title,function,test,erratum\nEq. (1),{title},{function},{test},\n".format(**cells)
    write_paper(equations_csv=text)
    with pytest.raises(TableError, match=f"equations.csv, line 2, column {column}: missing"):
        load_equations("paper")


def test_repeated_equation_is_refused(write_paper, paper_files):
    write_paper(
        equations_csv=paper_files["equations.csv"] + paper_files["equations.csv"].splitlines()[1] + "\n"
    )
    with pytest.raises(TableError, match=r"line 3, column equation: 'Eq. \(1\)' is already on line 2"):
        load_equations("paper")


def test_errata_may_be_none_but_not_half(write_paper):
    write_paper(errata_csv="id,location,printed,corrected,proof,test\n")
    assert load_errata("paper").empty
    write_paper(errata_csv="id,location,printed,corrected,proof,test\nXX-1,Eq. (1),+,-,,t\n")
    with pytest.raises(TableError, match="column proof: missing"):
        load_errata("paper")


def test_methods_and_lazy_names_are_found():
    assert find_function("soro_lib.replication.findings.Finding.value.fget")
    assert find_function("soro_lib.replication.Page.figure")


def test_nested_test_is_found_and_a_helper_is_not_a_test():
    find_test("tests/replication/test_equations.py::TestNested::test_inside")
    with pytest.raises(LookupError, match="begin with test"):
        find_test("tests/conftest.py::write_paper")
