"""Nothing reads a published value except the scorecard and, openly, a calibration."""

import ast
import json
import re
from pathlib import Path

import pytest

from soro_lib.project import ROOT

READER = "soro_lib.replication.published"
OLD_READER = "soro_lib.reporting.published"
CALIBRATION = r"soro_lib/papers/\w+/calibration\.py"
ALLOWED = {"soro_lib/replication/published.py", "soro_lib/replication/scorecard.py"}


def sources() -> list[tuple[str, str]]:
    """Return (path, code) of every library module, benchmark and notebook."""
    modules = [*ROOT.glob("soro_lib/**/*.py"), *ROOT.glob("benchmarks/**/*.py")]
    code = [(str(path.relative_to(ROOT)), path.read_text(encoding="utf-8")) for path in modules]
    for path in ROOT.glob("notebooks/*.ipynb"):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        lines = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
        code.append((str(path.relative_to(ROOT)), "\n\n".join(lines)))
    return code


def reads_published(code: str) -> bool:
    """Return whether code imports the loader of published numbers or names their file, docstrings apart."""
    tree = ast.parse(code)
    statements = [node.value for node in ast.walk(tree) if isinstance(node, ast.Expr)]
    prose = {id(value) for value in statements if isinstance(value, ast.Constant)}
    for node in ast.walk(tree):
        match node:
            case ast.Import(names=aliases):
                found = any(alias.name.startswith(READER) for alias in aliases)
            case ast.ImportFrom(module=module, names=aliases):
                names = {alias.name for alias in aliases}
                found = any(f"{module}.{name}".startswith((READER, OLD_READER)) for name in names)
                found = found or bool(names & {"load_published", "read_published"})
                found = found or str(module).endswith("published")
            case ast.Attribute(attr=name):
                found = name in ("load_published", "read_published")
            case ast.Constant(value=str(text)) if id(node) not in prose:
                found = "published.csv" in text or READER in text
            case _:
                found = False
        if found:
            return True
    return False


def test_only_scorecard_and_calibrations_read_published_values():
    readers = {name for name, code in sources() if reads_published(code)}
    readers -= {"soro_lib/workbook/check.py"}  # names the file among those that are written by hand
    assert {name for name in readers if not re.fullmatch(CALIBRATION, name)} <= ALLOWED


@pytest.mark.parametrize(
    "code",
    [
        "import soro_lib.replication.published",
        "from soro_lib.replication.published import load_published",
        "from soro_lib.replication import published",
        "from ...replication.published import COLUMNS",
        "from soro_lib.reporting.published import COLUMNS",
        "from soro_lib.replication.scorecard import load_published",
        "import pandas as pd\npd.read_csv('data/x/published.csv')",
        "import soro_lib.replication as r\nr.scorecard.load_published('x')",
        "import importlib\nimportlib.import_module('soro_lib.replication.published')",
    ],
)
def test_reading_is_recognised(code):
    assert reads_published(code)


def test_a_docstring_may_name_the_file():
    assert not reads_published('def f():\n    """Keyed by the id of ``published.csv``."""\n')


def test_sources_are_found():
    assert any(name == "soro_lib/replication/page.py" for name, _ in sources())
    assert Path(ROOT / "soro_lib").is_dir()
