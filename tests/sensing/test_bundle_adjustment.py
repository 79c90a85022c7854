"""Bundle adjustment against a numerical derivative, a dense least squares, and a made-up truth."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from soro_lib.sensing.bundle_adjustment import adjust, projection_jacobian

MATRIX = np.array([[500.0, 0, 320], [0, 500.0, 240], [0, 0, 1]])


def project(rotations, translations, points, frame, point):
    local = rotations[frame].apply(points[point]) + translations[frame]
    return 500 * local[:, :2] / local[:, 2:] + MATRIX[:2, 2]


@pytest.fixture
def problem():
    rng = np.random.default_rng(2)
    points = rng.uniform([-0.6, -0.5, 0.7], [0.6, 0.5, 1.3], (40, 3))
    rotations = Rotation.from_rotvec(rng.normal(0, 0.05, (5, 3)))
    translations = rng.normal(0, 0.1, (5, 3))
    frame, point = np.divmod(np.arange(200), 40)
    return rng, rotations, translations, points, frame, point


def test_jacobian_is_the_derivative_of_the_projection():
    rng = np.random.default_rng(1)
    local = rng.uniform([-0.5, -0.5, 0.8], [0.5, 0.5, 1.5], (20, 3))
    analytic = projection_jacobian(local, 500.0)
    step = 1e-6
    for column in range(6):
        change = np.zeros(6)
        change[column] = step
        ends = []
        for sign in (-1, 1):
            moved = local + sign * change[:3] + np.cross(sign * change[3:], local)
            ends.append(500 * moved[:, :2] / moved[:, 2:])
        np.testing.assert_allclose(
            analytic[:, :, column], (ends[1] - ends[0]) / (2 * step), rtol=1e-5, atol=1e-4
        )


def test_exact_pixels_give_the_truth_back(problem):
    rng, rotations, translations, points, frame, point = problem
    pixels = project(rotations, translations, points, frame, point)
    free = np.array([False, False, True, True, True])
    noisy = Rotation.from_rotvec(np.where(free[:, None], rng.normal(0, 0.02, (5, 3)), 0)) * rotations
    moved = translations + np.where(free[:, None], rng.normal(0, 0.02, (5, 3)), 0)
    start = points + rng.normal(0, 0.03, points.shape)
    found = adjust(MATRIX, noisy, moved, start, frame, point, pixels, free, iterations=30)
    np.testing.assert_allclose(found[2], points, atol=1e-6)
    np.testing.assert_allclose(found[1], translations, atol=1e-6)
    assert (found[0] * rotations.inv()).magnitude().max() < 1e-6


def test_it_finds_the_same_minimum_as_scipy(problem):
    rng, rotations, translations, points, frame, point = problem
    pixels = project(rotations, translations, points, frame, point) + rng.normal(0, 0.7, (200, 2))
    free = np.array([False, False, True, True, True])

    def residual(x):
        turned = Rotation.from_rotvec(np.vstack([np.zeros((2, 3)), x[:9].reshape(3, 3)])) * rotations
        shifted = translations + np.vstack([np.zeros((2, 3)), x[9:18].reshape(3, 3)])
        return (project(turned, shifted, x[18:].reshape(-1, 3), frame, point) - pixels).ravel()

    start = np.concatenate([np.zeros(18), points.ravel()])
    best = least_squares(residual, start, x_scale="jac")
    found = adjust(MATRIX, rotations, translations, points, frame, point, pixels, free, 40, huber=1e6)
    ours = project(found[0], found[1], found[2], frame, point) - pixels
    assert np.sum(ours**2) == pytest.approx(2 * best.cost, rel=1e-6)


def test_the_fixed_cameras_stay_and_the_cost_falls(problem):
    rng, rotations, translations, points, frame, point = problem
    pixels = project(rotations, translations, points, frame, point) + rng.normal(0, 0.5, (200, 2))
    start = points + rng.normal(0, 0.05, points.shape)
    free = np.array([False, True, True, True, True])
    found = adjust(MATRIX, rotations, translations, start, frame, point, pixels, free)
    np.testing.assert_array_equal(found[1][0], translations[0])
    assert (found[0][0] * rotations[0].inv()).magnitude() == 0
    before = np.linalg.norm(project(rotations, translations, start, frame, point) - pixels, axis=1).mean()
    after = np.linalg.norm(project(*found, frame, point) - pixels, axis=1).mean()
    assert after < 0.7 < 5 < before


def test_one_wrong_match_hardly_moves_the_rest(problem):
    _, rotations, translations, points, frame, point = problem
    pixels = project(rotations, translations, points, frame, point)
    pixels[7] += 80.0
    free = np.array([False, False, True, True, True])
    found = adjust(MATRIX, rotations, translations, points, frame, point, pixels, free, iterations=30)
    others = np.arange(40) != 7
    assert np.abs(found[2][others] - points[others]).max() < 2e-3
    assert np.linalg.norm(found[1] - translations, axis=1).max() < 2e-3
