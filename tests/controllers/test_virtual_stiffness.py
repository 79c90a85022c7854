"""Eqs. (8)-(11), (17)-(22) and Algorithms 1 and 2, against forms written out line by line."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from soro_lib.controllers import VirtualStiffnessController, limit_state
from soro_lib.controllers.virtual_stiffness import (
    STIFFEST,
    VIRTUAL_STIFFNESS,
    ErrorDependentStep,
    jacobian_step,
    reach_goal,
    state_limits,
    step_towards,
    weighted_pseudo_inverse,
    weighted_step,
    within_limits,
)
from soro_lib.robots import HelixArm
from soro_lib.robots.helix_kernels import unreachable_direction

ARM = HelixArm()
SOFTNESS = 1 / np.array(VIRTUAL_STIFFNESS)
BENT = np.array([0.3, -0.2, 0.11, 0.5, 0.4, 0.22, -0.6, 0.1, 0.24])
WILD = arrays(float, 9, elements=st.floats(-4, 4))


def test_limits_are_those_of_eq_11():
    lower, upper = state_limits(ARM)
    np.testing.assert_allclose(lower, [0, 0.08, 0, 0.16, 0, 0.16])
    np.testing.assert_allclose(upper, [np.pi / 4, 0.14, np.pi / 2, 0.26, np.pi / 2, 0.26])


@given(WILD)
def test_bends_and_lengths_are_eqs_8_and_9(q):
    selection = np.zeros((6, 9))
    for segment in range(3):
        selection[2 * segment, 3 * segment : 3 * segment + 2] = 1
        selection[2 * segment + 1, 3 * segment + 2] = 1
    np.testing.assert_allclose(np.abs(ARM.bends_and_lengths(q)), np.sqrt(selection @ q**2), atol=1e-12)


@given(WILD)
def test_limited_state_stays_within_the_limits(q):
    limited, softness = limit_state(q, SOFTNESS)
    assert within_limits(limited)
    assert np.all(softness <= SOFTNESS)
    assert np.all(np.isin(np.round(SOFTNESS / softness), [1, 100]))
    again, _ = limit_state(limited, softness)
    np.testing.assert_allclose(again, limited, atol=1e-12)
    if within_limits(q, slack=0.0):
        np.testing.assert_array_equal(limited, q)
        np.testing.assert_array_equal(softness, SOFTNESS)


@given(WILD)
def test_algorithm_2_written_out(q):
    """Lines 8 to 20 with magnitudes, signs kept, and radial shrinking where the printed root is imaginary."""
    expected, softness = q.copy(), SOFTNESS.copy()
    lower, upper = state_limits(ARM)
    for i in range(3):
        x, y, length = 3 * i, 3 * i + 1, 3 * i + 2
        if not lower[2 * i + 1] <= q[length] <= upper[2 * i + 1]:
            expected[length] = np.clip(q[length], lower[2 * i + 1], upper[2 * i + 1])
            softness[length] /= 100
        bend, bound = np.hypot(q[x], q[y]), upper[2 * i]
        if bend > bound:
            larger, smaller = (x, y) if abs(q[x]) > abs(q[y]) else (y, x)
            if abs(q[smaller]) <= bound:
                expected[larger] = np.sign(q[larger]) * np.sqrt(bound**2 - q[smaller] ** 2)
            else:
                expected[[x, y]] *= bound / bend
            softness[larger] /= 100
    limited, changed = limit_state(q, SOFTNESS)
    np.testing.assert_allclose(limited, expected, atol=1e-12)
    np.testing.assert_allclose(changed, softness)


def test_a_diagonal_matrix_of_stiffness_works_as_its_diagonal():
    q = np.array([1.0, 0, 0.2, 0, 0, 0.24, 0, 0, 0.24])
    vector, matrix = limit_state(q, SOFTNESS), limit_state(q, np.diag(SOFTNESS))
    np.testing.assert_array_equal(vector[0], matrix[0])
    np.testing.assert_array_equal(np.diag(vector[1]), matrix[1])


@given(st.integers(0, 2**32 - 1))
def test_pseudo_inverse_is_the_weighted_least_norm(seed):
    """The step solves the reachable part of J dq = e and costs least in the stiffness norm."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(ARM.lower, ARM.upper)
    softness = SOFTNESS * 10.0 ** -rng.integers(0, 3, 9)
    jacobian, error = ARM.tip_points_jacobian(q), 0.1 * rng.standard_normal(6)
    step = weighted_pseudo_inverse(jacobian, softness) @ error
    stretch = unreachable_direction(ARM.tip_points(q))
    np.testing.assert_allclose(jacobian @ step, error - stretch * (stretch @ error), atol=1e-7)
    null_space = np.linalg.svd(jacobian)[2][5:]
    np.testing.assert_allclose(null_space @ (step / softness), 0, atol=1e-5 * np.abs(step / softness).max())
    fast = weighted_step(jacobian, softness, error, stretch)
    np.testing.assert_allclose(fast, step, atol=1e-6 * max(1, np.abs(step).max()))


def test_steps_of_eqs_17_to_22():
    jacobian = ARM.tip_points_jacobian(BENT)
    measured = ARM.tip_points(BENT)
    goal = measured + 0.02 * np.array([1, -1, 0.5, 1, -1, 0.5])
    error = goal - measured
    np.testing.assert_allclose(
        jacobian_step(BENT, jacobian, error, 0.3, np.ones(9)),
        BENT + 0.3 * np.linalg.pinv(jacobian, rcond=1e-8) @ error,
        atol=1e-9,
    )
    towards = step_towards(measured, goal, 0.3)
    np.testing.assert_allclose(towards, 0.3 * goal + 0.7 * measured)
    np.testing.assert_allclose(
        jacobian_step(BENT, jacobian, towards - measured, 1.0, SOFTNESS),
        jacobian_step(BENT, jacobian, error, 0.3, SOFTNESS),
        atol=1e-12,
    )


