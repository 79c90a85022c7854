"""The figures of Vervloet's thesis and of what the replication adds, one function each.

Lengths in mm, times in seconds of the thesis's timestep where they stand beside its figures, steps elsewhere.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from soro_lib.arcs import backbone
from soro_lib.papers.soft_handover.experiments.handover import HandoverRun
from soro_lib.papers.soft_handover.experiments.use_case import Carry
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

OUTCOME_COLORS = {
    "handover": COLORS["green"],
    "safe stop": COLORS["sky"],
    "out of time": COLORS["light"],
    "beside the ball": COLORS["vermillion"],
}
"""What a run came to."""


def side_view(points: NDArray[np.float64], heading: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points (n, 3) of `arm_base` seen from the side: along a horizontal heading (2,) and up, in mm
    (n, 2)."""
    upright = 1e3 * origin_from_arm_base(points)
    along = 1e3 * points[:, :2] @ heading
    return np.column_stack([along, upright[:, 2]])


def draw_arm(
    axes: Any,
    arm: HelixArm,
    state: NDArray[np.float64],
    heading: NDArray[np.float64],
    style: Mapping[str, Any],
    label: str,
) -> None:
    """Draw backbone, gripper and joints of a state (9,), seen from the side."""
    segments = state.reshape(3, 3)
    line = np.concatenate([backbone(segments, 20), arm.tip_points(state)[None, 3:]])
    joints = np.stack([backbone(segments[: i + 1], 2)[-1] for i in range(3)])
    axes.plot(*side_view(line, heading).T, **style, label=label)
    axes.plot(*side_view(joints, heading).T, linestyle="none", marker="o", markersize=3, color=style["color"])


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
    ball = side_view(run.ball[None], heading)
    for axes, (title, step) in zip(np.atleast_1d(panels), moments.items()):
        draw_arm(axes, arm, run.commands[step], heading, COMMANDED, "commanded")
        if np.isfinite(run.estimates[step]).all():
            draw_arm(axes, arm, run.estimates[step], heading, ESTIMATE, "estimated")
        draw_arm(axes, arm, run.states[step], heading, TRUTH, "true")
        axes.plot(*ball.T, linestyle="none", marker="o", markersize=9, color=COLORS["green"], label="ball")
        axes.set_aspect("equal")
        label_axes(axes, "towards the ball [mm]", title=f"{title} (step {step})")
    label_axes(np.atleast_1d(panels)[0], y="up [mm]")
    legend(figure)
    return figure


