"""Figures of the hand and its filters (Lai et al., Figs. 3 to 5)."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from soro_lib.paths import A4_PAPER
from soro_lib.replication.plotting import (
    COLORS,
    ESTIMATE,
    MEASUREMENT,
    PAGE_WIDTH,
    REFERENCE,
    label_axes,
    legend,
    new_figure,
)
from soro_lib.sensing.hand_tracking import FINGERS

MODE_COLORS = {
    "palm": COLORS["light"],
    "v_sign": COLORS["sky"],
    "thumbs_up": COLORS["green"],
    "fist": COLORS["orange"],
}
"""One colour per gesture, in every figure."""
MODE_NAMES = {"palm": "palm", "v_sign": "V-sign", "thumbs_up": "thumbs-up", "fist": "fist"}
AXIS_COLORS = {"x": COLORS["blue"], "y": COLORS["green"], "z": COLORS["purple"]}
"""One colour per axis, where all three are drawn."""


def line_style(style: dict[str, Any]) -> dict[str, Any]:
    """Return the part of a style that is about a line alone."""
    return {key: style[key] for key in ("color", "linestyle", "linewidth")}


def shade_modes(axes: Any, time: pd.Series, mode: pd.Series) -> None:
    """Shade the background by gesture mode; the plain palm stays white."""
    times, modes = np.asarray(time), np.asarray(mode)
    starts = np.flatnonzero(np.concatenate([[True], modes[1:] != modes[:-1]]))
    for start, stop in zip(starts, [*starts[1:], len(modes) - 1]):
        if modes[start] != "palm":
            axes.axvspan(times[start], times[stop], color=MODE_COLORS[modes[start]], alpha=0.25, linewidth=0)


def stream_timing(table: pd.DataFrame) -> Figure:
    """Draw the intervals of the tracker's clock, in time and as a histogram."""
    stamp = table["timestamp_us"].drop_duplicates().to_numpy()
    interval = np.diff(stamp) * 1e-3
    figure, (left, right) = new_figure(PAGE_WIDTH, 2.4, columns=2, width_ratios=(2.2, 1), sharey=True)
    left.plot((stamp[1:] - stamp[0]) * 1e-6, interval, **MEASUREMENT)
    right.hist(interval, bins=np.linspace(0, max(interval.max(), 30) * 1.02, 90), orientation="horizontal",
               color=MEASUREMENT["color"])  # fmt: skip
    right.set_xscale("log")
    label_axes(left, "time [s]", "interval [ms]", title="Clock of the tracker")
    label_axes(right, "frames")
    return figure


def palm_before_after(timeline: pd.DataFrame) -> Figure:
    """Draw the palm position before and after the filter, and what the filter removed."""
    figure, axes = new_figure(PAGE_WIDTH, 4.4, rows=3, columns=2, width_ratios=(1.5, 1), sharex=True)
    time = timeline["time_s"]
    for (palm, removed), axis in zip(axes, "xyz"):
        raw, filtered = timeline[f"raw_{axis}_mm"], timeline[f"filtered_{axis}_mm"]
        palm.plot(time, raw, **MEASUREMENT, label="tracker")
        palm.plot(time, filtered, **{**ESTIMATE, "linewidth": 1.0}, label="Kalman filter")
        shade_modes(palm, time, timeline["mode"])
        removed.plot(time, raw - filtered, **{**MEASUREMENT, "markersize": 1.5})
        removed.set_ylim(-2.0, 2.0)
        label_axes(palm, y=f"palm {axis} [mm]")
    for panel in axes[2]:
        label_axes(panel, "time [s]")
    label_axes(axes[0, 0], title="Palm over the device")
    label_axes(axes[0, 1], title="tracker minus filter [mm]")
    legend(axes[0, 0], ncols=2, loc="lower right", bbox_to_anchor=(1.0, 0.97), borderaxespad=0.0)
    return figure


