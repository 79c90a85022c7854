"""What depends on the operator, the tracking and the detected goal."""

import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from soro_lib.papers.shared_control.figures.results import PARADIGM_COLORS, SHORT
from soro_lib.replication.plotting import (
    COLORS,
    REFERENCE,
    SERIES,
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
            table = group.pivot_table(
                index="offset_mm",
                columns="paradigm",
                values=metric,
                aggfunc="mean" if metric == "finished" else "median",
            )
            for name, line in table[list(PARADIGM_COLORS)].items():
                axes.plot(
                    line.index,
                    line,
                    "o-",
                    markersize=3,
                    color=PARADIGM_COLORS[str(name)],
                    label=SHORT[str(name)],
                )
            axes.set_title(f"{kind}: {label}", fontsize=8.5)
    for axes in grid[1]:
        label_axes(axes, "error of the goals [mm]")
    legend(figure, ncols=6)
    return figure


def tracking_noise(trials: pd.DataFrame, assumed_mm: float) -> Figure:
    """Mean force of assist-as-needed on the real arm against the noise of the tracking."""
    figure, axes = new_figure(height=2.6)
    for color, (counter, group) in zip(SERIES, trials.groupby("counter", sort=False)):
        cells = group.groupby("noise_mm")["assistance_n"]
        axes.errorbar(
            cells.mean().index,
            cells.mean(),
            1.96 * cells.sem(),
            fmt="o-",
            capsize=2,
            color=color,
            label=f"counter of the {counter}",
        )
    axes.set_xscale("symlog", linthresh=0.02)
    axes.set_xticks([0, 0.02, 0.05, 0.1, 0.2, 0.5], ["0", "0.02", "0.05", "0.1", "0.2", "0.5"])
    axes.minorticks_off()
    axes.axvline(assumed_mm, **{**REFERENCE, "linewidth": 0.9}, label="assumed for the real arm")
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
        axes.errorbar(
            people.mean().index,
            people.mean(),
            1.96 * people.sem(),
            fmt="o-",
            capsize=2,
            color=color,
            label=label,
        )
    axes.axvline(1.0, **{**REFERENCE, "linewidth": 0.9}, label="ξ_S")
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
    image = axes.imshow(correlations, cmap="PuOr", vmin=-0.8, vmax=0.8, aspect="auto")
    for row, (_, line) in enumerate(correlations.iterrows()):
        for column, value in enumerate(line):
            if abs(value) >= 0.2:
                color = "white" if abs(value) > 0.5 else COLORS["black"]
                axes.text(column, row, f"{value:.2f}", ha="center", va="center", fontsize=6.5, color=color)
    axes.set_yticks(range(len(correlations)), [name.replace("_", " ") for name in correlations.index])
    axes.set_xticks(range(correlations.shape[1]), list(correlations.columns), rotation=35, ha="right")
    axes.grid(visible=False)
    figure.colorbar(image, ax=axes, shrink=0.5, label="Spearman's ρ")
    return figure
