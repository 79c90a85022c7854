"""One thread per test, no user settings of matplotlib: what the runner also gives its notebooks."""

import copy
import os
from dataclasses import dataclass
from typing import Any

import pytest
from hypothesis import is_hypothesis_test, settings

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
