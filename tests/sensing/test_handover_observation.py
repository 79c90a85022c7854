"""The observer that draws its errors from a noise budget."""

import numpy as np
import pytest

from soro_lib.papers.soft_handover.world.observer import (
    NO_NOISE,
    NoisyObserver,
    VisionNoise,
    load_vision_noise,
)
from soro_lib.robots import HelixArm
from soro_lib.sensing.handover_observation import HandoverObservation

ARM = HelixArm()
BALL = np.array([0.15, 0.0, 0.64])


def test_perfect_sight_is_the_truth():
    look = NoisyObserver(NO_NOISE).observe(ARM.home, BALL, np.random.default_rng(0))
    np.testing.assert_allclose(look.wrist, [0, 0, 0.6], atol=1e-12)
    np.testing.assert_allclose(look.direction, [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(look.ball, BALL)


def test_jitter_changes_from_look_to_look_and_bias_stays_while_the_arm_stands_still():
    rng = np.random.default_rng(1)
    noise = VisionNoise(0.002, 0.005, 0, 0, 0, 0)
    means, deviations = [], []
    for _ in range(150):
        observer = NoisyObserver(noise)
        looks = np.array([observer.observe(ARM.home, BALL, rng).wrist for _ in range(30)])
        means.append(looks.mean(axis=0) - [0, 0, 0.6])
        deviations.append(looks.std(axis=0, ddof=1))
    assert np.mean(deviations) == pytest.approx(0.002, rel=0.05)
    assert np.std(means) == pytest.approx(0.005, rel=0.15)


def test_bias_is_another_one_after_a_long_way():
    rng = np.random.default_rng(2)
    far = ARM.home + np.tile([0.7, 0.0, 0.0], 3)
    products = []
    for _ in range(200):
        observer = NoisyObserver(VisionNoise(0, 0.005, 0, 0, 0, 0))
        first = observer.observe(ARM.home, BALL, rng).wrist - ARM.tip_points(ARM.home)[:3]
        second = observer.observe(far, BALL, rng).wrist - ARM.tip_points(far)[:3]
        products.append(first @ second)
    assert abs(np.mean(products)) < 0.3 * 3 * 0.005**2


@pytest.mark.parametrize("name", ["thesis", "gated", "joint", "three cameras"])
def test_every_estimator_has_a_budget(name):
    assert load_vision_noise(name).ball_jitter > 0


def test_unknown_estimator_is_named():
    with pytest.raises(KeyError, match="it has"):
        load_vision_noise("nobody")


def test_bad_budget_is_named():
    with pytest.raises(ValueError, match="ball_jitter"):
        VisionNoise(0, 0, 0, 0, -1, 0)


def test_a_look_of_the_wrong_shape_is_named():
    with pytest.raises(ValueError, match="ball must have shape"):
        HandoverObservation(None, None, np.zeros(2))
