"""Figures of pushes and flicks (Wang et al., Fig. 13, Tables III, IV and VI)."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from soro_lib.papers.visual_strain_fusion.experiments.collisions import ContactRun
from soro_lib.papers.visual_strain_fusion.world.motion import PERIOD
from soro_lib.replication.plotting import COLORS, PAGE_WIDTH, TRUTH, label_axes, legend, new_figure

STYLES: dict[str, dict[str, Any]] = {
    "slam": {"color": COLORS["orange"], "label": "camera"},
    "fibre": {"color": COLORS["green"], "label": "fibre"},
    "fusion": {"color": COLORS["blue"], "label": "fusion"},
}


def fig13a_push_on_cap(run: ContactRun) -> Figure:
    """Draw two slow pushes on the cap: trajectories of the four sensings, and errors."""
    return _draw_contacts(run)


def fig13b_push_on_body(run: ContactRun) -> Figure:
    """Draw two slow pushes on the body."""
    return _draw_contacts(run)


def flick_on_cap(run: ContactRun) -> Figure:
    """Draw two fast flicks on the cap, where the camera loses its features."""
    return _draw_contacts(run)


def _draw_contacts(run: ContactRun) -> Figure:
    """Draw the third and the eighth contact."""
    figure, axes = new_figure(PAGE_WIDTH, 4.6, rows=2, columns=2, height_ratios=(1.5, 1.0))
    errors = run.errors()
    for (path, error), event in zip(axes.T, (2, 7)):
        steps = np.flatnonzero(run.event == event)
        steps = np.arange(steps[0] - 20, steps[-1] + 20)
        for name, position in run.positions.items():
            path.plot(*(1e3 * position[steps, :2]).T, linewidth=1.0, **STYLES[name])
            error.plot(PERIOD * steps, 1e3 * errors[name][steps], linewidth=1.0, color=STYLES[name]["color"])
        path.plot(*(1e3 * run.motion.pose[steps, :2]).T, **{**TRUTH, "linewidth": 1.0}, label="truth")
        high = error.get_ylim()[1]
        lost = run.lost[steps]
        error.fill_between(PERIOD * steps, 0, high, where=lost, color=COLORS["light"], linewidth=0, zorder=0)
        error.set_ylim(0, high)
        path.set_aspect("equal", adjustable="datalim")
        label_axes(path, "x [mm]", "y [mm]", title=f"Contact {event + 1}")
        label_axes(error, "time [s]", "error [mm]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def table6_initial_samples(table: pd.DataFrame) -> Figure:
    """Draw mean and largest error under the identical flick over the number of initial samples."""
    return _draw_groups(table, "initial samples N0")


def protection_in_the_dark(table: pd.DataFrame) -> Figure:
    """Draw mean and largest error of a push on the body with the view covered: sheath against masking."""
    return _draw_groups(table[table.estimator != "slam"], "")


def _draw_groups(table: pd.DataFrame, label: str) -> Figure:
    figure, axes = new_figure(PAGE_WIDTH, 3.0, columns=2)
    groups = list(dict.fromkeys(table.contact))
    names = list(dict.fromkeys(table.estimator))
    for panel, (column, title) in zip(axes, (("mean_mm", "mean error"), ("max_mm", "largest error"))):
        for offset, name in enumerate(names):
            rows = table[table.estimator == name].groupby("contact")[column]
            mean, low, high = (getattr(rows, how)().reindex(groups) for how in ("mean", "min", "max"))
            place = np.arange(len(groups)) + 0.15 * (offset - (len(names) - 1) / 2)
            spread = np.stack([mean - low, high - mean])
            panel.errorbar(place, mean, spread, linestyle="none", marker="o", markersize=5, **STYLES[name])
        panel.set_xticks(range(len(groups)), labels=[group.replace(", ", ",\n") for group in groups])
        panel.set_ylim(bottom=0)
        label_axes(panel, label, f"{title} in contact [mm]")
    legend(figure)
    return figure
