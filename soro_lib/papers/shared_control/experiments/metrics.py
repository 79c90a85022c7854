"""The paper's performance metrics on a recorded trial, simulated or driven by hand.

Source: Stroppa et al., Section 5.2 and Eqs. (9)-(11).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def trajectory_length(tips: ArrayLike) -> float:
    """Length L of the tip's path [m]: integral of the velocity norm (Stroppa et al., Eq. (9), Erratum SC-15).

    Parameters
    ----------
    tips : array_like
        (n, 3) tip positions [m], in order.
    """
    return float(np.linalg.norm(np.diff(_points("tips", tips), axis=0), axis=1).sum())


def mean_assistance(forces: ArrayLike, times: ArrayLike) -> float:
    """Mean norm H of the guidance force [N] over the trial (Stroppa et al., Eq. (10), Erratum SC-16).

    Parameters
    ----------
    forces : array_like
        (n, 3) forces [N], each held until the next sample.
    times : array_like
        (n,) times of the samples [s], increasing; the first follows the start by the first period.

    Raises
    ------
    ValueError
        If the times do not increase or are not as many as the forces.
    """
    norms = np.linalg.norm(_points("forces", forces), axis=1)
    moments = np.asarray(times, dtype=float)
    periods = np.diff(moments, prepend=0.0)
    if moments.shape != norms.shape or np.any(periods <= 0):
        raise ValueError(f"times must be {len(norms)} increasing numbers above 0, got shape {moments.shape}")
    return float(norms @ periods / moments[-1])


def placement_error(items: ArrayLike, targets: ArrayLike) -> float:
    """Mean horizontal distance P of the items from their targets [m] (Stroppa et al., Eq. (11)).

    Parameters
    ----------
    items, targets : array_like
        (n, 3) positions [m], item i belongs on target i.
    """
    offsets = _points("items", items) - _points("targets", targets)
    return float(np.linalg.norm(offsets[:, :2], axis=1).mean())


def _points(name: str, value: ArrayLike) -> NDArray[np.float64]:
    points = np.asarray(value, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        raise ValueError(f"{name} must have shape (n, 3) with n >= 1, got {points.shape}")
    if not np.all(np.isfinite(points)):
        raise ValueError(
            f"{name} must be finite, row {int(np.argmin(np.isfinite(points).all(axis=1)))} is not"
        )
    return points
