"""One thread per test, no user settings of matplotlib: what the runner also gives its notebooks."""

import copy
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from hypothesis import is_hypothesis_test, settings

from soro_lib.project import ROOT, slugs

os.environ.setdefault("MPLBACKEND", "Agg")
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(variable, "1")

# The same examples everywhere, and no time limit on one: a busy machine is not a failure.
settings.register_profile("workbook", deadline=None, derandomize=True, max_examples=50)
settings.register_profile("soak", settings.get_profile("workbook"))
settings.load_profile("workbook")

SOAK_FACTOR = 20
"""How many times more examples `make soak` takes than `make test`."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Take many examples under the profile of `make soak`, also of tests that state a number of their own."""
    if config.getoption("--hypothesis-profile") != "soak":
        return
    for test in {getattr(item, "obj", None) for item in items}:
        if is_hypothesis_test(test):
            # Hypothesis offers no other way to change the settings of a test that has been decorated.
            own = test._hypothesis_internal_use_settings
            test._hypothesis_internal_use_settings = settings(
                own, max_examples=SOAK_FACTOR * own.max_examples
            )


@dataclass(frozen=True)
class Sweep:
    """The camera after its sweep before the flight `scene1_light`, as recorded.

    ``before`` and ``after`` are the states of the random numbers.
    """

    scene: Any
    tracker: Any
    similarity: Any
    before: dict[str, Any]
    after: dict[str, Any]

    def copy(self) -> Any:
        """Return a tracker to fly on with; only the feature detector, which has no state, is shared."""
        detector = self.tracker._detector
        return copy.deepcopy(self.tracker, {id(detector): detector})


@pytest.fixture(scope="session")
def sweep() -> Sweep:
    """Sweep once for all tests that fly: the sweep takes longer than all that they do with it."""
    import numpy as np

    from soro_lib.papers.visual_strain_fusion.experiments.camera_runs import FLIGHTS, start_tracker
    from soro_lib.papers.visual_strain_fusion.recordings import SEED
    from soro_lib.papers.visual_strain_fusion.world.scene import BrickScene

    flight = FLIGHTS["scene1_light"]
    rng = np.random.default_rng([SEED, *flight.disturbance.encode()])
    scene, before = BrickScene(flight.scene), rng.bit_generator.state
    tracker, similarity = start_tracker(scene, rng)
    return Sweep(scene, tracker, similarity, before, rng.bit_generator.state)


# A small invented paper, so that replication is tested without any real published number.
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
PAPER = {"published.csv": PUBLISHED, "equations.csv": EQUATIONS, "errata.csv": ERRATA, "card.toml": CARD}


@pytest.fixture
def paper_files() -> dict[str, str]:
    """Return the texts of the invented paper's files, by name."""
    return dict(PAPER)


@pytest.fixture
def write_paper(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Return a function that writes the invented paper with some files replaced, and gives its folder."""

    def write(**files: str) -> Path:
        folder = tmp_path / "data" / "paper"
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in (PAPER | {key.replace("_", "."): text for key, text in files.items()}).items():
            (folder / name).write_text(text, encoding="utf-8")
        return folder

    from soro_lib.replication import card, equations, published

    for module in (card, equations, published):
        monkeypatch.setattr(module, "data_directory", lambda slug: tmp_path / "data" / slug)
    return write


@pytest.fixture(params=slugs())
def slug(request: pytest.FixtureRequest) -> str:
    """Return every paper that has a notebook."""
    if not list((ROOT / "notebooks").glob(f"*_{request.param}.ipynb")):
        pytest.skip(f"no notebook of {request.param} yet")
    return request.param
