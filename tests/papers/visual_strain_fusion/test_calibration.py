"""The fitted plant: its stored optimum, and the file that holds it."""

import numpy as np
import pytest

from soro_lib.papers.visual_strain_fusion import calibration


def test_stored_plant_fits_the_published_cells():
    """The calibration's quick check: the stored optimum has the stored misfit, and no neighbour beats it."""
    optimum, stored = calibration.read(calibration.plant_file())["cap_3mm"]
    assert calibration.misfit(optimum[:, None], 3e-3)[0] == pytest.approx(stored, abs=0.015)
    assert stored < 0.1


def test_calibration_file_round_trip(tmp_path):
    optima = calibration.read(calibration.plant_file())
    calibration.write(optima, tmp_path / "plant.toml")
    again = calibration.read(tmp_path / "plant.toml")
    for name, (candidate, value) in optima.items():
        assert np.allclose(again[name][0], candidate, rtol=1e-12)
        assert again[name][1] == value
