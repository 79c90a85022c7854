"""The compiled kinematics: equal to the batched arm and to numerical derivatives."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from soro_lib.robots import HelixArm
from soro_lib.robots.helix_kernels import (
    cholesky,
    cholesky_solve,
    depth_moment,
    largest,
    tip_points_and_jacobian,
    unreachable_direction,
)

ARM = HelixArm()
STATES = st.tuples(
    *[
        component
        for bound in ARM.maximum_bends
        for component in (st.floats(-bound, bound), st.floats(-bound, bound), st.floats(0.08, 0.26))
    ]
).map(np.array)


@given(STATES)
def test_kernels_equal_the_batched_arm(q):
    points, jacobian = tip_points_and_jacobian(q, ARM.gripper_length)
    np.testing.assert_allclose(points, ARM.tip_points(q), atol=1e-12)
    np.testing.assert_allclose(jacobian, ARM.tip_points_jacobian(q), atol=1e-10)


@given(STATES)
@settings(max_examples=25)
def test_gravity_gradient_is_the_derivative(q):
    masses = np.array([0.04, 0.08, 0.08])
    _, gradient = depth_moment(q, masses, 3, 0.25, 0.05)
    step = 1e-6
    numerical = [
        (
            depth_moment(q + step * unit, masses, 3, 0.25, 0.05)[0]
            - depth_moment(q - step * unit, masses, 3, 0.25, 0.05)[0]
        )
        / (2 * step)
        for unit in np.eye(9)
    ]
    np.testing.assert_allclose(gradient, numerical, atol=1e-8)


@given(STATES)
def test_no_state_moves_the_tip_along_the_unreachable_direction(q):
    points, jacobian = tip_points_and_jacobian(q, 0.1)
    np.testing.assert_allclose(unreachable_direction(points) @ jacobian, 0, atol=1e-12)


@given(arrays(float, (6, 6), elements=st.floats(-1, 1)), arrays(float, 6, elements=st.floats(-1, 1)))
def test_cholesky_solves(root, vector):
    matrix = root @ root.T + 0.1 * np.eye(6)
    np.testing.assert_allclose(matrix @ cholesky_solve(cholesky(matrix), vector), vector, atol=1e-10)


def test_cholesky_says_when_a_matrix_is_not_positive_definite():
    assert np.isnan(cholesky(np.diag([1.0, -1.0, 1.0]))[0, 0])


def test_largest_magnitude_hides_no_nan():
    assert largest(np.array([1.0, -3.0, 2.0])) == 3.0
    assert np.isnan(largest(np.array([1.0, np.nan, 2.0])))
