"""The demonstrations: Figs. 7, 8 and 9, and the claims over all conditions."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from soro_lib.controllers.shared_control import PARADIGMS
from soro_lib.reporting.plotting import COLORS, SERIES, box_groups, label_axes, legend, new_figure

SHORT = dict(zip(PARADIGMS, ("Full", "AAN", "Fixed", "MSAE", "ASME", "Auto"), strict=True))
PARADIGM_COLORS = dict(zip(PARADIGMS, (COLORS["black"], *SERIES[:5]), strict=True))


def fig07a_placement_error(trials: pd.DataFrame) -> Figure:
    """Error at release by paradigm, one panel per participant or crowd (Fig. 7a)."""
    return _boxes(trials, "release_error_mm", "placement error [mm]")


def fig07b_time(trials: pd.DataFrame) -> Figure:
    """Time of a trial by paradigm, one panel per participant or crowd (Fig. 7b)."""
    return _boxes(trials, "time_s", "time [s]")


def _boxes(trials: pd.DataFrame, metric: str, label: str) -> Figure:
    figure, grid = new_figure(height=3.0, columns=4, sharey=True)
    for axes, ((environment, kind), cell) in zip(
        grid, trials.groupby(["environment", "kind"], sort=False), strict=True
    ):
        samples: dict[str, ArrayLike] = {
            SHORT[str(name)]: group[metric].dropna().to_numpy()
            for name, group in cell.groupby("paradigm", sort=False)
        }
        box_groups(axes, samples, tuple(PARADIGM_COLORS.values()))
        axes.plot(
            range(1, 7),
            [float(np.mean(np.asarray(values))) for values in samples.values()],
            "D",
            markersize=3.5,
            color=COLORS["black"],
            zorder=5,
        )
        axes.tick_params(axis="x", rotation=60)
        label_axes(axes, title=f"{kind}, {environment}")
    if metric == "time_s":
        grid[0].set_yscale("log")
        grid[0].set_yticks([15, 20, 30, 50, 100, 200], [15, 20, 30, 50, 100, 200])
        grid[0].minorticks_off()
    label_axes(grid[0], y=label)
    return figure


def fig08_error_against_time(trials: pd.DataFrame) -> Figure:
    """Error against time of single items, panels a to d (Fig. 8); ellipses hold half of each cloud."""
    figure, grid = new_figure(height=5.2, rows=2, columns=2, sharex=True, sharey=True)
    panels = trials.groupby(["environment", "kind"], sort=False)
    for axes, letter, ((environment, kind), cell) in zip(grid.flat, "abcd", panels, strict=True):
        for name, group in cell.groupby("paradigm", sort=False):
            times = group[["item1_time_s", "item2_time_s"]].to_numpy().ravel()
            errors = group[["item1_error_mm", "item2_error_mm"]].to_numpy().ravel()
            good = np.isfinite(times) & np.isfinite(errors)
            _cloud(axes, times[good], errors[good], PARADIGM_COLORS[str(name)], SHORT[str(name)])
        axes.set(xscale="log", yscale="log")
        axes.set_xticks([8, 10, 15, 20, 30, 50, 100], [8, 10, 15, 20, 30, 50, 100])
        axes.set_yticks([0.3, 1, 3, 10, 30, 100], [0.3, 1, 3, 10, 30, 100])
        axes.minorticks_off()
        axes.set(xlim=(7, 120), ylim=(0.2, 200))
        label_axes(axes, title=f"({letter}) {kind}, {environment}")
    for axes in grid[1]:
        label_axes(axes, "time of one item [s]")
    for axes in grid[:, 0]:
        label_axes(axes, y="placement error [mm]")
    legend(figure, ncols=6)
    return figure


def _cloud(axes: Axes, x: np.ndarray, y: np.ndarray, color: str, label: str) -> None:
    """A cloud of points on logarithmic axes and the ellipse about half of it."""
    points = np.log(np.column_stack([x, np.maximum(y, 0.05)]))
    size, alpha = (6.0, 0.8) if len(x) < 100 else (2.5, 0.12)
    axes.plot(x, y, ".", markersize=size, markeredgewidth=0, alpha=alpha, color=color)
    values, vectors = np.linalg.eigh(np.cov(points.T))
    angle = np.linspace(0, 2 * np.pi, 100)
    circle = np.sqrt(2 * np.log(2)) * np.column_stack([np.cos(angle), np.sin(angle)])
    ellipse = np.exp(np.median(points, axis=0) + circle * np.sqrt(np.maximum(values, 0)) @ vectors.T)
    axes.plot(*ellipse.T, color=color, linewidth=1.6, label=label)


def fig09_assistance(trials: pd.DataFrame) -> Figure:
    """Mean force of the two assistances for every kind and environment (Fig. 9)."""
    figure, axes = new_figure(height=2.8)
    samples: dict[str, ArrayLike] = {}
    for (environment, kind), cell in trials.groupby(["environment", "kind"], sort=False):
        for name in ("assist_as_needed", "fixed_assistance"):
            label = f"{SHORT[name]}\n{kind}\n{environment}"
            samples[label] = cell.loc[cell["paradigm"] == name, "assistance_n"].to_numpy()
    box_groups(axes, samples, (PARADIGM_COLORS["assist_as_needed"], PARADIGM_COLORS["fixed_assistance"]))
    label_axes(axes, y="mean force H [N]")
    return figure


def claim_matrix(probabilities: pd.DataFrame) -> Figure:
    """Probability of every claim (rows) under every attitude, law and approach (columns)."""
    table = probabilities.assign(
        condition=probabilities["attitude"] + ", " + probabilities["law"] + ", " + probabilities["approach"],
        row=probabilities["claim"].str.replace("_", " ")
        + " ("
        + probabilities["kind"]
        + ", "
        + probabilities["environment"].str.replace("simulated", "sim")
        + ")",
    )
    matrix = table.pivot_table(index="row", columns="condition", values="probability", sort=False)
    figure, axes = new_figure(height=0.155 * len(matrix) + 1.6)
    image = axes.imshow(matrix, cmap="RdYlBu", vmin=0, vmax=1, aspect="auto")
    for (row, column), value in np.ndenumerate(matrix.to_numpy()):
        if np.isfinite(value):
            color = "white" if value < 0.12 or value > 0.88 else COLORS["black"]
            axes.text(
                column,
                row,
                f"{value:.2f}".lstrip("0") or "0",
                ha="center",
                va="center",
                fontsize=5.5,
                color=color,
            )
    axes.set_yticks(range(len(matrix)), list(matrix.index), fontsize=6)
    axes.set_xticks(range(len(matrix.columns)), list(matrix.columns), rotation=40, ha="right", fontsize=6.5)
    axes.grid(visible=False)
    figure.colorbar(image, ax=axes, shrink=0.3, label="probability over operators")
    return figure
