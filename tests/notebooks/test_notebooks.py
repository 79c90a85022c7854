"""Every notebook through the runner, with small parameters, in a place of its own.

What they write has to be the same on any processor, with any number of threads and on any Python. Its
digests are those of ``quick.csv``, which is renewed, after a change that is meant to change numbers, by
``make quick && .venv/bin/python -m soro_lib.workbook digests --quick > tests/notebooks/quick.csv``.
"""

import csv
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from soro_lib.project import ROOT, slugs
from soro_lib.workbook import compare, execution
from soro_lib.workbook.__main__ import main
from soro_lib.workbook.display import VERDICTS
from soro_lib.workbook.notebooks import OVERVIEW, find_notebooks
from soro_lib.workbook.runner import count_verdicts

CELL_LIMIT_S = 300
KERNEL = "OPENBLAS_CORETYPE"
"""What OpenBLAS takes the processor for, on x86; elsewhere it knows none of these and nothing changes."""

OLDEST, OLD, NEW = "Prescott", "Sandybridge", "Haswell"


def other_pythons() -> dict[str, str]:
    """Return the interpreters of other supported versions that can be had here, on the path or from pyenv."""
    root = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    found = {}
    for version in ("3.11", "3.12", "3.13"):
        own = sorted(map(str, root.glob(f"{version}.*/bin/python{version}")))
        for python in (shutil.which(f"python{version}"), *own):
            if python and not sys.version.startswith(version):
                works = subprocess.run(
                    [python, "-c", "import venv, ensurepip"], capture_output=True, check=False
                )
                if works.returncode == 0:
                    found[version] = python
    return found


def run(slug: str, output: Path) -> None:
    arguments = ["run", "--quick", "--only", slug, "--output", str(output), "--timeout", str(CELL_LIMIT_S)]
    assert main(arguments) == 0


def changed(slug: str, output: Path) -> dict[str, str]:
    """Return the digests of one notebook's outputs that are not the stated ones; empty for a missing file."""
    with Path(__file__).with_name("quick.csv").open(newline="") as file:
        stated = {name: digest for name, digest in csv.reader(file) if name.startswith(f"{slug}/")}
    found = {name: text for name, text in compare.digests(output).items() if name.startswith(f"{slug}/")}
    return {name: found.get(name, "") for name in stated | found if stated.get(name) != found.get(name)}


@pytest.mark.notebook
@pytest.mark.parametrize("slug", find_notebooks(ROOT / "notebooks"))
def test_notebook_runs_with_small_parameters(
    slug: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(KERNEL, OLD)  # not the one of `make figures`
    run(slug, tmp_path)
    assert list((tmp_path / slug).glob("*.png")), "a notebook without a figure"
    if slug in slugs():
        verdicts = count_verdicts(tmp_path / slug / "scorecard.csv")
        assert verdicts
        assert set(verdicts) <= set(VERDICTS)
    if slug != OVERVIEW:  # which shows the scorecards that are committed
        assert not changed(slug, tmp_path), "see the head of this file"


@pytest.mark.soak
@pytest.mark.notebook
@pytest.mark.parametrize(
    ("kernel", "threads"),
    [(OLDEST, "1"), (OLDEST, "2"), (OLD, "2"), (NEW, "1"), (NEW, "2")],  # OLD with one: above
)
@pytest.mark.parametrize("slug", sorted(find_notebooks(ROOT / "notebooks").keys() - {OVERVIEW}))
def test_same_outputs_with_any_kernel_and_number_of_threads(
    slug: str, kernel: str, threads: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(KERNEL, kernel)
    monkeypatch.setattr(execution, "THREADS", threads)
    monkeypatch.setenv("OPENBLAS_THREAD_TIMEOUT", "4")  # waiting threads sleep, other tests run beside them
    run(slug, tmp_path)
    assert not changed(slug, tmp_path)


@pytest.mark.soak
@pytest.mark.notebook
def test_same_outputs_without_compiled_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    run("cross_robot", tmp_path)
    assert not changed("cross_robot", tmp_path)


@pytest.mark.soak
@pytest.mark.notebook
@pytest.mark.parametrize("version", ["3.11", "3.12", "3.13"])
def test_same_outputs_on_another_python(version: str, tmp_path: Path) -> None:
    """In a checkout and an environment of its own."""
    if version not in (pythons := other_pythons()):
        pytest.skip(f"this is Python {version}, or there is none here")
    tree = tmp_path / "checkout"
    subprocess.run(["git", "clone", "-q", str(ROOT), str(tree)], check=True)
    environment = {name: text for name, text in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))}
    made = subprocess.run(
        ["make", "env", f"PYTHON={pythons[version]}"], cwd=tree, env=environment, check=False
    )
    assert made.returncode == 0
    for slug in list(find_notebooks(ROOT / "notebooks"))[1::2]:  # half of them, for the time it takes
        command = [".venv/bin/python", "-m", "soro_lib.workbook", "run", "--quick", "--only", slug]
        assert subprocess.run([*command, "--output", str(tmp_path)], cwd=tree, check=False).returncode == 0
        assert not changed(slug, tmp_path)
