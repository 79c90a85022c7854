"""Declared calibration: the poses of Table II of Lai et al., and the actuations fitted to them.

The paper prints where base, mid and tip of four configurations were in simulation and in the experiment, but
not the seven actuator values. They are fitted here, openly; what follows from them about the simulated
positions counts as calibrated, never as reproduced.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import least_squares

from soro_lib.project import data_directory
from soro_lib.robots import CableDrivenArm
from soro_lib.robots.cable_driven_kernels import compiled_kinematics

Array = NDArray[np.float64]

LOOP_RATE = 11.0
"""Printed rate of the loop with servos [Hz]; only its period is derived from it."""
PAYLOAD, ROBOT_MASS = 4.0, 5.0
"""Printed masses of bullet case and robot [g]; only their ratio is derived from them."""
POINTS = ("base", "mid", "tip")
"""Frames {B}, {M}, {T} of the paper."""


def printed_positions(kind: str) -> Array:
    """Return the positions (4 configurations, 3 points, 3 axes) [m] of Table II; kind is "sim" or "exp"."""
    table = pd.read_csv(data_directory("gesture_steering") / "table2_positions.csv")
    columns = [f"{kind}_{axis}_mm" for axis in "xyz"]
    return table[columns].to_numpy(dtype=float).reshape(4, 3, 3) * 1e-3


@dataclass(frozen=True, eq=False)
class FittedPose:
    """The admissible actuation whose base, mid and tip come closest to a printed pose.

    Attributes
    ----------
    actuation : ndarray (7,)
        Slide [m] and cables.
    mid, tip : ndarray (3,)
        Where the model then is [m].
    mid_residual, tip_residual : float
        Distances to the printed positions [m].
    """

    actuation: Array
    mid: Array
    tip: Array
    mid_residual: float
    tip_residual: float


def fitted_pose(arm: CableDrivenArm, base: Array, mid: Array, tip: Array) -> FittedPose:
    """Fit the actuation to printed base, mid and tip positions (3,) [m] by bounded least squares."""
    kinematics = compiled_kinematics(arm)
    lower, upper = arm.lower.copy(), arm.upper.copy()
    upper[1:] = -0.02  # pretension [N]

    def residual(actuation: Array) -> Array:
        pose = kinematics(actuation)
        least_tension = 1e-3 * actuation[1:]
        slide = (actuation[:1] - base[2]) * 1e3
        return np.concatenate([slide, (pose.mid - mid) * 1e3, (pose.tip - tip) * 1e3, least_tension])

    def slope(actuation: Array) -> Array:
        pose, unit = kinematics(actuation), np.eye(7)
        return np.vstack([1e3 * unit[:1], pose.mid_jacobian * 1e3, pose.tip_jacobian * 1e3, 1e-3 * unit[1:]])

    starts = [np.clip([base[2], *[cable] * 6], lower, upper) for cable in (-0.1, -0.5, -1.0)]
    fits = [least_squares(residual, start, slope, bounds=(lower, upper), x_scale="jac") for start in starts]
    actuation = min(fits, key=lambda fit: fit.cost).x
    pose = kinematics(actuation)
    residuals = (float(np.linalg.norm(found - point)) for found, point in ((pose.mid, mid), (pose.tip, tip)))
    return FittedPose(actuation, pose.mid, pose.tip, *residuals)


def table2_poses(arm: CableDrivenArm | None = None) -> list[FittedPose]:
    """Fit all four configurations of Table II."""
    arm = arm or CableDrivenArm()
    return [fitted_pose(arm, *points) for points in printed_positions("sim")]
