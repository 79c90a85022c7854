"""What an operator believes about the goal."""

import math

import numpy as np
import pytest

from soro_lib.papers.shared_control.world.belief import Belief, belief_error, new_belief
from soro_lib.papers.shared_control.world.people import EXPERT, NAIVE

ZERO = (0.0, 0.0, 0.0)


@pytest.mark.parametrize("automation", [(0, 0, 0), (1, 1, 0), (0, 0, 1), (1, 1, 1)])
def test_only_the_free_depth_axis_suffers_the_depth_error(automation):
    belief = Belief(right=0.0, up=0.0, depth=0.05, glance=0.0, shift=ZERO)
    error = np.array(belief_error(EXPERT, belief, tuple(map(float, automation))))
    if automation == (0, 0, 0):
        np.testing.assert_allclose(error, 0.05 * np.array([math.cos(math.pi / 6), 0.0, 0.5]))
    else:
        np.testing.assert_array_equal(np.abs(error), 0.0)


def test_beliefs_have_their_stated_spread_and_correlation():
    rng = np.random.default_rng(1)
    belief, depths, ups = Belief(0.0, 0.0, 0.0, 0.0, ZERO), [], []
    for _ in range(20000):
        belief = new_belief(NAIVE, belief, rng)
        depths.append(belief.depth)
        ups.append(belief.up)
    assert np.std(depths) == pytest.approx(0.05, rel=0.05)
    assert np.corrcoef(depths[1:], depths[:-1])[0, 1] == pytest.approx(0.6, abs=0.03)
    assert np.std(ups) == pytest.approx(0.004, rel=0.05)
