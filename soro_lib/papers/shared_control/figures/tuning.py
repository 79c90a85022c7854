"""The tuning study, the continuous blend and the stability of the guided hand."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from soro_lib.replication.plotting import COLORS, REFERENCE, SERIES, TRUTH, label_axes, legend, new_figure

METRIC_NAMES = {"time_s": "T", "path_m": "L", "assistance_n": "H", "placement_error_mm": "P"}


def anova_comparison(tables: Mapping[str, pd.DataFrame]) -> Figure:
    """p of every main and two-way effect: repetitions as blocks F(1, 2) against the plain analysis.

    Parameters
    ----------
    tables : mapping of str to pandas.DataFrame
        By response: columns effect, p_blocked, p_plain.
    """
    figure, axes = new_figure(height=3.4)
    for color, (response, table) in zip(SERIES, tables.items()):
        axes.loglog(
            table["p_plain"].clip(lower=1e-4),
            table["p_blocked"],
            "o",
            markersize=4,
            alpha=0.8,
            color=color,
            label=METRIC_NAMES[response],
        )
    axes.axhline(0.05, **{**REFERENCE, "linewidth": 0.9})
    axes.axvline(0.05, **{**REFERENCE, "linewidth": 0.9})
    label_axes(axes, "p, plain n-way analysis (least drawn: 0.0001)", "p, repetitions as blocks F(1, 2)")
    legend(axes, title="response")
    return figure


def implied_scatter(table: pd.DataFrame) -> Figure:
    """Scatter of single trials that the printed F imply, beside that of the simulated operators.

    Parameters
    ----------
    table : pandas.DataFrame
        Columns response, printed (implied by an effect and its F) and one column per simulated operator.
    """
    figure, grid = new_figure(height=2.6, columns=3)
    operators = [name for name in table.columns if name not in ("response", "printed")]
    units = {"time_s": "s", "path_m": "m", "assistance_n": "N"}
    for axes, (response, group) in zip(grid, table.groupby("response", sort=False), strict=True):
        axes.bar(operators, group[operators].iloc[0], color=SERIES[0], alpha=0.6)
        for value in group["printed"]:
            axes.axhline(value, **REFERENCE)
        if response == "assistance_n":
            axes.axhline(3.5, color=COLORS["black"], linewidth=1, linestyle=":")
            axes.annotate(
                "no quantity in 0 to 7 N\nscatters more",
                (0.02, 4.2),
                xycoords=("axes fraction", "data"),
                fontsize=6.5,
            )
        axes.tick_params(axis="x", rotation=30)
        label_axes(axes, y=f"sd of {METRIC_NAMES[str(response)]} [{units[str(response)]}]")
    grid[0].plot([], [], **REFERENCE, label="implied by the printed F")
    legend(figure)
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
        axes.errorbar(
            rows["passivity"],
            rows["effect"],
            spread,
            fmt="o-",
            capsize=2,
            color=COLORS["blue"],
            label="simulated",
        )
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
            image = axes.imshow(np.log10(surface), origin="lower", cmap="viridis_r", aspect="auto")
            steering, eversion = surface.index.tolist(), surface.columns.tolist()
            for (y, x), value in np.ndenumerate(surface.to_numpy()):
                name = corners.get((steering[y], eversion[x]), "")
                pale = np.log10(value) > np.mean(image.get_clim())
                axes.text(
                    x,
                    y,
                    f"{name}\n{value:.0f}" if value >= 10 else f"{name}\n{value:.1f}",
                    ha="center",
                    va="center",
                    fontsize=7.5,
                    color="white" if pale else "black",
                )
            axes.set_xticks(range(surface.shape[1]), list(surface.columns))
            axes.set_yticks(range(surface.shape[0]), list(surface.index))
            axes.grid(visible=False)
            label_axes(
                axes, "machine's share of eversion", "machine's share of steering", title=f"{kind}: {label}"
            )
    return figure


def stability(table: pd.DataFrame, used: float) -> Figure:
    """Critical guidance stiffness against the stiffness of the hand, for several delays (k against k_h)."""
    figure, grid = new_figure(height=3.2, columns=2, sharey=True)
    titles = {"x": "steering (gain 10)", "z": "eversion (gain 15)"}
    for axes, (axis, group) in zip(grid, table.groupby("axis", sort=False), strict=True):
        for color, (delay, line) in zip(SERIES, group.groupby("delay_s")):
            axes.loglog(
                line["hand_stiffness_n_per_m"],
                line["critical_stiffness_n_per_m"],
                color=color,
                label=f"limit, delay {delay:g} s",
            )
        axes.axhline(
            group["passive_stiffness_n_per_m"].max(),
            color=COLORS["grey"],
            linestyle=":",
            label="passive, no delay",
        )
        axes.axhline(used, **REFERENCE, label=f"k_MAX = {used:g} N/m")
        axes.axvline(150, **{**TRUTH, "linewidth": 0.8})
        axes.set_xticks([30, 50, 100, 200, 500], [30, 50, 100, 200, 500])
        axes.set_yticks([0.5, 2, 10, 50, 200], [0.5, 2, 10, 50, 200])
        axes.minorticks_off()
        label_axes(axes, "hand stiffness k_h [N/m]", title=titles[str(axis)])
    label_axes(grid[0], y="guidance stiffness k [N/m]")
    legend(figure)
    return figure
