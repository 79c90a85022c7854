"""Figures of steering in simulation (Lai et al., Figs. 6 to 9)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from soro_lib.papers.gesture_steering.figures.hands import MODE_NAMES, shade_modes
from soro_lib.replication.plotting import (
    COLORS,
    ESTIMATE,
    MEASUREMENT,
    PAGE_WIDTH,
    REFERENCE,
    SERIES,
    equal_aspect,
    label_axes,
    legend,
    new_figure,
)
from soro_lib.robots import CableDrivenArm


def draw_arm(axes: Any, arm: CableDrivenArm, actuation: ArrayLike, strength: float = 1.0) -> None:
    """Draw slide, proximal and distal segment [mm]."""
    points = arm.backbone(actuation, 20) * 1e3
    pieces = (points[:21], points[20:41], points[40:])
    for piece, color, width in zip(
        pieces, (COLORS["light"], COLORS["blue"], COLORS["orange"]), (3.0, 5.0, 5.0)
    ):
        axes.plot(*piece.T, color=color, linewidth=width, alpha=strength, solid_capstyle="butt")


def fig06_gesture_poses(poses: Sequence[tuple[str, Any]]) -> Figure:
    """Draw the arm under the six hands of Fig. 6; the sixth panel also shows the fifth pose, pale."""
    arm = CableDrivenArm()
    figure, axes = new_figure(PAGE_WIDTH, 5.4, rows=2, columns=3, projection="3d")
    for index, (panel, (name, result)) in enumerate(zip(axes.ravel(), poses)):
        if index == 5:
            draw_arm(panel, arm, poses[4][1].actuation, strength=0.25)
        draw_arm(panel, arm, result.actuation)
        tip, direction = result.tip * 1e3, result.direction
        panel.quiver(*tip, *(25 * direction), color=COLORS["vermillion"], linewidth=1.5)
        equal_aspect(panel, [[-28, -28, 0], [28, 28, 140]], margin=0.0)
        panel.set_box_aspect((56, 56, 140), zoom=1.12)
        panel.set_title(f"({'abcdef'[index]}) {name}", fontsize=9)
        panel.set_zlabel("z [mm]", fontsize=7)
        panel.tick_params(labelsize=6, pad=-2)
        panel.view_init(elev=18, azim=-60)
    return figure


def fig07a_infinity_path(table: pd.DataFrame) -> Figure:
    """Draw the infinity path and its errors."""
    figure, axes = new_figure(PAGE_WIDTH, 2.9, columns=2, width_ratios=(1.2, 1))
    axes[0].plot(table["target_x_mm"], table["target_y_mm"], **REFERENCE, label="target")
    axes[0].plot(table["tip_x_mm"], table["tip_y_mm"], **ESTIMATE, label="tip")
    axes[0].set_aspect("equal", adjustable="datalim")
    label_axes(axes[0], "x [mm]", "y [mm]", title="Infinity path, palm held flat")
    legend(axes[0], loc="upper center")
    _errors(axes[1], table)
    return figure


def fig07b_rotation(table: pd.DataFrame) -> Figure:
    """Draw the arm while its tip turns about a fixed point, and the errors."""
    arm = CableDrivenArm()
    figure, _ = new_figure(PAGE_WIDTH, 3.2, columns=1)
    figure.clear()
    grid = figure.add_gridspec(1, 2, width_ratios=(1, 1.2))
    left, right = figure.add_subplot(grid[0], projection="3d"), figure.add_subplot(grid[1])
    cables = ["slide_mm", *(f"cable_{index}" for index in range(1, 7))]
    for row in np.linspace(60, len(table) - 1, 8).astype(int):
        actuation = table[cables].to_numpy()[row] * [1e-3, *[1.0] * 6]
        draw_arm(left, arm, actuation, strength=0.5)
    left.scatter(-15, -20, 140, color=COLORS["vermillion"], marker="x", s=40, zorder=10)
    equal_aspect(left, [[-35, -40, 0], [20, 15, 150]], margin=0.0)
    left.set_box_aspect((55, 55, 150), zoom=1.05)
    left.tick_params(labelsize=6, pad=-2)
    left.view_init(elev=20, azim=-50)
    label_axes(left, title="Turning about a fixed point")
    _errors(right, table)
    return figure


def _errors(axes: Any, table: pd.DataFrame) -> None:
    """Draw both errors over time, with the paper's bounds 1 mm and 2 degrees as the axis limits."""
    twin = axes.twinx()
    axes.plot(table["time_s"], table["position_error_mm"], **ESTIMATE, label="position")
    twin.plot(
        table["time_s"], table["direction_error_deg"], color=COLORS["green"], linewidth=1.2, label="direction"
    )
    axes.set_ylim(0, max(1.0, 1.05 * table["position_error_mm"].max()))
    twin.set_ylim(0, max(2.0, 1.05 * table["direction_error_deg"].max()))
    twin.grid(False)
    twin.spines["right"].set_visible(True)
    label_axes(axes, "time [s]", "position error [mm]", title="Command minus model")
    label_axes(twin, y="direction error [deg]")
    handles = [*axes.get_lines(), *twin.get_lines()]
    axes.legend(handles, [handle.get_label() for handle in handles], loc="upper right", ncols=2)


