"""Every notebook through the runner, with small parameters, in a place of its own."""

from pathlib import Path

import pytest

from soro_lib.project import ROOT, SLUGS
from soro_lib.workbook.__main__ import main
from soro_lib.workbook.display import VERDICTS
from soro_lib.workbook.notebooks import find_notebooks
from soro_lib.workbook.runner import count_verdicts

CELL_LIMIT_S = 300


@pytest.mark.notebook
@pytest.mark.parametrize("slug", find_notebooks(ROOT / "notebooks"))
def test_notebook_runs_with_small_parameters(slug: str, tmp_path: Path) -> None:
    arguments = ["run", "--quick", "--only", slug, "--output", str(tmp_path), "--timeout", str(CELL_LIMIT_S)]
    assert main(arguments) == 0
    assert list((tmp_path / slug).glob("*.png")), "a notebook without a figure"
    if slug in SLUGS:
        verdicts = count_verdicts(tmp_path / slug / "scorecard.csv")
        assert verdicts
        assert set(verdicts) <= set(VERDICTS)
