"""The figures of Vervloet's thesis and of what the replication adds, one function each.

Lengths in mm, times in seconds of the thesis's timestep where they stand beside its figures, steps elsewhere.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from soro_lib.arcs import backbone
from soro_lib.papers.soft_handover.experiments.handover import HandoverRun
from soro_lib.papers.soft_handover.experiments.use_case import Carry
from soro_lib.papers.soft_handover.world.plant import Array
from soro_lib.replication.plotting import (
    COLORS,
    ESTIMATE,
    MEASUREMENT,
    PAGE_WIDTH,
    REFERENCE,
    SERIES,
    TRUTH,
    error_band,
    label_axes,
    legend,
    new_figure,
)
from soro_lib.robots.helix import HelixArm, origin_from_arm_base

COMMANDED: dict[str, Any] = {"color": COLORS["purple"], "linestyle": ":", "linewidth": 1.6}
"""What the tendons were cut to."""

MEASURED: dict[str, Any] = {**MEASUREMENT, "linestyle": "-", "marker": "none", "linewidth": 1.5, "alpha": 1.0}
"""A filtered measurement over time."""

PLANT_COLORS = {"K": COLORS["blue"], "E": COLORS["vermillion"]}
"""The two plants."""

THRESHOLD: dict[str, Any] = {**REFERENCE, "label": "stop threshold"}
"""The error at which the gripper closes or goes down."""

GREY_THRESHOLD: dict[str, Any] = {**THRESHOLD, "color": COLORS["grey"]}
"""The same beside curves of the usual colour."""

BOWL = np.array([(-80, 0), (-60, -50), (60, -50), (80, 0)])
"""The outline of the bowl around the middle of its opening [mm]."""

OUTCOME_COLORS = {
    "handover": COLORS["green"],
    "safe stop": COLORS["sky"],
    "out of time": COLORS["light"],
    "beside the ball": COLORS["vermillion"],
}
"""What a run came to."""


def side_view(points: Array, heading: Array) -> Array:
    """Return points (n, 3) of `arm_base` seen from the side: along a horizontal heading (2,) and up, in mm
    (n, 2)."""
    upright = 1e3 * origin_from_arm_base(points)
    along = 1e3 * points[:, :2] @ heading
    return np.column_stack([along, upright[:, 2]])


SHAPES = {"commanded": COMMANDED, "estimated": ESTIMATE, "true": TRUTH}
"""How the shapes of the arm are drawn, from behind to the front."""


def draw_moment(
    axes: Any, arm: HelixArm, heading: Array, states: Mapping[str, Array], ball: Array, size: float
) -> None:
    """Draw backbone, gripper and joints of the states (9,) that are known, and a ball (3,), from the side."""
    for name, style in SHAPES.items():
        if name in states and np.isfinite(states[name]).all():
            segments = states[name].reshape(3, 3)
            line = np.concatenate([backbone(segments, 20), arm.tip_points(states[name])[None, 3:]])
            joints = np.stack([backbone(segments[: i + 1], 2)[-1] for i in range(3)])
            axes.plot(*side_view(line, heading).T, **style, label=name)
            dots = {"linestyle": "none", "marker": "o", "markersize": 3, "color": style["color"]}
            axes.plot(*side_view(joints, heading).T, **dots)
    dot = {"linestyle": "none", "marker": "o", "markersize": size, "color": COLORS["green"]}
    axes.plot(*side_view(ball[None], heading).T, **dot, label="ball")
    axes.set_aspect("equal")


def evolution(arm: HelixArm, run: HandoverRun, moments: Mapping[str, int]) -> Figure:
    """Draw true, commanded and estimated arm at some steps of a run, from the side (Figs. 6, 11 and 13).

    Parameters
    ----------
    arm : HelixArm
    run : HandoverRun
    moments : mapping of str to int
        Title and step of each panel.
    """
    figure, panels = new_figure(PAGE_WIDTH, 4.2, 1, len(moments), sharey=True, sharex=True)
    heading = run.ball[:2] / np.linalg.norm(run.ball[:2])
    shapes = {"commanded": run.commands, "estimated": run.estimates, "true": run.states}
    for axes, (title, step) in zip(panels, moments.items()):
        states = {name: shape[step] for name, shape in shapes.items()}
        draw_moment(axes, arm, heading, states, run.ball, 9)
        label_axes(axes, "towards the ball [mm]", title=f"{title} (step {step})")
    label_axes(panels[0], y="up [mm]")
    legend(figure)
    return figure


def fig13_use_case(arm: HelixArm, run: HandoverRun, carry: Carry, release: Array) -> Figure:
    """Draw the arm as it takes the ball, carries it and lets it go over the bowl, seen along y (Fig. 13)."""
    figure, panels = new_figure(PAGE_WIDTH, 4.0, 1, 4, sharey=True, sharex=True)
    heading = np.array([1.0, 0.0])
    in_gripper = run.ball - arm.tip_points(run.state)[3:]
    bowl = side_view(release[None] + [0, 0, 0.08], heading) + BOWL
    moments: dict[str, tuple[HandoverRun | Carry, int]] = {
        "start": (run, 0),
        "taken": (run, -1),
        "on the way": (carry, carry.steps // 3),
        "let go": (carry, -1),
    }
    for axes, (title, (part, step)) in zip(panels, moments.items()):
        state = part.states[step]
        ball = run.ball if title == "start" else arm.tip_points(state)[3:] + in_gripper
        draw_moment(axes, arm, heading, {"commanded": part.commands[step], "true": state}, ball, 7)
        axes.plot(*bowl.T, color=COLORS["grey"], label="bowl")
        label_axes(axes, "x [mm]", title=title)
    label_axes(panels[0], y="up [mm]")
    legend(figure)
    return figure


def panel_per_plant(
    table: pd.DataFrame,
    draw: Callable[[Any, pd.DataFrame], None],
    x: str,
    y: str,
    note: str = "",
    height: float = 3.0,
    **options: Any,
) -> Figure:
    """Draw the rows of every plant in a panel of its own, by a function of axes and rows; options go to the
    legend."""
    plants = table["plant"].unique()
    figure, panels = new_figure(PAGE_WIDTH, height, 1, len(plants), sharey=True)
    for axes, plant in zip(np.atleast_1d(panels), plants):
        draw(axes, table[table["plant"] == plant])
        label_axes(axes, x, y, title=f"Plant {plant}{note}")
    legend(figure, **options)
    return figure


def mean_over_runs(traces: pd.DataFrame, column: str) -> pd.DataFrame:
    """Return mean and standard deviation over the runs still moving, up to the median length (as in Fig.
    7)."""
    lengths = traces.groupby(["block", "run"])["step"].max()
    steps = traces[traces["step"] <= lengths.median()].groupby("step")[column]
    return pd.DataFrame({"mean": steps.mean(), "sd": steps.std(ddof=0)}).reset_index()


class Curve(NamedTuple):
    """What is averaged over runs: a column of their traces [mm], the duration of a step, and its looks."""

    traces: pd.DataFrame
    column: str
    timestep: float
    style: Mapping[str, Any]
    label: str


def over_time(
    curves: Sequence[Curve],
    x: str = "time [s]",
    y: str = "error to the goal [mm]",
    *,
    single: pd.DataFrame | None = None,
    threshold: Mapping[str, Any] | None = THRESHOLD,
    **options: Any,
) -> Figure:
    """Draw means with their standard deviations over time, after some single runs."""

    def draw(axes: Any, rows: pd.DataFrame) -> None:
        plant = rows["plant"].iloc[0]
        if single is not None:
            for number, run in single[single["plant"] == plant].groupby("run"):
                label = "" if number else "one block of eight runs"
                time = curves[0].timestep * run["step"]
                axes.plot(time, run["error_mm"], color=COLORS["grey"], linewidth=0.7, label=label)
        for traces, column, timestep, style, label in curves:
            mean = mean_over_runs(traces[traces["plant"] == plant], column)
            time, middle = timestep * mean["step"], mean["mean"]
            axes.plot(time, middle, **style, label=label)
            error_band(axes, time, middle - mean["sd"], middle + mean["sd"], style["color"])
        if threshold is None:
            axes.set_ylim(bottom=0)
        else:
            axes.axhline(50, **threshold)

    return panel_per_plant(curves[0].traces, draw, x, y, **options)


def fig07_single_runs(traces: pd.DataFrame, timestep: float, step_size: float) -> Figure:
    """Draw the error of eight single runs and of the mean over all (Figs. 7, 16 and 17)."""
    runs = traces[traces["alpha"] == step_size]
    mean = Curve(runs, "error_mm", timestep, ESTIMATE, "mean and sd of all runs")
    return over_time([mean], single=runs[runs["block"] == 0], note=f", step size {step_size}")


def fig08_step_sizes(
    traces: pd.DataFrame, timestep: Mapping[float, float], step_sizes: Sequence[float]
) -> Figure:
    """Draw the mean error over time for each step size (Fig. 8)."""
    curves = []
    for color, step_size in zip(SERIES, step_sizes):
        runs, label = traces[traces["alpha"] == step_size], f"step size {step_size}"
        curves.append(Curve(runs, "error_mm", timestep[step_size], {"color": color}, label))
    return over_time(curves)


def fig09_commanded_and_measured(traces: pd.DataFrame, timestep: float, step_size: float) -> Figure:
    """Draw the distance of f(q_sys) and of the measured gripper from the calibrated place (Figs. 9, 18 and
    20)."""
    return _two_distances(traces, timestep, step_size, "commanded", "commanded, f(q_sys)")


def fig10_estimated_and_measured(traces: pd.DataFrame, timestep: float, step_size: float) -> Figure:
    """Draw the distance of f(q_est) and of the measured gripper from the calibrated place (Figs. 10, 19 and
    21)."""
    return _two_distances(traces, timestep, step_size, "estimated", "estimated, f(q_est)")


def _two_distances(traces: pd.DataFrame, timestep: float, step_size: float, which: str, label: str) -> Figure:
    runs = traces[traces["alpha"] == step_size]
    curves = [
        Curve(runs, f"{which}_mm", timestep, SHAPES[which], label),
        Curve(runs, "measured_mm", timestep, MEASURED, "measured"),
        Curve(runs, f"{which}_gap_mm", timestep, {"color": COLORS["green"]}, "between the two"),
    ]
    y, note = "from the calibrated place [mm]", f", step size {step_size}"
    return over_time(curves, y=y, note=note, threshold=None)


def fig12_guidance(
    automated: pd.DataFrame, guided: pd.DataFrame, timestep: float, step_size: float
) -> Figure:
    """Draw the error of automated handovers beside guided ones (Figs. 12 and 22)."""
    alone, led = (traces[traces["alpha"] == step_size] for traces in (automated, guided))
    curves = [
        Curve(alone, "error_mm", timestep, ESTIMATE, "automated"),
        Curve(led, "error_mm", timestep, {"color": COLORS["vermillion"]}, "guided by a hand"),
    ]
    return over_time(curves, threshold=GREY_THRESHOLD, note=f", step size {step_size}")


def without_estimation(traces: pd.DataFrame, step_size: float) -> Figure:
    """Draw the error with and without the state optimisation."""
    seen = traces[traces["alpha"] == step_size].dropna(subset="error_mm")
    curves = [
        Curve(seen[seen["estimated"]], "error_mm", 1.0, ESTIMATE, "with state optimisation"),
        Curve(seen[~seen["estimated"]], "error_mm", 1.0, {"color": COLORS["vermillion"]}, "without"),
    ]
    return over_time(curves, "step", threshold=GREY_THRESHOLD, note=f", step size {step_size}", height=2.8)


def success_over_opening(table: pd.DataFrame) -> Figure:
    """Draw the success rate over how far from the gripper point a ball may lie."""

    def draw(axes: Any, rows: pd.DataFrame) -> None:
        for color, (alpha, group) in zip(SERIES, rows.groupby("alpha")):
            success = 100 * group["success"]
            axes.plot(group["opening_mm"], success, color=color, marker="o", label=f"step size {alpha}")
        axes.axvline(40, **REFERENCE, label="assumed here")

    return panel_per_plant(table, draw, "catches within [mm]", "success [%]", height=2.6)


def error_floor(table: pd.DataFrame) -> Figure:
    """Draw where the error rests without noise against the bound over the step size."""
    figure, axes = new_figure(PAGE_WIDTH * 0.62, 3.2)
    looks = (("o", "blue"), ("^", "orange"), ("s", "green"))
    for (marker, color), (loop, rows) in zip(looks, table.groupby("loop", sort=False)):
        style = {"linestyle": "none", "marker": marker, "color": COLORS[color], "label": loop}
        axes.plot(rows["predicted_mm"], rows["floor_mm"], **style)
    line = np.array([0, table["predicted_mm"].max()])
    axes.plot(line, line, **{**GREY_THRESHOLD, "label": "pose bound / step size"})
    axes.axhline(50, **THRESHOLD)
    label_axes(
        axes, "pose bound / step size [mm]", "error at rest [mm]", title="Without noise the error stalls"
    )
    legend(axes)
    return figure


def bars_per_plant(axes: Any, table: pd.DataFrame, by: str, column: str) -> None:
    """Draw one bar per label and plant: the success rate, or the median of a column with its 5th to 95th
    percentile."""
    groups = table.groupby([by, "plant"], sort=False)[column]
    if column == "success":
        length, spread = groups.mean().mul(100), None
    else:
        length = groups.median()
        spread = [length - groups.quantile(0.05), groups.quantile(0.95) - length]
    labels, plants = table[by].unique(), table["plant"].unique()
    height = 0.8 / len(plants)
    for number, plant in enumerate(plants):
        place = np.arange(len(labels)) + (number - (len(plants) - 1) / 2) * height
        bars = {"height": 0.9 * height, "color": PLANT_COLORS[plant], "alpha": 0.75}
        if spread is not None:
            bars["xerr"] = np.clip([part.xs(plant, level="plant")[labels] for part in spread], 0, None)
            bars |= {"error_kw": {"linewidth": 0.8, "ecolor": COLORS["black"]}, "label": f"plant {plant}"}
        axes.barh(place, length.xs(plant, level="plant")[labels], **bars)
    axes.set_yticks(range(len(labels)), labels)
    axes.invert_yaxis()


def comparison(
    runs: pd.DataFrame, by: str, columns: Mapping[str, str], rows: str, height: float, ratios: Sequence[float]
) -> tuple[Figure, NDArray[np.object_]]:
    """Return bars per plant of some columns by a label, one row of panels per value of `rows`.

    Parameters
    ----------
    runs : DataFrame
    by : str
        Column of the labels.
    columns : mapping of str to str
        Axis label of each column to draw.
    rows : str
        Column whose values have a row each; "" for one row of everything.
    height : float
        Of a row [in].
    ratios : sequence of float
        Relative widths of the panels.
    """
    groups = [run for _, run in runs.groupby(rows, sort=False)] if rows else [runs]
    size = PAGE_WIDTH, height * len(groups)
    figure, panels = new_figure(*size, len(groups), len(columns), width_ratios=ratios, squeeze=False)
    for row, group in zip(panels, groups):
        for axes, column in zip(row, columns):
            bars_per_plant(axes, group, by, column)
            if column == "success":
                axes.set_xlim(0, 100)
            if axes is not row[0]:
                axes.set_yticklabels([])
    for axes, label in zip(panels[-1], columns.values()):
        label_axes(axes, label)
    legend(figure)
    return figure, panels


def loop_variants(runs: pd.DataFrame) -> Figure:
    """Draw steps and success of the readings of Algorithm 1, one row of panels per step size."""
    columns = {"steps": "steps, median and 90 % range", "success": "success [%]"}
    figure, panels = comparison(runs, "variant", columns, "alpha", 2.6, (2, 1))
    for row, step_size in zip(panels, runs["alpha"].unique()):
        label_axes(row[0], columns["steps"], title=f"Step size {step_size}")
        label_axes(row[1], columns["success"])
    return figure


def suggestions(runs: pd.DataFrame) -> Figure:
    """Draw steps, final miss and success of the suggested improvements on both plants."""
    columns = {"steps": "steps", "miss_mm": "ball to gripper [mm]", "success": "success [%]"}
    return comparison(runs, "controller", columns, "", 4.6, (2, 2, 1))[0]


def compare_eyes(runs: pd.DataFrame) -> Figure:
    """Draw steps and final miss through better and better eyes, one row of panels per controller."""
    columns = {"steps": "steps", "miss_mm": "ball to gripper [mm]"}
    figure, panels = comparison(runs, "observer", columns, "controller", 1.9, (1, 1))
    for axes, controller in zip(panels[:, 0], runs["controller"].unique()):
        label_axes(axes, title=controller)
    return figure


def filter_cap(runs: pd.DataFrame, poles: pd.DataFrame) -> Figure:
    """Draw steps and overshoot over the step size with and without the filters, beside the slowest pole."""
    figure, panels = new_figure(PAGE_WIDTH, 2.8, 1, 3)
    medians = runs.groupby(["filters", "alpha"], sort=False)[["steps", "overshoot_mm"]].median()
    for color, filters in zip(SERIES, runs["filters"].unique()):
        for axes, column in zip(panels, medians):
            axes.plot(medians.loc[filters][column], color=color, marker="o", label=filters)
        pole = poles[poles["filters"] == filters]
        panels[2].plot(pole["step_gain"], pole["pole"], color=color, label=filters)
    panels[0].set_ylim(bottom=0)
    label_axes(panels[0], "step size [-]", "steps", title="Steps")
    label_axes(panels[1], "step size [-]", "overshoot [mm]", title="Overshoot")
    label_axes(panels[2], "loop gain per step [-]", "slowest pole, modulus [-]", title="Linear loop")
    legend(figure)
    return figure


def estimated_shapes(table: pd.DataFrame) -> Figure:
    """Draw the errors of the estimated shape over the weight of the lengths, one panel per quantity."""
    figure, panels = new_figure(PAGE_WIDTH, 2.8, 1, 3)
    sizes = table.assign(length_error_mm=table["length_error_mm"].abs(), outside=100.0 * table["outside"])
    quantities = {
        "length_error_mm": ("median", "Lengths", "median error [mm]"),
        "bend_error_deg": ("median", "Bending", "median error [deg]"),
        "outside": ("mean", "Impossible lengths", "outside the limits [%]"),
    }
    for axes, (column, (statistic, title, label)) in zip(panels, quantities.items()):
        for plant, group in sizes.groupby("plant", sort=False):
            by_weight = group.groupby("length_weight")[column].agg(statistic)
            axes.plot(by_weight, color=PLANT_COLORS[str(plant)], marker="o", label=f"plant {plant}")
        axes.set_xscale("log")
        axes.set_ylim(bottom=0)
        label_axes(axes, "weight of lengths [-]", label, title=title)
    legend(figure)
    return figure


def reach_by_heading(table: pd.DataFrame) -> Figure:
    """Draw steps over the ball's distance aside, on the side of a tendon and opposite one."""
    sides = {0.0: ("towards a tendon", "blue", "o"), 180.0: ("opposite a tendon", "vermillion", "s")}

    def draw(axes: Any, rows: pd.DataFrame) -> None:
        for heading, (label, name, marker) in sides.items():
            color, side = COLORS[name], rows[rows["heading_deg"] == heading]
            axes.plot(side["lateral_mm"], side["steps"], color=color, zorder=2)
            for closed, face, suffix in ((True, color, ""), (False, "white", ", never reached")):
                shown = side[side["closed"] == closed]
                style = {"marker": marker, "color": color, "markerfacecolor": face, "linestyle": "none"}
                if len(shown):
                    axes.plot(shown["lateral_mm"], shown["steps"], **style, label=f"{label}{suffix}")

    figure = panel_per_plant(table, draw, "ball aside [mm]", "steps", height=2.8)
    figure.axes[0].set_ylim(bottom=0)
    return figure


