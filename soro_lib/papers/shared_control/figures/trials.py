"""One trial at a time: the task in space and its two state machines at work."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

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
    equal_aspect,
    label_axes,
    legend,
    new_figure,
)

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
        style = {"color": colors[name], "alpha": 0.25, "linewidth": 0}
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
