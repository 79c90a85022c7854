"""A golden copy holds what a commit does, and a checkout that does otherwise is told."""

import subprocess
import sys
from pathlib import Path

import pytest

from soro_lib.project import ROOT, slugs
from soro_lib.workbook import golden
from soro_lib.workbook.generators import NothingToRun, generators
from soro_lib.workbook.golden import GoldenError, lost_tests, unresolved


def test_a_lost_test_is_told_unless_it_has_a_new_name():
    before = ["tests/a.py::test_x", "tests/a.py::test_y", "tests/a.py::test_z"]
    now = ["tests/a.py::test_x", "tests/b.py::test_y"]
    renames = {"tests/a.py::test_y": "tests/b.py::test_y", "tests/a.py::test_z": ""}
    assert lost_tests(before, now, renames) == []
    (lost,) = lost_tests(before, now, {"tests/a.py::test_y": "tests/b.py::test_y"})
    assert "tests/a.py::test_z is gone" in lost
    (wrong,) = lost_tests(before[1:2], now, {"tests/a.py::test_y": "tests/c.py::test_y"})
    assert "there is no test tests/c.py::test_y" in wrong


def test_a_row_may_rename_all_tests_of_a_file_or_all_cases_of_a_test():
    before = [
        "tests/a.py::test_x[1-a::b]",
        "tests/a.py::test_x[2]",
        "tests/a.py::test_y",
        "tests/ab.py::test_z",
    ]
    now = ["tests/b.py::test_w[1-a::b]", "tests/b.py::test_w[2]", "tests/c.py::test_y", "tests/ab.py::test_z"]
    renames = {"tests/a.py": "tests/c.py", "tests/a.py::test_x": "tests/b.py::test_w"}
    assert lost_tests(before, now, renames) == []
    assert len(lost_tests(before, now, {"tests/a.py": "tests/c.py"})) == 2
    assert lost_tests(before, now, {"tests/a.py": ""}) == []


def test_imports_of_readme_and_notebooks_are_found_and_resolve():
    names = golden.imported_names(ROOT)
    assert "soro_lib.robots:HelixArm" in names
    assert len(names) > 20
    assert unresolved(names) == []
    gone = ["soro_lib.robots:HelixLeg", "soro_lib.nowhere", "soro_lib.nowhere:x"]
    assert unresolved([*gone, "soro_lib:arcs", "soro_lib.robots:helix"]) == gone


def test_digests_see_names_sizes_and_contents(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "x.csv").write_text("1")
    before = golden.digests(tmp_path)
    assert list(before) == ["a/x.csv"]
    assert before["a/x.csv"].startswith("1 ")
    (tmp_path / "a" / "x.csv").write_text("2")
    assert golden.digests(tmp_path) != before


def test_what_is_stated_can_be_read_and_names_a_commit():
    assert len(golden.stated_commit()) == 40
    golden.compare.load_exceptions(golden.STATED / "exceptions.csv")
    golden.load_renames(golden.STATED / "renames.csv")


def test_an_unknown_commit_is_refused(tmp_path):
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    with pytest.raises(GoldenError, match="no-such-commit"):
        golden.build("no-such-commit", tmp_path)


BENCHMARKS = """
import json, pathlib, sys
counter = pathlib.Path("counter")
run = int(counter.read_text()) + 1 if counter.exists() else 1
counter.write_text(str(run))
if run > 3:
    sys.exit("no fourth time")
rows = [{"name": "step", "value": [3.0, 1.0, 2.0][run - 1]}, {"name": f"only run {run}", "value": 5.0}]
pathlib.Path("build").mkdir(exist_ok=True)
pathlib.Path("build/benchmarks.json").write_text(json.dumps({"rows": rows}))
"""


def test_the_best_time_of_each_benchmark_counts_until_one_run_fails(tmp_path):
    (tmp_path / "benchmarks").mkdir()
    (tmp_path / "benchmarks" / "run.py").write_text(BENCHMARKS)
    best = golden._benchmarks(tmp_path, sys.executable, 5)
    assert best == {"step": 1.0, "only run 1": 5.0, "only run 2": 5.0, "only run 3": 5.0}
    assert golden._benchmarks(tmp_path, sys.executable, 0) == {}


def test_every_generator_takes_the_small_form_and_a_folder():
    found = {**generators("data"), **generators("calibrations")}
    assert set(found.values()) == set(slugs())
    for module in found:
        source = ROOT.joinpath(*module.split(".")).with_suffix(".py").read_text()
        assert "generator_options(" in source, module


def test_generators_that_cannot_be_found_are_told(tmp_path: Path):
    (tmp_path / "soro_lib" / "papers" / "some").mkdir(parents=True)
    (tmp_path / "soro_lib" / "papers" / "some" / "recordings.py").write_text("x = 1\n")
    with pytest.raises(NothingToRun, match="nothing to run for data in "):
        generators("data", tmp_path)
