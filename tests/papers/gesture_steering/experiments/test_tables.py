"""Tables I and II: what follows from their own numbers, and their errata."""

import numpy as np
import pytest

from soro_lib.papers.gesture_steering.calibration import table2_poses
from soro_lib.papers.gesture_steering.experiments import tables
from soro_lib.robots import CableDrivenArm


def test_upper_ends_of_table1():
    """Erratum GS-21: a length of 45 mm explains the upper K_T to four digits, but not the upper K_a."""
    table = tables.table1().set_index("quantity")
    assert table.loc["K_T", "unloaded"] == pytest.approx(5.0211, abs=5e-5)
    assert table.loc["K_T", "compressed"] == pytest.approx(5.5790, abs=5e-5)
    assert table.loc["K_a", "unloaded"] == pytest.approx(0.8550, abs=5e-5)
    assert abs(table.loc["K_a", "compressed"] - 0.9907) > 0.03
    strain, poisson = 0.110, 0.45
    thickened = table.loc["K_a", "unloaded"] * (1 + poisson * strain) ** 2 / (1 - poisson * strain)
    assert thickened == pytest.approx(0.9907, abs=1e-3)


def test_chord_of_configuration_1_is_longer_than_its_segment():
    """Erratum GS-22: no actuation of a compressible segment of 50 mm spans 51.6 mm."""
    chords = tables.segment_chords().set_index(["configuration", "segment"])["sim_chord_mm"]
    assert chords[1, "distal"] == pytest.approx(51.63, abs=0.01)
    arm = CableDrivenArm()
    actuations = np.random.default_rng(0).uniform(arm.lower, arm.upper, size=(2000, 7))
    spans = np.linalg.norm(arm.tip(actuations) - arm.mid_point(actuations), axis=1)
    assert spans.max() <= arm.segment_length
    residuals = [pose.mid_residual + pose.tip_residual for pose in table2_poses(arm)]
    assert residuals[1] > 2 * max(residuals[0], residuals[2], residuals[3])


def test_rigid_caps_explain_configurations_2_and_3_but_not_1():
    fits = tables.cap_study((0.0, 3e-3)).set_index(["coupling_sign", "cap_mm", "configuration"])
    assert (fits.loc[(-1, 3.0)].loc[[2, 3], "tip_residual_mm"] < 0.2).all()
    assert (fits.loc[(-1, 0.0)].loc[[2, 3], "tip_residual_mm"] > 1.0).all()
    assert fits.loc[(-1, 3.0, 1), "tip_residual_mm"] > 1.5


def test_one_sign_of_table2_is_wrong():
    """Erratum GS-23: -4.397 + 5 is positive."""
    table = tables.table2_errors().set_index(["configuration", "point"])
    assert table.loc[(2, "tip"), "error_y_mm"] == pytest.approx(0.603)
    assert table.loc[(2, "tip"), "norm_mm"] == pytest.approx(1.080, abs=1e-3)
