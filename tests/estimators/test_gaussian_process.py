"""The rolling Gaussian process against scikit-learn's, and its bookkeeping."""

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF

from soro_lib.estimators.gaussian_process import RollingGaussianProcess

WINDOW, SCALES, NOISE = 40, np.array([2.0, 2.0, 1.0]), 0.3


def walk(rng, count, batch=()):
    """A random walk of inputs and smooth outputs of it."""
    inputs = np.cumsum(rng.normal(0.0, 0.1, (count, *batch, 3)), axis=0)
    return inputs, np.stack([np.sin(inputs[..., 0]) + inputs[..., 1], inputs[..., 2] ** 2], axis=-1)


def reference(inputs, outputs, query):
    process = GaussianProcessRegressor(RBF(SCALES), alpha=NOISE**2, optimizer=None, normalize_y=True)
    return process.fit(inputs, outputs).predict(query[None])[0]


@pytest.mark.parametrize("count", [2, 17, WINDOW, WINDOW + 1, 10 * WINDOW - 1, 10 * WINDOW, 10 * WINDOW + 7])
def test_equal_to_scikit_learn_on_the_same_window(count):
    rng = np.random.default_rng(1)
    inputs, outputs = walk(rng, count)
    process = RollingGaussianProcess(WINDOW, SCALES, outputs=2, noise=NOISE)
    for sample in zip(inputs, outputs):
        process.add(*sample)
    query = inputs[-1] + 0.1
    assert process.size == min(count, WINDOW)
    expected = reference(inputs[-WINDOW:], outputs[-WINDOW:], query)
    assert np.allclose(process.predict(query), expected, rtol=0.0, atol=1e-8)


def test_batch_is_so_many_single_processes():
    rng = np.random.default_rng(2)
    inputs, outputs = walk(rng, 90, (2, 3))
    together = RollingGaussianProcess(WINDOW, SCALES, outputs=2, noise=NOISE, batch=(2, 3))
    alone = RollingGaussianProcess(WINDOW, SCALES, outputs=2, noise=NOISE)
    for x, y in zip(inputs, outputs):
        together.add(x, y)
        alone.add(x[1, 2], y[1, 2])
    assert np.allclose(together.predict(inputs[-1])[1, 2], alone.predict(inputs[-1, 1, 2]), atol=1e-12)


def test_no_sample_predicts_nothing():
    assert np.array_equal(RollingGaussianProcess(5, [1.0], outputs=2, noise=0.1).predict([0.0]), [0.0, 0.0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [((0, [1.0], 1, 0.1), "window"), ((5, [0.0], 1, 0.1), "length_scales"), ((5, [1.0], 1, 0.0), "noise")],
)
def test_bad_parameters_are_refused(arguments, message):
    window, scales, outputs, noise = arguments
    with pytest.raises(ValueError, match=message):
        RollingGaussianProcess(window, scales, outputs=outputs, noise=noise)


def test_sample_that_is_not_finite_is_refused():
    process = RollingGaussianProcess(5, [1.0], outputs=1, noise=0.1)
    with pytest.raises(ValueError, match="sample 0"):
        process.add([np.nan], [1.0])
    assert process.count == 0