def loop_speed(runs: pd.DataFrame) -> Figure:
    """Draw the handover time over the duration of a step."""

    def draw(axes: Any, rows: pd.DataFrame) -> None:
        for color, (controller, group) in zip(SERIES, rows.groupby("controller", sort=False)):
            for dash, (constant, times) in zip(("-", "--", ":"), group.groupby("time_constant_s")):
                style = {"color": color, "linestyle": dash, "marker": "."}
                label = f"{controller}, arm {constant} s"
                axes.plot(times.groupby("timestep_s")["time_s"].median(), **style, label=label)
        axes.set(xscale="log", yscale="log")

    y = "median handover time [s]"
    return panel_per_plant(runs, draw, "duration of a step [s]", y, ncols=2)


def stacked_shares(
    axes: Any,
    names: pd.Series,
    outcomes: pd.Series,
    colors: Mapping[str, str],
    shift: float = 0.0,
    **style: Any,
) -> None:
    """Draw a bar per name, in the order of their first appearance: the share of each outcome [%]."""
    shares = pd.crosstab(names, outcomes, normalize="index")
    shares = 100 * shares.reindex(index=names.unique(), columns=list(colors), fill_value=0.0)
    starts = shares.cumsum(axis=1).shift(axis=1, fill_value=0.0)
    for outcome, color in colors.items():
        place = np.arange(len(shares)) + shift
        axes.barh(place, shares[outcome], left=starts[outcome], color=color, label=outcome, **style)


def faults(table: pd.DataFrame) -> Figure:
    """Draw what runs come to under each fault at three severities, one panel per controller."""
    controllers = table["controller"].unique()
    names = table["fault"].str.cat(table["severity"], sep=": ").replace("none: -", "no fault")
    figure, panels = new_figure(PAGE_WIDTH, 7.6, 1, len(controllers), sharey=True)
    for axes, controller in zip(panels, controllers):
        chosen = table["controller"] == controller
        stacked_shares(axes, names[chosen], table.loc[chosen, "outcome"], OUTCOME_COLORS, height=0.85)
        axes.set_xlim(0, 100)
        axes.grid(axis="y", visible=False)
        label_axes(axes, "runs [%]", title=controller)
    panels[0].set_yticks(range(names.nunique()), names.unique())
    panels[0].set_ylim(names.nunique() - 0.4, -0.6)
    legend(figure)
    return figure
