"""The runner on small notebooks of its own: real kernels, real signals, real files."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import nbformat
import pytest
from filelock import FileLock

from soro_lib.project import ROOT
from soro_lib.workbook.__main__ import main
from soro_lib.workbook.notebooks import Parameter, ParameterError, find_notebooks
from soro_lib.workbook.runner import Places, recover
from soro_lib.workbook.staleness import Record, current_inputs, current_outputs, stale_because

PARAMETERS = """\
seed: int = 1  # [-] seed
quick: bool = False  # [-] small run
length: float = 0.5  # [m] length of the arm
name: str = "tip"  # [-] name of the file
gains: list[float] = [1.0, 2.0]  # [1/s] gains
"""
OUTPUT = "import os, pathlib\noutput = pathlib.Path(os.environ['SORO_OUTPUT'])\n"

ALPHA = OUTPUT + "(output / 'scorecard.csv').write_text('id,verdict\\na,reproduced\\nb,differs\\n')"
ALPHA_CHECKS = """\
from soro_lib.arcs import LENGTH
data = pathlib.Path(os.environ['PYTHONPATH']) / 'data' / 'alpha' / 'table.csv'
(output / f'{name}.csv').write_text(f'{data.read_text()},{LENGTH},{length},{seed},{quick}')
assert os.listdir() == [] and os.environ['MPLBACKEND'] == 'Agg' and os.environ['OMP_NUM_THREADS'] == '1'
"""
BETA = OUTPUT + "from soro_lib import robots\n(output / 'robot.csv').write_text(str(robots.Helix))"
OVERVIEW = (
    OUTPUT
    + "cards = sorted(pathlib.Path(os.environ['SORO_FIGURES']).glob('*/scorecard.csv'))\n"
    + "(output / 'merged.csv').write_text(''.join(card.read_text() for card in cards))"
)
WAIT = """\
import time
(output / 'half.csv').write_text('half')
pathlib.Path('pid').write_text(str(os.getpid()))
pathlib.Path('pid').rename('{pid_file}')
time.sleep(60)
"""
RUN = """\
import pathlib, sys
from soro_lib.workbook.__main__ import main
sys.exit(main(['run'], pathlib.Path('{project}')))
"""
LIBRARY = {
    "__init__.py": "",
    "arcs.py": "LENGTH = 2.0\n",
    "robots/__init__.py": (
        "import lazy_loader\n__getattr__, __dir__, __all__ = lazy_loader.attach(\n"
        "    __name__, submod_attrs={'helix': ['Helix'], 'growing': ['Growing']})\n"
    ),
    "robots/helix.py": "Helix = 'helix'\n",
    "robots/growing.py": "from ..arcs import LENGTH\nGrowing = LENGTH\n",
    "ageing.py": "import warnings\n\ndef old():\n    warnings.warn('old', DeprecationWarning)\n",
}


def write_notebook(path: Path, *cells: str, parameters: str = PARAMETERS) -> None:
    """Write a notebook with a heading, a parameters cell and some code cells."""
    tagged = nbformat.v4.new_code_cell(parameters, metadata={"tags": ["parameters"]})
    notebook = nbformat.v4.new_notebook(
        cells=[
            nbformat.v4.new_markdown_cell(f"# All about {path.stem[3:]}"),
            tagged,
            *map(nbformat.v4.new_code_cell, cells),
        ],
        metadata={"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}},
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    nbformat.write(notebook, path)


def write_project(root: Path) -> Path:
    """Write a project with a small library of its own, one data file and three notebooks."""
    for name, source in LIBRARY.items():
        path = root / "soro_lib" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(source)
    (root / "data" / "alpha").mkdir(parents=True)
    (root / "data" / "alpha" / "table.csv").write_text("7")
    (root / "environment.txt").write_text("numpy==2.4.6\n")
    write_notebook(root / "notebooks" / "00_overview.ipynb", OVERVIEW)
    write_notebook(root / "notebooks" / "01_alpha.ipynb", ALPHA, ALPHA_CHECKS)
    write_notebook(root / "notebooks" / "02_beta.ipynb", BETA)
    return root


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a project whose notebooks have all been run; to be copied, not changed."""
    root = write_project(tmp_path_factory.mktemp("finished"))
    assert main(["run", "--jobs", "2"], root) == 0
    return root