def fig08_gesture_changes(tables: dict[str, pd.DataFrame]) -> Figure:
    """Draw the pointing direction through gesture changes, panels a to d."""
    figure, axes = new_figure(PAGE_WIDTH, 4.8, rows=2, columns=2, sharex=True, sharey=True)
    titles = {"a": "palm, fist, palm", "b": "palm, thumbs-up, palm", "c": "palm, V-sign, palm", "d": "palm"}
    for panel, (letter, table) in zip(axes.ravel(), tables.items()):
        shade_modes(panel, table["time_s"], table["mode"])
        for angle, symbol, color in (("alpha", "α", COLORS["blue"]), ("gamma", "γ", COLORS["green"])):
            asked, dashed = table[f"target_{angle}_deg"], {"linestyle": "--", "linewidth": 1.0}
            panel.plot(table["time_s"], asked, color=color, **dashed, label=f"{symbol} asked")
            panel.plot(
                table["time_s"], table[f"{angle}_deg"], color=color, linewidth=1.6, label=f"{symbol} tip"
            )
        label_axes(panel, title=f"({letter}) {titles[letter]}")
    for panel in axes[1]:
        label_axes(panel, "time [s]")
    for panel in axes[:, 0]:
        label_axes(panel, y="tilt [deg]")
    legend(figure)
    return figure


def fig09_loop_rate(table: pd.DataFrame) -> Figure:
    """Draw the rate of the loop without and with the servo bus."""
    figure, (left, right) = new_figure(PAGE_WIDTH, 2.5, columns=2)
    for panel, (name, rows), limit in zip((left, right), table.groupby("loop", sort=False), (150, 20)):
        panel.plot(rows["time_s"], rows["rate_hz"], **{**MEASUREMENT, "markersize": 2.0})
        panel.set_ylim(0, limit)
        panel.set_xlim(0, 130)
        label_axes(panel, "time [s]", "loop rate [Hz]", title=str(name))
    right.axhline(rows["rate_hz"].mean(), **_line(ESTIMATE))
    return figure


def palm_workspace(reach: pd.DataFrame) -> Figure:
    """Draw how far the tip can tilt towards every side, by height and distance from the axis."""
    figure, axes = new_figure(PAGE_WIDTH, 2.9, columns=2, width_ratios=(1.2, 1))
    grid = reach.pivot(index="z_mm", columns="radius_mm", values="tilt_deg")
    mesh = axes[0].pcolormesh(
        grid.columns, grid.index, grid, shading="nearest", cmap="viridis", vmin=0, vmax=40
    )
    figure.colorbar(mesh, ax=axes[0], label="tilt towards every side [deg]")
    axes[0].grid(False)
    for color, (height, row) in zip(SERIES, grid.iloc[:: max(len(grid) // 3, 1)].iterrows()):
        axes[1].plot(row.index, row, marker="o", markersize=3, color=color, label=f"z = {height:.0f} mm")
    label_axes(
        axes[0], "distance from the axis [mm]", "height of the tip [mm]", title="Where the tip can point"
    )
    label_axes(axes[1], "distance from the axis [mm]", "tilt [deg]")
    legend(axes[1])
    return figure


def robot_timeline(table: pd.DataFrame) -> Figure:
    """Draw what the controller makes of a recording: tip, errors, tensions."""
    figure, axes = new_figure(PAGE_WIDTH, 5.0, rows=3, sharex=True)
    for axis, color in zip("xyz", (COLORS["blue"], COLORS["green"], COLORS["purple"])):
        axes[0].plot(table["time_s"], table[f"goal_{axis}_mm"], color=color, linestyle="--", linewidth=0.9)
        axes[0].plot(table["time_s"], table[f"tip_{axis}_mm"], color=color, label=axis)
    axes[1].plot(table["time_s"], table["position_error_mm"], **ESTIMATE, label="position [mm]")
    axes[1].plot(table["time_s"], table["direction_error_deg"], color=COLORS["green"], linewidth=1.0,
                 label="direction [deg]")  # fmt: skip
    for index in range(1, 7):
        axes[2].plot(table["time_s"], -table[f"cable_{index}"], linewidth=1.0, color=SERIES[index - 1],
                     label=f"{(index + 2) // 3}.{(index - 1) % 3 + 1}")  # fmt: skip
    for panel, unit, title in zip(
        axes, ("tip [mm]", "tip to target", "tension [N]"), ("The arm under this hand (dashed: goal)", "", "")
    ):
        shade_modes(panel, table["time_s"], table["mode"])
        label_axes(panel, y=unit, title=title)
        panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    label_axes(axes[2], "time [s]")
    return figure


def explorer_view(actuation: ArrayLike, mode: str, trace: ArrayLike | None = None) -> Figure:
    """Draw one pose of the arm: what the explorer shows where nobody can move its controls."""
    figure, axes = new_figure(4.2, 4.2, projection="3d")
    draw_arm(axes, CableDrivenArm(), actuation)
    if trace is not None:
        axes.plot(*(np.asarray(trace).T * 1e3), **_line(REFERENCE))
    equal_aspect(axes, [[-45, -45, 0], [45, 45, 150]], margin=0.0)
    axes.set_title(MODE_NAMES[mode])
    axes.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]")
    return figure


def _line(style: dict[str, Any]) -> dict[str, Any]:
    return {key: style[key] for key in ("color", "linestyle", "linewidth")}
