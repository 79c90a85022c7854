"""The fibre of Wang et al.: geometry of the helix, strain against a brute-force skin, limits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soro_lib.arcs import chain_transform
from soro_lib.papers.visual_strain_fusion.world.fibre import FibreGratings, bond_spread
from soro_lib.papers.visual_strain_fusion.world.motion import spiral

FIBRE = FibreGratings()


def test_spacing_of_the_gratings_is_along_the_fibre():
    """Erratum VS-22: 17 gratings 20 mm apart fit on 354 mm of helix, not on 90 mm of arm."""
    assert FIBRE.turn == pytest.approx(64.96e-3, abs=1e-5)
    helix = FIBRE.length / FIBRE.pitch * FIBRE.turn
    assert 16 * 0.020 < helix < 18 * 0.020 + FIBRE.turn
    assert FIBRE.length < 16 * 0.020
    assert np.diff(FIBRE.height) == pytest.approx(5.08e-3, abs=1e-5)
    assert np.degrees(np.diff(FIBRE.azimuth)) == pytest.approx(110.8, abs=0.1)


def test_rigid_bonding_would_shift_hundreds_of_times_more():
    """Erratum VS-22: 0.158 nm is about 130 microstrain, against percents of skin strain."""
    motion = spiral(400)
    rigid = FibreGratings(transfer=1.0).shift(motion.configuration, motion.elongations)
    assert np.abs(rigid).max() > 30e-9
    assert pytest.approx(131e-6, rel=0.01) == 0.158e-9 / (0.78 * 1550e-9)


@settings(max_examples=20)
@given(st.floats(-1.2, 1.2), st.floats(-1.2, 1.2), st.floats(0.085, 0.1))
def test_axial_strain_is_the_stretch_of_lines_on_the_skin(dx, dy, length):
    """Against lines parallel to the axis, carried along by the sections of the bent arm."""
    count = 200
    segments = np.tile([dx / count, dy / count, length / count], (count, 1))
    frames = np.stack([chain_transform(segments[:k]) for k in (100, 101)])
    points = FIBRE.radius * np.stack(
        [np.cos(FIBRE.azimuth), np.sin(FIBRE.azimuth), np.zeros(17), np.full(17, 1 / FIBRE.radius)]
    )
    ends = (frames @ points)[:, :3]
    stretch = np.linalg.norm(ends[1] - ends[0], axis=0) / (FIBRE.length / count) - 1.0
    assert np.allclose(FIBRE.axial_strain([[dx, dy, length]]), stretch, atol=2e-4)


def test_incompressible_skin_turns_the_sign():
    assert pytest.approx(-0.403, abs=0.001) == FIBRE.strain_gain


def test_straight_arm_at_rest_has_no_shift():
    assert np.allclose(FIBRE.shift([[0.0, 0.0, FIBRE.length]]), 0.0)


def test_noise_is_that_of_a_resting_fibre():
    """Mean |noise| of a normal variable is 0.798 sigma."""
    noise = FIBRE.shift(np.tile([0.0, 0.0, FIBRE.length], (2000, 1, 1)), rng=np.random.default_rng(1))
    assert np.abs(noise).mean() == pytest.approx(9.07e-13, rel=0.02)


def test_bond_spread_has_mean_one():
    gains = bond_spread(np.random.default_rng(1), 200000)
    assert gains.mean() == pytest.approx(1.0, abs=0.01)
    assert np.log(gains).std() == pytest.approx(0.45, abs=0.01)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"pitch": 0.0}, "pitch"),
        ({"noise": -1.0}, "noise"),
        ({"bond_gain": np.ones(3)}, "bond_gain"),
        ({"spacing": 0.03}, "beyond length"),
    ],
)
def test_bad_parameters_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        FibreGratings(**options)


@pytest.mark.parametrize("shape", [np.zeros(3), [[np.nan, 0, 0.09]]])
def test_bad_shape_is_refused(shape):
    with pytest.raises(ValueError, match="configuration"):
        FIBRE.shift(shape)