@pytest.fixture
def project(finished: Path, tmp_path: Path) -> Path:
    """Return a copy of the finished project."""
    return Path(shutil.copytree(finished, tmp_path / "project"))


def files(folder: Path) -> dict[str, bytes]:
    """Return the content of every file below a folder."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def stale(root: Path) -> set[str]:
    """Return the notebooks that the next run would run."""
    return {
        slug
        for slug, notebook in find_notebooks(root / "notebooks").items()
        if stale_because(
            Record.load(root / "build" / "state" / f"{slug}.json"),
            current_inputs(notebook, {}, root, root / "figures"),
            current_outputs(root / "figures" / slug),
        )
    }


def test_a_run_writes_figures_executed_notebooks_and_verdicts(finished: Path) -> None:
    figures = files(finished / "figures")
    assert figures["alpha/tip.csv"] == b"7,2.0,0.5,1,False"
    assert figures["overview/merged.csv"] == figures["alpha/scorecard.csv"]
    assert len(list((finished / "build" / "notebooks").glob("*.ipynb"))) == 3
    record = Record.load(finished / "build" / "state" / "alpha.json")
    assert record
    assert record.verdicts == {"reproduced": 1, "differs": 1}
    assert not (finished / "build" / ".staging").exists()


def test_a_second_run_does_nothing(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = {path: path.stat().st_mtime_ns for path in project.rglob("*.csv")}
    assert main(["run"], project) == 0
    assert capsys.readouterr().out.count("up to date") == 3
    assert {path: path.stat().st_mtime_ns for path in project.rglob("*.csv")} == before


def edit(name: str) -> Callable[[Path], object]:
    """Return a change: one more line at the end of a file."""
    return lambda root: (root / name).write_bytes((root / name).read_bytes() + b"\n")


def edit_cell(root: Path) -> None:
    path = root / "notebooks" / "02_beta.ipynb"
    notebook = nbformat.read(path, as_version=4)
    notebook.cells[2].source += "\n"
    nbformat.write(notebook, path)


def execute_in_place(root: Path) -> None:
    path = root / "notebooks" / "02_beta.ipynb"
    notebook = nbformat.read(path, as_version=4)
    notebook.cells[2].execution_count = 3
    nbformat.write(notebook, path)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (edit("data/alpha/table.csv"), {"alpha", "overview"}),
        (edit("soro_lib/arcs.py"), {"alpha"}),
        (edit("soro_lib/robots/helix.py"), {"beta"}),
        (edit("soro_lib/robots/growing.py"), set()),
        (edit("soro_lib/ageing.py"), set()),
        (edit("environment.txt"), {"alpha", "beta", "overview"}),
        (edit("figures/beta/robot.csv"), {"beta"}),
        (edit("figures/alpha/scorecard.csv"), {"alpha", "overview"}),
        (lambda root: (root / "figures/alpha/tip.csv").unlink(), {"alpha", "overview"}),
        (lambda root: (root / "figures/beta/more.png").write_bytes(b"x"), {"beta", "overview"}),
        (lambda root: (root / "figures/beta/.DS_Store").write_bytes(b"x"), set()),
        (lambda root: shutil.rmtree(root / "build"), {"alpha", "beta", "overview"}),
        (edit_cell, {"beta"}),
        (execute_in_place, set()),
        (lambda root: None, set()),
    ],
)
def test_a_change_makes_stale_what_depends_on_it_and_no_more(
    project: Path, change: Callable[[Path], object], expected: set[str]
) -> None:
    change(project)
    assert stale(project) == expected


def test_a_changed_module_reruns_its_notebook_only(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (project / "soro_lib" / "robots" / "helix.py").write_text("Helix = 'longer'\n")
    assert main(["run"], project) == 0
    out = capsys.readouterr().out
    assert "beta: running, 2 code cells (soro_lib/robots/helix.py changed)" in out
    assert out.count("up to date") == 2
    assert (project / "figures" / "beta" / "robot.csv").read_text() == "longer"


def test_same_bytes_with_one_job_and_with_two(project: Path, tmp_path: Path) -> None:
    for jobs in ("1", "2"):
        assert main(["run", "--jobs", jobs, "--output", str(tmp_path / jobs)], project) == 0
    figures = files(project / "figures")
    for jobs in ("1", "2"):
        assert {name: files(tmp_path / jobs)[name] for name in figures} == figures


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["-p", "lenght", "1"], "no selected notebook has a parameter 'lenght'"),
        (["-p", "length", "long"], "length takes a value of type float, not 'long'"),
        (["-p", "seed", "1.5"], "seed takes a value of type int, not '1.5'"),
        (["-p", "quick", "1"], "quick takes a value of type bool, not '1'"),
        (["-p", "gains", "[1.0, 'x']"], "gains takes a value of type list[float]"),
        (["--only", "gamma"], "no notebook gamma; there are: overview, alpha, beta"),
    ],
)
def test_wrong_requests_are_refused_before_anything_runs(
    project: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], complaint: str
) -> None:
    assert main(["run", "--force", *arguments], project) == 2
    captured = capsys.readouterr()
    assert complaint in captured.err
    assert "running" not in captured.out
    if "-p" in arguments:
        assert "length: float = 0.5  # [m] length of the arm" in captured.err


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        ("float", "2", 2.0),
        ("float", "-1e-3", -1e-3),
        ("int", "3", 3),
        ("bool", "true", True),
        ("str", "3", "3"),
        ("list[float]", "[1.0]", [1.0]),
        ("tuple[int, ...]", "(1, 2)", (1, 2)),
        ("dict[str, int]", "{'a': 1}", {"a": 1}),
    ],
)
def test_values_are_read_by_their_type(kind: str, text: str, value: object) -> None:
    parsed = Parameter("x", kind, "", "").parse(text)
    assert parsed == value
    assert type(parsed) is type(value)


@pytest.mark.parametrize(
    ("kind", "text"), [("int", "True"), ("float", "nan()"), ("list[int]", "3"), ("bool", "yes"), ("int", "")]
)
def test_values_of_another_type_are_refused(kind: str, text: str) -> None:
    with pytest.raises(ParameterError, match="takes a value of type"):
        Parameter("x", kind, "", "").parse(text)


def test_other_parameters_and_quick_leave_the_figures_alone(project: Path) -> None:
    before = files(project / "figures")
    assert main(["run", "--only", "alpha", "-p", "length", "2", "-p", "name", "other"], project) == 0
    assert main(["run", "--only", "alpha", "--quick"], project) == 0
    assert files(project / "figures") == before
    assert (project / "build/custom/alpha/other.csv").read_text() == "7,2.0,2.0,1,False"
    assert (project / "build/quick/alpha/tip.csv").read_text() == "7,2.0,0.5,1,True"
    assert stale(project) == set()


def test_a_file_named_by_a_parameter_is_found_and_its_content_counts(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (project / "own.csv").write_text("1")
    monkeypatch.chdir(project)
    value = Parameter("recording", "str", "", "").parse("own.csv")
    assert value == str(project / "own.csv")
    notebook = find_notebooks(project / "notebooks")["beta"]
    before = current_inputs(notebook, {"name": value}, project, project / "figures")
    (project / "own.csv").write_text("2")
    after = current_inputs(notebook, {"name": value}, project, project / "figures")
    assert {name for name in after if before[name] != after[name]} == {"own.csv"}


def test_files_of_the_run_before_disappear(project: Path) -> None:
    arguments = ["run", "--only", "alpha", "-p", "name", "other", "--output", str(project / "figures")]
    assert main(arguments, project) == 0
    assert set(files(project / "figures" / "alpha")) == {"other.csv", "scorecard.csv"}
    assert stale(project) == {"alpha", "overview"}


def test_failures_are_named_kept_and_stop_nothing_else(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    notebooks = project / "notebooks"
    write_notebook(notebooks / "02_beta.ipynb", BETA, "raise ValueError('too long')", "1 / 0")
    write_notebook(notebooks / "03_slow.ipynb", "import time", "time.sleep(60)")
    write_notebook(notebooks / "04_dying.ipynb", "import os\nos._exit(1)")
    write_notebook(notebooks / "05_ageing.ipynb", "from soro_lib.ageing import old\nold()")
    write_notebook(notebooks / "06_fine.ipynb", OUTPUT)
    write_notebook(notebooks / "07_broken.ipynb", "a = = 1")
    before = files(project / "figures")
    assert main(["run", "--jobs", "3", "--timeout", "2"], project) == 1
    out = capsys.readouterr().out
    assert "beta: code cell 3: ValueError: too long" in out
    assert "slow: code cell 3: took longer than 2 s" in out
    assert "dying: code cell 2: the kernel died" in out
    assert "ageing: code cell 2: DeprecationWarning: old" in out
    assert "broken: code cell 2: SyntaxError: invalid syntax" in out
    assert "fine: done" in out
    assert files(project / "figures") == before
    half = nbformat.read(project / "build" / "failed" / "02_beta.ipynb", as_version=4)
    assert [cell.execution_count for cell in half.cells if cell.cell_type == "code"] == [1, 2, 3, None]


@pytest.fixture
def slow_run(project: Path) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """Yield a run of beta and the process id of its kernel, which has written a file and then waits."""
    pid_file = project / "pid"
    wait = WAIT.format(pid_file=pid_file)
    write_notebook(project / "notebooks" / "02_beta.ipynb", BETA, wait)
    code = RUN.format(project=project)
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, cwd=ROOT)
    wait_until(pid_file.is_file)
    yield process, int(pid_file.read_text())
    process.kill()
    process.communicate()


def wait_until(condition: Callable[[], bool], seconds: float = 30.0) -> None:
    """Wait for something to become true."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.02)


