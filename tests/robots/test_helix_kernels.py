"""The compiled kinematics: equal to the batched arm, the matrix exponential and numerical derivatives."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import expm

from soro_lib.robots import HelixArm
from soro_lib.robots.helix_kernels import (
    arc,
    arc_coefficients,
    cholesky,
    cholesky_solve,
    depth_moment,
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


@pytest.mark.parametrize("scale", [0.0, 1e-9, 1e-4, 0.0999, 0.1001, 1.0, 3.0])
def test_arc_is_the_matrix_exponential(scale):
    dx, dy, length = 0.6 * scale, -0.8 * scale, 0.24
    twist = np.array([[0, 0, dx, 0], [0, 0, dy, 0], [-dx, -dy, 0, length], [0, 0, 0, 0]])
    rotation, translation = np.empty((3, 3)), np.empty(3)
    arc(dx, dy, length, rotation, translation)
    np.testing.assert_allclose(rotation, expm(twist)[:3, :3], atol=1e-14)
    np.testing.assert_allclose(translation, expm(twist)[:3, 3], atol=1e-14)


def test_series_and_closed_form_agree_where_they_meet():
    np.testing.assert_allclose(arc_coefficients(0.1 - 1e-12), arc_coefficients(0.1 + 1e-12), rtol=1e-10)


def test_compiled_and_plain_python_agree():
    q = np.array([0.3, -0.4, 0.12, 0.5, 0.8, 0.24, -0.6, 0.2, 0.24])
    compiled = tip_points_and_jacobian(q, 0.1)
    plain = tip_points_and_jacobian.py_func(q, 0.1)
    np.testing.assert_allclose(compiled[0], plain[0], atol=1e-15)
    np.testing.assert_allclose(compiled[1], plain[1], atol=1e-14)


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
