"""Figures of the paper: single trials (Figs. 2, 4, 5), demonstrations (Figs. 7 to 9), claims, tuning."""

from collections.abc import Iterable, Mapping
from string import ascii_lowercase
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from numpy.typing import ArrayLike, NDArray

from soro_lib.controllers.shared_control import PARADIGMS
from soro_lib.controllers.shared_control.assist_as_needed import MOTIONS
from soro_lib.controllers.shared_control.goal_selection import PHASES
from soro_lib.papers.shared_control.experiments.task import Scene
from soro_lib.replication.plotting import (
    COLORS,
    ESTIMATE,
    GOAL,
    MEASUREMENT,
    REFERENCE,
    SERIES,
    TRUTH,
    box_groups,
    equal_aspect,
    label_axes,
    legend,
    new_figure,
)

# --- One trial at a time: the task in space and its two state machines at work ------------------------------

MOTION_COLORS = dict(
    zip(MOTIONS, ("#ffffff", COLORS["green"], COLORS["orange"], COLORS["vermillion"], COLORS["sky"]))
)
PHASE_COLORS = dict(
    zip(PHASES, ("#ffffff", COLORS["blue"], COLORS["sky"], COLORS["green"], COLORS["orange"], "#dddddd"))
)


def _points(trace: pd.DataFrame, name: str) -> NDArray[np.float64]:
    return trace[[f"{name}_{axis}_m" for axis in "xyz"]].to_numpy()


def _shade(
    axes: Axes, time: pd.Series, state: pd.Series, colors: Mapping[str, str], names: tuple[str, ...]
) -> None:
    """Colour the background by a state, one patch per spell; each state enters the legend once."""
    codes = state.to_numpy(dtype=int)
    starts = np.flatnonzero(np.diff(codes, prepend=-1))
    ends = [*starts[1:], len(codes)]
    named: set[str] = set()
    for start, end in zip(starts, ends, strict=True):
        name = names[codes[start]]
        label = None if name in named or name == "start" else name
        named.add(name)
        style: dict[str, Any] = {"color": colors[name], "alpha": 0.25, "linewidth": 0}
        axes.axvspan(time.iloc[start], time.iloc[end - 1] + 0.01, **style, label=label)


def fig02_task(traces: Mapping[str, pd.DataFrame], scene: Scene) -> Figure:
    """The task in space: tip paths of a few trials, body at the end, items and targets (after Figs. 2 and 6).

    Parameters
    ----------
    traces : mapping of str to pandas.DataFrame
        Traces of `trace_trial` by label; drawn side by side.
    scene : Scene
    """
    figure, grid = new_figure(height=4.2, columns=len(traces), projection="3d")
    places = np.array([scene.start, *scene.items, *scene.targets, (0.0, 0.0, 0.0)])
    for axes, (label, trace) in zip(np.atleast_1d(grid), traces.items(), strict=True):
        path = _points(trace, "tip")
        axes.plot(*path.T, **TRUTH, label="tip")
        goals = np.unique(_points(trace, "goal")[:-1], axis=0)
        axes.plot(*goals.T, **{**GOAL, "markersize": 5, "markeredgewidth": 1.2}, label="goals")
        axes.plot(*np.array([(0, 0, 0), path[-1]]).T, color=COLORS["light"], linewidth=7, zorder=1)
        for number, (item, target) in enumerate(zip(scene.items, scene.targets, strict=True)):
            style = {"color": SERIES[number], "linestyle": "none"}
            axes.plot(*np.array([item]).T, "s", markersize=8, **style, label=f"item {number + 1}")
            ring = {"markersize": 11, "fillstyle": "none", **style}
            axes.plot(*np.array([target]).T, "o", **ring, label=f"target {number + 1}")
        equal_aspect(axes, np.vstack([places, path]))
        axes.invert_zaxis()
        axes.view_init(elev=22, azim=-65)
        axes.locator_params(nbins=3)
        label_axes(axes, "x [m]", "y [m]", "z [m]", f"{label}, {trace['time_s'].iloc[-1]:.0f} s")
    legend(figure, ncols=6)
    return figure


def fig04_goal_machine(trace: pd.DataFrame) -> Figure:
    """Goal selection at work (Fig. 4): height of tip and goal under the phases of the machine."""
    figure, (height, across) = new_figure(height=3.8, rows=2, sharex=True)
    time = trace["time_s"]
    for axes in (height, across):
        _shade(axes, time, trace["phase"], PHASE_COLORS, PHASES)
    height.plot(time, trace["goal_z_m"], **REFERENCE, label="goal")
    height.plot(time, trace["tip_z_m"], **TRUTH, label="tip")
    height.axhline(0.55, color=COLORS["grey"], linewidth=0.8, linestyle=":", label="counts as lifted")
    height.invert_yaxis()
    across.plot(time, trace["goal_x_m"], **REFERENCE)
    across.plot(time, trace["tip_x_m"], **TRUTH)
    label_axes(height, y="z, down [m]", title="Goal selection in a mostly autonomous trial")
    label_axes(across, "time [s]", "x [m]")
    legend(figure)
    return figure


