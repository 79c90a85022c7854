"""The simulated pneumatic plant: each mechanism on its own, and none of them when switched off."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soro_lib.arcs import chain_transform
from soro_lib.papers.visual_strain_fusion.world.plant import (
    BackboneParameters,
    ChamberParameters,
    PneumaticPlant,
    Wall,
)
from soro_lib.robots.pneumatic import PneumaticArm

ARM = PneumaticArm()
EVEN = BackboneParameters(taper=0.0, threefold=0.0, tip_weight=0.0)


def test_ideal_plant_is_the_arm():
    plant = PneumaticPlant(ARM, ChamberParameters(), EVEN)
    command = ARM.home + np.array([3e-3, 1e-3, -1e-3])
    assert np.array_equal(plant.drive(command), command)
    assert np.allclose(plant.lengths, command, atol=1e-12)
    assert np.allclose(plant.tip, ARM.tip(command), atol=1e-10)


def test_steppers_lose_the_fraction_of_a_step():
    plant = PneumaticPlant(ARM, ChamberParameters(resolution=1e-5))
    for _ in range(100):
        executed = plant.drive(plant.motors + 0.99e-5)
    assert np.array_equal(executed, ARM.home)
    assert np.allclose(plant.drive(ARM.home + 2.5e-5), ARM.home + 2e-5, atol=1e-12)


def test_play_is_a_hysteresis_of_its_width():
    plant = PneumaticPlant(ARM, ChamberParameters(play=2e-4))
    up = plant.drive(ARM.home + 1e-3) * 0 + plant.lengths
    plant.drive(ARM.home + 2e-3)
    plant.drive(ARM.home + 1e-3)
    assert np.allclose(plant.lengths - up, 2e-4, atol=1e-12)


def test_dead_band_swallows_and_suction_is_weak():
    chambers = ChamberParameters(dead_band=1e-3, softness=1e-5, suction=0.2)
    assert abs(chambers.stretch(0.8e-3)) < 1e-6
    assert chambers.stretch(3e-3) == pytest.approx(2e-3, rel=1e-3)
    assert chambers.stretch(-1e-3) == pytest.approx(-0.2e-3, rel=1e-6)


@given(st.floats(0.2, 5), st.floats(0.4, 2), st.floats(0, 2e-3), st.floats(1e-5, 5e-4))
def test_stretch_is_zero_at_zero_and_increases(gain, exponent, dead_band, softness):
    chambers = ChamberParameters(gain=gain, exponent=exponent, dead_band=dead_band, softness=softness)
    assert chambers.stretch(0.0) == pytest.approx(0.0, abs=1e-15)
    assert (np.diff(chambers.stretch(np.linspace(-5e-3, 1e-2, 200))) > -1e-15).all()


def test_even_backbone_is_one_arc():
    bending, length = np.array([[0.3, -0.7], [0.0, 0.0]]), np.array([0.09, 0.1])
    arc = np.concatenate([bending, length[:, None]], axis=1)[:, None, :]
    assert np.allclose(chain_transform(EVEN.shape(bending, length)), chain_transform(arc), atol=1e-12)


def test_backbone_converges_with_its_segments():
    tips = [chain_transform(BackboneParameters(segments=n).shape([0.6, 0.5], 0.09))[:3, 3] for n in (18, 400)]
    assert np.linalg.norm(tips[0] - tips[1]) < 5e-5


def test_tip_weight_takes_curvature_back_and_is_odd():
    heavy, light = BackboneParameters(tip_weight=22.0), BackboneParameters(tip_weight=0.0)
    bends = [np.hypot(*b.shape([0.8, 0.0], 0.09)[:, :2].sum(axis=0)) for b in (heavy, light)]
    assert bends[0] < bends[1]
    there = heavy.shape([0.5, 0.2], 0.09)[:, :2]
    assert np.allclose(
        BackboneParameters(threefold=0.0).shape([-0.5, -0.2], 0.09)[:, :2],
        -BackboneParameters(threefold=0.0).shape([0.5, 0.2], 0.09)[:, :2],
    )
    assert np.isfinite(there).all()


def test_moment_of_a_contact_falls_to_zero_where_it_acts():
    curvature = BackboneParameters().contact_curvature([6.0, 0.0], 0.5)[:, 0]
    assert (np.diff(curvature[:9]) < 0).all()
    assert np.array_equal(curvature[9:], np.zeros(9))
    assert curvature[0] == pytest.approx(6.0 * (0.5 - 0.5 / 18))


def test_batch_is_so_many_single_plants():
    gains = np.array([1.0, 2.0])[:, None]
    together = PneumaticPlant(ARM, ChamberParameters(gain=gains, play=1e-4), BackboneParameters(), batch=(2,))
    alone = PneumaticPlant(ARM, ChamberParameters(gain=2.0, play=1e-4), BackboneParameters())
    for command in np.random.default_rng(1).uniform(0, 3e-3, (5, 3)):
        together.drive(np.tile(ARM.home + command, (2, 1)))
        alone.drive(ARM.home + command)
    assert np.allclose(together.tip[1], alone.tip, atol=1e-12)


@pytest.mark.parametrize(
    "command", [[np.nan, 0.09, 0.09], [np.inf, 0.09, 0.09], [-0.01, 0.09, 0.09], [0.09, 0.09]]
)
def test_bad_command_is_refused_and_nothing_moves(command):
    """Pressures that are negative beyond the arm's limits, not finite, or too few."""
    plant = PneumaticPlant(ARM, ChamberParameters())
    with pytest.raises(ValueError, match="actuation"):
        plant.drive(command)
    assert np.array_equal(plant.motors, ARM.home)


@pytest.mark.parametrize(
    ("kind", "options", "message"),
    [
        (ChamberParameters, {"gain": 0.0}, "gain"),
        (ChamberParameters, {"play": np.array([1e-4, -1e-4])}, "play"),
        (BackboneParameters, {"threefold": 0.9}, "threefold"),
        (BackboneParameters, {"segments": 0}, "segments"),
    ],
)
def test_bad_parameters_are_refused(kind, options, message):
    with pytest.raises(ValueError, match=message):
        kind(**options)


def test_wall_stops_the_arm_on_its_side_only():
    wall = Wall(direction=0.0, limit=0.2)
    assert np.allclose(
        wall.stop(np.array([[0.5, 0.3], [0.1, 0.3], [-0.5, 0.0]])), [[0.2, 0.3], [0.1, 0.3], [-0.5, 0]]
    )
    plant = PneumaticPlant(ARM, ChamberParameters(), wall=wall)
    plant.drive(ARM.chamber_lengths([[0.6, 0.0, 0.09]]))
    assert plant.configuration[0, 0] == pytest.approx(0.2)
