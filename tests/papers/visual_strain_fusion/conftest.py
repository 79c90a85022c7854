"""Runs that several tests look at: fusing a flight takes seconds."""

import pytest


@pytest.fixture(scope="session")
def motion():
    from soro_lib.papers.visual_strain_fusion.world.motion import spiral

    return spiral()


@pytest.fixture(scope="session")
def runs():
    import numpy as np

    from soro_lib.papers.visual_strain_fusion.experiments.fusion_runs import fuse_flights

    return fuse_flights(["scene1_obstacles", "scene1_light"], np.random.default_rng(1), seeds=1)
