"""A golden copy of a commit, and what a later checkout does otherwise.

``make golden`` runs the commit that ``tests/golden/commit.toml`` names, or any other, in a work tree of its
own and keeps under ``build/golden/<commit>`` all that a move of code must not change: the outputs of the
notebooks in full and with small parameters, the tests' names, the names that README and notebooks import, the
small form of all generated data and calibrations, and the times of the benchmarks. ``make unchanged``
compares the checkout with it.
"""

import ast
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from soro_lib.project import ROOT
from soro_lib.replication.tabular import read_rows
from soro_lib.workbook import compare
from soro_lib.workbook.generators import FILES
from soro_lib.workbook.notebooks import find_notebooks

STATED = ROOT / "tests" / "golden"
"""What a checkout states about its golden copy: the commit, wanted differences, new names of tests."""

WRITERS = ("generator", "source")
"""Keys of a data card, or of fitted values, that name the module that wrote them."""

BENCHMARK_RUNS = 5
"""The golden time of a benchmark is the best of so many runs."""


class GoldenError(RuntimeError):
    """A golden copy cannot be made or is not there."""


def stated_commit() -> str:
    """Return the commit to compare with; ``tests/golden/commit.toml`` names it and says why."""
    return str(tomllib.loads((STATED / "commit.toml").read_text(encoding="utf-8"))["commit"])


def golden_folder(reference: str, root: Path = ROOT) -> Path:
    """Return where the golden copy of a commit is kept; a name of a commit that git knows will do.

    Raises
    ------
    GoldenError
        If git knows no such commit.
    """
    found = _git(root, "rev-parse", "--verify", "--quiet", f"{reference}^{{commit}}")
    return root / "build" / "golden" / found.strip()[:12]


def build(reference: str, root: Path = ROOT, benchmark_runs: int = BENCHMARK_RUNS) -> Path:
    """Make the golden copy of a commit, unless it is there, and return its folder.

    The benchmarks are run `benchmark_runs` times, which may be none; the best time of each counts.

    The commit's own code runs, in a work tree of its own, with this interpreter where both have the same
    lock, else in an environment made for it. What an old commit cannot do is said and left out.

    Raises
    ------
    GoldenError
        If git knows no such commit or its notebooks fail.
    """
    folder = golden_folder(reference, root)
    if folder.is_dir():
        return folder
    partial = folder.with_name(folder.name + ".partial")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir(parents=True)
    with work_tree(folder.name, root) as tree:
        python = _interpreter(tree, root)
        for name, quick in (("figures", []), ("quick", ["--quick"])):
            _say(f"{folder.name}: notebooks, {name}")
            output = ["--output", str(partial / name)]
            if _run(tree, python, "-m", "soro_lib.workbook", "run", "--force", *quick, *output):
                raise GoldenError(f"the notebooks of {reference} fail; see above")
        _write_lines(partial / "tests.txt", collected_tests(tree, python))
        _write_lines(partial / "imports.txt", imported_names(tree))
        for kind in FILES:
            _say(f"{folder.name}: {kind}, small form")
            output = ["--output", str(partial / "small" / kind)]
            if _run(tree, python, "-m", "soro_lib.workbook", "generate", kind, "--small", *output):
                _say(f"{folder.name} has no small form of {kind}; left out")
        times = _benchmarks(tree, python, benchmark_runs)
        (partial / "benchmarks.json").write_text(json.dumps(times, indent=1), encoding="utf-8")
    partial.rename(folder)
    return folder


