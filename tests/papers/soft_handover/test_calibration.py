"""Plant K has the printed distances, a timestep its printed length."""

import numpy as np
import pytest

from soro_lib.papers.soft_handover.calibration import FITTED_ROWS, final_distances, plant_k, timestep
from soro_lib.replication.published import load_published


def test_stored_plant_k_brings_the_printed_distances():
    printed = load_published("soft_handover")
    target = [1e-2 * printed[row].value for row in FITTED_ROWS]
    np.testing.assert_allclose(final_distances(np.array(plant_k().realised)), target, atol=0.006)


def test_timestep_is_printed_and_between_for_other_step_sizes():
    assert timestep(0.1) == 1.38
    assert timestep(0.3) == pytest.approx((1.51 + 1.45) / 2)
