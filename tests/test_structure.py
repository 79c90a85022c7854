"""The rules of the house: floors, light imports, notebooks, slugs, lock."""

import ast
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import papermill
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from soro_lib.project import ROOT, slugs
from soro_lib.workbook.imports import imported_names
from soro_lib.workbook.notebooks import conforms, find_notebooks

FLOORS = {
    "soro_lib.project": 0,
    "soro_lib.arcs": 0,
    "soro_lib.arc_kernels": 0,
    "soro_lib.poses": 0,
    "soro_lib.jit": 0,
    "soro_lib.paths": 0,
    "soro_lib.replication.datacards": 0,
    "soro_lib.robots": 1,
    "soro_lib.sensing": 1,
    "soro_lib.controllers": 2,
    "soro_lib.estimators": 2,
    "soro_lib.papers.shared_control.world": 2,
    "soro_lib.studies": 3,
    "soro_lib.calibrations": 3,
    "soro_lib.replication": 4,
    "soro_lib.workbook": 5,
    "soro_lib.widgets": 5,
}
"""Floor of every room; a module may import from its own floor and below."""

LIFT = ("soro_lib.calibrations", "soro_lib.replication.published")
"""The one way up: a declared calibration may load published values."""

HEAVY = ("cv2", "cvxpy", "sklearn", "matplotlib", "numba", "pandas", "statsmodels", "papermill", "joblib")

NOTEBOOKS = find_notebooks(ROOT / "notebooks")
MODULES = sorted((ROOT / "soro_lib").rglob("*.py"))


def room(dotted: str) -> str:
    """Return the room that a module belongs to: ``soro_lib.robots.helix`` is in ``soro_lib.robots``."""
    return ".".join(dotted.split(".")[:2])


def upward_imports(source: str, path: Path) -> list[str]:
    """Return the imports of a module that go to a higher floor."""
    package = ".".join(path.parts[:-1])
    own = room(".".join(path.with_suffix("").parts))
    if own == "soro_lib.__init__":
        return sorted(name for name in imported_names(source, package) if FLOORS.get(room(name), 0) > 0)
    return sorted(
        name
        for name in imported_names(source, package)
        if room(name) in FLOORS
        and FLOORS[room(name)] > FLOORS[own]
        and not (own == LIFT[0] and name.startswith(LIFT[1]))
    )


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_module_imports_from_a_higher_floor(path: Path) -> None:
    inside = path.relative_to(ROOT)
    own = room(".".join(inside.with_suffix("").parts))
    assert own == "soro_lib.__init__" or own in FLOORS, f"{own} has no floor in tests/test_structure.py"
    assert not upward_imports(path.read_text(encoding="utf-8"), inside)


@pytest.mark.parametrize(
    "source",
    [
        "import soro_lib.papers.gesture_steering.experiments",
        "from soro_lib.studies import findings",
        "from soro_lib import studies\nstudies.findings",
        "from ..studies.findings import Finding",
        "def late():\n    from soro_lib.replication import Page",
    ],
)
def test_upward_import_is_noticed(source: str) -> None:
    assert upward_imports(source, Path("soro_lib/robots/helix.py"))


def test_import_on_the_same_floor_or_below_is_allowed() -> None:
    source = "from soro_lib.arcs import arc_transform\nfrom .base import Robot\nimport soro_lib.sensing"
    assert not upward_imports(source, Path("soro_lib/robots/helix.py"))


@pytest.mark.parametrize("statement", ["import soro_lib", "import soro_lib.arcs, soro_lib.robots"])
def test_light_imports_stay_light(statement: str) -> None:
    code = f"{statement}\nimport sys\nprint(*[name for name in {HEAVY} if name in sys.modules])"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert loaded.split() == []


def test_every_public_name_can_be_imported() -> None:
    code = (
        "import importlib\n"
        f"for package in {sorted(name for name, floor in FLOORS.items() if floor in (1, 2))}:\n"
        "    module = importlib.import_module(package)\n"
        "    for name in getattr(module, '__all__', []):\n"
        "        getattr(module, name)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_notebooks_are_those_of_the_slugs() -> None:
    assert [path.name for path in sorted((ROOT / "notebooks").glob("*.ipynb"))] == [
        notebook.path.name for notebook in NOTEBOOKS.values()
    ]
    assert list(NOTEBOOKS)[:5] == ["overview", *slugs()]
    assert set(NOTEBOOKS) - {"overview", *slugs()} <= {"cross_robot"}


@pytest.mark.parametrize("folder", ["data", "figures"])
def test_folders_are_those_of_the_slugs(folder: str) -> None:
    found = {path.name for path in (ROOT / folder).iterdir() if path.is_dir()}
    assert set(slugs()) <= found <= set(NOTEBOOKS)


@pytest.mark.parametrize("slug", NOTEBOOKS)
def test_parameters_have_type_unit_and_fitting_default(slug: str) -> None:
    notebook = NOTEBOOKS[slug]
    (cell,) = [cell for cell in notebook.cells if "parameters" in cell.metadata.get("tags", [])]
    assigned = ast.parse(cell.source).body
    assert all(isinstance(line, ast.AnnAssign) for line in assigned), "every line: name: type = literal"
    # What papermill does not recognise as a parameter could not be set.
    assert list(papermill.inspect_notebook(notebook.path)) == [line.target.id for line in assigned]
    for line, parameter in zip(assigned, notebook.parameters.values(), strict=True):
        assert parameter.unit, f"{parameter.name}: the comment begins with a unit in brackets"
        assert re.fullmatch(r"\[[^\]]+\] \S.*", parameter.help), f"{parameter.name}: says what it is"
        value = ast.literal_eval(line.value)
        assert conforms(value, line.annotation), f"{parameter.name}: {value!r} is no {parameter.type}"
    assert notebook.parameters["quick"].type == "bool"
    assert notebook.parameters["quick"].default == "False"
    assert notebook.parameters["seed"].type == "int"


@pytest.mark.parametrize("slug", NOTEBOOKS)
def test_notebooks_carry_no_outputs(slug: str) -> None:
    cells = json.loads(NOTEBOOKS[slug].path.read_text(encoding="utf-8"))["cells"]
    assert not [cell for cell in cells if cell.get("outputs") or cell.get("execution_count") is not None]


@pytest.mark.parametrize("slug", NOTEBOOKS)
def test_cells_are_short(slug: str) -> None:
    long = [code.splitlines()[0] for code in NOTEBOOKS[slug].code if len(code.splitlines()) > 25]
    assert not long


def test_lock_satisfies_requirements() -> None:
    lock = (ROOT / "environment.txt").read_text(encoding="utf-8")
    pins = re.findall(r"^([A-Za-z0-9_.-]+)==([^ ;\\]+)", lock, re.MULTILINE)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    wanted = [
        *project["project"]["dependencies"],
        *project["project"]["optional-dependencies"]["dev"],
        *project["build-system"]["requires"],
    ]
    for requirement in map(Requirement, wanted):
        versions = [version for name, version in pins if name == canonicalize_name(requirement.name)]
        assert versions, f"{requirement} is not in environment.txt; run `make lock`"
        assert all(map(requirement.specifier.contains, versions)), f"{requirement} against {versions}"
    assert lock.count("--hash=sha256:") >= len(pins)


def test_nothing_committed_names_an_index_or_a_home() -> None:
    lock = (ROOT / "environment.txt").read_text(encoding="utf-8")
    assert "index-url" not in lock
    assert "://" not in lock
