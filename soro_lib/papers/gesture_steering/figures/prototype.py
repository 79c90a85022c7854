"""Figures of the simulated prototype (Lai et al., Figs. 10 and 11, Table II)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse
from numpy.typing import NDArray

from soro_lib.papers.gesture_steering.figures.hands import AXIS_COLORS, line_style
from soro_lib.papers.gesture_steering.figures.steering import arm_pieces
from soro_lib.replication.plotting import (
    COLORS,
    ESTIMATE,
    GOAL,
    MEASUREMENT,
    PAGE_WIDTH,
    REFERENCE,
    box_groups,
    error_band,
    label_axes,
    legend,
    new_figure,
)
from soro_lib.robots import CableDrivenArm

Array = NDArray[np.float64]

PANELS = {"a": "palm hover", "b": "V-sign hover", "c": "circle", "d": "swaying arc"}
BOUNDS = (
    ("position_error_mm", "position error [mm]", 4.0),
    ("direction_error_deg", "direction error [deg]", 5.0),
)
"""Errors of Fig. 10: column, label, and the bound that the paper claims."""


def fig10_hover_and_paths(measured: pd.DataFrame) -> Figure:
    """Draw panels a to d of Fig. 10: errors of the prototypes over time, mean and 95 % of sessions."""
    figure, axes = new_figure(PAGE_WIDTH, 5.4, rows=3, columns=4, sharex="col", sharey="row")
    for column, (letter, rows) in enumerate(measured.groupby("panel")):
        one = rows[rows["session"] == 0]
        for axis, color in AXIS_COLORS.items():
            axes[0, column].plot(one["time_s"], one[f"mea_{axis}_mm"], **{**MEASUREMENT, "color": color})
            axes[0, column].plot(one["time_s"], one[f"sim_{axis}_mm"], color=color, linewidth=1.0, label=axis)
        for panel, (name, label, bound) in zip(axes[1:, column], BOUNDS):
            groups = rows.groupby("time_s")[name]
            low, high = groups.quantile(0.025), groups.quantile(0.975)
            error_band(panel, low.index, low, high)
            panel.plot(low.index, groups.mean(), **ESTIMATE)
            panel.axhline(bound, color=COLORS["vermillion"], linestyle="--", linewidth=1.0)
            panel.set_ylim(0, 1.9 * bound)
            label_axes(panel, y="" if column else label)
        label_axes(axes[0, column], title=f"({letter}) {PANELS[str(letter)]}")
        label_axes(axes[2, column], "time [s]")
    label_axes(axes[0, 0], y="tip [mm]")
    axes[0, 3].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def fig11_configurations(actuations: Sequence[Array], sim: Array, exp: Array) -> Figure:
    """Draw the four configurations of Table II from the front and the side [mm], with the printed points."""
    arm = CableDrivenArm()
    figure, axes = new_figure(PAGE_WIDTH, 4.3, columns=8, sharey=True)
    for index, panel in enumerate(axes):
        configuration, axis = divmod(index, 2)
        for piece, color in arm_pieces(arm, actuations[configuration]):
            panel.plot(piece[:, axis], piece[:, 2], color=color, linewidth=6, solid_capstyle="butt", zorder=1)
        panel.plot(*sim[configuration][:, (axis, 2)].T * 1e3, **GOAL, label="printed simulation")
        panel.plot(*exp[configuration][:, (axis, 2)].T * 1e3, "o", color=COLORS["black"], markersize=3.5,
                   label="printed experiment", zorder=5)  # fmt: skip
        panel.set(xlim=(-14, 14), ylim=(25, 158), aspect="equal", xticks=(-10, 0, 10))
        label_axes(panel, f"{'XY'[axis]} [mm]", title=f"Config. {configuration}" if axis == 0 else "")
        panel.title.set_fontsize(8.5)
    label_axes(axes[0], y="Z [mm]")
    legend(figure)
    return figure


def table2_distribution(placed: dict[str, pd.DataFrame]) -> Figure:
    """Draw the error norms of Table II: median and 95 % of simulated sessions, and the printed value."""
    figure, axes = new_figure(PAGE_WIDTH, 3.0, columns=len(placed), sharey=True)
    for panel, (name, table) in zip(np.atleast_1d(axes), placed.items()):
        place = np.arange(len(table))
        spread = [table["median_mm"] - table["low_mm"], table["high_mm"] - table["median_mm"]]
        style = {"fmt": "o", "color": COLORS["blue"], "markersize": 4, "linewidth": 1.2}
        panel.errorbar(place, table["median_mm"], spread, **style, label="simulated prototypes")
        panel.plot(place, table["printed_mm"], **GOAL, label="printed")
        labels = [f"{{{point[0].upper()}}}" for point in table["point"]]
        panel.set_xticks(place, labels)
        for start in (2.5, 5.5, 8.5):
            panel.axvline(start, color=COLORS["light"], linewidth=0.8)
        label_axes(panel, "configurations 0 to 3", title=name)
    label_axes(np.atleast_1d(axes)[0], y="error norm [mm]")
    legend(figure)
    return figure


def cause_shares(table: pd.DataFrame) -> Figure:
    """Draw what each cause does alone: probability of the 2-mm claim and the largest error along X."""
    figure, (left, right) = new_figure(PAGE_WIDTH, 2.9, columns=2, sharey=True)
    causes = table["cause"].unique()[::-1]
    for control, offset, color in (("force", 0.2, "blue"), ("length", -0.2, "orange")):
        rows = table[table["control"] == control].set_index("cause").loc[causes]
        place, style = np.arange(len(causes)) + offset, {"height": 0.36, "color": COLORS[color]}
        left.barh(place, rows["claim"], label=f"{control} control", **style)
        right.barh(place, rows[["x_mm", "y_mm", "z_mm"]].max(axis=1), **style)
    left.set_yticks(np.arange(len(causes)), causes)
    right.axvline(2.0, **line_style(REFERENCE))
    label_axes(left, "probability that all axes are within 2 mm", title="One cause at a time")
    label_axes(right, "largest axis error, median session [mm]")
    legend(figure)
    return figure


def steady_state_errors(steady: pd.DataFrame) -> Figure:
    """Draw the steady-state errors of Fig. 10 over sessions, by panel."""
    figure, axes = new_figure(PAGE_WIDTH, 2.4, columns=2)
    for panel, (column, label, bound) in zip(axes, BOUNDS):
        box_groups(panel, {str(letter): rows[column] for letter, rows in steady.groupby("panel")})
        panel.axhline(bound, color=COLORS["vermillion"], linestyle="--", linewidth=1.2)
        panel.set_ylim(0, None)
        label_axes(panel, "panel of Fig. 10", label)
    return figure


def tip_ellipses(path: Array, scatter: list[tuple[Array, Array]]) -> Figure:
    """Draw the 95 % ellipse of the true tip along a path, from above and from the side [mm]."""
    figure, axes = new_figure(PAGE_WIDTH, 3.0, columns=2)
    for panel, (first, second) in zip(axes, ((0, 1), (0, 2))):
        panel.plot(path[:, first] * 1e3, path[:, second] * 1e3, **REFERENCE, label="commanded tip")
        for mean, covariance in scatter:
            panel.add_patch(_ellipse(mean, covariance, (first, second)))
            panel.plot(mean[first] * 1e3, mean[second] * 1e3, color=COLORS["blue"], marker=".", markersize=4)
        panel.set_aspect("equal", adjustable="datalim")
        label_axes(panel, f"{'xyz'[first]} [mm]", f"{'xyz'[second]} [mm]")
    label_axes(axes[0], title="Where the true tip may be (95 %)")
    legend(axes[0])
    return figure


def _ellipse(mean: Array, covariance: Array, plane: tuple[int, int]) -> Any:
    values, vectors = np.linalg.eigh(covariance[np.ix_(plane, plane)] * 1e6)
    width, height = 2 * np.sqrt(5.991 * values)  # 95 % of a chi-square with two degrees of freedom
    angle = np.degrees(np.arctan2(vectors[1, 0], vectors[0, 0]))
    first, second = (1e3 * mean[list(plane)]).tolist()
    return Ellipse((first, second), width, height, angle=angle, facecolor=COLORS["blue"], alpha=0.18)
