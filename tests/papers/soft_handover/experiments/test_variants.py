"""What the printed algorithm does: filters, poles, reach."""

import numpy as np
import pytest

from soro_lib.papers.soft_handover.calibration import plant_k
from soro_lib.papers.soft_handover.experiments import (
    variants,
)
from soro_lib.papers.soft_handover.world.plant import ElasticPlant

PLANTS = {"K": plant_k(), "E": ElasticPlant()}


def test_filter_pole_is_the_spectral_radius_of_the_loop():
    gain, share = 0.27, 0.3
    loop = np.array([[1 - gain, gain], [-share * (1 - gain), 1 - share * gain]])
    assert variants.filter_pole(share, gain) == pytest.approx(np.abs(np.linalg.eigvals(loop)).max())


def test_a_ball_opposite_a_tendon_is_slow_on_the_elastic_arm_only():
    table = variants.reach_by_heading(PLANTS, (0.12, 0.17), step_limit=60)
    steps = table.set_index(["plant", "heading_deg", "lateral_mm"])["steps"]
    assert steps["E", 180.0, 170.0] > 2 * steps["E", 0.0, 170.0]
    assert steps["E", 180.0, 120.0] <= steps["E", 0.0, 120.0] + 2
    assert steps["K", 180.0, 170.0] == steps["K", 0.0, 170.0]