def fig05_stiffness_machine(traces: Mapping[str, pd.DataFrame]) -> Figure:
    """Assist-as-needed at work (Fig. 5): distance, stiffness and force of one trial per operator."""
    figure, grid = new_figure(
        height=4.6, rows=3, columns=len(traces), sharex="col", sharey="row", squeeze=False
    )
    for (label, trace), column in zip(traces.items(), grid.T, strict=True):
        time = trace["time_s"]
        for axes in column:
            _shade(axes, time, trace["motion"], MOTION_COLORS, MOTIONS)
        column[0].plot(time, 1e3 * trace["distance_m"], **TRUTH, label="m")
        column[0].axhline(30, color=COLORS["grey"], linestyle=":", linewidth=1)
        column[1].plot(time, trace["stiffness_n_per_m"], **ESTIMATE, label="k")
        column[2].plot(time, trace["magnitude_n"], color=COLORS["vermillion"], linewidth=1.4, label="|f|")
        label_axes(column[0], title=label)
        label_axes(column[2], "time [s]")
    label_axes(grid[0, 0], y="distance m [mm]")
    label_axes(grid[1, 0], y="stiffness k [N/m]")
    label_axes(grid[2, 0], y="force |f| [N]")
    legend(figure)
    return figure


def printed_counter(stiffness: Mapping[str, NDArray[np.float64]], sample_time: float = 0.01) -> Figure:
    """Stiffness while a tip rests 0.5 m from its goal, under the printed and the corrected condition."""
    figure, axes = new_figure(height=2.4)
    for (label, values), style in zip(stiffness.items(), (ESTIMATE, REFERENCE), strict=True):
        axes.plot(sample_time * np.arange(len(values)), values, **style, label=label)
    label_axes(axes, "time at rest [s]", "stiffness k [N/m]")
    legend(axes)
    return figure


def counter_readings(table: pd.DataFrame) -> Figure:
    """Mean force of assist-as-needed for each operator under the two readings of the counter."""
    figure, grid = new_figure(height=2.8, columns=2)
    for axes, (environment, group) in zip(grid, table.groupby("environment", sort=False), strict=True):
        force = group.pivot_table(
            index=["kind", "operator"], columns="counter", values="assistance_n", sort=False
        )
        for color, (kind, people) in zip(SERIES, force.groupby("kind", sort=False)):
            axes.plot(people["text"], people["caption"], **{**MEASUREMENT, "color": color}, label=str(kind))
        top = float(force.to_numpy().max())
        axes.plot([0, top], [0, top], color=COLORS["grey"], linewidth=0.8, linestyle=":")
        label_axes(
            axes, "H, counter of the text [N]", "H, counter of the caption [N]", title=str(environment)
        )
    legend(figure)
    return figure


# --- The demonstrations: Figs. 7, 8 and 9, and the claims over all conditions -------------------------------

SHORT = dict(zip(PARADIGMS, ("Full", "AAN", "Fixed", "MSAE", "ASME", "Auto"), strict=True))
PARADIGM_COLORS = dict(zip(PARADIGMS, (COLORS["black"], *SERIES[:5]), strict=True))

OWN: dict[str, Any] = {
    **{"linestyle": "none", "marker": "*", "markersize": 10, "color": COLORS["vermillion"]},
    **{"markeredgecolor": "white", "markeredgewidth": 0.6, "zorder": 6},
}
"""A trial that somebody drove, over simulated ones."""


def fig07a_placement_error(trials: pd.DataFrame, own: pd.DataFrame | None = None) -> Figure:
    """Error at release by paradigm, one panel per participant or crowd (Fig. 7a).

    Parameters
    ----------
    trials : pandas.DataFrame
        Of `simulate`, or of `trial_table`.
    own : pandas.DataFrame, optional
        Of `trial_table`; finished trials are drawn as stars, into the panel of their environment and kind, or
        of their environment alone where no panel has their kind.
    """
    return _boxes(trials, "release_error_mm", "placement error [mm]", own)


def fig07b_time(trials: pd.DataFrame, own: pd.DataFrame | None = None) -> Figure:
    """Time of a trial by paradigm, one panel per participant or crowd (Fig. 7b); ``own`` as in Fig. 7a."""
    return _boxes(trials, "time_s", "time [s]", own)


