"""The closed curve: the fitted map, and fused feedback; small but real."""

import numpy as np

from soro_lib.papers.visual_strain_fusion.experiments import closed_curve, tracking


def test_fitted_map_knows_the_chamber():
    chambers = tracking.load_plant("pentagram").chambers
    mapping = closed_curve.fit_actuation_map(chambers)
    wanted = np.array([0.0905, 0.092, 0.094])
    stretched = 0.09 + chambers.stretch(mapping.motor_lengths(wanted) - 0.09)
    assert np.allclose(stretched, wanted, atol=2e-3)


def test_curve_is_followed_with_fused_feedback():
    run = closed_curve.follow_curve(np.random.default_rng(1), fitted_map=True, cycles=1)
    assert len(run.tip) == closed_curve.APPROACH + closed_curve.TARGETS
    assert closed_curve.summarise_curve(run).deviation_mm[0] < 5.0
    assert not run.lost.any()
