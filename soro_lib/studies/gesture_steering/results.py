"""Everything the study obtains, by the id of the published number it stands beside."""

from __future__ import annotations

import math

import numpy as np

from soro_lib.calibrations.gesture_steering import POINTS, table2_poses
from soro_lib.controllers.gestures import gesture_count
from soro_lib.controllers.gesture_steering import SteeringSettings
from soro_lib.controllers.steering_step import step_bound_as_printed
from soro_lib.robots import CableDrivenArm
from soro_lib.studies.findings import Finding
from soro_lib.studies.gesture_steering import tables

Findings = dict[str, Finding]


def parameter_findings() -> Findings:
    """Return the parameters in use."""
    arm, settings = CableDrivenArm(), SteeringSettings()
    mapping, printed_step = settings.mapping, step_bound_as_printed()
    return {
        "s2_installation_angle": Finding(math.acos(arm.coupling_sign)),
        "s2_cables_per_segment": Finding((len(arm.lower) - 1) / 2),
        "s2_proximal_passages": Finding(len(arm.lower) - 1),
        "abstract_length": Finding(2 * arm.segment_length * 1e3),
        "s3d_gesture_combinations": Finding(
            gesture_count(), "five fingers with two states each: 2^5 = 32; 120 is 5! (erratum GS-15)"
        ),
        "s4a_initial_variance": Finding(settings.palm_filter.initial_variance * 1e6),
        "s4a_box_size": Finding(2 * mapping.half_width * 1e3),
        "s4a_box_height": Finding(mapping.lowest * 1e3),
        "eq4_offset": Finding(mapping.offset * 1e3),
        "s4b_scale_x": Finding(mapping.scale_x),
        "s4b_scale_y": Finding(mapping.scale_y),
        "s4b_scale_z": Finding(mapping.scale_z),
        "s4b_damping": Finding(settings.weights.damping),
        "eq26_slide_maximum": Finding(arm.upper[0] * 1e3),
        "eq26_cable_minimum": Finding(arm.lower[1]),
        "eq26_bound": Finding(printed_step[1][0]),
        "eq26_scale_slide": Finding(printed_step[0][0, 0]),
        "fig13_payload_share": Finding(100 * 4.0 / 5.0),
    }


def table1_findings() -> Findings:
    """Return Table I from modulus and cross-section."""
    table = tables.table1().set_index("quantity")
    thickening = "length alone gives EA / 45 mm; the print needs the cross-section to thicken as well (erratum GS-21)"
    return {
        "table1_young_modulus": Finding(table.loc["E", "unloaded"]),
        "table1_axial_stiffness_low": Finding(table.loc["K_a", "unloaded"]),
        "table1_axial_stiffness_high": Finding(table.loc["K_a", "compressed"], thickening),
        "table1_bending_stiffness_low": Finding(table.loc["K_T", "unloaded"]),
        "table1_bending_stiffness_high": Finding(table.loc["K_T", "compressed"]),
        "table1_segment_length": Finding(table.loc["L_k", "unloaded"]),
    }


def table2_findings() -> Findings:
    """Return Table II: errors and norms recomputed, and the model's closest poses."""
    found: Findings = {}
    sign = "sim. minus exp. is positive; the norm is not affected (erratum GS-23)"
    for row in tables.table2_errors().itertuples():
        name = f"table2_c{row.configuration}_{row.point}"
        for axis in "xyz":
            reason = sign if name + axis == "table2_c2_tipy" else ""
            found[f"{name}_error_{axis}"] = Finding(getattr(row, f"error_{axis}_mm"), reason)
        found[f"{name}_norm"] = Finding(row.norm_mm)
    errors = tables.table2_errors()[[f"error_{axis}_mm" for axis in "xyz"]].abs()
    found["table2_claim_printed"] = Finding(float((errors <= 2.0).all(axis=None)))

    stretched = "not reproducible as printed: a chord of 51.6 mm in a segment that is 50 mm long and only shortens"
    short = "every arc through the printed points is longer than the 50 mm of an unloaded segment"
    for configuration, pose in enumerate(table2_poses()):
        base = np.array([0.0, 0.0, pose.actuation[0]])
        reason = stretched if configuration == 1 else short if configuration else ""
        for point, position in zip(POINTS, (base, pose.mid, pose.tip)):
            for axis, value in zip("xyz", position * 1e3):
                found[f"table2_c{configuration}_{point}_sim_{axis}"] = Finding(value, reason)
    return found
