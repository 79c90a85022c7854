"""Figures of the camera side of visual-strain fusion: Figs. 5 to 8 of Wang et al., and two of our own."""

from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from soro_lib.papers.visual_strain_fusion.experiments.fusion_runs import SEEN, TRUE, camera_errors
from soro_lib.replication.plotting import (
    COLORS,
    ESTIMATE,
    MEASUREMENT,
    PAGE_WIDTH,
    TRUTH,
    equal_aspect,
    label_axes,
    legend,
    new_figure,
)
from soro_lib.sensing.camera import Image

CAMERA: dict[str, Any] = {"color": COLORS["orange"], "linewidth": 1.0, "zorder": 2}
FIBRE: dict[str, Any] = {"color": COLORS["green"], "linewidth": 1.0, "zorder": 3}
FUSED: dict[str, Any] = {**ESTIMATE, "linewidth": 1.1}
"""The camera is the measurement, the fused pose the estimate; the fibre has a colour of its own."""

PHASES = {
    "moving obstacles": {1: "undisturbed", 2: "resting hand", 3: "moving hand", 4: "covered lens"},
    "varying light": {1: "ordinary light", 2: "weak light or darkness", 3: "moving lamp"},
}
"""Numbers of the conditions in the paper's Figs. 6(a) and 7(a)."""

PHASE_COLORS = {2: "#f3e3c2", 3: "#dbe7f3", 4: "#e9d3dd"}
CIRCLED = {1: "①", 2: "②", 3: "③", 4: "④"}

NAMES = {"camera": "camera (SLAM)", "fibre": "fibre (F-emp)", "fused": "fusion"}
"""What the paper calls the estimates."""


def fig05a_camera_errors(frames: pd.DataFrame) -> Figure:
    """Errors of the camera's position along x, y and z over an undisturbed flight, with their means."""
    figure, rows = new_figure(PAGE_WIDTH, 4.2, 3, 1, sharex=True, sharey=True)
    errors = np.abs(camera_errors(frames)).T
    for axes, axis, color, error in zip(rows, "xyz", ("blue", "orange", "green"), errors):
        axes.plot(frames["time_s"], error, color=COLORS[color], linewidth=0.8)
        axes.axhline(error.mean(), color=COLORS["black"], linewidth=1.2, linestyle="--")
        axes.annotate(
            f"mean {error.mean():.3f} mm", (1.0, error.mean()), xycoords=("axes fraction", "data"),
            xytext=(-4, 3), textcoords="offset points", ha="right", va="bottom", fontsize=8,
        )  # fmt: skip
        label_axes(axes, y=f"|error {axis}| [mm]")
    label_axes(rows[-1], x="time [s]")
    label_axes(rows[0], title="Camera alone, undisturbed")
    return figure


def fig05b_trajectories(frames: pd.DataFrame) -> Figure:
    """True path of the tip and the camera's estimates, in space and from above."""
    figure, axes = new_figure(PAGE_WIDTH, 3.4)
    axes.remove()
    figure.set_layout_engine("constrained", wspace=0.1)
    truth, seen = frames[TRUE].to_numpy(), frames[SEEN].to_numpy()[::12]
    space = figure.add_subplot(1, 2, 1, projection="3d")
    space.plot(*truth.T, **{**TRUTH, "linewidth": 1.0})
    space.plot(*seen.T, **{**MEASUREMENT, "markersize": 2.5})
    equal_aspect(space, truth)
    space.invert_zaxis()
    space.set_zticks([0, -5, -10])
    label_axes(space, "x [mm]", "y [mm]", "z [mm]")
    above = figure.add_subplot(1, 2, 2)
    above.plot(truth[:, 0], truth[:, 1], **TRUTH, label="true path")
    above.plot(seen[:, 0], seen[:, 1], **MEASUREMENT, label="camera")
    above.set_aspect("equal")
    label_axes(above, "x [mm]", "y [mm]")
    legend(above, loc="upper left")
    return figure


