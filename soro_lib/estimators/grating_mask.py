"""Finding and replacing gratings that do not fit the others: touched, broken or missing ones.

An improvement over Wang et al., who name contact on the fibre as the weak point of their estimator
(Sec. IV-F) and propose a sheath. Seventeen gratings watch an arm of two degrees of freedom: each of them is
predictable from the rest, so one that disagrees can be set aside and filled in.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import finite, number, numbers, positive

Array = NDArray[np.float64]

REFRESH = 10
"""Number of learned samples after which the model is inverted anew."""


@dataclass(frozen=True)
class RepairedShift:
    """Wavelength shifts after the check.

    Attributes
    ----------
    shift : ndarray (l,)
        Finite shifts; masked ones replaced by their conditional mean given the others [m].
    masked : ndarray (l,) of bool
        Which gratings were replaced.
    """

    shift: Array
    masked: NDArray[np.bool_]


class GratingMask:
    """Gaussian model of all shifts, and the leave-one-out test that follows from it.

    Parameters
    ----------
    shifts : array_like (n, l)
        Wavelength shifts of a run without contact [m].
    noise : float
        Standard deviation of one shift [m]; added to the model so that no grating is believed exactly.
    gate : float
        Number of leave-one-out standard deviations at which a grating is set aside.
    most : int or None
        Largest number of gratings set aside for disagreeing; default a third of them. Gratings that are not
        finite are always set aside.
    """

    def __init__(
        self, shifts: ArrayLike, *, noise: float, gate: float = 5.0, most: int | None = None
    ) -> None:
        shifts = finite("shifts", shifts, ("n >= 2", "l"))
        self.gate = number("gate", gate, above=0, at_most=np.inf)
        self.most = shifts.shape[1] // 3 if most is None else most
        self._scale = positive("noise", noise)
        self._mean = shifts.mean(axis=0)
        self._count = len(shifts)
        deviations = (shifts - self._mean) / noise
        self._scatter = deviations.T @ deviations
        self._refresh()

    def learn(self, shift: ArrayLike) -> None:
        """Add one sample that is known to be free of contact, ``(l,)`` [m]; what is not finite is ignored."""
        deviation = (np.asarray(shift, dtype=float) - self._mean) / self._scale
        if not np.isfinite(deviation).all():
            return
        self._count += 1
        self._mean = self._mean + self._scale * deviation / self._count
        self._scatter += (1.0 - 1.0 / self._count) * np.multiply.outer(deviation, deviation)
        if self._count % REFRESH == 0:
            self._refresh()

    def repair(self, shift: ArrayLike) -> RepairedShift:
        """Set aside the gratings that disagree, worst first, and fill them in from the rest.

        Parameters
        ----------
        shift : array_like (l,)
            Wavelength shifts [m]; may hold values that are not finite.

        Returns
        -------
        RepairedShift
            If every grating is missing, the mean of the model, with all of them masked.

        Raises
        ------
        ValueError
            If the number of gratings is wrong.
        """
        shift = numbers("shift", shift, self._mean.shape)
        masked = ~np.isfinite(shift)
        deviation = np.where(masked, 0.0, (shift - self._mean) / self._scale)
        precision = self._precision
        if masked.any():
            precision = self._marginal_precision(masked)
        for _ in range(self.most):
            surprise = np.abs(precision @ deviation) / np.sqrt(np.maximum(precision.diagonal(), 1e-300))
            worst = int(surprise.argmax())
            if surprise[worst] <= self.gate:
                break
            masked[worst], deviation[worst] = True, 0.0
            precision = self._marginal_precision(masked)
        if masked.any():
            deviation[masked] = self._covariance[masked] @ (precision @ deviation)
        return RepairedShift(np.where(masked, self._mean + self._scale * deviation, shift), masked)

    def _refresh(self) -> None:
        self._covariance = self._scatter / self._count + np.eye(len(self._scatter))
        self._precision = np.linalg.inv(self._covariance)

    def _marginal_precision(self, masked: NDArray[np.bool_]) -> Array:
        """Precision of the trusted gratings alone, padded with zeros to the full size."""
        trusted = np.flatnonzero(~masked)
        precision = np.zeros_like(self._covariance)
        precision[np.ix_(trusted, trusted)] = np.linalg.inv(self._covariance[np.ix_(trusted, trusted)])
        return precision
