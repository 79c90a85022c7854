"""Figures of the contest of controllers and arms."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from soro_lib.papers.cross_robot.experiments.contest import TrackedPath
from soro_lib.replication.plotting import COLORS, PAGE_WIDTH, REFERENCE, TRUTH, label_axes, legend, new_figure

SMALLEST = 0.03
"""Errors below this share of the arm's length are drawn at the edge [%]."""

LOOKS: dict[tuple[str, str], dict[str, Any]] = {
    ("scaled", "as modelled"): {
        "marker": "o",
        "markerfacecolor": "none",
        "markersize": 7.5,
        "elinewidth": 0.0,
        "color": COLORS["black"],
    },
    ("scaled", "disturbed"): {"marker": "o", "color": COLORS["blue"]},
    ("as printed", "disturbed"): {"marker": "x", "color": COLORS["vermillion"], "markeredgewidth": 1.6},
}
"""How the conditions of the contest are drawn."""

LABELS = ("arm as modelled", "arm disturbed", "arm disturbed, constants as printed")


def contest(table: pd.DataFrame) -> Figure:
    """Error of every controller on every arm, while moving and while holding, with 95 % intervals."""
    arms, names = list(table["arm"].unique()), list(table["controller"].unique())
    figure, axes = new_figure(PAGE_WIDTH, 5.4, rows=2, columns=len(arms), sharex=True, sharey=True)
    for row, (measure, title) in zip(axes, (("median", "moving"), ("held", "holding")), strict=True):
        for panel, arm in zip(row, arms, strict=True):
            for (constants, plant), label in zip(LOOKS, LABELS, strict=True):
                cells = table.query("arm == @arm and constants == @constants and plant == @plant")
                cells = cells.dropna(subset=[f"{measure}_mm"])
                _draw(panel, cells, measure, names, LOOKS[constants, plant], label)
            panel.set(xscale="log", xlim=(0.8 * SMALLEST, 40.0), yticks=range(len(names)), yticklabels=names)
            panel.set_title(f"{arm}, {title}", fontsize=8)
    axes[0, 0].invert_yaxis()
    figure.supxlabel("error [% of the arm's length]", fontsize=9)
    legend(figure, ncols=3, loc="outside upper center")
    return figure


def _draw(
    axes: Any, cells: pd.DataFrame, measure: str, names: list[str], look: dict[str, Any], label: str
) -> None:
    """Draw one condition in one panel: mean over seeds and its interval."""
    per_mm = cells[f"{measure}_percent"] / cells[f"{measure}_mm"]
    value, low, high = (
        np.maximum(cells[f"{measure}{end}_mm"] * per_mm, SMALLEST) for end in ("", "_low", "_high")
    )
    rows = [names.index(name) for name in cells["controller"]]
    reach = [value - low, high - value]
    style = {"linestyle": "none", "elinewidth": 1.0, "markersize": 4.5, **look}
    axes.errorbar(value, rows, xerr=reach, label=label, **style)


def paths(runs: Mapping[tuple[str, str], TrackedPath]) -> Figure:
    """The way of the tips of the disturbed arms, one controller per row and one arm per column."""
    names = ("gesture steering", "fixed assistance", "hybrid, learning", "virtual stiffness")
    arms = list(dict.fromkeys(arm for _, arm in runs))
    figure, axes = new_figure(PAGE_WIDTH, 5.6, rows=len(names), columns=len(arms))
    for line, name in zip(axes, names, strict=True):
        for panel, arm in zip(line, arms, strict=True):
            run = runs[name, arm]
            centre = run.goals[:, :2].min(axis=0) / 2.0 + run.goals[:, :2].max(axis=0) / 2.0
            for member in range(run.tips.shape[1] // 2, run.tips.shape[1]):
                panel.plot(
                    *(1e3 * (run.tips[:, member, :2] - centre)).T,
                    **{**TRUTH, "linewidth": 0.6, "alpha": 0.45},
                )
            panel.plot(*(1e3 * (run.goals[:, :2] - centre)).T, **REFERENCE)
            half = 1e3 * np.ptp(run.goals[:, 0]) / 2.0
            panel.set(aspect="equal", xlim=(-1.5 * half, 1.5 * half), ylim=(-1.35 * half, 1.35 * half))
            panel.tick_params(labelsize=6.5)
    for panel, arm in zip(axes[0], arms, strict=True):
        panel.set_title(arm, loc="center", fontsize=9)
    for panel, name in zip(axes[:, 0], names, strict=True):
        label_axes(panel, y=f"{name}\ny [mm]")
        panel.yaxis.label.set_fontsize(7.5)
    for panel in axes[-1]:
        label_axes(panel, x="x [mm]")
    return figure
