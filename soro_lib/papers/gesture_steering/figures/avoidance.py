"""Figures of obstacle avoidance (Lai et al., Fig. 14) and of what goes beyond the paper."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from soro_lib.controllers.obstacles import Sphere
from soro_lib.papers.gesture_steering.figures.steering import draw_arm
from soro_lib.replication.plotting import (
    COLORS,
    PAGE_WIDTH,
    SERIES,
    equal_aspect,
    label_axes,
    legend,
    new_figure,
)
from soro_lib.robots import CableDrivenArm


def fig14_obstacle(runs: pd.DataFrame, line: str, obstacle: Sphere) -> Figure:
    """Draw the arm past the obstacle, the tip's deviation and the clearance, one column per policy."""
    arm = CableDrivenArm()
    policies = list(runs["policy"].unique())
    figure, _ = new_figure(PAGE_WIDTH, 5.6, columns=1)
    figure.clear()
    grid = figure.add_gridspec(3, len(policies), height_ratios=(1.7, 1, 1))
    shared: list[list] = [[], []]
    for column, policy in enumerate(policies):
        table = runs[(runs["line"] == line) & (runs["policy"] == policy) & (runs["seed"] == 0)]
        scene = figure.add_subplot(grid[0, column], projection="3d")
        cables = ["slide_mm", *(f"cable_{index}" for index in range(1, 7))]
        for row in np.linspace(0, len(table) - 1, 5).astype(int):
            draw_arm(scene, arm, table[cables].to_numpy()[row] * [1e-3, *[1.0] * 6], strength=0.5)
        scene.plot_wireframe(*_ball(obstacle), color=COLORS["vermillion"], linewidth=0.4)
        equal_aspect(scene, [[-30, -30, 20], [30, 30, 140]], margin=0.0)
        scene.set_box_aspect((60, 60, 120), zoom=1.3)
        scene.tick_params(labelsize=5, pad=-3)
        scene.view_init(elev=15, azim=-65)
        scene.set_title(policy, fontsize=9)
        deviation = figure.add_subplot(grid[1, column], sharey=shared[0][0] if column else None)
        clearance = figure.add_subplot(grid[2, column], sharey=shared[1][0] if column else None)
        shared[0].append(deviation)
        shared[1].append(clearance)
        for axis, color in zip("xyz", SERIES):
            deviation.plot(
                table["time_s"], table[f"deviation_{axis}_mm"], color=color, label=axis, linewidth=1.2
            )
        clearance.plot(table["time_s"], table["clearance_mm"], color=COLORS["blue"])
        clearance.axhline(0.0, color=COLORS["vermillion"], linewidth=1.0, linestyle="--")
        label_axes(clearance, "time [s]")
    label_axes(shared[0][0], y="tip deviation [mm]")
    label_axes(shared[1][0], y="clearance [mm]")
    shared[0][-1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _ball(obstacle: Sphere) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    longitude, latitude = np.meshgrid(np.linspace(0, 2 * np.pi, 13), np.linspace(0, np.pi, 8))
    x, y, z = obstacle.centre
    radius = obstacle.radius
    return (
        1e3 * (x + radius * np.sin(latitude) * np.cos(longitude)),
        1e3 * (y + radius * np.sin(latitude) * np.sin(longitude)),
        1e3 * (z + radius * np.cos(latitude)),
    )


def avoidance_trade(summary: pd.DataFrame) -> Figure:
    """Draw smallest clearance against largest tip deviation: the trade of each policy, one panel per line."""
    lines = summary["line"].unique()
    figure, axes = new_figure(PAGE_WIDTH, 2.6, columns=len(lines), sharey=True)
    for panel, line in zip(axes, lines):
        for color, (policy, rows) in zip(
            SERIES, summary[summary["line"] == line].groupby("policy", sort=False)
        ):
            deviation = rows[["x_mm", "y_mm", "z_mm"]].max(axis=1)
            panel.plot(deviation, rows["clearance_mm"], "o", color=color, markersize=5, label=policy)
        panel.axhline(0.0, color=COLORS["vermillion"], linewidth=1.0, linestyle="--")
        label_axes(panel, "tip deviation [mm]", title=line)
        panel.title.set_fontsize(8.5)
    label_axes(axes[0], y="clearance [mm]")
    legend(figure)
    return figure


def delay_against_rate(table: pd.DataFrame) -> Figure:
    """Draw the delay from hand to tip by loop rate."""
    figure, axes = new_figure(PAGE_WIDTH, 2.5)
    place = np.arange(len(table))
    axes.bar(place - 0.2, table["position_ms"], width=0.38, color=COLORS["blue"], label="position")
    axes.bar(place + 0.2, table["direction_ms"], width=0.38, color=COLORS["green"], label="direction")
    axes.set_xticks(place, table["loop"])
    label_axes(axes, y="delay of the commanded tip [ms]", title="From hand to tip")
    legend(axes)
    return figure
