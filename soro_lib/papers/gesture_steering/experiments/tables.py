"""Tables I and II of Lai et al., recomputed from what they rest on."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from soro_lib.papers.gesture_steering.calibration import POINTS, printed_positions, table2_poses
from soro_lib.robots import CableDrivenArm

COMPRESSED_LENGTH = 0.045
"""Length [m] at which K_T reaches the upper end of Table I."""


def table1() -> pd.DataFrame:
    """Derive the stiffnesses of Table I from modulus and cross-section.

    Returns
    -------
    DataFrame
        ``quantity``, ``unit``, ``unloaded`` (50 mm), ``compressed`` (45 mm).
    """
    arm = CableDrivenArm()
    long, short = arm.segment_length, COMPRESSED_LENGTH
    rows = [
        ("E", "MPa", arm.young_modulus * 1e-6, arm.young_modulus * 1e-6),
        ("K_a", "N/mm", arm.axial_rigidity / long * 1e-3, arm.axial_rigidity / short * 1e-3),
        ("K_T", "Nmm/rad", arm.bending_stiffness(long) * 1e3, arm.bending_stiffness(short) * 1e3),
        ("L_k", "mm", long * 1e3, short * 1e3),
    ]
    return pd.DataFrame(rows, columns=["quantity", "unit", "unloaded", "compressed"])


def table2_errors() -> pd.DataFrame:
    """Recompute errors and norms of Table II from its printed positions.

    Returns
    -------
    DataFrame
        ``configuration``, ``point``, ``error_{x,y,z}_mm`` (sim. minus exp.), ``norm_mm``, and the same
        relative to the robot's own base, ``relative_{x,y,z}_mm``, which takes the registration of the frame
        out.
    """
    error = (printed_positions("sim") - printed_positions("exp")) * 1e3
    relative = error - error[:, :1]
    index = pd.MultiIndex.from_product([range(4), POINTS], names=["configuration", "point"])
    values = np.concatenate([error, np.linalg.norm(error, axis=-1, keepdims=True), relative], axis=-1)
    columns = [*(f"error_{axis}_mm" for axis in "xyz"), "norm_mm", *(f"relative_{axis}_mm" for axis in "xyz")]
    return pd.DataFrame(values.reshape(12, 7), index, columns).reset_index()


def segment_chords() -> pd.DataFrame:
    """Measure the straight distances between the printed points of Table II.

    A chord cannot be longer than its arc, and a compressed segment not longer than 50 mm, so a simulated
    chord above 50 mm is beyond any model of this kind: the proof that configuration 1 is not reproducible as
    printed.

    Returns
    -------
    DataFrame
        ``configuration``, ``segment``, ``sim_chord_mm``, ``exp_chord_mm``.
    """
    index = pd.MultiIndex.from_product([range(4), ("proximal", "distal")], names=["configuration", "segment"])
    chords = {}
    for kind in ("sim", "exp"):
        between = np.diff(printed_positions(kind), axis=1)
        chords[f"{kind}_chord_mm"] = 1e3 * np.linalg.norm(between, axis=-1).ravel()
    return pd.DataFrame(chords, index).reset_index()


def cap_study(caps: Sequence[float]) -> pd.DataFrame:
    """Fit Table II's simulated poses with rigid caps of several lengths [m] after the soft segments.

    Returns
    -------
    DataFrame
        ``cap_mm``, ``coupling_sign``, ``configuration``, ``mid_residual_mm``, ``tip_residual_mm``.
    """
    rows = [
        (cap * 1e3, sign, configuration, pose.mid_residual * 1e3, pose.tip_residual * 1e3)
        for sign in (-1, 1)
        for cap in caps
        for configuration, pose in enumerate(table2_poses(CableDrivenArm(cap_length=cap, coupling_sign=sign)))
    ]
    columns = ["cap_mm", "coupling_sign", "configuration", "mid_residual_mm", "tip_residual_mm"]
    return pd.DataFrame(rows, columns=columns)
