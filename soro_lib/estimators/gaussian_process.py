"""Gaussian process regression on the newest samples, at a cost that fits into a control step.

Scikit-learn's `GaussianProcessRegressor` with a fixed kernel factorises the whole window at every step. Here
the inverse of the kernel matrix follows a replaced sample by two rank-one corrections; the result is the same
(tested against scikit-learn), and a whole batch of regressors runs as one.
"""

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import finite, number, positive

Array = NDArray[np.float64]


class RollingGaussianProcess:
    """Squared-exponential Gaussian process with fixed hyperparameters on a rolling window.

    Parameters
    ----------
    window : int
        Largest number of samples N_r; the oldest makes room for the newest.
    length_scales : array_like (n,)
        Length scale of each input, in its unit.
    outputs : int
        Number of outputs, each with its own mean over the window and a common kernel.
    noise : float
        Standard deviation of the noise relative to that of the signal [-].
    batch : tuple of int
        Leading shape: so many independent regressors, fed in step.

    Notes
    -----
    Equal to scikit-learn's ``GaussianProcessRegressor(RBF(length_scales), alpha=noise**2, optimizer=None,
    normalize_y=True)`` fitted to the window. An empty slot is a sample that correlates with nothing, so that
    growing and rolling are the same operation.

    Examples
    --------
    >>> process = RollingGaussianProcess(50, [1.0], outputs=1, noise=0.01)
    >>> for x in np.linspace(-1.0, 1.0, 21):
    ...     process.add([x], [x**2])
    >>> bool(abs(process.predict([0.5])[0] - 0.25) < 1e-2)
    True
    """

    def __init__(
        self,
        window: int,
        length_scales: ArrayLike,
        *,
        outputs: int,
        noise: float,
        batch: tuple[int, ...] = (),
    ) -> None:
        number("window", window, at_least=1)
        number("outputs", outputs, at_least=1)
        scales = finite("length_scales", length_scales, ("n",), above=0)
        self.window, self.length_scales, self.noise = window, scales, positive("noise", noise)
        self.count = 0
        self._inputs = np.zeros((*batch, window, len(scales)))
        self._outputs = np.zeros((*batch, window, outputs))
        self._inverse = np.broadcast_to(np.eye(window) / self._diagonal, (*batch, window, window)).copy()

    @property
    def size(self) -> int:
        """Number of samples in the window."""
        return min(self.count, self.window)

    @property
    def _diagonal(self) -> float:
        return 1.0 + self.noise**2

    def add(self, inputs: ArrayLike, outputs: ArrayLike) -> None:
        """Take one sample per regressor, ``(..., n)`` and ``(..., m)``, in place of the oldest.

        Raises
        ------
        ValueError
            If a value is not finite.
        """
        inputs = finite(f"inputs of sample {self.count}", inputs)
        outputs = finite(f"outputs of sample {self.count}", outputs)
        slot = self.count % self.window
        self._inputs[..., slot, :] = inputs / self.length_scales
        self._outputs[..., slot, :] = outputs
        self.count += 1
        if self.count % (10 * self.window) == 0:
            self._refresh()
        else:
            self._replace(slot)

    def predict(self, inputs: ArrayLike) -> Array:
        """Mean of the process at inputs ``(..., n)``, as ``(..., m)``; zero before the first sample."""
        if self.count == 0:
            return np.zeros((*self._outputs.shape[:-2], self._outputs.shape[-1]))
        values = self._outputs[..., : self.size, :]
        mean = values.mean(axis=-2)
        correlation = self._correlate(np.asarray(inputs, dtype=float) / self.length_scales)
        weights = (correlation[..., None, :] @ self._inverse)[..., 0, : self.size]
        return mean + (weights[..., None, :] @ (values - mean[..., None, :]))[..., 0, :]

    def _correlate(self, scaled: Array) -> Array:
        """Kernel between one scaled input and every slot; zero for empty slots."""
        difference = self._inputs - scaled[..., None, :]
        correlation = np.exp(-0.5 * np.einsum("...wn,...wn->...w", difference, difference))
        correlation[..., self.size :] = 0.0
        return correlation

    def _replace(self, slot: int) -> None:
        """Correct the inverse for a new sample in a slot: take the old one out, put the new one in."""
        removed = self._inverse[..., slot] / np.sqrt(self._inverse[..., slot, slot])[..., None]
        correlation = self._correlate(self._inputs[..., slot, :])
        correlation[..., slot] = 0.0
        projection = np.sum(removed * correlation, axis=-1)[..., None]
        added = (self._inverse @ correlation[..., None])[..., 0] - removed * projection
        remainder = self._diagonal - np.sum(added * correlation, axis=-1)
        added[..., slot] = -1.0
        added /= np.sqrt(remainder)[..., None]
        _exchange(
            self._inverse.reshape(-1, self.window, self.window),
            removed.reshape(-1, self.window),
            added.reshape(-1, self.window),
        )

    def _refresh(self) -> None:
        """Invert the kernel matrix afresh, so that rounding cannot pile up."""
        difference = self._inputs[..., :, None, :] - self._inputs[..., None, :, :]
        kernel = np.exp(-0.5 * np.einsum("...ijn,...ijn->...ij", difference, difference))
        self._inverse = np.linalg.inv(kernel + self.noise**2 * np.eye(self.window))


@njit(cache=True)
def _exchange(inverse: Array, removed: Array, added: Array) -> None:
    """Add ``added added' - removed removed'`` to matrices ``(n, w, w)`` in place, in one pass over memory."""
    for k in range(inverse.shape[0]):
        for i in range(inverse.shape[1]):
            for j in range(inverse.shape[2]):
                inverse[k, i, j] += added[k, i] * added[k, j] - removed[k, i] * removed[k, j]