def _boxes(trials: pd.DataFrame, metric: str, label: str, own: pd.DataFrame | None) -> Figure:
    cells = list(trials.groupby(["environment", "kind"], sort=False))
    figure, grid = new_figure(height=3.0, columns=len(cells), sharey=True, squeeze=False)
    for axes, ((environment, kind), cell) in zip(grid[0], cells, strict=True):
        samples: dict[str, Any] = {
            str(name): group[metric].dropna().to_numpy()
            for name, group in cell.groupby("paradigm", sort=False)
        }
        box_groups(axes, samples, tuple(PARADIGM_COLORS[name] for name in samples))
        means = [values.mean() if len(values) else np.nan for values in samples.values()]
        axes.plot(range(1, len(samples) + 1), means, "D", markersize=3.5, color=COLORS["black"], zorder=5)
        mine = _finished(own, trials, (environment, kind), samples)
        axes.plot([list(samples).index(name) + 1 for name in mine["paradigm"]], mine[metric], **OWN)
        axes.set_xticklabels([SHORT[name] for name in samples])
        axes.tick_params(axis="x", rotation=60)
        label_axes(axes, title=f"{kind}, {environment}")
    first = grid[0, 0]
    if metric == "time_s":
        first.set_yscale("log")
        first.set_yticks([15, 20, 30, 50, 100, 200], [15, 20, 30, 50, 100, 200])
        first.minorticks_off()
    label_axes(first, y=label)
    return figure


def _finished(
    own: pd.DataFrame | None, trials: pd.DataFrame, cell: tuple[Any, Any], paradigms: Iterable[str]
) -> pd.DataFrame:
    """The driven trials that belong into a panel: of its environment and kind, or of no kind shown."""
    own = trials.iloc[:0] if own is None else own
    environment, kind = cell
    fits = (own["environment"] == environment) & own["paradigm"].isin(list(paradigms))
    fits &= (own["kind"] == kind) | ~own["kind"].isin(trials["kind"])
    return own[fits & (own["finished"] == 1)]


