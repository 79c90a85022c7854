"""Figures of tracking (Wang et al., Figs. 9 to 12 and 14(c), Tables I and II)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from soro_lib.papers.visual_strain_fusion.experiments.closed_curve import CurveRun, octopus
from soro_lib.papers.visual_strain_fusion.experiments.hybrid_control import Comparison
from soro_lib.papers.visual_strain_fusion.experiments.tracking import GAINS, path_distance
from soro_lib.papers.visual_strain_fusion.world.motion import PERIOD
from soro_lib.papers.visual_strain_fusion.world.plant import Wall
from soro_lib.replication.plotting import COLORS, PAGE_WIDTH, REFERENCE, label_axes, legend, new_figure
from soro_lib.replication.scorecard import build_scorecard

MODEL: dict[str, Any] = {"color": COLORS["grey"], "linewidth": 1.0}
HYBRID: dict[str, Any] = {"color": COLORS["blue"], "linewidth": 1.2}
CONTROLLER_STYLES: dict[str, dict[str, Any]] = {
    "model": {"color": COLORS["grey"], "marker": "s"},
    "literal": {"color": COLORS["blue"], "marker": "o"},
    "no learning": {"color": COLORS["vermillion"], "marker": "D"},
    "relative": {"color": COLORS["green"], "marker": "^"},
    "additive": {"color": COLORS["sky"], "marker": "v"},
    "actual motion": {"color": COLORS["orange"], "marker": "P"},
}
"""How the controllers look in every figure."""
LABELS = {"literal": "Eq. (29) as printed", "no learning": "gain alone, no learning", "model": "model-based"}


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


def _draw_tracking(comparison: Comparison, gain: float, seed: int = 0) -> Figure:
    column = GAINS.index(gain)
    runs = {"model-based": (comparison.model, MODEL), "hybrid": (comparison.compensated["literal"], HYBRID)}
    figure, axes = new_figure(PAGE_WIDTH, 3.4, columns=2, width_ratios=(1.0, 1.25))
    grid = axes[1].get_subplotspec().subgridspec(2, 1)
    axes[1].remove()
    error_axes, deviation_axes = (figure.add_subplot(grid[row]) for row in range(2))
    closed = 1e3 * np.vstack([comparison.points, comparison.points[:1]])
    axes[0].plot(*closed.T, **REFERENCE, label="target path")
    for name, (run, style) in runs.items():
        tips = run.tip[:, seed, column]
        axes[0].plot(*(1e3 * tips).T, **style, label=name)
        time = PERIOD * np.arange(len(tips))
        error_axes.plot(time, 1e3 * run.error[:, seed, column], **style)
        deviation_axes.plot(time, 1e3 * path_distance(tips, comparison.points), **style)
    axes[0].set_aspect("equal")
    label_axes(axes[0], "x [mm]", "y [mm]", title=f"Kp = {gain:.2f}")
    label_axes(error_axes, y="error [mm]")
    label_axes(deviation_axes, "time since the start of the phase [s]", "deviation [mm]")
    legend(figure)
    return figure


def _draw_zoom(comparison: Comparison, gains: tuple[float, float], seed: int = 0) -> Figure:
    figure, axes = new_figure(PAGE_WIDTH, 3.2, columns=2)
    points = 1e3 * comparison.points
    corner = points[np.argmin(points[:, 1])]
    for panel, gain in zip(axes, gains):
        column = GAINS.index(gain)
        panel.plot(*np.vstack([points, points[:1]]).T, **REFERENCE, label="target path")
        half = len(comparison.points)
        panel.plot(
            *(1e3 * comparison.model.tip[half:, seed, column]).T, **MODEL, label="model-based, second cycle"
        )
        hybrid = 1e3 * comparison.compensated["literal"].tip[half:, seed, column]
        panel.plot(*hybrid.T, **HYBRID, label="hybrid, second cycle")
        panel.set_xlim(corner[0] - 14, corner[0] + 14)
        panel.set_ylim(corner[1] - 4, corner[1] + 20)
        panel.set_aspect("equal")
        label_axes(panel, "x [mm]", "y [mm]", title=f"Kp = {gain:.2f}")
    legend(figure)
    return figure


def tables12_learning_or_gain(summary: pd.DataFrame) -> Figure:
    """Draw the mean tracking error over the gain for every controller, with the spread over seeds."""
    figure, axes = new_figure(PAGE_WIDTH, 3.4, columns=2)
    for panel, (path, group) in zip(axes, summary.groupby("path", sort=False)):
        for offset, (name, rows) in enumerate(group.groupby("controller", sort=False)):
            by_gain = rows.groupby("gain").error_mm
            gains = np.array(GAINS) + 0.0011 * (offset - 2.5)
            spread = np.stack([by_gain.mean() - by_gain.min(), by_gain.max() - by_gain.mean()])
            panel.errorbar(
                gains,
                by_gain.mean(),
                spread,
                linestyle=":",
                linewidth=0.8,
                markersize=4.5,
                label=LABELS.get(str(name), f"Eq. (29), {name}"),
                **CONTROLLER_STYLES[str(name)],
            )
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
    for panel, table in zip(axes, ("table1", "table2")):
        cells = [published[f"{table}_kp{100 * gain:02.0f}_model_error_mean"] for gain in GAINS]
        panel.plot(GAINS, cells, "x", color=COLORS["black"], markersize=8, zorder=5, label="published")
    for name, summary in summaries.items():
        model = summary[summary.controller == "model"]
        for panel, path in zip(axes, ("pentagram", "circle")):
            by_gain = model[model.path == path].groupby("gain").error_mm.mean()
            panel.plot(by_gain.index, by_gain, marker="o", markersize=4, label=name)
            label_axes(panel, "gain Kp [-]", "model-based error [mm]", title=path)
            panel.set_xticks(GAINS)
            panel.set_ylim(0, 32)
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
    figure.axes[0].plot(*rod.T, color=COLORS["vermillion"], linewidth=4.0, alpha=0.5, solid_capstyle="round")
    figure.axes[0].annotate(
        "rod on this side", (40.0 * normal[0], 40.0 * normal[1]), ha="left", color=COLORS["vermillion"]
    )
    return figure


def _draw_curve(run: CurveRun, cycles: tuple[int, ...]) -> Figure:
    figure, axes = new_figure(PAGE_WIDTH, 3.6, columns=2, width_ratios=(1.0, 1.25))
    grid = axes[1].get_subplotspec().subgridspec(2, 1)
    axes[1].remove()
    panels = [figure.add_subplot(grid[row]) for row in range(2)]
    target = 1e3 * octopus()
    axes[0].plot(*np.vstack([target, target[:1]]).T, **REFERENCE, label="target path")
    styles: dict[int, dict[str, Any]] = {
        1: MODEL,
        2: HYBRID,
        3: {"color": COLORS["orange"], "linewidth": 1.2},
    }
    names = {1: "model-based", 2: "hybrid", 3: "hybrid behind an obstacle"}
    time = PERIOD * np.arange(len(run.tip))
    for cycle in cycles:
        chosen = run.cycle == cycle
        axes[0].plot(*(1e3 * run.tip[chosen]).T, **styles[cycle], label=names[cycle])
        for panel, values in zip(panels, (run.error, run.deviation)):
            panel.plot(time[chosen], 1e3 * values[chosen], **styles[cycle])
            panel.set_ylim(0, 12)
    _shade(panels, time, run.lost & np.isin(run.cycle, cycles))
    axes[0].set_aspect("equal")
    label_axes(axes[0], "x [mm]", "y [mm]")
    label_axes(panels[0], y="error [mm]")
    label_axes(panels[1], "time [s]", "deviation [mm]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def _shade(panels: list[Any], time: ArrayLike, lost: ArrayLike) -> None:
    for panel in panels:
        low, high = panel.get_ylim()
        panel.fill_between(
            np.asarray(time),
            low,
            high,
            where=np.asarray(lost).tolist(),
            color=COLORS["light"],
            linewidth=0,
            zorder=0,
        )
