"""What the paper leaves open: operator, tracking, detected goal, the blend, the guided hand's stability."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from soro_lib.papers.shared_control.figures.paper import PARADIGM_COLORS, SHORT, THIN, number_map
from soro_lib.replication.plotting import (
    COLORS,
    REFERENCE,
    SERIES,
    TRUTH,
    box_groups,
    label_axes,
    legend,
    new_figure,
)


def misdetection(trials: pd.DataFrame) -> Figure:
    """Median time, error and share of finished trials against the error of the detected goals."""
    figure, grid = new_figure(height=4.4, rows=2, columns=3, sharex=True, sharey="col")
    metrics = {
        "time_s": "median time [s]",
        "release_error_mm": "median error [mm]",
        "finished": "finished [-]",
    }
    for row, (kind, group) in zip(grid, trials.groupby("kind", sort=False), strict=True):
        for axes, (metric, label) in zip(row, metrics.items(), strict=True):
            middle = "mean" if metric == "finished" else "median"
            lines = group.groupby(["offset_mm", "paradigm"])[metric].agg(middle).unstack()
            for name, color in PARADIGM_COLORS.items():
                axes.plot(lines.index, lines[name], "o-", markersize=3, color=color, label=SHORT[name])
            axes.set_title(f"{kind}: {label}", fontsize=8.5)
    for axes in grid[1]:
        label_axes(axes, "error of the goals [mm]")
    legend(figure, ncols=6)
    return figure


def _intervals(axes: Axes, samples: Any, color: str, label: str) -> None:
    """Mean and 95 % interval (normal) of grouped samples over the groups."""
    mean = samples.mean()
    axes.errorbar(mean.index, mean, 1.96 * samples.sem(), fmt="o-", capsize=2, color=color, label=label)


def tracking_noise(trials: pd.DataFrame, assumed_mm: float) -> Figure:
    """Mean force of assist-as-needed on the real arm against the noise of the tracking."""
    figure, axes = new_figure(height=2.6)
    for color, (counter, group) in zip(SERIES, trials.groupby("counter", sort=False)):
        _intervals(axes, group.groupby("noise_mm")["assistance_n"], color, f"counter of the {counter}")
    axes.set_xscale("symlog", linthresh=0.02)
    axes.set_xticks([0, 0.02, 0.05, 0.1, 0.2, 0.5], ["0", "0.02", "0.05", "0.1", "0.2", "0.5"])
    axes.minorticks_off()
    axes.axvline(assumed_mm, **THIN, label="assumed for the real arm")
    axes.axvline(0.1, color=COLORS["grey"], linestyle=":", linewidth=1, label="th_M per sample")
    label_axes(axes, "tracking noise per axis and sample [mm]", "mean force H [N]")
    legend(axes)
    return figure


def dwell(trials: pd.DataFrame) -> Figure:
    """Error of naive users against the time they wait before they press."""
    figure, axes = new_figure(height=2.6)
    styles = {
        ("full_teleoperation", "ignore"): ("Full Teleoperation", COLORS["black"]),
        ("assist_as_needed", "ignore"): ("AAN, force ignored", COLORS["sky"]),
        ("assist_as_needed", "use"): ("AAN, force used as a cue", COLORS["blue"]),
    }
    for (paradigm, attitude), (label, color) in styles.items():
        chosen = trials[(trials["paradigm"] == paradigm) & (trials["attitude"] == attitude)]
        people = chosen.groupby(["dwell_s", "operator"])["release_error_mm"].mean().groupby("dwell_s")
        _intervals(axes, people, color, label)
    axes.axvline(1.0, **THIN, label="ξ_S")
    axes.set_ylim(bottom=0)
    label_axes(axes, "dwell before the button is pressed [s]", "placement error [mm]")
    legend(axes)
    return figure


def lifts(trials: pd.DataFrame) -> Figure:
    """Time of mostly autonomous trials with and without the lifts, beside the shared paradigms."""
    figure, grid = new_figure(height=2.6, columns=2)
    for axes, (kind, group) in zip(grid, trials.groupby("kind", sort=False), strict=True):
        people = group.groupby(["case", "operator"], sort=False)["time_s"].mean()
        names = {"Mostly autonomous": "Auto", "without lifts": "Auto,\nno lifts"}
        samples: dict[str, ArrayLike] = {
            names.get(str(case), str(case)): values.to_numpy()
            for case, values in people.groupby("case", sort=False)
        }
        box_groups(axes, samples, (COLORS["sky"], COLORS["light"], COLORS["green"], COLORS["vermillion"]))
        label_axes(axes, y="time [s]", title=str(kind))
    return figure


def sensitivity(correlations: pd.DataFrame) -> Figure:
    """Rank correlation of each conclusion's margin (columns) with each parameter of the operator (rows)."""
    figure, axes = new_figure(height=4.4)
    table = correlations.rename(index=lambda name: name.replace("_", " "))
    words = table.map(lambda value: f"{value:.2f}" if abs(value) >= 0.2 else "")
    image = number_map(axes, table, words, table.abs() > 0.5, 6.5, cmap="PuOr", vmin=-0.8, vmax=0.8)
    axes.set_xticks(axes.get_xticks(), table.columns, rotation=35, ha="right")
    figure.colorbar(image, ax=axes, shrink=0.5, label="Spearman's ρ")
    return figure


