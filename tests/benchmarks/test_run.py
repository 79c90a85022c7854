"""Two checkouts measured alternately: rows are matched by name, ratios are those of the pairs."""

import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.alternation import alternate, by_name, changes, compare_with, measured, on_one_side, table
from benchmarks.run import process_cost
from soro_lib.workbook.golden import GoldenError

OLD, NEW = Path("old"), Path("new")
STEP, MINUTE = ("one step", "us"), ("a minute", "s")


def test_old_and_new_take_turns():
    calls = []

    def measure(checkout, module):
        calls.append((checkout, module))
        return {STEP: float(len(calls))}

    pairs = alternate(OLD, NEW, "bench_x", 3, measure)
    assert calls == 3 * [(OLD, "bench_x"), (NEW, "bench_x")]
    assert pairs == [({STEP: 1.0}, {STEP: 2.0}), ({STEP: 3.0}, {STEP: 4.0}), ({STEP: 5.0}, {STEP: 6.0})]


def test_median_is_that_of_the_ratios_of_pairs_not_the_ratio_of_medians():
    pairs = [({STEP: 10.0}, {STEP: 5.0}), ({STEP: 100.0}, {STEP: 40.0}), ({STEP: 12.0}, {STEP: 9.0})]
    (change,) = changes(pairs)
    assert change.ratio == pytest.approx(0.5)
    assert (min(change.ratios), max(change.ratios)) == pytest.approx((0.4, 0.75))
    assert (change.before, change.after) == (12.0, 9.0)
    assert table(pairs).split() == ["0.50", "0.40", "0.75", "12", "9", "us", "one", "step"]


def test_rows_of_one_side_are_listed_and_a_failed_run_does_not_count():
    pairs = [({STEP: 2.0, MINUTE: 1.0}, {STEP: 1.0, ("new", "s"): 1.0}), ({}, {STEP: 3.0})]
    (change,) = changes(pairs)
    assert change.ratios == (0.5,)
    assert on_one_side(pairs) == (["a minute"], ["new"])
    assert table(pairs).endswith("only before: a minute\nonly after: new")


def test_a_row_in_another_unit_is_another_row():
    assert changes([({("x", "s"): 1.0}, {("x", "ms"): 1.0})]) == []


def test_rows_are_named_without_what_old_commits_measured_but_with_their_equations():
    rows = [
        {"name": "one frame (640x480, 597 features)", "value": 12.0, "unit": "ms"},
        {"name": "one step, Eq. (26)", "value": 17.0, "unit": "us", "reference": "one peer"},
        {"name": "one step, Eq. (26)", "value": 17.0, "unit": "us", "reference": "another"},
    ]
    assert by_name(rows) == {("one frame", "ms"): 12.0, ("one step, Eq. (26)", "us"): 17.0}


def checkout(folder: Path, clock: str) -> Path:
    """Write a checkout whose one benchmark tells its clock and what peers it was given."""
    (folder / "benchmarks").mkdir(parents=True)
    (folder / "benchmarks" / "run.py").write_text(f"# {clock}\ncompare = lambda name, ours, peers: peers\n")
    (folder / "benchmarks" / "bench_x.py").write_text(
        "import time\n"
        "from dataclasses import dataclass\n"
        "from benchmarks.run import compare\n"
        "@dataclass\n"
        "class Row:\n"
        "    name: str\n"
        "    value: float\n"
        "    unit: str\n"
        "def rows():\n"
        "    print('a remark')\n"
        "    (peer,) = compare('x', None, {'slow': lambda: 1 / 0}).values()\n"
        "    return [Row('CPU clock', time.perf_counter is time.process_time, ''), Row('peer', peer, '')]\n"
    )
    return folder


@pytest.mark.parametrize(("clock", "patched"), [("perf_counter", True), ("process_time", False)])
def test_an_old_checkout_is_measured_in_cpu_time_too_and_peers_are_left_out(tmp_path, clock, patched):
    found = measured(checkout(tmp_path / "tree", clock), "bench_x")
    assert found == {("CPU clock", ""): patched, ("peer", ""): None}
    assert measured(tmp_path / "tree", "bench_of_later") == {}


def test_a_benchmark_that_fails_is_reported_and_has_no_rows(tmp_path, capsys):
    tree = checkout(tmp_path, "process_time")
    (tree / "benchmarks" / "bench_x.py").write_text("raise ValueError\n")
    assert measured(tree, "bench_x") == {}
    assert "bench_x fails" in capsys.readouterr().err


def test_an_unknown_commit_is_refused():
    with pytest.raises(GoldenError, match="no-such-commit"):
        compare_with("no-such-commit", [], 1)


def test_work_of_a_process_is_counted_and_a_failure_is_told(tmp_path):
    busy = "import time\nwhile time.process_time() < 0.3: pass\nblock = bytearray(50_000_000)"
    parent = f"import subprocess, sys\nsubprocess.run([sys.executable, '-c', {busy!r}])"
    spent, peak = process_cost([sys.executable, "-c", parent], tmp_path, {})
    assert 0.3 <= spent < 2.0
    assert peak > 50
    with pytest.raises(subprocess.CalledProcessError) as told:
        process_cost([sys.executable, "-c", "raise SystemExit('why')"], tmp_path, {})
    assert "why" in told.value.output
