"""An online extreme learning machine: wavelength shifts in, tip pose out (Wang et al., Sec. II-C).

One hidden layer of random radial basis functions, whose output weights are solved once by least squares
(Eqs. (1)-(9)) and then refreshed sample by sample with exponential forgetting (Eqs. (10)-(17)), which is
recursive least squares. Three things are added that the paper does not print and that it cannot do without:
the inputs are scaled, the first solution is regularised, and the covariance is bounded.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.blas import dsymv, dsyr

from soro_lib.checks import finite, number, numbers, positive
from soro_lib.poses import align_quaternion

Array = NDArray[np.float64]

POSE_SIZE = 7
IDENTITY_QUATERNION = np.array([0.0, 0.0, 0.0, 1.0])


@dataclass(frozen=True)
class UpdateResult:
    """What one sample taught the network.

    Attributes
    ----------
    prediction : ndarray (7,)
        Pose predicted before the sample was learned, with a unit quaternion [m, -].
    variance : float
        Variance of each component of its position [m^2].
    prior_error : ndarray (7,)
        Label minus prediction before the sample was learned: the honest prediction error [m, -].
    posterior_error : ndarray (7,)
        Label minus prediction after the sample was learned: what remains of the label itself [m, -].
    accepted : bool
        False if the sample was refused and nothing was learned.
    reason : str
        Why the sample was refused; empty if it was accepted.
    """

    prediction: Array
    variance: float
    prior_error: Array
    posterior_error: Array
    accepted: bool
    reason: str = ""


def unit_quaternion(quaternion: ArrayLike) -> Array:
    """Scale quaternions ``(..., 4)`` to unit length; one without a direction becomes the identity."""
    quaternion = np.asarray(quaternion, dtype=float)
    if quaternion.ndim == 1:  # a single one, as in every step of a filter: four times faster
        length = math.sqrt(quaternion @ quaternion)
        return quaternion / length if 1e-9 < length < math.inf else IDENTITY_QUATERNION.copy()
    norm = np.sqrt(np.einsum("...i,...i->...", quaternion, quaternion))[..., None]
    usable = np.isfinite(norm) & (norm > 1e-9)
    return np.where(usable, quaternion / np.where(usable, norm, 1.0), IDENTITY_QUATERNION)


def radial_basis(inputs: ArrayLike, centres: ArrayLike, widths: ArrayLike) -> Array:
    """Response of the hidden nodes, ``exp(-|x - a_i|^2 / b_i)`` (Wang et al., Eq. (3); Erratum VS-5).

    Parameters
    ----------
    inputs : array_like (..., l)
        Scaled wavelength shifts [-].
    centres : array_like (N, l)
        Node centres a_i [-].
    widths : array_like (N,)
        Node widths b_i > 0 [-].

    Returns
    -------
    ndarray (..., N)
        One row of the hidden-layer output matrix per input.
    """
    inputs, centres = np.asarray(inputs, dtype=float), np.asarray(centres, dtype=float)
    return _radial_basis(inputs, centres.T, np.vecdot(centres, centres), -np.asarray(widths, dtype=float))


def _radial_basis(inputs: Array, centres: Array, squared_norms: Array, negative_widths: Array) -> Array:
    """Respond as `radial_basis`, to centres ``(l, N)`` with what depends on them alone computed before."""
    squared = -2.0 * inputs @ centres
    squared += np.vecdot(inputs, inputs)[..., None]
    squared += squared_norms
    squared /= negative_widths
    return np.exp(squared, out=squared)


def same_hemisphere(poses: ArrayLike, reference: ArrayLike) -> Array:
    """Flip the sign of each pose's quaternion so that it lies on the side of the reference's.

    Parameters
    ----------
    poses, reference : array_like (..., 7)
        Position [m] and scalar-last quaternion; the two shapes broadcast.

    Returns
    -------
    ndarray (..., 7)
        The same poses; q and -q are one rotation, but their average is not.
    """
    poses = np.asarray(poses, dtype=float)
    aligned = align_quaternion(poses[..., 3:], np.asarray(reference, dtype=float)[..., 3:])
    return np.concatenate([np.broadcast_to(poses[..., :3], (*aligned.shape[:-1], 3)), aligned], axis=-1)


class ExtremeLearningMachine:
    """Radial basis network from wavelength shifts to the tip pose, learned online.

    Parameters
    ----------
    rng : numpy.random.Generator
        Draws the centres ~ U(-1, 1) and the widths ~ U(width_range) * inputs, once.
    inputs : int
        Number of gratings l.
    hidden : int
        Number of hidden nodes N (paper: 200).
    width_range : tuple of float
        Range of the node widths per input dimension [-].
    input_scale : float
        Wavelength shift that becomes 1 at the input [m]; about a third of the range of shifts.
    regularisation : float
        Ridge added to the normal matrix of the first solution, > 0 [-].
    forgetting : float
        Weight w of the past per sample, in (0, 1] [-].
    maximum_trace : float
        Bound on the trace of the covariance H; forgetting pauses where it would be exceeded [-].

    Notes
    -----
    The shift is in metres, a pose is ``(x, y, z, qx, qy, qz, qw)`` in metres with a scalar-last unit
    quaternion. H is kept as one triangle, so it is symmetric by construction.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> network = ExtremeLearningMachine(rng, inputs=2, hidden=20, regularisation=1e-8)
    >>> shifts = 5e-11 * rng.uniform(-1, 1, (200, 2))
    >>> poses = np.zeros((200, 7)); poses[:, 0] = 1e8 * shifts[:, 0]; poses[:, 6] = 1.0
    >>> network.fit(shifts, poses)
    >>> bool(abs(network.predict([2e-11, 0.0])[0] - 2e-3) < 1e-5)
    True
    """

    def __init__(
        self,
        rng: np.random.Generator,
        *,
        inputs: int = 17,
        hidden: int = 200,
        width_range: tuple[float, float] = (1.0, 10.0),
        input_scale: float = 5e-11,
        regularisation: float = 1e-4,
        forgetting: float = 0.999,
        maximum_trace: float = 1e7,
    ) -> None:
        number("inputs", inputs, at_least=1)
        number("hidden", hidden, at_least=1)
        number("width_range[0]", width_range[0], above=0, at_most=width_range[1])
        number("forgetting", forgetting, above=0, at_most=1)
        number("maximum_trace", maximum_trace, above=0, at_most=math.inf)
        self.centres = rng.uniform(-1.0, 1.0, (hidden, inputs))
        self.widths = rng.uniform(*width_range, hidden) * inputs
        self._nodes = self.centres.T, np.vecdot(self.centres, self.centres), -self.widths
        self.input_scale = positive("input_scale", input_scale)
        self.regularisation = positive("regularisation", regularisation)
        self.forgetting = forgetting
        self.maximum_trace = maximum_trace
        self.weights = np.zeros((hidden, POSE_SIZE))
        self.weights[:, 6] = 1.0 / hidden
        self.label_variance = 0.0
        self.is_fitted = False
        self._covariance = np.asfortranarray(np.eye(hidden) / regularisation)

    @property
    def covariance(self) -> Array:
        """Covariance H of the output weights, ``(N, N)``, before scaling by the label variance [-]."""
        lower = np.tril(self._covariance)
        return lower + np.tril(lower, -1).T

    @property
    def trace(self) -> float:
        """Trace of the covariance [-]."""
        return float(self._covariance.diagonal().sum())

    def hidden_output(self, shift: ArrayLike) -> Array:
        """Rows of the hidden-layer output matrix, ``(..., N)`` for shifts ``(..., l)`` [m] (Eqs. (3), (4)).

        Raises
        ------
        ValueError
            If the number of gratings is wrong or a shift is not finite; the message names the gratings.
        """
        shift = numbers("shift", shift, (..., self.centres.shape[1]))
        if not np.isfinite(shift).all():
            broken = np.unique(np.nonzero(~np.isfinite(shift))[-1])
            raise ValueError(
                f"shift of gratings {broken.tolist()} is not finite; repair it with a GratingMask"
            )
        return _radial_basis(shift / self.input_scale, *self._nodes)

    def fit(self, shifts: ArrayLike, poses: ArrayLike) -> None:
        """Solve the output weights for a first batch of samples (Eqs. (5)-(7), (9); Errata VS-6, VS-7).

        Parameters
        ----------
        shifts : array_like (N0, l)
            Wavelength shifts [m].
        poses : array_like (N0, 7)
            Labels: poses from the camera [m, -].

        Raises
        ------
        ValueError
            If the samples do not match or are not finite.
        """
        hidden = self.hidden_output(numbers("shifts", shifts, ("n", self.centres.shape[1])))
        poses = finite("poses", poses, (len(hidden), POSE_SIZE))
        labels = same_hemisphere(poses, poses[0])
        normal = hidden.T @ hidden + self.regularisation * np.eye(hidden.shape[1])
        try:
            factor = cho_factor(normal, lower=True)
        except np.linalg.LinAlgError:
            raise ValueError(
                f"the normal matrix is singular in floating point (condition {np.linalg.cond(normal):.1e}); "
                f"raise regularisation={self.regularisation}"
            ) from None
        self.weights = cho_solve(factor, hidden.T @ labels)
        self._covariance = np.asfortranarray(cho_solve(factor, np.eye(hidden.shape[1])))
        self.label_variance = float(np.mean((labels - hidden @ self.weights)[:, :3] ** 2))
        self.is_fitted = True

    def predict(self, shift: ArrayLike) -> Array:
        """Tip poses ``(..., 7)`` for shifts ``(..., l)`` [m], with unit quaternions (Eqs. (1), (2), (8))."""
        return self._pose(self.hidden_output(shift) @ self.weights)

    def predict_with_variance(self, shift: ArrayLike) -> tuple[Array, float]:
        """Pose ``(7,)`` and the variance of each of its position components [m^2] for one shift.

        The variance is that of recursive least squares, ``sigma^2 (1 + phi H phi')``, with sigma the running
        label residual.
        """
        hidden = self.hidden_output(shift)
        spread = float(hidden @ dsymv(1.0, self._covariance, hidden, lower=1))
        return self._pose(hidden @ self.weights), self._variance(spread)

    def update(self, shift: ArrayLike, pose: ArrayLike) -> UpdateResult:
        """Learn one sample (Eqs. (10)-(17) in their corrected, cumulative form; Errata VS-2, VS-3).

        Parameters
        ----------
        shift : array_like (l,)
            Wavelength shifts [m].
        pose : array_like (7,)
            Label: pose from the camera [m, -]; the sign of its quaternion does not matter.

        Returns
        -------
        UpdateResult
            Errors before and after learning; a label that is not finite, or a covariance that lost its
            positive definiteness, is refused and leaves the network as it was.
        """
        label = numbers("pose", pose, (POSE_SIZE,))
        hidden = self.hidden_output(shift)
        raw = hidden @ self.weights
        direction = dsymv(1.0, self._covariance, hidden, lower=1)
        spread = float(hidden @ direction)
        prediction, variance = self._pose(raw), self._variance(spread)
        if label[3:] @ raw[3:] < 0.0:
            label = np.concatenate([label[:3], -label[3:]])
        innovation = label - raw
        if not np.isfinite(innovation).all():
            return UpdateResult(prediction, variance, innovation, innovation, False, "label not finite")
        if not 0.0 <= spread < np.inf:
            reason = "covariance not positive definite"
            return UpdateResult(prediction, variance, innovation, innovation, False, reason)
        forgetting = self.forgetting if self.trace <= self.forgetting * self.maximum_trace else 1.0
        scale = 1.0 / (forgetting + spread)
        self.weights += (scale * direction)[:, None] * innovation
        dsyr(-scale, direction, lower=1, a=self._covariance, overwrite_a=1)
        if forgetting < 1.0:
            self._covariance *= 1.0 / forgetting  # four times faster than a division of every entry
        residual = innovation * (forgetting * scale)
        self.label_variance += 0.005 * (float(innovation[:3] @ residual[:3]) / 3.0 - self.label_variance)
        return UpdateResult(prediction, variance, innovation, residual, True)

    def _variance(self, spread: float) -> float:
        return self.label_variance * (1.0 + max(spread, 0.0))

    @staticmethod
    def _pose(raw: Array) -> Array:
        pose = raw.copy()
        pose[..., 3:] = unit_quaternion(raw[..., 3:])
        return pose