def fig13_use_case(arm: HelixArm, run: HandoverRun, carry: Carry, release: NDArray[np.float64]) -> Figure:
    """Draw the arm as it takes the ball, carries it and lets it go over the bowl, seen along y (Fig. 13)."""
    figure, panels = new_figure(PAGE_WIDTH, 4.0, 1, 4, sharey=True, sharex=True)
    heading = np.array([1.0, 0.0])
    moments = {
        "start": (run.states[0], run.commands[0]),
        "taken": (run.states[-1], run.commands[-1]),
        "on the way": (carry.states[carry.steps // 3], carry.commands[carry.steps // 3]),
        "let go": (carry.states[-1], carry.commands[-1]),
    }
    in_gripper = run.ball - arm.tip_points(run.state)[3:]
    bowl = side_view(release[None] + [0, 0, 0.08], heading)[0]
    for axes, (title, (state, command)) in zip(panels, moments.items()):
        held = run.ball if title == "start" else arm.tip_points(state)[3:] + in_gripper
        draw_arm(axes, arm, command, heading, COMMANDED, "commanded")
        draw_arm(axes, arm, state, heading, TRUTH, "true")
        ball = side_view(held[None], heading)
        axes.plot(*ball.T, linestyle="none", marker="o", markersize=7, color=COLORS["green"], label="ball")
        axes.plot(
            bowl[0] + np.array([-80, -60, 60, 80]),
            bowl[1] + np.array([0, -50, -50, 0]),
            color=COLORS["grey"],
            label="bowl",
        )
        axes.set_aspect("equal")
        label_axes(axes, "x [mm]", title=title)
    label_axes(panels[0], y="up [mm]")
    legend(figure)
    return figure


def mean_over_runs(traces: pd.DataFrame, column: str) -> pd.DataFrame:
    """Return mean and standard deviation over the runs still moving, up to the median length (as in Fig.
    7)."""
    lengths = traces.groupby(["block", "run"])["step"].max()
    steps = traces[traces["step"] <= lengths.median()].groupby("step")[column]
    return pd.DataFrame({"mean": steps.mean(), "sd": steps.std(ddof=0)}).reset_index()


def draw_mean(
    axes: Any, traces: pd.DataFrame, column: str, timestep: float, style: Mapping[str, Any], label: str
) -> None:
    """Draw the mean of a column over time with its standard deviation."""
    curve = mean_over_runs(traces, column)
    time = timestep * curve["step"]
    axes.plot(time, curve["mean"], **style, label=label)
    error_band(axes, time, curve["mean"] - curve["sd"], curve["mean"] + curve["sd"], style["color"])


def fig07_single_runs(traces: pd.DataFrame, timestep: float, step_size: float) -> Figure:
    """Draw the error of eight single runs and of the mean over all (Figs. 7, 16 and 17), one panel per
    plant."""
    plants = traces["plant"].unique()
    figure, panels = new_figure(PAGE_WIDTH, 3.0, 1, len(plants), sharey=True)
    for axes, plant in zip(np.atleast_1d(panels), plants):
        chosen = traces[(traces["plant"] == plant) & (traces["alpha"] == step_size)]
        for number, (_, run) in enumerate(chosen[chosen["block"] == 0].groupby("run")):
            label = "one block of eight runs" if number == 0 else ""
            axes.plot(
                timestep * run["step"], run["error_mm"], color=COLORS["grey"], linewidth=0.7, label=label
            )
        draw_mean(axes, chosen, "error_mm", timestep, ESTIMATE, "mean and sd of all runs")
        axes.axhline(50, **REFERENCE, label="stop threshold")
        label_axes(axes, "time [s]", "error to the goal [mm]", title=f"Plant {plant}, step size {step_size}")
    legend(figure)
    return figure


def fig08_step_sizes(
    traces: pd.DataFrame, timestep: Mapping[float, float], step_sizes: Sequence[float]
) -> Figure:
    """Draw the mean error over time for each step size (Fig. 8), one panel per plant."""
    plants = traces["plant"].unique()
    figure, panels = new_figure(PAGE_WIDTH, 3.0, 1, len(plants), sharey=True)
    for axes, plant in zip(np.atleast_1d(panels), plants):
        for color, step_size in zip(SERIES, step_sizes):
            chosen = traces[(traces["plant"] == plant) & (traces["alpha"] == step_size)]
            style = {"color": color}
            draw_mean(axes, chosen, "error_mm", timestep[step_size], style, f"step size {step_size}")
        axes.axhline(50, **REFERENCE, label="stop threshold")
        label_axes(axes, "time [s]", "error to the goal [mm]", title=f"Plant {plant}")
    legend(figure)
    return figure


def fig09_commanded_and_measured(traces: pd.DataFrame, timestep: float, step_size: float) -> Figure:
    """Draw the distance of f(q_sys) and of the measured gripper from the calibrated place (Figs. 9, 18 and
    20)."""
    return _two_distances(traces, timestep, step_size, "commanded", COMMANDED, "commanded, f(q_sys)")


def fig10_estimated_and_measured(traces: pd.DataFrame, timestep: float, step_size: float) -> Figure:
    """Draw the distance of f(q_est) and of the measured gripper from the calibrated place (Figs. 10, 19 and
    21)."""
    return _two_distances(traces, timestep, step_size, "estimated", ESTIMATE, "estimated, f(q_est)")


def _two_distances(
    traces: pd.DataFrame, timestep: float, step_size: float, which: str, style: Mapping[str, Any], label: str
) -> Figure:
    plants = traces["plant"].unique()
    figure, panels = new_figure(PAGE_WIDTH, 3.0, 1, len(plants), sharey=True)
    for axes, plant in zip(np.atleast_1d(panels), plants):
        chosen = traces[(traces["plant"] == plant) & (traces["alpha"] == step_size)]
        draw_mean(axes, chosen, f"{which}_mm", timestep, style, label)
        draw_mean(axes, chosen, "measured_mm", timestep, MEASURED, "measured")
        draw_mean(axes, chosen, f"{which}_gap_mm", timestep, {"color": COLORS["green"]}, "between the two")
        axes.set_ylim(bottom=0)
        label_axes(
            axes, "time [s]", "from the calibrated place [mm]", title=f"Plant {plant}, step size {step_size}"
        )
    legend(figure)
    return figure


def fig12_guidance(
    automated: pd.DataFrame, guided: pd.DataFrame, timestep: float, step_size: float
) -> Figure:
    """Draw the error of automated handovers beside two guided ones (Figs. 12 and 22), one panel per plant."""
    plants = automated["plant"].unique()
    figure, panels = new_figure(PAGE_WIDTH, 3.0, 1, len(plants), sharey=True)
    for axes, plant in zip(np.atleast_1d(panels), plants):
        alone = automated[(automated["plant"] == plant) & (automated["alpha"] == step_size)]
        led = guided[(guided["plant"] == plant) & (guided["alpha"] == step_size)]
        draw_mean(axes, alone, "error_mm", timestep, ESTIMATE, "automated")
        draw_mean(axes, led, "error_mm", timestep, {"color": COLORS["vermillion"]}, "guided by a hand")
        axes.axhline(50, **{**REFERENCE, "color": COLORS["grey"]}, label="stop threshold")
        label_axes(axes, "time [s]", "error to the goal [mm]", title=f"Plant {plant}, step size {step_size}")
    legend(figure)
    return figure


def success_over_opening(table: pd.DataFrame) -> Figure:
    """Draw the success rate over how far from the gripper point a ball may lie, one panel per plant."""
    plants = table["plant"].unique()
    figure, panels = new_figure(PAGE_WIDTH, 2.6, 1, len(plants), sharey=True)
    for axes, plant in zip(np.atleast_1d(panels), plants):
        for color, (alpha, group) in zip(SERIES, table[table["plant"] == plant].groupby("alpha")):
            axes.plot(
                group["opening_mm"],
                100 * group["success"],
                color=color,
                marker="o",
                label=f"step size {alpha}",
            )
        axes.axvline(40, **REFERENCE, label="assumed here")
        label_axes(axes, "catches within [mm]", "success [%]", title=f"Plant {plant}")
    legend(figure)
    return figure


def error_floor(table: pd.DataFrame) -> Figure:
    """Draw where the error rests without noise against the bound over the step size."""
    figure, axes = new_figure(PAGE_WIDTH * 0.62, 3.2)
    styles = {
        "all 20 iterations": ("o", "blue"),
        "early exit": ("^", "orange"),
        "no error floor": ("s", "green"),
    }
    for loop, (marker, color) in styles.items():
        rows = table[table["loop"] == loop]
        axes.plot(
            rows["predicted_mm"],
            rows["floor_mm"],
            linestyle="none",
            marker=marker,
            color=COLORS[color],
            label=loop,
        )
    line = np.array([0, table["predicted_mm"].max()])
    axes.plot(line, line, **{**REFERENCE, "color": COLORS["grey"]}, label="pose bound / step size")
    axes.axhline(50, **REFERENCE, label="stop threshold")
    label_axes(
        axes, "pose bound / step size [mm]", "error at rest [mm]", title="Without noise the error stalls"
    )
    legend(axes)
    return figure


def grouped_bars(axes: Any, table: pd.DataFrame, by: str, column: str, group: str) -> None:
    """Draw the median of a column with its 5th to 95th percentile, one bar per label and group (plant)."""
    labels = list(table[by].unique())
    groups = list(table[group].unique())
    height = 0.8 / len(groups)
    for number, name in enumerate(groups):
        samples = [table.loc[(table[by] == label) & (table[group] == name), column] for label in labels]
        middle = np.array([values.median() for values in samples])
        low, high = (np.array([values.quantile(q) for values in samples]) for q in (0.05, 0.95))
        place = np.arange(len(labels)) + (number - (len(groups) - 1) / 2) * height
        axes.barh(
            place,
            middle,
            height=0.9 * height,
            xerr=np.clip([middle - low, high - middle], 0, None),
            color=PLANT_COLORS.get(name, SERIES[number]),
            alpha=0.75,
            error_kw={"linewidth": 0.8, "ecolor": COLORS["black"]},
            label=f"plant {name}",
        )
    axes.set_yticks(range(len(labels)), labels)
    axes.invert_yaxis()


def success_bars(axes: Any, table: pd.DataFrame, by: str, group: str) -> None:
    """Draw the success rate, one bar per label and group (plant)."""
    rates = table.groupby([by, group], sort=False)["success"].mean().mul(100).unstack(group)
    height = 0.8 / rates.shape[1]
    for number, name in enumerate(rates.columns):
        place = np.arange(len(rates)) + (number - (rates.shape[1] - 1) / 2) * height
        axes.barh(
            place, rates[name], height=0.9 * height, color=PLANT_COLORS.get(name, SERIES[number]), alpha=0.75
        )
    axes.set_yticks(range(len(rates)), [""] * len(rates))
    axes.set_xlim(0, 100)
    axes.invert_yaxis()


def loop_variants(runs: pd.DataFrame) -> Figure:
    """Draw steps and success of the readings of Algorithm 1, one row of panels per step size."""
    step_sizes = list(runs["alpha"].unique())
    figure, panels = new_figure(
        PAGE_WIDTH, 2.6 * len(step_sizes), len(step_sizes), 2, width_ratios=[2, 1], squeeze=False
    )
    for row, step_size in zip(panels, step_sizes):
        chosen = runs[runs["alpha"] == step_size]
        grouped_bars(row[0], chosen, "variant", "steps", "plant")
        success_bars(row[1], chosen, "variant", "plant")
        label_axes(row[0], "steps, median and 90 % range", title=f"Step size {step_size}")
        label_axes(row[1], "success [%]")
    legend(figure)
    return figure


def filter_cap(runs: pd.DataFrame, poles: pd.DataFrame) -> Figure:
    """Draw steps and overshoot over the step size with and without the filters, beside the slowest pole."""
    figure, panels = new_figure(PAGE_WIDTH, 2.8, 1, 3)
    for color, (filters, group) in zip(SERIES, runs.groupby("filters", sort=False)):
        medians = group.groupby("alpha")[["steps", "overshoot_mm"]].median()
        panels[0].plot(medians.index, medians["steps"], color=color, marker="o", label=filters)
        panels[1].plot(medians.index, medians["overshoot_mm"], color=color, marker="o", label=filters)
    for color, (filters, group) in zip(SERIES, poles.groupby("filters", sort=False)):
        panels[2].plot(group["step_gain"], group["pole"], color=color, label=filters)
    panels[0].set_ylim(bottom=0)
    label_axes(panels[0], "step size [-]", "steps", title="Steps")
    label_axes(panels[1], "step size [-]", "overshoot [mm]", title="Overshoot")
    label_axes(panels[2], "loop gain per step [-]", "slowest pole, modulus [-]", title="Linear loop")
    legend(figure)
    return figure


def estimated_shapes(table: pd.DataFrame) -> Figure:
    """Draw the errors of the estimated shape over the weight of the lengths, one panel per quantity."""
    figure, panels = new_figure(PAGE_WIDTH, 2.8, 1, 3)
    table = table.assign(length_miss_mm=table["length_error_mm"].abs())
    weights = sorted(table["length_weight"].unique())
    for plant, group in table.groupby("plant", sort=False):
        color = PLANT_COLORS[str(plant)]
        by_weight = group.groupby("length_weight")
        panels[0].plot(
            weights, by_weight["length_miss_mm"].median(), color=color, marker="o", label=f"plant {plant}"
        )
        panels[1].plot(weights, by_weight["bend_error_deg"].median(), color=color, marker="o")
        panels[2].plot(weights, 100 * by_weight["outside"].mean(), color=color, marker="o")
    for axes, title, label in zip(
        panels,
        ("Lengths", "Bending", "Impossible lengths"),
        ("median error [mm]", "median error [deg]", "outside the limits [%]"),
    ):
        axes.set_xscale("log")
        axes.set_ylim(bottom=0)
        label_axes(axes, "weight of lengths [-]", label, title=title)
    legend(figure)
    return figure


def without_estimation(traces: pd.DataFrame, step_size: float) -> Figure:
    """Draw the error with and without the state optimisation, one panel per plant."""
    plants = traces["plant"].unique()
    figure, panels = new_figure(PAGE_WIDTH, 2.8, 1, len(plants), sharey=True)
    for axes, plant in zip(np.atleast_1d(panels), plants):
        chosen = traces[(traces["plant"] == plant) & (traces["alpha"] == step_size)]
        for estimated, style, label in (
            (True, ESTIMATE, "with state optimisation"),
            (False, {"color": COLORS["vermillion"]}, "without"),
        ):
            rows = chosen[chosen["estimated"] == estimated].dropna(subset=["error_mm"])
            draw_mean(axes, rows, "error_mm", 1.0, style, label)
        axes.axhline(50, **{**REFERENCE, "color": COLORS["grey"]}, label="stop threshold")
        label_axes(axes, "step", "error to the goal [mm]", title=f"Plant {plant}, step size {step_size}")
    legend(figure)
    return figure


def reach_by_heading(table: pd.DataFrame) -> Figure:
    """Draw steps over the ball's distance aside, on the side of a tendon and opposite one, one panel per
    plant."""
    plants = table["plant"].unique()
    figure, panels = new_figure(PAGE_WIDTH, 2.8, 1, len(plants), sharey=True)
    sides = {0.0: ("towards a tendon", "blue", "o"), 180.0: ("opposite a tendon", "vermillion", "s")}
    for axes, plant in zip(np.atleast_1d(panels), plants):
        for heading, (label, color, marker) in sides.items():
            rows = table[(table["plant"] == plant) & (table["heading_deg"] == heading)]
            axes.plot(rows["lateral_mm"], rows["steps"], color=COLORS[color], zorder=2)
            for closed, face in ((True, COLORS[color]), (False, "white")):
                shown = rows[rows["closed"] == closed]
                if len(shown):
                    name = label if closed else f"{label}, never reached"
                    style = {"marker": marker, "color": COLORS[color], "markerfacecolor": face}
                    axes.plot(shown["lateral_mm"], shown["steps"], linestyle="none", label=name, **style)
        label_axes(axes, "ball aside [mm]", "steps", title=f"Plant {plant}")
    np.atleast_1d(panels)[0].set_ylim(bottom=0)
    legend(figure)
    return figure


def suggestions(runs: pd.DataFrame) -> Figure:
    """Draw steps, final miss and success of the suggested improvements on both plants."""
    figure, panels = new_figure(PAGE_WIDTH, 4.6, 1, 3, width_ratios=[2, 2, 1])
    grouped_bars(panels[0], runs, "controller", "steps", "plant")
    grouped_bars(panels[1], runs, "controller", "miss_mm", "plant")
    success_bars(panels[2], runs, "controller", "plant")
    panels[1].set_yticklabels([])
    label_axes(panels[0], "steps")
    label_axes(panels[1], "ball to gripper [mm]")
    label_axes(panels[2], "success [%]")
    legend(figure)
    return figure


def compare_eyes(runs: pd.DataFrame) -> Figure:
    """Draw steps and final miss through better and better eyes, one row of panels per controller."""
    controllers = list(runs["controller"].unique())
    figure, panels = new_figure(PAGE_WIDTH, 1.9 * len(controllers), len(controllers), 2, squeeze=False)
    for row, controller in zip(panels, controllers):
        chosen = runs[runs["controller"] == controller]
        grouped_bars(row[0], chosen, "observer", "steps", "plant")
        grouped_bars(row[1], chosen, "observer", "miss_mm", "plant")
        row[1].set_yticklabels([])
        label_axes(row[0], title=controller)
    label_axes(panels[-1][0], "steps")
    label_axes(panels[-1][1], "ball to gripper [mm]")
    legend(figure)
    return figure


def loop_speed(runs: pd.DataFrame) -> Figure:
    """Draw the handover time over the duration of a step, one panel per plant."""
    plants = runs["plant"].unique()
    figure, panels = new_figure(PAGE_WIDTH, 3.0, 1, len(plants), sharey=True)
    dashes = ("-", "--", ":")
    for axes, plant in zip(np.atleast_1d(panels), plants):
        chosen = runs[runs["plant"] == plant]
        for color, (controller, group) in zip(SERIES, chosen.groupby("controller", sort=False)):
            for dash, (constant, rows) in zip(dashes, group.groupby("time_constant_s")):
                times = rows.groupby("timestep_s")["time_s"].median()
                axes.plot(
                    times.index,
                    times,
                    color=color,
                    linestyle=dash,
                    marker=".",
                    label=f"{controller}, arm {constant} s",
                )
        axes.set_xscale("log")
        axes.set_yscale("log")
        label_axes(axes, "duration of a step [s]", "median handover time [s]", title=f"Plant {plant}")
    legend(figure, ncols=2)
    return figure


def faults(table: pd.DataFrame) -> Figure:
    """Draw what runs come to under each fault at three severities, one panel per controller."""
    controllers = list(table["controller"].unique())
    rows = table[["fault", "severity"]].drop_duplicates()
    labels = [
        f"{fault}: {severity}" if severity != "-" else "no fault" for fault, severity in rows.to_numpy()
    ]
    figure, panels = new_figure(PAGE_WIDTH, 7.6, 1, len(controllers), sharey=True)
    for axes, controller in zip(np.atleast_1d(panels), controllers):
        chosen = table[table["controller"] == controller]
        counts = (
            chosen.groupby(["fault", "severity"])["outcome"]
            .value_counts(normalize=True)
            .unstack(fill_value=0)
        )
        counts = counts.reindex(pd.MultiIndex.from_frame(rows)).fillna(0)
        left = np.zeros(len(rows))
        for outcome, color in OUTCOME_COLORS.items():
            width = 100 * counts.get(outcome, pd.Series(0.0, index=counts.index)).to_numpy()
            axes.barh(np.arange(len(rows)), width, left=left, color=color, height=0.85, label=outcome)
            left += width
        axes.set_xlim(0, 100)
        axes.grid(axis="y", visible=False)
        label_axes(axes, "runs [%]", title=controller)
    first = np.atleast_1d(panels)[0]
    first.set_yticks(range(len(rows)), labels)
    first.set_ylim(len(rows) - 0.4, -0.6)
    legend(figure)
    return figure
