"""Tracking: the plant that follows the targets."""

import pytest

from soro_lib.papers.visual_strain_fusion.experiments import tracking


def test_unknown_plant_is_named():
    with pytest.raises(ValueError, match="triangle"):
        tracking.load_plant("triangle")
