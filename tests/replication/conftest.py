"""A small invented paper, so that the reporting floor is tested without any real published number."""

from collections.abc import Callable
from pathlib import Path

import pytest

from soro_lib.project import ROOT, slugs
from soro_lib.replication import card, equations, published

PUBLISHED = """id,location,quantity,value,unit,kind,role,tolerance,note
error,Table I,tip error,1.25,mm,simulated,prediction,0.05,
stiffness,Table I,fitted stiffness,40,N/m,simulated,calibration,10%,
faster,Sec. V,A is faster than B,1,probability,ordering,prediction,0.2,
force,Fig. 9,force at the gripper,3.5,N,hardware,prediction,,needs the force sensor
"""
EQUATIONS = """equation,title,function,test,erratum
Eq. (1),arc,soro_lib.arcs.arc_transform,tests/replication/test_equations.py::test_index_is_complete,XX-1
"""
ERRATA = """id,location,printed,corrected,proof,test
XX-1,Eq. (1),+,-,a rotation has determinant 1,tests/replication/test_equations.py::test_index_is_complete
"""
CARD = """number = 5
title = "A paper"
authors = ["A. Author", "B. Author"]
citation = "Journal of Tests, 2020"
covered = ["the error"]
not_covered = [["the force", "needs a sensor"]]
"""
FILES = {"published.csv": PUBLISHED, "equations.csv": EQUATIONS, "errata.csv": ERRATA, "card.toml": CARD}


@pytest.fixture
def paper_files() -> dict[str, str]:
    """Return the texts of the invented paper's files, by name."""
    return dict(FILES)


@pytest.fixture
def write_paper(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Return a function that writes the invented paper with some files replaced, and gives its folder."""

    def write(**files: str) -> Path:
        folder = tmp_path / "data" / "paper"
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in (FILES | {key.replace("_", "."): text for key, text in files.items()}).items():
            (folder / name).write_text(text, encoding="utf-8")
        return folder

    for module in (card, equations, published):
        monkeypatch.setattr(module, "data_directory", lambda slug: tmp_path / "data" / slug)
    return write


@pytest.fixture(params=slugs())
def slug(request: pytest.FixtureRequest) -> str:
    """Return every paper that has a notebook."""
    if not list((ROOT / "notebooks").glob(f"*_{request.param}.ipynb")):
        pytest.skip(f"no notebook of {request.param} yet")
    return request.param
