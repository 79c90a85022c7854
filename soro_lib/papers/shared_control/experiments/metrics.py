"""The paper's performance metrics on a recorded trial, simulated or driven by hand.

Source: Stroppa et al., Section 5.2 and Eqs. (9)-(11).
"""

import numpy as np
from numpy.typing import ArrayLike

from soro_lib.checks import finite, increasing


def trajectory_length(tips: ArrayLike) -> float:
    """Length L of the tip's path [m]: integral of the velocity norm (Stroppa et al., Eq. (9), Erratum SC-15).

    Parameters
    ----------
    tips : array_like
        (n, 3) tip positions [m], in order.
    """
    return float(np.linalg.norm(np.diff(finite("tips", tips, ("n", 3)), axis=0), axis=1).sum())


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
    norms = np.linalg.norm(finite("forces", forces, ("n", 3)), axis=1)
    moments = increasing("times", np.concatenate([[0.0], times]), (len(norms) + 1,))
    return float(norms @ np.diff(moments) / moments[-1])


def placement_error(items: ArrayLike, targets: ArrayLike) -> float:
    """Mean horizontal distance P of the items from their targets [m] (Stroppa et al., Eq. (11)).

    Parameters
    ----------
    items, targets : array_like
        (n, 3) positions [m], item i belongs on target i.
    """
    offsets = finite("items", items, ("n", 3)) - finite("targets", targets, ("n", 3))
    return float(np.linalg.norm(offsets[:, :2], axis=1).mean())
