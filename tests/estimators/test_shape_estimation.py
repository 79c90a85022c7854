"""The state optimisation, Eq. (16), against SciPy's general solver and its own conditions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soro_lib.estimators import estimate_shape
from soro_lib.estimators.shape_estimation import POSE_WEIGHTS, estimate_shape_by_slsqp
from soro_lib.robots import HelixArm

ARM = HelixArm()
SHARES = np.repeat([0.45, 0.55, 0.60], 3) ** np.tile([1, 1, 0], 3)


def sagging_case(seed):
    """Return a commanded state within the limits and the noisy pose of an arm that sags from it."""
    rng = np.random.default_rng(seed)
    commanded = rng.uniform(0.7 * ARM.lower + 0.3 * ARM.home, 0.7 * ARM.upper + 0.3 * ARM.home)
    points = ARM.tip_points(SHARES * commanded)
    wrist = points[:3] + 0.003 * rng.standard_normal(3)
    direction = points[3:] - points[:3] + 0.003 * rng.standard_normal(3)
    return commanded, np.concatenate([wrist, wrist + 0.1 * direction / np.linalg.norm(direction)])


@pytest.mark.parametrize("seed", range(40))
def test_same_optimum_as_slsqp(seed):
    commanded, measured = sagging_case(seed)
    own, reference = estimate_shape(commanded, measured), estimate_shape_by_slsqp(commanded, measured)
    assert own.converged
    assert own.cost <= reference.cost + 1e-9
    np.testing.assert_allclose(own.q, reference.q, atol=2e-6)


@given(st.integers(0, 2**32 - 1), st.floats(0.001, 0.05))
@settings(max_examples=40)
def test_optimum_lies_on_the_bound_and_satisfies_the_kkt_conditions(seed, bound):
    commanded, measured = sagging_case(seed)
    estimate = estimate_shape(commanded, measured, bound)
    assert estimate.converged
    assert estimate.residual <= bound * (1 + 1e-6)
    if estimate.cost > 0:
        assert estimate.residual == pytest.approx(bound, rel=1e-6)
        miss = ARM.tip_points(estimate.q) - measured
        pull = ARM.tip_points_jacobian(estimate.q).T @ miss
        push = np.square(POSE_WEIGHTS) * (commanded - estimate.q)
        multiplier = push @ pull / (pull @ pull)
        assert multiplier > 0
        np.testing.assert_allclose(push, multiplier * pull, atol=1e-6 * max(1, np.abs(push).max()))


def test_a_pose_within_the_bound_keeps_the_commanded_state():
    estimate = estimate_shape(ARM.home, ARM.tip_points(ARM.home) + 1e-3, bound=0.005)
    assert estimate.converged
    np.testing.assert_array_equal(estimate.q, ARM.home)


def test_a_pose_that_no_state_has_is_reported():
    stretched = np.array([0.1, 0, 0.5, 0.1, 0, 0.75])
    estimate = estimate_shape(ARM.home, stretched)
    assert not estimate.converged
    assert "no state explains" in estimate.reason
    assert np.isfinite(estimate.q).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"q_sys": np.zeros(8)}, "q_sys must have shape"),
        ({"q_sys": np.full(9, np.nan)}, "q_sys must be finite"),
        ({"measured_points": [0, 0, np.inf, 0, 0, 0]}, "measured_points must be finite"),
        ({"measured_points": []}, "measured_points must have shape"),
        ({"bound": 0.0}, "bound must be a finite number above 0"),
        ({"bound": np.nan}, "bound must be a finite number above 0"),
        ({"weights": np.zeros(9)}, "weights must be a finite number above 0"),
    ],
)
def test_bad_input_is_named(arguments, message):
    good = {"q_sys": ARM.home, "measured_points": ARM.tip_points(ARM.home)}
    with pytest.raises(ValueError, match=message):
        estimate_shape(**{**good, **arguments})