def algorithm_1(q_sys, q_est, goal, measured, step_size, iterations, early_exit, tolerance=0.005):
    """Algorithm 1 line by line with the batched arm, NumPy's pseudo-inverse and `limit_state`."""
    softness = SOFTNESS.copy()
    target = step_size * goal + (1 - step_size) * measured
    error = target - measured
    result = None
    for _ in range(iterations):
        change = weighted_pseudo_inverse(ARM.tip_points_jacobian(q_est), softness) @ error
        change *= min(1, 0.5 / max(np.abs(change).max(), 1e-300))
        wanted = q_sys + change
        q_sys, softness = limit_state(wanted, softness)
        softness = np.maximum(softness, STIFFEST * SOFTNESS)
        q_est = q_est + change + (q_sys - wanted)
        error = target - ARM.tip_points(q_est)
        if np.linalg.norm(error) < tolerance:
            result = q_sys, q_est
            if early_exit:
                break
    return result or (q_sys, q_est)


@pytest.mark.parametrize("inner_loop", ["all", "early exit"])
@pytest.mark.parametrize("seed", range(8))
def test_algorithm_1_written_out(seed, inner_loop):
    rng = np.random.default_rng(seed)
    q_sys = limit_state(rng.uniform(0.9 * ARM.lower + 0.1 * ARM.home, ARM.upper), SOFTNESS)[0]
    q_est = q_sys * np.tile([0.6, 0.6, 1.0], 3)
    measured = ARM.tip_points(q_est)
    goal = measured + np.tile(0.1 * rng.standard_normal(3), 2)
    step = VirtualStiffnessController(step_size=0.4, inner_loop=inner_loop).update(
        q_sys, q_est, goal, measured
    )
    expected = algorithm_1(q_sys, q_est, goal, measured, 0.4, 20, inner_loop == "early exit")
    np.testing.assert_allclose(step.q_sys, expected[0], atol=1e-5)
    np.testing.assert_allclose(step.q_est, expected[1], atol=1e-5)
    assert within_limits(step.q_sys)


def test_compiled_and_plain_python_agree():
    measured = ARM.tip_points(BENT)
    arguments = (
        BENT,
        BENT,
        measured + 0.03,
        measured,
        SOFTNESS,
        *state_limits(ARM),
        0.005,
        20,
        False,
        False,
        0.1,
    )
    compiled, plain = reach_goal(*arguments), reach_goal.py_func(*arguments)
    np.testing.assert_allclose(compiled[0], plain[0], atol=1e-12)
    np.testing.assert_allclose(compiled[1], plain[1], atol=1e-12)


def test_a_goal_out_of_reach_is_reported_and_stays_within_the_limits():
    far = ARM.tip_points(ARM.home) + 2.0
    step = VirtualStiffnessController(step_size=1.0).update(ARM.home, ARM.home, far, ARM.tip_points(ARM.home))
    assert not step.converged
    assert "left of this step" in step.reason
    assert step.crops > 0
    assert within_limits(step.q_sys)
    assert np.isfinite(step.q_est).all()


@given(st.integers(0, 2**32 - 1), st.floats(0.05, 1.5))
def test_whatever_the_goal_the_command_stays_within_the_limits(seed, step_size):
    rng = np.random.default_rng(seed)
    goal, measured = rng.normal(0, 1, (2, 6))
    step = VirtualStiffnessController(step_size=step_size).update(
        ARM.home, rng.normal(0, 1, 9), goal, measured
    )
    assert within_limits(step.q_sys)


def test_step_grows_with_the_error_between_its_bounds():
    step = ErrorDependentStep(near=0.2, far=1.0, near_error=0.05, far_error=0.25)
    assert [step(e) for e in (0.0, 0.05, 0.15, 0.25, 9.0)] == pytest.approx([0.2, 0.2, 0.6, 1.0, 1.0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"step_size": 0.0}, "step_size"),
        ({"step_size": np.nan}, "step_size"),
        ({"stiffness": (1.0,) * 8}, "stiffness"),
        ({"tolerance": -1.0}, "tolerance"),
        ({"max_iterations": 0}, "max_iterations"),
        ({"inner_loop": "some"}, "inner_loop"),
        ({"error_reference": "guess"}, "error_reference"),
    ],
)
def test_bad_parameters_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        VirtualStiffnessController(**arguments)


@pytest.mark.parametrize("position", range(4))
def test_bad_input_is_named(position):
    arguments = [ARM.home, ARM.home, np.zeros(6), np.zeros(6)]
    arguments[position] = arguments[position] * np.nan
    with pytest.raises(ValueError, match=("q_sys", "q_est", "goal_points", "measured_points")[position]):
        VirtualStiffnessController().update(*arguments)


def test_limit_state_refuses_what_is_no_state():
    with pytest.raises(ValueError, match=r"q must be finite, got nan at index \(0,\)"):
        limit_state([np.nan] * 9, SOFTNESS)
    with pytest.raises(ValueError, match="inverse_stiffness"):
        limit_state(ARM.home, [1.0, 2.0])
