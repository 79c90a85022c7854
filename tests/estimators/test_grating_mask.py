"""Leave-one-out test of the gratings: what is found, what is filled in, what is left alone."""

import numpy as np
import pytest

from soro_lib.estimators.grating_mask import GratingMask
from soro_lib.papers.visual_strain_fusion.world.motion import glue_fibre, spiral

NOISE = 1.137e-12


@pytest.fixture(scope="module")
def readings():
    """Shifts of a whole spiral, in an order without history [m]."""
    rng = np.random.default_rng(1)
    motion = spiral(2000)
    return rng.permutation(glue_fibre(rng).shift(motion.configuration, motion.elongations, rng))


@pytest.fixture(scope="module")
def mask(readings):
    return GratingMask(readings[:1000], noise=NOISE)


def test_whole_fibre_is_left_alone(mask, readings):
    masked = [mask.repair(shift).masked.sum() for shift in readings[1000:]]
    assert np.mean(masked) < 0.02


@pytest.mark.parametrize("fault", [np.nan, np.inf, 9e-11, 0.0])
def test_broken_grating_is_found_and_filled_in(mask, readings, fault):
    """Missing, jumping or stuck: the reading comes back within a few times the noise."""
    found, errors = [], []
    for number, whole in enumerate(readings[1000:1200]):
        grating = number % 17
        if np.isfinite(fault) and abs(whole[grating] - fault) < 2e-11:
            continue
        shift = whole.copy()
        shift[grating] = fault
        repaired = mask.repair(shift)
        found.append(repaired.masked[grating])
        errors.append(abs(repaired.shift[grating] - whole[grating]))
        assert np.isfinite(repaired.shift).all()
    assert np.mean(found) > 0.9
    assert np.median(errors) < 5e-12


def test_all_gratings_missing_gives_the_mean(mask):
    repaired = mask.repair(np.full(17, np.nan))
    assert repaired.masked.all()
    assert np.isfinite(repaired.shift).all()


def test_filled_in_value_is_the_conditional_mean(readings):
    """Against the textbook formula, with the covariance written out."""
    mask = GratingMask(readings, noise=NOISE, gate=1e9)
    shift = readings[0].copy()
    shift[[3, 8]] = np.nan
    mean = readings.mean(axis=0)
    covariance = np.cov(readings.T, bias=True) + NOISE**2 * np.eye(17)
    gone, kept = [3, 8], [i for i in range(17) if i not in (3, 8)]
    direct = mean[gone] + covariance[np.ix_(gone, kept)] @ np.linalg.solve(
        covariance[np.ix_(kept, kept)], (shift - mean)[kept]
    )
    assert np.allclose(mask.repair(shift).shift[gone], direct, rtol=1e-6, atol=1e-18)


def test_learning_is_the_same_as_starting_with_all_samples(readings):
    grown, whole = GratingMask(readings[:100], noise=NOISE), GratingMask(readings[:200], noise=NOISE)
    for shift in readings[100:200]:
        grown.learn(shift)
    grown.learn(np.full(17, np.nan))
    shift = readings[500] + np.eye(17)[4] * 9e-11
    assert np.allclose(grown.repair(shift).shift, whole.repair(shift).shift, rtol=1e-6)


def test_bad_input_is_refused():
    with pytest.raises(ValueError, match="finite"):
        GratingMask([[1.0, np.nan], [1.0, 2.0]], noise=1.0)
    with pytest.raises(ValueError, match="noise"):
        GratingMask(np.zeros((3, 2)), noise=0.0)
    with pytest.raises(ValueError, match="shape"):
        GratingMask(np.eye(3), noise=1.0).repair(np.zeros(2))