def collected_tests(tree: Path, python: str = sys.executable) -> list[str]:
    """Return the names of all tests of a checkout, as pytest collects them.

    Tests that have nothing to run on here, because recordings are not beside the checkout, are left out.
    """
    command = [python, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider"]
    done = subprocess.run(
        command, cwd=tree, env=_environment(tree), capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise GoldenError(f"pytest cannot collect the tests of {tree}:\n{done.stdout[-2000:]}")
    return sorted(line for line in done.stdout.splitlines() if "::" in line and "NOTSET]" not in line)


def imported_names(tree: Path) -> list[str]:
    """Return what README and notebooks import from the library, as ``module`` or ``module:name``."""
    readme = (tree / "README.md").read_text(encoding="utf-8")
    sources = re.findall(r"```python\n(.*?)```", readme, re.DOTALL)
    for notebook in find_notebooks(tree / "notebooks").values():
        sources += notebook.code
    return sorted({name for source in sources for name in _names(source)})


def _names(source: str) -> Iterator[str]:
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.startswith("soro_lib"))
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("soro_lib"):
            yield from (f"{node.module}:{alias.name}" for alias in node.names)


def unresolved(names: Iterable[str], tree: Path = ROOT) -> list[str]:
    """Return which of the names that `imported_names` gives a checkout no longer has."""
    code = (
        "import importlib, json, sys\n"
        "for name in json.load(sys.stdin):\n"
        "    module, _, attribute = name.partition(':')\n"
        "    try:\n"
        "        found = importlib.import_module(module)\n"
        "        attribute and not hasattr(found, attribute) and importlib.import_module("
        "f'{module}.{attribute}')\n"
        "    except ImportError:\n"
        "        print(name)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        input=json.dumps(list(names)),
        cwd=tree,
        env=_environment(tree),
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.split("\n")[:-1]


def digests(folder: Path) -> dict[str, str]:
    """Return the size and digest of every file below a folder, by its path there.

    Of TOML files the values count, but for those that name the module that wrote them, which may move.
    """
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    contents = {path.relative_to(folder).as_posix(): _content(path) for path in files}
    return {name: f"{len(data)} {hashlib.sha256(data).hexdigest()}" for name, data in contents.items()}


def _content(path: Path) -> bytes:
    data = path.read_bytes()
    if path.suffix != ".toml":
        return data
    values = tomllib.loads(data.decode())
    return repr({name: value for name, value in values.items() if name not in WRITERS}).encode()


def lost_tests(before: Sequence[str], now: Sequence[str], renames: Mapping[str, str]) -> list[str]:
    """Return the tests that are gone without a new name, and new names that no test has."""
    there, problems = set(now), []
    for name in before:
        new = name if name in there else renamed(name, renames)
        if new is None:
            problems.append(f"test {name} is gone; if that is wanted, say so in renames.csv")
        elif new and new not in there:
            problems.append(f"renames.csv: there is no test {new}")
    return problems


def renamed(test: str, renames: Mapping[str, str]) -> str | None:
    """Return the new name of a test, nothing if it was given up, None if no row speaks of it.

    A row names a test, all cases of one or all tests of a file; the longest that fits counts.
    """
    parts = re.split(r"(?=::|\[)", test)
    starts = ["".join(parts[:count]) for count in range(len(parts), 0, -1)]
    old = next((start for start in starts if start in renames), None)
    if old is None:
        return None
    return renames[old] and renames[old] + test.removeprefix(old)


def load_renames(path: Path) -> dict[str, str]:
    """Return the new name of each renamed test (or file of tests), empty for what was given up.

    The columns are old, new, reason.

    Raises
    ------
    TableError
        If the table has other columns, or a test has two new names.
    """
    return {row["old"]: row["new"] for row in read_rows(path, ("old", "new", "reason"), key="old")}


def unchanged(quick: bool = False, root: Path = ROOT) -> list[str]:
    """Return what this checkout does otherwise than its golden copy.

    Parameters
    ----------
    quick
        Compare the outputs with small parameters, and leave out what takes long: generated data.
    root
        The checkout; its notebooks have been run.

    Raises
    ------
    GoldenError
        If there is no golden copy yet.
    """
    folder = golden_folder(stated_commit(), root)
    if not folder.is_dir():
        raise GoldenError(f"no golden copy in {folder}; run `make golden`")
    stated = compare.load_exceptions(STATED / "exceptions.csv")
    found = compare.differences(compare.outputs(folder, quick), compare.outputs(root, quick))
    problems = [str(difference) for difference in compare.without(found, stated)]
    renames = load_renames(STATED / "renames.csv")
    problems += lost_tests(_lines(folder / "tests.txt"), collected_tests(root), renames)
    problems += [
        f"{name} can no longer be imported" for name in unresolved(_lines(folder / "imports.txt"), root)
    ]
    if not quick:
        problems += _changed_data(folder / "small", root / "build" / "small")
    return problems


def _changed_data(golden: Path, again: Path) -> list[str]:
    """Make the small form of data and calibrations again and compare it."""
    shutil.rmtree(again, ignore_errors=True)
    problems = []
    for kind in FILES:
        if not (golden / kind).is_dir():
            continue
        output = ["--output", str(again / kind)]
        if _run(ROOT, sys.executable, "-m", "soro_lib.workbook", "generate", kind, "--small", *output):
            problems.append(f"make {kind}, small form, fails")
        before, now = digests(golden / kind), digests(again / kind)
        problems += [
            f"small form of {kind}: {name} is no longer the same"
            for name in sorted(before.keys() | now.keys())
            if before.get(name) != now.get(name)
        ]
    return problems


def _benchmarks(tree: Path, python: str, runs: int) -> dict[str, float]:
    """Return the best time of every benchmark, by name; nothing of a commit whose benchmarks do not run."""
    best: dict[str, float] = {}
    for number in range(runs):
        _say(f"benchmarks, run {number + 1} of {runs}")
        if _run(tree, python, "-m", "benchmarks.run"):
            break
        rows = json.loads((tree / "build" / "benchmarks.json").read_text(encoding="utf-8"))["rows"]
        for row in rows:
            best[row["name"]] = min(row["value"], best.get(row["name"], row["value"]))
    return best


@contextmanager
def work_tree(commit: str, root: Path = ROOT) -> Iterator[Path]:
    """Check a commit out beside this checkout, in a folder that is gone again however the block ends."""
    tree = root / "build" / "golden" / f"{commit}.tree"
    _git(root, "worktree", "prune")
    if tree.exists():
        shutil.rmtree(tree)
        _git(root, "worktree", "prune")
    _git(root, "worktree", "add", "--detach", str(tree), commit)
    try:
        yield tree
    finally:
        _git(root, "worktree", "remove", "--force", str(tree))


def _interpreter(tree: Path, root: Path) -> str:
    """Return an interpreter with the packages that a work tree asks for."""
    locks = [path / "environment.txt" for path in (tree, root)]
    if locks[0].read_bytes() == locks[1].read_bytes():
        return sys.executable
    if subprocess.run(["make", "env"], cwd=tree, check=False).returncode:
        raise GoldenError(f"the environment of {tree} could not be set up; see above")
    return str(tree / ".venv" / "bin" / "python")


def _environment(tree: Path) -> dict[str, str]:
    """Return an environment in which the library of a work tree is the one that is imported."""
    return {**os.environ, "PYTHONPATH": str(tree)}


def _run(tree: Path, python: str, *arguments: str) -> int:
    return subprocess.run([python, *arguments], cwd=tree, env=_environment(tree), check=False).returncode


def _git(root: Path, *arguments: str) -> str:
    command = ["git", "-C", str(root), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise GoldenError(f"{' '.join(command)}: {done.stderr.strip() or 'failed'}")
    return done.stdout


def _write_lines(path: Path, lines: Iterable[str]) -> None:
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def _lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines()


def _say(text: str) -> None:
    print(text, flush=True)
