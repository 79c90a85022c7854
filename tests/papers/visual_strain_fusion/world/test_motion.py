"""How the arm is moved: the spiral of the paper, and a fibre that is glued for it."""

import numpy as np
import pytest

from soro_lib.papers.visual_strain_fusion.world import motion
from soro_lib.papers.visual_strain_fusion.world.motion import glue_fibre, spiral


def test_spiral_reaches_the_published_range_and_slows_nowhere():
    run = motion.spiral()
    assert np.linalg.norm(run.pose[:, :3], axis=1).max() == pytest.approx(40.23e-3, rel=0.02)
    assert (run.elongations >= -1e-12).all()
    assert np.allclose(np.linalg.norm(run.pose[:, 3:], axis=1), 1.0)


def test_glued_fibre_has_the_range_it_was_scaled_to():
    fibre = glue_fibre(np.random.default_rng(1))
    motion = spiral(400)
    assert np.abs(fibre.shift(motion.configuration, motion.elongations)).max() == pytest.approx(1.58e-10)
