"""Distances between arm and obstacles, and how they change."""

import numpy as np
import pytest

from soro_lib.controllers.obstacles import Sphere, clearances, smallest_clearance
from soro_lib.robots import CableDrivenArm

ARM = CableDrivenArm()
BALL = Sphere((0.005, -0.003, 0.09), 0.01)


def test_clearance_gradients_are_derivatives():
    rng = np.random.default_rng(2)
    for _ in range(10):
        actuation = rng.uniform(ARM.lower + 1e-3, ARM.upper - 1e-3)
        nearest = clearances(ARM, actuation, [BALL])[0]
        change = rng.normal(0, 1, 7) * [1e-5, *[1e-4] * 6]
        moved = np.clip(actuation + change, ARM.lower, ARM.upper)
        after = smallest_clearance(ARM, moved, BALL, 40)
        before = smallest_clearance(ARM, actuation, BALL, 40)
        assert after - before == pytest.approx(nearest.gradient @ (moved - actuation), abs=2e-6)
        assert nearest.distance - nearest.contact == pytest.approx(before)


@pytest.mark.parametrize("bad", [((0, 0), 1.0), ((0, 0, np.nan), 1.0), ((0, 0, 0), 0.0)])
def test_bad_spheres_are_named(bad):
    with pytest.raises(ValueError, match="Sphere"):
        Sphere(*bad)
