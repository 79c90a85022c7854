"""Figures of the fibre and its learning estimator (Wang et al., Figs. 2, 3, Sec. IV-C)."""

import math
from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from soro_lib.papers.visual_strain_fusion.experiments.estimation import DIVERGED, ROUNDING_LIMIT, LearningRun
from soro_lib.papers.visual_strain_fusion.world.fibre import FibreGratings
from soro_lib.papers.visual_strain_fusion.world.motion import PERIOD
from soro_lib.papers.visual_strain_fusion.world.plant import BackboneParameters
from soro_lib.replication.plotting import COLORS, PAGE_WIDTH, SERIES, label_axes, legend, new_figure

DIVERGED_COLOR = "#b00000"


def fig03_strain_along_the_helix(fibre: FibreGratings) -> Figure:
    """Draw the strain of the gratings: growing bend in one direction, one bend in four directions."""
    figure, axes = new_figure(PAGE_WIDTH, 3.0, columns=2, sharey=True)
    backbone = BackboneParameters()
    bends = [(0, angle, 0, f"bend {angle} deg") for angle in (20, 40, 60)]
    bends += [(1, 45, heading, f"toward {heading} deg") for heading in (0, 90, 180, 270)]
    for color, (column, angle, heading, label) in zip((*SERIES[:3], *SERIES[:4]), bends):
        toward = np.array([np.cos(np.deg2rad(heading)), np.sin(np.deg2rad(heading))])
        strain = fibre.axial_strain(backbone.shape(np.deg2rad(angle) * toward, fibre.length))
        axes[column].plot(1e3 * fibre.position, 100 * strain, marker=".", color=color, label=label)
    label_axes(axes[0], "place along the fibre [mm]", "axial strain of the skin [%]", title="Same plane")
    label_axes(axes[1], "place along the fibre [mm]", title="Same bend, 45 deg")
    axes[0].set_ylim(-14.0, 20.0)
    for panel in axes:
        legend(panel, loc="upper left", ncols=2, fontsize=7)
    return figure


def elm_before_and_after(table: pd.DataFrame) -> Figure:
    """Draw the error before and after learning of every network, against the labels, on one axis."""
    figure, axes = new_figure(PAGE_WIDTH, 3.4)
    groups = table.groupby("network", sort=False)
    rows = np.arange(len(groups))
    diverged = np.isinf(groups["prior_mean_mm"].max().to_numpy())
    styles = {
        "prior_mean_mm": ("to the truth, before learning", COLORS["black"], "s"),
        "prior_label_mm": ("to the label, before learning", COLORS["blue"], "o"),
        "posterior_label_mm": ("to the label, after learning it", COLORS["orange"], "v"),
    }
    for column, (label, color, marker) in styles.items():
        mean, low, high = (getattr(groups[column], how)().mask(diverged) for how in ("mean", "min", "max"))
        spread = np.stack([mean - low, high - mean])
        axes.errorbar(mean, rows, xerr=spread, linestyle="none", color=color, marker=marker, label=label)
    axes.set_yticks(rows, labels=list(groups.groups))
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.3)
    for row in rows[diverged]:
        axes.text(0.02, row, f"diverged: errors beyond {DIVERGED:g} m", va="center", color=DIVERGED_COLOR)
    label_axes(axes, "mean spatial error [mm]")
    legend(figure)
    return figure


def elm_blow_up(runs: Mapping[str, LearningRun], hold: tuple[int, int]) -> Figure:
    """Draw covariance and error while the arm stands still and after: forgetting with narrow excitation.

    A line ends where rounding takes over, because it would go on differently on every processor.
    """
    figure, axes = new_figure(PAGE_WIDTH, 3.8, rows=2, sharex=True)
    second = round(1.0 / PERIOD)
    limit = f"beyond $10^{{{math.log10(ROUNDING_LIMIT):.0f}}}$ rounding decides"
    for color, (name, run) in zip((COLORS["vermillion"], COLORS["blue"], COLORS["black"]), runs.items()):
        seconds = np.count_nonzero(run.resolved) // second
        steps = slice(0, seconds * second)
        time, trace = PERIOD * run.step[steps], run.trace[steps]
        error = 1e3 * run.prior[steps].reshape(seconds, second).mean(axis=1)
        axes[0].plot(time, trace, color=color, label=name)
        axes[1].plot(time[second - 1 :: second], error, color=color)
        if not run.resolved.all():
            fate = f"then diverges, errors beyond {DIVERGED:g} m" if run.diverged else limit
            for panel, value, height, word in zip(axes, (trace[-1], error[-1]), (1e11, 4.0), (limit, fate)):
                panel.plot(time[-1], value, "x", color=DIVERGED_COLOR, markeredgewidth=2, zorder=5)
                panel.plot([time[-1]] * 2, [value, height], ":", color=DIVERGED_COLOR, zorder=5)
                panel.text(time[-1] + 1.0, height, word, color=DIVERGED_COLOR, va="center")
    for panel in axes:
        panel.set_yscale("log")
        panel.axvspan(PERIOD * hold[0], PERIOD * hold[1], color=COLORS["light"], alpha=0.5, zorder=0)
    axes[0].set_ylim(1e6, 1e12)
    axes[1].set_ylim(1e-1, 1e1)
    label_axes(axes[0], y="trace of H [-]", title="Standing still (grey)")
    label_axes(axes[1], "time [s]", "error before learning,\nmean of 1 s [mm]")
    legend(axes[0])
    return figure


def elm_samples_and_blackouts(samples: pd.DataFrame, blackouts: pd.DataFrame) -> Figure:
    """Draw what the first samples are worth, and how long the fibre holds without the camera."""
    figure, axes = new_figure(PAGE_WIDTH, 3.0, columns=2)
    by_count = {
        "next_mm": ("next 10 s, not learning", "orange", "o"),
        "frozen_mm": ("rest of the spiral, not learning", "vermillion", "s"),
        "learning_mm": ("rest of the spiral, learning", "blue", "D"),
    }
    by_length = {"mean_mm": ("mean", "blue", "D"), "max_mm": ("max", "vermillion", "s")}
    panels = ((axes[0], samples, "samples", by_count), (axes[1], blackouts, "seconds", by_length))
    for panel, table, key, styles in panels:
        for column, (label, color, marker) in styles.items():
            mean = table.groupby(key)[column].mean()
            panel.plot(mean, color=COLORS[color], marker=marker, markersize=4, label=label)
            panel.plot(table[key], table[column], ".", color=COLORS[color], alpha=0.4, markersize=3)
        legend(panel, fontsize=7)
    axes[0].set(yscale="log", xticks=sorted(samples.samples.unique()))
    axes[1].set_ylim(bottom=0)
    label_axes(axes[0], "initial samples N0", "mean error to the truth [mm]")
    label_axes(axes[1], "time without camera [s]", "error of the fibre alone [mm]")
    return figure