def passivity(table: pd.DataFrame, printed: Mapping[str, float]) -> Figure:
    """Effects of the tuning study against the passivity of the operator; the printed ones are lines."""
    chosen = {
        "fmax_time": "f_MAX high\neffect on T [s]",
        "xi_time": "ξ_A, ξ_S low\neffect on T [s]",
        "fmax_assistance": "f_MAX high\neffect on H [N]",
        "kmax_assistance": "k_MAX low, ξ_S high\neffect on H [N]",
    }
    figure, grid = new_figure(height=2.9, columns=4)
    for axes, (name, label) in zip(grid, chosen.items(), strict=True):
        rows = table[table["contrast"] == name]
        spread = [rows["effect"] - rows["low"], rows["high"] - rows["effect"]]
        style = {"fmt": "o-", "capsize": 2, "color": COLORS["blue"], "label": "simulated"}
        axes.errorbar(rows["passivity"], rows["effect"], spread, **style)
        axes.axhline(printed[name], **REFERENCE, label="printed")
        axes.axhline(0, color=COLORS["grey"], linewidth=0.8)
        if name == "kmax_assistance":
            axes.axhspan(7, 10, color=COLORS["light"], linewidth=0, label="impossible")
        axes.set_title(label, fontsize=8)
        label_axes(axes, "passivity ρ")
    legend(figure)
    return figure


def blend_surface(trials: pd.DataFrame) -> Figure:
    """Time and error over the machine's shares in steering and eversion, for both kinds of operator."""
    figure, grid = new_figure(height=5.0, rows=2, columns=2)
    corners: dict[Any, str] = {(0.0, 0.0): "Full", (0.0, 1.0): "MSAE", (1.0, 0.0): "ASME", (1.0, 1.0): "Auto"}
    metrics = {"time_s": "median time [s]", "release_error_mm": "median error [mm]"}
    for row, (kind, group) in zip(grid, trials.groupby("kind", sort=False), strict=True):
        for axes, (metric, label) in zip(row, metrics.items(), strict=True):
            surface = group.pivot_table(index="steering", columns="eversion", values=metric, aggfunc="median")
            logs = pd.DataFrame(np.log10(surface), surface.index, surface.columns)
            words = surface.map(lambda value: f"\n{value:.0f}" if value >= 10 else f"\n{value:.1f}")
            for corner, name in corners.items():
                words.loc[corner] = name + words.loc[corner]
            white = logs > (logs.to_numpy().min() + logs.to_numpy().max()) / 2
            number_map(axes, logs, words, white, 7.5, "black", origin="lower", cmap="viridis_r")
            shares = "machine's share of eversion", "machine's share of steering"
            label_axes(axes, *shares, title=f"{kind}: {label}")
    return figure


def stability(table: pd.DataFrame, used: float) -> Figure:
    """Critical guidance stiffness against the stiffness of the hand, for several delays (k against k_h)."""
    figure, grid = new_figure(height=3.2, columns=2, sharey=True)
    titles = {"x": "steering (gain 10)", "z": "eversion (gain 15)"}
    for axes, (axis, group) in zip(grid, table.groupby("axis", sort=False), strict=True):
        for color, (delay, line) in zip(SERIES, group.groupby("delay_s")):
            hand, limit = line["hand_stiffness_n_per_m"], line["critical_stiffness_n_per_m"]
            axes.loglog(hand, limit, color=color, label=f"limit, delay {delay:g} s")
        passive = group["passive_stiffness_n_per_m"].max()
        axes.axhline(passive, color=COLORS["grey"], linestyle=":", label="passive, no delay")
        axes.axhline(used, **REFERENCE, label=f"k_MAX = {used:g} N/m")
        axes.axvline(150, **{**TRUTH, "linewidth": 0.8})
        axes.set_xticks([30, 50, 100, 200, 500], [30, 50, 100, 200, 500])
        axes.set_yticks([0.5, 2, 10, 50, 200], [0.5, 2, 10, 50, 200])
        axes.minorticks_off()
        label_axes(axes, "hand stiffness k_h [N/m]", title=titles[str(axis)])
    label_axes(grid[0], y="guidance stiffness k [N/m]")
    legend(figure)
    return figure