def fig05c_stitched(front: Image, side: Image) -> Figure:
    """Pictures of a flight, hung in space at the estimated poses: from the front and from the side."""
    return _pictures({"front": front, "side": side}, 3.5, width_ratios=(1.0, 1.25))


def _pictures(images: Mapping[str, Image], height: float, **options: Any) -> Figure:
    figure, columns = new_figure(PAGE_WIDTH, height, 1, 2, **options)
    for axes, (title, image) in zip(columns, images.items()):
        _show(axes, _trimmed(image), title)
    return figure


def fig06a_views(views: Sequence[Any], disturbance: str = "moving obstacles") -> Figure:
    """Views of the camera under each condition, with the features that fit the pose and the others."""
    figure, columns = new_figure(PAGE_WIDTH, 4.0 if len(views) > 3 else 2.2, -(-len(views) // 3), 3)
    cells = np.ravel(columns)
    for axes, view in zip(cells, views):
        draw_view(axes, view, disturbance)
    for axes in cells[len(views) :]:
        axes.set_axis_off()
    return figure


def fig07a_views(views: Sequence[Any]) -> Figure:
    """Views of the camera in ordinary and weak light, in darkness, and with a lamp shining into the lens."""
    return fig06a_views(views, "varying light")


def draw_view(axes: Axes, view: Any, disturbance: str) -> None:
    """Draw one view with its features: inliers filled, the others as small crosses."""
    phase = view.conditions.phase
    _show(axes, view.image, f"{CIRCLED[phase]} {PHASES[disturbance][phase]}, {view.time:.0f} s")
    other, inlier = view.frame.other_pixels, view.frame.inlier_pixels
    axes.plot(*other.T, linestyle="none", marker="x", markersize=2.2, markeredgewidth=0.5, color="white")
    axes.plot(*inlier.T, linestyle="none", marker="o", markersize=2.2, markeredgewidth=0, color="#3cff6b")
    axes.set_xlabel(view.found, fontsize=8)


def fig06b_deviations(run: pd.DataFrame, reach: float) -> Figure:
    """Error of camera and fusion under moving obstacles, in mm, over the range and over the step."""
    return _deviations(run, reach, {"camera": CAMERA, "fused": FUSED}, "moving obstacles")


def fig07b_deviations(run: pd.DataFrame, reach: float) -> Figure:
    """Error of camera, fibre and fusion in varying light."""
    return _deviations(run, reach, {"camera": CAMERA, "fibre": FIBRE, "fused": FUSED}, "varying light")


def _deviations(
    run: pd.DataFrame, reach: float, styles: Mapping[str, dict[str, Any]], disturbance: str
) -> Figure:
    figure, rows = new_figure(PAGE_WIDTH, 5.0, 2, 1, sharex=True, height_ratios=(1.4, 1.0))
    for name, style in styles.items():
        rows[0].plot(run["time_s"], run[f"{name}_mm"], **style, label=NAMES[name])
        percent = 100 * run[f"{name}_mm"] / run["step_mm"].where(run["step_mm"] > 0)
        rows[1].plot(run["time_s"], percent.clip(lower=1), **style)
    for axes in rows:
        _shade_phases(axes, run)
    rows[0].set_yscale("symlog", linthresh=2, linscale=1.2)
    rows[0].set_yticks([0, 1, 2, 5, 10, 20], ["0", "1", "2", "5", "10", "20"])
    rows[0].set_ylim(0, max(30, 1.1 * float(run["camera_mm"].max())))
    share = rows[0].secondary_yaxis("right", functions=(lambda e: 100 * e / reach, lambda p: p * reach / 100))
    share.set_yscale("symlog", linthresh=200 / reach, linscale=1.2)
    share.set_ylabel(f"of {reach:.1f} mm [%]")
    share.minorticks_off()
    share.set_yticks([0, 2, 5, 10, 20, 50], ["0", "2", "5", "10", "20", "50"])
    rows[1].set_yscale("log")
    label_axes(rows[0], y="error [mm]", title=disturbance.capitalize())
    label_axes(rows[1], x="time [s]", y="error / step [%]")
    legend(figure)
    return figure


def _shade_phases(axes: Axes, run: pd.DataFrame) -> None:
    """Shade the disturbed parts of a run and number them as the paper does."""
    phase, time = run["phase"].to_numpy(), run["time_s"].to_numpy()
    starts = np.flatnonzero(np.diff(phase, prepend=-1))
    for start, end in zip(starts, [*starts[1:], len(phase)]):
        if phase[start] > 1:
            axes.axvspan(time[start], time[end - 1], color=PHASE_COLORS[phase[start]], linewidth=0, zorder=0)
        place = (time[start] + time[end - 1]) / 2
        if time[end - 1] - time[start] > 1.5:
            axes.annotate(
                CIRCLED[phase[start]], (place, 1.0), xycoords=("data", "axes fraction"),
                xytext=(0, -2), textcoords="offset points", ha="center", va="top", fontsize=8,
            )  # fmt: skip


def fig06c_trajectories(run: pd.DataFrame, truth: NDArray[np.float64]) -> Figure:
    """Paths of the tip from above, by camera, fibre and fusion, while the view is disturbed."""
    figure, columns = new_figure(PAGE_WIDTH, 2.9, 1, 3, sharex=True, sharey=True)
    part = run[run["time_s"] >= 100]
    for axes, (name, style) in zip(columns, (("fused", FUSED), ("camera", CAMERA), ("fibre", FIBRE))):
        axes.plot(*(1e3 * truth[part.index, :2].T), **{**TRUTH, "linewidth": 0.8}, label="true path")
        axes.plot(part[f"{name}_x_mm"], part[f"{name}_y_mm"], **{**style, "zorder": 4, "alpha": 0.85})
        axes.set_aspect("equal")
        label_axes(axes, "x [mm]", title=NAMES[name])
    label_axes(columns[0], y="y [mm]")
    return figure


def fig08_reconstructions(obstacles: Image, light: Image) -> Figure:
    """Pictures of the disturbed flights, hung in space at the fused poses."""
    return _pictures({"(a) moving obstacles": obstacles, "(b) varying light": light}, 3.7)


def fusion_compared(errors: pd.DataFrame, windows: Sequence[str], labels: Mapping[str, str]) -> Figure:
    """Root-mean-square and largest errors by window: means over scenes and fibres, with 95 % ranges."""
    figure, columns = new_figure(PAGE_WIDTH, 3.4, 1, 2)
    colors = ("orange", "green", "sky", "blue", "purple")
    width = 0.8 / len(labels)
    for axes, (statistic, title) in zip(columns, (("rmse_mm", "root mean square"), ("max_mm", "largest"))):
        samples = errors.groupby(["estimate", "window"])[statistic]
        middle, low, high = samples.mean(), samples.quantile(0.025), samples.quantile(0.975)
        for index, (name, label) in enumerate(labels.items()):
            place = np.arange(len(windows)) + (index - (len(labels) - 1) / 2) * width
            axes.bar(place, middle[name][windows], 0.92 * width, color=COLORS[colors[index]], label=label)
            axes.vlines(place, low[name][windows], high[name][windows], color=COLORS["black"], linewidth=1.0)
        axes.set_xticks(np.arange(len(windows)), windows, rotation=15, ha="right")
        axes.set_yscale("log")
        axes.minorticks_off()
        axes.set_yticks([0.2, 0.5, 1, 2, 5, 10, 20], ["0.2", "0.5", "1", "2", "5", "10", "20"])
        label_axes(axes, y="error [mm]", title=title)
    legend(figure, ncols=3)
    return figure


def error_and_confidence(frames: pd.DataFrame) -> Figure:
    """Error of the tracked frames against what the camera says of itself: inliers' error, inliers, spread."""
    figure, columns = new_figure(PAGE_WIDTH, 2.7, 1, 3, sharey=True)
    tracked = frames[frames["tracked"] > 0]
    error = np.linalg.norm(camera_errors(tracked), axis=1)
    signs = (
        ("inlier_error_px", "mean error of the inliers [px]", ()),
        ("inliers", "inliers", (20, 50, 100, 200, 400)),
        ("spread_mm", "spread by the Jacobian [mm]", (0.1, 0.2, 0.5, 1.0, 2.0)),
    )
    for axes, (column, label, ticks) in zip(columns, signs):
        axes.plot(tracked[column], error, **{**MEASUREMENT, "markersize": 2.0, "alpha": 0.35})
        axes.set_yscale("log")
        label_axes(axes, x=label)
        if ticks:
            axes.set_xscale("log")
            axes.minorticks_off()
            axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    label_axes(columns[0], y="error [mm]")
    return figure


def explorer_plots(run: pd.DataFrame, shifts: NDArray[np.float64], step: int, truth: Any) -> Figure:
    """One moment of a flight: shifts of the gratings, errors and weight around it, and the path from above.

    Parameters
    ----------
    run : DataFrame
        A fused flight.
    shifts : array (n, gratings)
        Wavelength shifts [m].
    step : int
        The moment.
    truth : array (n, 3)
        True tip positions [m].
    """
    figure, cells = new_figure(PAGE_WIDTH, 4.6, 2, 2, width_ratios=(1.6, 1.0))
    (errors, paths), (weights, gratings) = cells
    now = float(run["time_s"].iloc[step])
    near = run[run["time_s"].between(now - 15, now + 15)]
    for name, style in (("camera", CAMERA), ("fibre", FIBRE), ("fused", FUSED)):
        errors.plot(near["time_s"], near[f"{name}_mm"], **style, label=NAMES[name])
        path = [f"{name}_x_mm", f"{name}_y_mm"]
        paths.plot(*near[path].to_numpy().T, **style)
        paths.plot(*run[path].iloc[step], marker="o", color=style["color"])
    errors.set_ylim(0, max(3.0, 1.1 * float(near["camera_mm"].max())))
    label_axes(errors, y="error [mm]", title=f"{now:.2f} s")
    legend(errors, loc="upper left", ncols=3)
    paths.plot(*(1e3 * truth[near.index, :2].T), **{**TRUTH, "linewidth": 0.9})
    paths.set_aspect("equal", adjustable="datalim")
    label_axes(paths, "x [mm]", "y [mm]")
    weights.fill_between(near["time_s"], near["weight"], color=COLORS["green"], alpha=0.4, linewidth=0)
    weights.set_ylim(0, 1)
    label_axes(weights, "time [s]", "weight of the fibre")
    for axes in (errors, weights):
        axes.axvline(now, color=COLORS["black"], linewidth=0.8)
    gratings.bar(np.arange(1, shifts.shape[1] + 1), 1e12 * shifts[step], color=COLORS["green"])
    largest = 1e12 * float(np.abs(shifts).max())
    gratings.set_ylim(-largest, largest)
    label_axes(gratings, "grating", "shift [pm]")
    return figure


def annotated(image: Image, frame: Any) -> Image:
    """Return a picture with the features that fit the pose as green dots and the others as white ones."""
    picture = image.copy() if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
    for pixels, color in ((frame.other_pixels, (255, 255, 255)), (frame.inlier_pixels, (80, 255, 60))):
        for x, y in np.round(pixels).astype(int):
            cv2.circle(picture, (int(x), int(y)), 3, color, 1, cv2.LINE_AA)
    return picture


def _show(axes: Axes, image: Image, title: str) -> None:
    """Show a blue-green-red or grey picture without axes."""
    if image.ndim == 3:
        image = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), dtype=np.uint8)
    axes.imshow(image, cmap="gray", vmin=0, vmax=255)
    axes.set(xticks=[], yticks=[])
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    axes.set_title(title, fontsize=8)


def _trimmed(image: Image) -> Image:
    """Return the picture without its white margins."""
    printed = image.min(axis=2) < 255
    rows, columns = np.flatnonzero(printed.max(axis=1)), np.flatnonzero(printed.max(axis=0))
    return image[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