def goal_timeline(timeline: pd.DataFrame) -> Figure:
    """Draw the tip goal, its tilt and the gestures of a recording."""
    figure, axes = new_figure(PAGE_WIDTH, 4.6, rows=3, sharex=True, height_ratios=(1.4, 1.2, 0.8))
    top, middle, bottom = axes
    for axis, color in AXIS_COLORS.items():
        top.plot(timeline["time_s"], timeline[f"goal_{axis}_mm"], color=color, label=axis)
    middle.plot(timeline["time_s"], timeline["tilt_raw_deg"], **MEASUREMENT, label="tracker, limited to 30°")
    middle.plot(timeline["time_s"], timeline["tilt_deg"], **ESTIMATE, label="LPF-SLERP")
    for finger, name in enumerate(FINGERS):
        extended = timeline["fingers"].str[finger] == "1"
        bar = {"where": extended, "step": "post", "color": COLORS["grey"], "linewidth": 0}
        bottom.fill_between(timeline["time_s"], finger - 0.35, finger + 0.35, **bar)
        bottom.annotate(name, (1.005, finger), xycoords=("axes fraction", "data"), va="center", fontsize=7.5)
    bottom.set(yticks=[], ylim=(-0.6, 4.6))
    bottom.grid(False)
    for panel in axes:
        shade_modes(panel, timeline["time_s"], timeline["mode"])
    seen = [mode for mode in MODE_COLORS if mode != "palm" and (timeline["mode"] == mode).any()]
    patches = [Rectangle((0, 0), 1, 1, color=MODE_COLORS[mode], alpha=0.25) for mode in seen]
    names, below = [MODE_NAMES[mode] for mode in seen], {"bbox_to_anchor": (0.5, -0.45)}
    bottom.legend(patches, names, loc="upper center", ncols=3, **below)
    label_axes(top, y="goal [mm]", title="What the hand asks of the tip")
    label_axes(middle, y="tilt [deg]")
    label_axes(bottom, "time [s]", "extended")
    for panel in (top, middle):
        legend(panel, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 0.97), borderaxespad=0.0)
    return figure


def fig05_a4_sheet(palm: pd.DataFrame, finger: pd.DataFrame) -> Figure:
    """Draw palm and finger tracing the edges of an A4 sheet, and the palm's tilt."""
    figure, (left, right) = new_figure(PAGE_WIDTH, 3.2, columns=2, width_ratios=(1.35, 1))
    length, width = 1e3 * np.array(A4_PAPER)
    left.add_patch(Rectangle((-length / 2, -width / 2), length, width, fill=False, **line_style(REFERENCE)))
    left.plot([], [], **REFERENCE, label="sheet")
    left.plot(palm["x_mm"], palm["z_mm"], **ESTIMATE, label="palm")
    left.plot(finger["x_mm"], finger["z_mm"], color=COLORS["green"], linewidth=1.6, label="finger tip")
    left.set_aspect("equal")
    right.plot(palm["time_s"], palm["deviation_mm"], **ESTIMATE)
    right.plot(finger["time_s"], finger["deviation_mm"], color=COLORS["green"], linewidth=1.6)
    right.plot(palm["time_s"], palm["tilt_deg"], color=COLORS["grey"], linewidth=1.0, label="palm tilt [deg]")
    label_axes(left, "device x [mm]", "device z [mm]", title="Tracing an A4 sheet")
    label_axes(right, "time [s]", "distance to the edge [mm]")
    legend(left, loc="center")
    legend(right)
    return figure


def filter_comparison(table: pd.DataFrame) -> Figure:
    """Draw error and lag of the palm filters per recording."""
    recordings = table["recording"].unique()
    figure, (left, right) = new_figure(PAGE_WIDTH, 2.6, columns=2)
    for column, panel in (("error_mm", left), ("lag_ms", right)):
        for index, (name, rows) in enumerate(table.groupby("filter", sort=False)):
            offset = (index - 2) * 0.16
            panel.bar(np.arange(len(recordings)) + offset, rows[column], width=0.15, label=name)
        panel.set_xticks(np.arange(len(recordings)), recordings)
    label_axes(left, y="error [mm]", title="Against a zero-phase smoother")
    label_axes(right, y="lag [ms]")
    legend(figure)
    return figure