def fig08_error_against_time(trials: pd.DataFrame, own: pd.DataFrame | None = None) -> Figure:
    """Error against time of single items, panels a to d (Fig. 8); ellipses hold half of each cloud.

    ``own`` as in Fig. 7a, in the colours of the paradigms.
    """
    panels = list(trials.groupby(["environment", "kind"], sort=False))
    rows, columns = -(-len(panels) // 2), min(len(panels), 2)
    shared = {"sharex": True, "sharey": True, "squeeze": False}
    figure, grid = new_figure(height=0.4 + 2.4 * rows, rows=rows, columns=columns, **shared)
    for axes in grid.flat[len(panels) :]:
        axes.set_visible(False)
    for axes, letter, ((environment, kind), cell) in zip(grid.flat, ascii_lowercase, panels):
        for name, group in cell.groupby("paradigm", sort=False):
            _cloud(axes, *_items(group), PARADIGM_COLORS[str(name)], SHORT[str(name)])
        for name, group in _finished(own, trials, (environment, kind), PARADIGM_COLORS).groupby("paradigm"):
            axes.plot(*_items(group), **{**OWN, "color": PARADIGM_COLORS[str(name)], "markersize": 12})
        axes.set(xscale="log", yscale="log")
        axes.set_xticks([8, 10, 15, 20, 30, 50, 100], [8, 10, 15, 20, 30, 50, 100])
        axes.set_yticks([0.3, 1, 3, 10, 30, 100], [0.3, 1, 3, 10, 30, 100])
        axes.minorticks_off()
        axes.set(xlim=(7, 120), ylim=(0.2, 200))
        label_axes(axes, title=f"({letter}) {kind}, {environment}")
    for axes in grid[-1]:
        label_axes(axes, "time of one item [s]")
    for axes in grid[:, 0]:
        label_axes(axes, y="placement error [mm]")
    legend(figure, ncols=6)
    return figure


def _items(trials: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Time and error of every item that was placed."""
    times = trials[["item1_time_s", "item2_time_s"]].to_numpy().ravel()
    errors = trials[["item1_error_mm", "item2_error_mm"]].to_numpy().ravel()
    good = np.isfinite(times) & np.isfinite(errors)
    return times[good], errors[good]


def _cloud(axes: Axes, x: np.ndarray, y: np.ndarray, color: str, label: str) -> None:
    """A cloud of points on logarithmic axes and the ellipse about half of it; a few points have none."""
    points = np.log(np.column_stack([x, np.maximum(y, 0.05)]))
    few = len(x) < 5
    alpha = 1.0 if few else 0.5 if len(x) < 100 else 0.12
    dots = axes.plot(x, y, ".", markersize=7 if few else 2.5, markeredgewidth=0, alpha=alpha, color=color)
    if few:
        dots[0].set_label(label)
        return
    values, vectors = np.linalg.eigh(np.cov(points.T))
    angle = np.linspace(0, 2 * np.pi, 100)
    circle = np.sqrt(2 * np.log(2)) * np.column_stack([np.cos(angle), np.sin(angle)])
    ellipse = np.exp(np.median(points, axis=0) + circle * np.sqrt(np.maximum(values, 0)) @ vectors.T)
    axes.plot(*ellipse.T, color=color, linewidth=1.6, label=label)


def fig09_assistance(trials: pd.DataFrame, own: pd.DataFrame | None = None) -> Figure:
    """Mean force of the two assistances for every kind and environment (Fig. 9); ``own`` as in Fig. 7a."""
    figure, axes = new_figure(height=2.8)
    samples: dict[str, ArrayLike] = {}
    colors = []
    for (environment, kind), cell in trials.groupby(["environment", "kind"], sort=False):
        for name in ("assist_as_needed", "fixed_assistance"):
            if len(forces := cell.loc[cell["paradigm"] == name, "assistance_n"].to_numpy()):
                samples[f"{SHORT[name]}\n{kind}\n{environment}"] = forces
                colors.append(PARADIGM_COLORS[name])
                mine = _finished(own, trials, (environment, kind), [name])["assistance_n"]
                axes.plot([len(samples)] * len(mine), mine, **OWN)
    if samples:
        box_groups(axes, samples, tuple(colors))
    label_axes(axes, y="mean force H [N]")
    return figure


def claim_matrix(probabilities: pd.DataFrame) -> Figure:
    """Probability of every claim (rows) under every attitude, law and approach (columns)."""
    place = probabilities["environment"].str.replace("simulated", "sim")
    table = probabilities.assign(
        condition=probabilities["attitude"] + ", " + probabilities["law"] + ", " + probabilities["approach"],
        row=probabilities["claim"].str.replace("_", " ") + " (" + probabilities["kind"] + ", " + place + ")",
    )
    matrix = table.pivot_table(index="row", columns="condition", values="probability", sort=False)
    words = matrix.map(lambda value: f"{value:.2f}".lstrip("0") or "0" if np.isfinite(value) else "")
    figure, axes = new_figure(height=0.155 * len(matrix) + 1.6)
    white = (matrix < 0.12) | (matrix > 0.88)
    image = number_map(axes, matrix, words, white, 5.5, cmap="RdYlBu", vmin=0, vmax=1)
    axes.set_yticks(axes.get_yticks(), matrix.index, fontsize=6)
    axes.set_xticks(axes.get_xticks(), matrix.columns, rotation=40, ha="right", fontsize=6.5)
    figure.colorbar(image, ax=axes, shrink=0.3, label="probability over operators")
    return figure


def number_map(
    axes: Axes,
    table: pd.DataFrame,
    words: pd.DataFrame,
    white: pd.DataFrame,
    fontsize: float,
    dark: str = COLORS["black"],
    **options: Any,
) -> AxesImage:
    """Draw a table as colours, named along both sides, with words in each cell, white where so marked."""
    image = axes.imshow(table, aspect="auto", **options)
    for (row, column), text in np.ndenumerate(words.to_numpy()):
        color = "white" if white.iat[row, column] else dark
        axes.text(column, row, text, ha="center", va="center", fontsize=fontsize, color=color)
    axes.set_yticks(range(len(table)), list(table.index))
    axes.set_xticks(range(table.shape[1]), list(table.columns))
    axes.grid(visible=False)
    return image


# --- The tuning study ---------------------------------------------------------------------------------------

THIN = {**REFERENCE, "linewidth": 0.9}
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
        style = {"markersize": 4, "alpha": 0.8, "color": color, "label": METRIC_NAMES[response]}
        axes.loglog(table["p_plain"].clip(lower=1e-4), table["p_blocked"], "o", **style)
    axes.axhline(0.05, **THIN)
    axes.axvline(0.05, **THIN)
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
            words = "no quantity in 0 to 7 N\nscatters more"
            axes.annotate(words, (0.02, 4.2), xycoords=("axes fraction", "data"), fontsize=6.5)
        axes.tick_params(axis="x", rotation=30)
        label_axes(axes, y=f"sd of {METRIC_NAMES[str(response)]} [{units[str(response)]}]")
    grid[0].plot([], [], **REFERENCE, label="implied by the printed F")
    legend(figure)
    return figure
