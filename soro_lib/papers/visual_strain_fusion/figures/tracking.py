"""Figures of tracking (Wang et al., Figs. 9 to 12 and 14(c), Tables I and II)."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from soro_lib.papers.visual_strain_fusion.experiments.closed_curve import CurveRun, octopus
from soro_lib.papers.visual_strain_fusion.experiments.hybrid_control import Comparison
from soro_lib.papers.visual_strain_fusion.experiments.tracking import GAINS, path_distance
from soro_lib.papers.visual_strain_fusion.world.motion import PERIOD
from soro_lib.papers.visual_strain_fusion.world.plant import Wall
from soro_lib.replication.plotting import COLORS, PAGE_WIDTH, REFERENCE, label_axes, legend, new_figure
from soro_lib.replication.scorecard import build_scorecard

MODEL: dict[str, Any] = {"color": COLORS["grey"], "linewidth": 1.0, "label": "model-based"}
HYBRID: dict[str, Any] = {"color": COLORS["blue"], "linewidth": 1.2, "label": "hybrid"}
OBSTRUCTED = {**HYBRID, "color": COLORS["orange"], "label": "hybrid behind an obstacle"}
CONTROLLERS = {
    "model": ("model-based", COLORS["grey"], "s"),
    "literal": ("Eq. (29) as printed", COLORS["blue"], "o"),
    "no learning": ("gain alone, no learning", COLORS["vermillion"], "D"),
    "relative": ("Eq. (29), relative", COLORS["green"], "^"),
    "additive": ("Eq. (29), additive", COLORS["sky"], "v"),
    "actual motion": ("Eq. (29), actual motion", COLORS["orange"], "P"),
}
"""How the controllers are called and look: label, colour, marker."""


def fig09a_pentagram_kp08(comparison: Comparison) -> Figure:
    """Draw the pentagram at a good gain: path, error and deviation of both controllers."""
    return _draw_tracking(comparison, 0.08)


def fig09b_pentagram_kp04(comparison: Comparison) -> Figure:
    """Draw the pentagram at a poor gain."""
    return _draw_tracking(comparison, 0.04)


def fig09c_pentagram_zoom(comparison: Comparison) -> Figure:
    """Draw one corner of the pentagram at both gains."""
    return _draw_zoom(comparison, (0.08, 0.04))


def fig10a_circle_kp10(comparison: Comparison) -> Figure:
    """Draw the circle at a good gain."""
    return _draw_tracking(comparison, 0.10)


def fig10b_circle_kp06(comparison: Comparison) -> Figure:
    """Draw the circle at a poor gain."""
    return _draw_tracking(comparison, 0.06)


def fig10c_circle_zoom(comparison: Comparison) -> Figure:
    """Draw a piece of the circle at both gains."""
    return _draw_zoom(comparison, (0.10, 0.06))


def _path_and_errors(height: float, points: np.ndarray) -> tuple[Figure, Axes, Axes, Axes]:
    """Return a figure with the closed path [m] on the left, and axes of error and deviation on the right."""
    figure, (path, right) = new_figure(PAGE_WIDTH, height, columns=2, width_ratios=(1.0, 1.25))
    grid = right.get_subplotspec().subgridspec(2, 1)
    right.remove()
    error, deviation = (figure.add_subplot(grid[row]) for row in range(2))
    _draw_path(path, points)
    label_axes(error, y="error [mm]")
    label_axes(deviation, y="deviation [mm]")
    return figure, path, error, deviation


def _draw_path(axes: Axes, points: np.ndarray) -> None:
    axes.plot(*(1e3 * np.vstack([points, points[:1]])).T, **REFERENCE, label="target path")
    axes.set_aspect("equal")
    label_axes(axes, "x [mm]", "y [mm]")


def _draw_tracking(comparison: Comparison, gain: float) -> Figure:
    """Draw the runs of the first seed at one gain."""
    figure, path, error, deviation = _path_and_errors(3.4, comparison.points)
    member = 0, GAINS.index(gain)
    for run, style in ((comparison.model, MODEL), (comparison.compensated["literal"], HYBRID)):
        tips = run.tip[:, *member]
        path.plot(*(1e3 * tips).T, **style)
        time = PERIOD * np.arange(len(tips))
        error.plot(time, 1e3 * run.error[:, *member], **style)
        deviation.plot(time, 1e3 * path_distance(tips, comparison.points), **style)
    label_axes(path, title=f"Kp = {gain:.2f}")
    label_axes(deviation, "time since the start of the phase [s]")
    legend(figure)
    return figure


def _draw_zoom(comparison: Comparison, gains: tuple[float, float]) -> Figure:
    """Draw the second cycles of the first seed around the lowest point of the path."""
    figure, axes = new_figure(PAGE_WIDTH, 3.2, columns=2)
    points = comparison.points
    x, y = 1e3 * points[np.argmin(points[:, 1])]
    for panel, gain in zip(axes, gains):
        _draw_path(panel, points)
        for run, style in ((comparison.model, MODEL), (comparison.compensated["literal"], HYBRID)):
            tips, label = run.tip[len(points) :, 0, GAINS.index(gain)], f"{style['label']}, second cycle"
            panel.plot(*(1e3 * tips).T, **{**style, "label": label})
        panel.set(xlim=(x - 14, x + 14), ylim=(y - 4, y + 20))
        label_axes(panel, title=f"Kp = {gain:.2f}")
    legend(figure)
    return figure


def tables12_learning_or_gain(summary: pd.DataFrame) -> Figure:
    """Draw the mean tracking error over the gain for every controller, with the spread over seeds."""
    figure, axes = new_figure(PAGE_WIDTH, 3.4, columns=2)
    for panel, (path, group) in zip(axes, summary.groupby("path", sort=False)):
        for offset, (name, rows) in enumerate(group.groupby("controller", sort=False)):
            by_gain = rows.groupby("gain").error_mm
            gains, mean = np.array(GAINS) + 0.0011 * (offset - 2.5), by_gain.mean()
            spread = np.stack([mean - by_gain.min(), by_gain.max() - mean])
            label, color, marker = CONTROLLERS[str(name)]
            style = {"linestyle": ":", "linewidth": 0.8, "markersize": 4.5, "color": color, "marker": marker}
            panel.errorbar(gains, mean, spread, label=label, **style)
        panel.set_yscale("log")
        panel.set_xticks(GAINS)
        panel.set_yticks([1, 2, 5, 10, 20], labels=["1", "2", "5", "10", "20"])
        panel.minorticks_off()
        label_axes(panel, "gain Kp [-]", "mean tracking error [mm]", title=str(path))
    legend(figure, ncols=3)
    return figure


def cap_or_no_cap(summaries: Mapping[str, pd.DataFrame]) -> Figure:
    """Draw the model-based error over the gain under several hypotheses about the 3 mm, and as published."""
    figure, axes = new_figure(PAGE_WIDTH, 3.2, columns=2)
    published = build_scorecard("visual_strain_fusion", {}).set_index("id")["published"]
    for panel, table, path in zip(axes, ("table1", "table2"), ("pentagram", "circle")):
        cells = [published[f"{table}_kp{100 * gain:02.0f}_model_error_mean"] for gain in GAINS]
        panel.plot(GAINS, cells, "x", color=COLORS["black"], markersize=8, zorder=5, label="published")
        for name, summary in summaries.items():
            model = summary[(summary.controller == "model") & (summary.path == path)]
            panel.plot(model.groupby("gain").error_mm.mean(), marker="o", markersize=4, label=name)
        panel.set(xticks=GAINS, ylim=(0, 32))
        label_axes(panel, "gain Kp [-]", "model-based error [mm]", title=path)
    legend(figure, ncols=3)
    return figure


def fig11_linear_map(run: CurveRun) -> Figure:
    """Draw the closed curve with the linear actuation map: model-based and hybrid cycle."""
    return _draw_curve(run, (1, 2))


def fig12_fitted_map(run: CurveRun) -> Figure:
    """Draw the closed curve with the fitted map; the third cycle has an obstacle before the camera."""
    return _draw_curve(run, (1, 2, 3))


def fig14c_beside_a_rod(run: CurveRun, wall: Wall) -> Figure:
    """Draw the closed curve with a rod beside the arm."""
    figure = _draw_curve(run, (1, 2))
    normal = np.array([np.cos(wall.direction), np.sin(wall.direction)])
    along = np.array([-normal[1], normal[0]])
    rod = 38.0 * normal + np.array([[-8.0], [8.0]]) * along
    path, color = figure.axes[0], COLORS["vermillion"]
    path.plot(*rod.T, color=color, linewidth=4.0, alpha=0.5, solid_capstyle="round")
    path.annotate("rod on this side", tuple((40.0 * normal).tolist()), ha="left", color=color)
    return figure


def _draw_curve(run: CurveRun, cycles: tuple[int, ...]) -> Figure:
    figure, path, *panels = _path_and_errors(3.6, octopus())
    styles = {1: MODEL, 2: HYBRID, 3: OBSTRUCTED}
    time = PERIOD * np.arange(len(run.tip))
    lost = (run.lost & np.isin(run.cycle, cycles)).tolist()
    for cycle in cycles:
        path.plot(*(1e3 * run.tip[run.cycle == cycle]).T, **styles[cycle])
    for panel, values in zip(panels, (run.error, run.deviation)):
        for cycle in cycles:
            chosen = run.cycle == cycle
            panel.plot(time[chosen], 1e3 * values[chosen], **styles[cycle])
        panel.set_ylim(0, 12)
        panel.fill_between(time, 0, 12, where=lost, color=COLORS["light"], linewidth=0, zorder=0)
    label_axes(panels[1], "time [s]")
    figure.legend(*path.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure
