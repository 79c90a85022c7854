"""Measures this checkout against another one: old, new, old, new, and so on, each in a process of its own.

What slows a machine down for a while then slows both sides; the median over the pairs forgets the rest. Each
side runs the benchmarks of its own checkout, with the packages of this environment, and without the peers.
All times are CPU times, also those of a commit whose benchmarks still measured wall time.
"""

import json
import os
import re
import statistics
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.run import ROOT

Rows = Mapping[tuple[str, str], float]
"""Values of one run of one side, by name and unit."""

CHILD = """
import json, sys, time
from dataclasses import asdict
from importlib import import_module
from pathlib import Path

if "process_time" not in Path("benchmarks/run.py").read_text(encoding="utf-8"):
    time.perf_counter = time.process_time  # before timeit is imported, which takes it for its clock

from benchmarks import run

with_peers = run.compare
run.compare = lambda name, ours, peers, *rest, **named: with_peers(name, ours, {"-": None}, *rest, **named)
rows = import_module("benchmarks." + sys.argv[1]).rows()
print()
print(json.dumps([asdict(row) for row in rows]))
"""


@dataclass(frozen=True)
class Change:
    """What has become of one row.

    Attributes
    ----------
    name, unit : str
        Of the row.
    before, after : float
        Medians over the runs, in ``unit``.
    ratios : tuple of float
        New over old, for each pair of runs; below 1: faster.
    """

    name: str
    unit: str
    before: float
    after: float
    ratios: tuple[float, ...]

    @property
    def ratio(self) -> float:
        """Median of the ratios."""
        return statistics.median(self.ratios)


def by_name(rows: Iterable[Mapping[str, Any]]) -> dict[tuple[str, str], float]:
    """Return the values of rows; a computation with several peers has several rows and one value.

    Remarks in brackets are left out of the name: old commits wrote there what they had measured.
    """
    values: dict[tuple[str, str], float] = {}
    for row in rows:
        values.setdefault((re.sub(r" \([^)]* [^)]*\)", "", row["name"]), row["unit"]), row["value"])
    return values


def changes(pairs: Sequence[tuple[Rows, Rows]]) -> list[Change]:
    """Match the rows of alternate runs, (old, new) each; a pair in which a row is missing does not count."""
    found = []
    for key in dict.fromkeys(key for pair in pairs for key in pair[1]):
        both = [(old[key], new[key]) for old, new in pairs if key in old and key in new]
        if both:
            before, after = map(statistics.median, zip(*both))
            found.append(Change(*key, before, after, tuple(new / old for old, new in both)))
    return found


def on_one_side(pairs: Sequence[tuple[Rows, Rows]]) -> tuple[list[str], list[str]]:
    """Return the names of rows that only the old side has, and those that only the new one has."""
    old, new = ({name: None for pair in pairs for name, _ in pair[side]} for side in (0, 1))
    return [name for name in old if name not in new], [name for name in new if name not in old]


def measured(checkout: Path, module: str) -> dict[tuple[str, str], float]:
    """Run one benchmark module of a checkout; no rows where it has none or fails, which is reported."""
    if not (checkout / "benchmarks" / f"{module}.py").is_file():
        return {}
    environment = {**os.environ, "PYTHONPATH": str(checkout)}
    command = [sys.executable, "-c", CHILD, module]
    done = subprocess.run(
        command, cwd=checkout, env=environment, stdout=subprocess.PIPE, text=True, check=False
    )
    if done.returncode:
        print(f"{module} fails in {checkout}; see above", file=sys.stderr)
        return {}
    return by_name(json.loads(done.stdout.splitlines()[-1]))


def alternate(
    before: Path,
    after: Path,
    module: str,
    runs: int,
    measure: Callable[[Path, str], Rows] = measured,
) -> list[tuple[Rows, Rows]]:
    """Measure a module of both checkouts so many times, the old one first each time."""
    pairs = []
    for run in range(runs):
        print(f"{module}, run {run + 1} of {runs} ...", file=sys.stderr, flush=True)
        pairs.append((measure(before, module), measure(after, module)))
    return pairs


def table(pairs: Sequence[tuple[Rows, Rows]]) -> str:
    """Return what has changed as text: ratios new over old in front, and what there was no pair of."""
    lines = [
        f"{change.ratio:>6.2f}  {min(change.ratios):>6.2f}  {max(change.ratios):>6.2f}  "
        f"{change.before:>9.3g}  {change.after:>9.3g} {change.unit:<2}  {change.name}"
        for change in changes(pairs)
    ]
    for side, names in zip(("before", "after"), on_one_side(pairs)):
        lines += [f"only {side}: {name}" for name in names]
    return "\n".join(lines)


def compare_with(reference: str, modules: Sequence[str], runs: int) -> None:
    """Measure this checkout against the folder of another one, or against a commit, and print the ratios."""
    if Path(reference).is_dir():
        _compare(Path(reference).resolve(), modules, runs)
        return
    from soro_lib.workbook.golden import golden_folder, work_tree

    with work_tree(golden_folder(reference).name) as tree:
        _compare(tree, modules, runs)


def _compare(before: Path, modules: Sequence[str], runs: int) -> None:
    print(f"{'median':>6}  {'min':>6}  {'max':>6}  {'before':>9}  {'after':>9}     what; ratios new / old")
    for module in modules:
        print(table(alternate(before, ROOT, module, runs)), flush=True)
