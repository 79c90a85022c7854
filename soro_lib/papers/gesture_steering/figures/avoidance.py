"""Figures of obstacle avoidance (Lai et al., Fig. 14) and of what goes beyond the paper."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from soro_lib.controllers.obstacles import Sphere
from soro_lib.papers.gesture_steering.experiments.steering import actuations
from soro_lib.papers.gesture_steering.figures.steering import draw_arm, draw_room
from soro_lib.replication.plotting import COLORS, PAGE_WIDTH, SERIES, label_axes, legend, new_figure


def fig14_obstacle(runs: pd.DataFrame, line: str, obstacle: Sphere) -> Figure:
    """Draw the arm past the obstacle, the tip's deviation and the clearance, one column per policy."""
    runs = runs[(runs["line"] == line) & (runs["seed"] == 0)]
    policies = list(runs["policy"].unique())
    figure, axes = new_figure(PAGE_WIDTH, 5.6)
    axes.remove()
    grid = figure.add_gridspec(3, len(policies), height_ratios=(1.7, 1, 1))
    shared: list[list] = [[], []]
    for column, policy in enumerate(policies):
        table = runs[runs["policy"] == policy]
        scene = figure.add_subplot(grid[0, column], projection="3d")
        for actuation in actuations(table)[np.linspace(0, len(table) - 1, 5).astype(int)]:
            draw_arm(scene, actuation, strength=0.5)
        scene.plot_wireframe(*_ball(obstacle), color=COLORS["vermillion"], linewidth=0.4)
        draw_room(scene, (-30, -30, 20), (30, 30, 140), 1.3, (15, -65))
        scene.tick_params(labelsize=5, pad=-3)
        scene.set_title(policy, fontsize=9)
        deviation = figure.add_subplot(grid[1, column], sharey=shared[0][0] if column else None)
        clearance = figure.add_subplot(grid[2, column], sharey=shared[1][0] if column else None)
        shared[0].append(deviation)
        shared[1].append(clearance)
        time = table["time_s"]
        for axis, color in zip("xyz", SERIES):
            deviation.plot(time, table[f"deviation_{axis}_mm"], color=color, label=axis, linewidth=1.2)
        clearance.plot(time, table["clearance_mm"], color=COLORS["blue"])
        clearance.axhline(0.0, color=COLORS["vermillion"], linewidth=1.0, linestyle="--")
        label_axes(clearance, "time [s]")
    label_axes(shared[0][0], y="tip deviation [mm]")
    label_axes(shared[1][0], y="clearance [mm]")
    shared[0][-1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _ball(obstacle: Sphere) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    longitude, latitude = np.meshgrid(np.linspace(0, 2 * np.pi, 13), np.linspace(0, np.pi, 8))
    unit = np.sin(latitude) * np.cos(longitude), np.sin(latitude) * np.sin(longitude), np.cos(latitude)
    x, y, z = (1e3 * (middle + obstacle.radius * surface) for middle, surface in zip(obstacle.centre, unit))
    return x, y, z


def avoidance_trade(summary: pd.DataFrame) -> Figure:
    """Draw smallest clearance against largest tip deviation: the trade of each policy, one panel per line."""
    lines = summary["line"].unique()
    figure, axes = new_figure(PAGE_WIDTH, 2.6, columns=len(lines), sharey=True)
    for panel, line in zip(axes, lines):
        policies = summary[summary["line"] == line].groupby("policy", sort=False)
        for color, (policy, rows) in zip(SERIES, policies):
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
    for offset, name, color in ((-0.2, "position", "blue"), (0.2, "direction", "green")):
        axes.bar(place + offset, table[f"{name}_ms"], width=0.38, color=COLORS[color], label=name)
    axes.set_xticks(place, table["loop"])
    label_axes(axes, y="delay of the commanded tip [ms]", title="From hand to tip")
    legend(axes)
    return figure