def is_gone(pid: int) -> bool:
    """Whether a process has ended (a zombie that nobody has collected counts as ended)."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    status = Path(f"/proc/{pid}/stat")
    return status.is_file() and status.read_text().rpartition(")")[2].split()[0] == "Z"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL], ids=lambda n: n.name)
def test_ending_a_run_leaves_old_figures_and_no_kernel(
    project: Path, slow_run: tuple[subprocess.Popen[str], int], number: signal.Signals
) -> None:
    process, kernel = slow_run
    before = files(project / "figures")
    process.send_signal(number)
    status = process.wait(20)
    assert status == (-number if number == signal.SIGKILL else 128 + number)
    wait_until(lambda: is_gone(kernel), 10)
    assert files(project / "figures") == before
    assert "beta" in stale(project)
    write_notebook(project / "notebooks" / "02_beta.ipynb", BETA)
    assert main(["run"], project) == 0
    assert files(project / "figures") == before
    assert not (project / "build" / ".staging").exists()


def test_two_runs_at_once_do_not_mix(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (project / "build" / "run.pid").write_text("4711")
    with FileLock(project / "build" / "run.lock"):
        assert main(["run"], project) == 2
    assert "another run (pid 4711) is writing to" in capsys.readouterr().err


def test_figures_set_aside_by_a_killed_run_come_back(project: Path) -> None:
    before = files(project / "figures")
    aside = project / "build" / ".staging" / "beta" / "output.old"
    aside.parent.mkdir(parents=True)
    (project / "figures" / "beta").rename(aside)
    recover(Places.of(project, None, quick=False, changed=False))
    assert files(project / "figures") == before


def test_a_file_that_is_no_notebook_is_named(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (project / "notebooks" / "03_text.ipynb").write_text("no json")
    assert main(["run"], project) == 2
    assert "03_text.ipynb is not a notebook" in capsys.readouterr().err


def test_list_and_html(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"], project) == 0
    assert "alpha: All about alpha\n    seed: int = 1  # [-] seed" in capsys.readouterr().out
    shutil.rmtree(project / "build" / "html", ignore_errors=True)
    assert main(["html"], project) == 0
    index = (project / "build" / "html" / "index.html").read_text()
    assert '<a href="01_alpha.html">All about alpha</a>' in index
    assert "All about alpha" in (project / "build" / "html" / "01_alpha.html").read_text()


@pytest.mark.skipif(shutil.which("make") is None, reason="no make on this machine")
@pytest.mark.parametrize(
    ("arguments", "forced"),
    [(["figures"], False), (["-B", "figures"], True), (["figures", "JOBS=1B"], False)],
)
def test_make_always_forces_the_runner(arguments: list[str], forced: bool) -> None:
    # Started from within another make, its flags would be inherited.
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))
    }
    plan = subprocess.run(
        ["make", "-n", *arguments], cwd=ROOT, env=environment, capture_output=True, text=True, check=True
    )
    assert ("--force" in plan.stdout) is forced
