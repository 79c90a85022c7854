"""Figures of steering in simulation (Lai et al., Figs. 6 to 9)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from soro_lib.papers.gesture_steering.experiments.steering import actuations
from soro_lib.papers.gesture_steering.figures.hands import AXIS_COLORS, MODE_NAMES, line_style, shade_modes
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


def arm_pieces(arm: CableDrivenArm, actuation: ArrayLike) -> list[tuple[np.ndarray, str]]:
    """Return the backbones (n, 3) [mm] of slide, proximal and distal segment, and their colours."""
    points = arm.backbone(actuation, 20) * 1e3
    colors = COLORS["light"], COLORS["blue"], COLORS["orange"]
    return list(zip((points[:21], points[20:41], points[40:]), colors))


def draw_arm(axes: Any, actuation: ArrayLike, strength: float = 1.0) -> None:
    """Draw slide, proximal and distal segment [mm]."""
    for (piece, color), width in zip(arm_pieces(CableDrivenArm(), actuation), (3.0, 5.0, 5.0)):
        axes.plot(*piece.T, color=color, linewidth=width, alpha=strength, solid_capstyle="butt")


def draw_room(
    axes: Any, low: Sequence[float], high: Sequence[float], zoom: float, view: tuple[int, int]
) -> None:
    """Show what lies between two corners [mm], from an elevation and an azimuth [deg]."""
    equal_aspect(axes, [low, high], margin=0.0)
    axes.set_box_aspect(np.subtract(high, low), zoom=zoom)
    axes.tick_params(labelsize=6, pad=-2)
    axes.view_init(*view)


def fig06_gesture_poses(poses: Sequence[tuple[str, Any]]) -> Figure:
    """Draw the arm under the six hands of Fig. 6; the sixth panel also shows the fifth pose, pale."""
    figure, axes = new_figure(PAGE_WIDTH, 5.4, rows=2, columns=3, projection="3d")
    for index, (panel, (name, result)) in enumerate(zip(axes.ravel(), poses)):
        if index == 5:
            draw_arm(panel, poses[4][1].actuation, strength=0.25)
        draw_arm(panel, result.actuation)
        panel.quiver(*(1e3 * result.tip), *(25 * result.direction), color=COLORS["vermillion"], linewidth=1.5)
        draw_room(panel, (-28, -28, 0), (28, 28, 140), 1.12, (18, -60))
        panel.set_title(f"({'abcdef'[index]}) {name}", fontsize=9)
        panel.set_zlabel("z [mm]", fontsize=7)
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
    figure, axes = new_figure(PAGE_WIDTH, 3.2)
    axes.remove()
    grid = figure.add_gridspec(1, 2, width_ratios=(1, 1.2))
    left, right = figure.add_subplot(grid[0], projection="3d"), figure.add_subplot(grid[1])
    for actuation in actuations(table)[np.linspace(60, len(table) - 1, 8).astype(int)]:
        draw_arm(left, actuation, strength=0.5)
    left.scatter(-15, -20, 140, color=COLORS["vermillion"], marker="x", s=40, zorder=10)
    draw_room(left, (-35, -40, 0), (20, 15, 150), 1.05, (20, -50))
    label_axes(left, title="Turning about a fixed point")
    _errors(right, table)
    return figure


def _errors(axes: Any, table: pd.DataFrame) -> None:
    """Draw both errors over time, with the paper's bounds 1 mm and 2 degrees as the axis limits."""
    twin = axes.twinx()
    axes.plot(table["time_s"], table["position_error_mm"], **ESTIMATE, label="position")
    direction = {"color": COLORS["green"], "linewidth": 1.2, "label": "direction"}
    twin.plot("time_s", "direction_error_deg", data=table, **direction)
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
            asked = {"linestyle": "--", "linewidth": 1.0, "label": f"{symbol} asked"}
            panel.plot("time_s", f"target_{angle}_deg", data=table, color=color, **asked)
            panel.plot(
                "time_s", f"{angle}_deg", data=table, color=color, linewidth=1.6, label=f"{symbol} tip"
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
        panel.plot("time_s", "rate_hz", data=rows, **{**MEASUREMENT, "markersize": 2.0})
        panel.set(xlim=(0, 130), ylim=(0, limit))
        label_axes(panel, "time [s]", "loop rate [Hz]", title=str(name))
    right.axhline(rows["rate_hz"].mean(), **line_style(ESTIMATE))
    return figure


def palm_workspace(reach: pd.DataFrame) -> Figure:
    """Draw how far the tip can tilt towards every side, by height and distance from the axis."""
    figure, axes = new_figure(PAGE_WIDTH, 2.9, columns=2, width_ratios=(1.2, 1))
    grid = reach.pivot(index="z_mm", columns="radius_mm", values="tilt_deg")
    mesh = axes[0].pcolormesh(grid.columns, grid.index, grid, shading="nearest", vmin=0, vmax=40)
    figure.colorbar(mesh, ax=axes[0], label="tilt towards every side [deg]")
    axes[0].grid(False)
    for color, (height, row) in zip(SERIES, grid.iloc[:: max(len(grid) // 3, 1)].iterrows()):
        axes[1].plot(row.index, row, marker="o", markersize=3, color=color, label=f"z = {height:.0f} mm")
    for panel, label in zip(axes, ("height of the tip [mm]", "tilt [deg]")):
        label_axes(panel, "distance from the axis [mm]", label)
    label_axes(axes[0], title="Where the tip can point")
    legend(axes[1])
    return figure


def robot_timeline(table: pd.DataFrame) -> Figure:
    """Draw what the controller makes of a recording: tip, errors, tensions."""
    figure, axes = new_figure(PAGE_WIDTH, 5.0, rows=3, sharex=True)
    for axis, color in AXIS_COLORS.items():
        axes[0].plot(table["time_s"], table[f"goal_{axis}_mm"], color=color, linestyle="--", linewidth=0.9)
        axes[0].plot(table["time_s"], table[f"tip_{axis}_mm"], color=color, label=axis)
    axes[1].plot("time_s", "position_error_mm", data=table, **ESTIMATE, label="position [mm]")
    direction = {"color": COLORS["green"], "linewidth": 1.0, "label": "direction [deg]"}
    axes[1].plot("time_s", "direction_error_deg", data=table, **direction)
    for index, color in zip(range(6), SERIES):
        cable = {"linewidth": 1.0, "color": color, "label": f"{index // 3 + 1}.{index % 3 + 1}"}
        axes[2].plot(table["time_s"], -table[f"cable_{index + 1}"], **cable)
    for panel, unit in zip(axes, ("tip [mm]", "tip to target", "tension [N]")):
        shade_modes(panel, table["time_s"], table["mode"])
        label_axes(panel, y=unit)
        panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    label_axes(axes[0], title="The arm under this hand (dashed: goal)")
    label_axes(axes[2], "time [s]")
    return figure


def explorer_view(actuation: ArrayLike, mode: str, trace: ArrayLike) -> Figure:
    """Draw one pose of the arm: what the explorer shows where nobody can move its controls."""
    figure, axes = new_figure(4.2, 4.2, projection="3d")
    draw_arm(axes, actuation)
    axes.plot(*(np.asarray(trace).T * 1e3), **line_style(REFERENCE))
    equal_aspect(axes, [[-45, -45, 0], [45, 45, 150]], margin=0.0)
    label_axes(axes, "x [mm]", "y [mm]", "z [mm]", MODE_NAMES[mode])
    return figure
