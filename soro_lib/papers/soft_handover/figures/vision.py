"""What the cameras of the handover see, how well, and where they fail: one function per figure.

Pictures are blue, green, red as OpenCV has them; errors in mm and degrees.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
import pandas as pd
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, MultipleLocator, NullFormatter

from soro_lib.papers.soft_handover.figures.handovers import SHAPES, stacked_shares
from soro_lib.papers.soft_handover.world.plant import Array
from soro_lib.replication.plotting import COLORS, PAGE_WIDTH, equal_aspect, label_axes, legend, new_figure
from soro_lib.robots.helix import origin_from_arm_base
from soro_lib.sensing.camera import Image
from soro_lib.sensing.handover_vision import Look
from soro_lib.sensing.stereo_vision import CalibratedCamera, around

ESTIMATOR_COLORS = {"thesis": COLORS["orange"], "gated": COLORS["sky"], "joint": COLORS["blue"]}
"""The three pose estimators."""

RULE_COLORS = {"largest piece": COLORS["orange"], "joined pieces": COLORS["blue"]}
"""The two ways to measure a hidden ball."""

PLANT_MARKERS = {"K": "o", "E": "s"}
"""The two plants."""

RED, YELLOW, DARK_BLUE, CYAN = (40, 40, 230), (40, 220, 250), (160, 60, 20), (230, 200, 40)


def annotated(image: Image, camera: CalibratedCamera, look: Look, index: int, thickness: int = 2) -> Image:
    """Return a picture with what was found in it, as in the thesis's Fig. 4.

    Markers are outlined; the ball has a yellow circle and a red dot, the wrist a dark blue dot and the
    gripper point a yellow one.
    """
    picture = image.copy()
    for corners in look.markers[index].values():
        cv2.polylines(picture, [np.round(corners).astype(np.int32)], True, CYAN, thickness, cv2.LINE_AA)
    sight = look.chosen[index]
    if sight is not None:
        x, y = (round(value) for value in sight.centre)
        cv2.circle(picture, (x, y), round(sight.radius), YELLOW, thickness, cv2.LINE_AA)
        cv2.circle(picture, (x, y), 2 * thickness, RED, -1, cv2.LINE_AA)
    seen = look.observation
    if seen.wrist is not None and seen.direction is not None:
        points = camera.project([seen.wrist, seen.wrist + 0.10 * seen.direction])
        for (x, y), color in zip(np.round(points).astype(int).tolist(), (DARK_BLUE, YELLOW)):
            cv2.circle(picture, (x, y), 4 * thickness, color, -1, cv2.LINE_AA)
    return picture


def plain_logarithm(axes: Any, name: str) -> None:
    """Make the axis "x" or "y" logarithmic, with ticks at 1, 2 and 5 written as plain numbers."""
    axes.set(**{f"{name}scale": "log"})
    axis = getattr(axes, f"{name}axis")
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def show_picture(axes: Any, picture: Image, title: str = "") -> None:
    """Draw a picture without axes."""
    axes.imshow(picture[..., ::-1])
    axes.set_axis_off()
    label_axes(axes, title=title)


def patch_legend(figure: Figure, colors: Mapping[str, str], title: str) -> None:
    """Add a legend of filled colours below a figure."""
    patches = [Patch(color=color) for color in colors.values()]
    figure.legend(patches, list(colors), loc="outside lower center", ncols=len(colors), title=title)


def fig04_detections(
    images: Sequence[Image], cameras: Sequence[CalibratedCamera], look: Look, titles: Sequence[str]
) -> Figure:
    """Draw the pictures of all cameras with what was found in them."""
    figure, panels = new_figure(PAGE_WIDTH, 2.5, 1, len(images))
    for i, axes in enumerate(panels):
        show_picture(axes, annotated(images[i], cameras[i], look, i), titles[i])
    return figure


def close_ups(
    images: Sequence[Image], cameras: Sequence[CalibratedCamera], look: Look, ball: Array, half: int = 70
) -> list[Image]:
    """Return what each camera shows around a true ball (3,) [m], the found circle drawn finely."""
    pictures = []
    for i, (image, camera) in enumerate(zip(images, cameras)):
        rows, columns = around(tuple(camera.project([ball])[0].tolist()), half, image.shape)
        picture = image.copy()
        sight = look.chosen[i]
        if sight is not None:
            x, y = (round(8 * value) for value in sight.centre)
            cv2.circle(picture, (x, y), round(8 * sight.radius), YELLOW, 1, cv2.LINE_AA, shift=3)
            cv2.circle(picture, (x, y), 12, RED, -1, cv2.LINE_AA, shift=3)
        pictures.append(picture[rows, columns])
    return pictures


def fig15_occlusion(table: pd.DataFrame, pictures: Sequence[Image], hidden: float) -> Figure:
    """Draw the error of the ball against its visible share, beside the pictures of the worst case."""
    figure, (left, middle, right) = new_figure(PAGE_WIDTH, 2.9, 1, 3, width_ratios=(1, 1, 2.2))
    for axes, picture, name in zip((left, middle), pictures, ("worst case: left", "and right camera")):
        show_picture(axes, picture, name)
    for rule, group in table.groupby("rule", sort=False):
        color = RULE_COLORS[str(rule)]
        style = {"linestyle": "none", "markersize": 4, "color": color, "label": str(rule)}
        marker = {"marker": "o", "markerfacecolor": "none"} if rule == "largest piece" else {"marker": "."}
        right.plot(100 * group["visible"], group["ball_mm"], **style, **marker)
    right.axvline(100 * hidden, color=COLORS["grey"], linewidth=0.8, linestyle=":")
    plain_logarithm(right, "y")
    x, y = "visible share of the ball, worse camera [%]", "error of the ball [mm]"
    label_axes(right, x, y, title=f"{table['pose'].nunique()} balls")
    legend(right)
    return figure


SEEN_BY = {
    "neither": COLORS["light"],
    "left only": "#f3d9a4",
    "right only": "#b5d8ee",
    "both": COLORS["green"],
}
"""Colours of places by the cameras that see them."""


def fig14_workspace(table: pd.DataFrame) -> Figure:
    """Draw which cameras see ring and ball at every place of the gripper, in three planes."""
    depths = sorted(table["y_mm"].unique())
    colors = ListedColormap(list(SEEN_BY.values()))
    figure, panels = new_figure(PAGE_WIDTH, 2.35, 1, len(depths), sharey=True)
    for axes, depth in zip(panels, depths):
        plane = table[table["y_mm"] == depth]
        seen = plane["left"].astype(int) + 2 * plane["right"].astype(int)
        grid = plane.assign(seen=seen).pivot(index="z_mm", columns="x_mm", values="seen")
        axes.pcolormesh(grid.columns, grid.index, grid, cmap=colors, vmin=0, vmax=3, rasterized=True)
        axes.plot([0], [700], marker="+", markersize=9, color=COLORS["black"])
        where = (
            f"{abs(depth):.0f} mm {'nearer' if depth > 0 else 'farther'}" if depth else "in the arm's plane"
        )
        label_axes(axes, "to the right [mm]", title=where)
        axes.set_aspect("equal")
        axes.grid(False)
    panels[0].invert_yaxis()
    panels[0].set_ylabel("below the base [mm]")
    patch_legend(figure, SEEN_BY, "seen by")
    return figure


SHIFTS = dict(zip(ESTIMATOR_COLORS, (-0.22, 0.0, 0.22)))
"""Where each estimator stands beside the middle of its row."""


def name_rows(axes: Any, names: Sequence[str]) -> None:
    """Name the rows of a figure, the first at the top."""
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()


def error_budget(budget: pd.DataFrame) -> Figure:
    """Draw median and 95th percentile of the gripper's error per cause and estimator."""
    figure, (left, right) = new_figure(PAGE_WIDTH, 3.2, 1, 2, sharey=True)
    names = list(dict.fromkeys(budget["condition"]))
    for axes, what, unit in ((left, "gripper", "mm"), (right, "direction", "deg")):
        for estimator, color in ESTIMATOR_COLORS.items():
            rows = budget[budget["estimator"] == estimator]
            place = np.array([names.index(name) for name in rows["condition"]]) + SHIFTS[estimator]
            median, high = rows[f"{what}_median_{unit}"], rows[f"{what}_p95_{unit}"]
            axes.hlines(place, median, high, color=color, linewidth=2.0)
            axes.plot(median, place, "o", color=color, markersize=5, label=estimator)
            axes.plot(high, place, "|", color=color, markersize=8, markeredgewidth=2)
        plain_logarithm(axes, "x")
        label_axes(axes, f"error of the {what} [{unit}]")
    name_rows(left, names)
    left.set_title("dot: median, bar: 95th percentile")
    legend(figure)
    return figure


def degradations(table: pd.DataFrame) -> Figure:
    """Draw how often arm and ball are found in bad pictures, and how far off the gripper is."""
    names = list(dict.fromkeys(table["degradation"]))
    figure, (left, right) = new_figure(PAGE_WIDTH, 3.4, 1, 2, sharey=True)
    errors = table.groupby(["estimator", "degradation"])["gripper_mm"]
    for estimator, color in ESTIMATOR_COLORS.items():
        median, high = (errors.quantile(q)[estimator][names] for q in (0.5, 0.95))
        place = np.arange(len(names)) + SHIFTS[estimator]
        left.hlines(place, median, high, color=color, linewidth=2.0)
        left.plot(median, place, "o", color=color, markersize=4, label=estimator)
    thesis = table[table["estimator"] == "thesis"].groupby("degradation", sort=False)
    for shift, what, color in ((-0.17, "gripper_mm", COLORS["black"]), (0.17, "ball_mm", COLORS["green"])):
        share = 100 * thesis[what].count() / thesis.size()
        label = "arm found" if what == "gripper_mm" else "ball found"
        right.barh(np.arange(len(names)) + shift, share[names], 0.32, color=color, label=label)
    plain_logarithm(left, "x")
    name_rows(left, names)
    label_axes(left, "error of the gripper [mm]", title="median to 95th percentile")
    label_axes(right, "share of the looks [%]", title="found at all")
    legend(figure)
    return figure


VERDICT_COLORS = {"located": COLORS["green"], "refused": COLORS["sky"], "wrong": COLORS["vermillion"]}


def image_faults(table: pd.DataFrame, estimators: Sequence[str] = ("thesis", "joint")) -> Figure:
    """Draw what becomes of arm and ball under every fault of the pictures."""
    figure, panels = new_figure(PAGE_WIDTH, 3.4, 1, 2, sharey=True)
    for axes, what in zip(panels, ("gripper", "ball")):
        for shift, opacity, estimator in zip((-0.2, 0.2), (0.55, 1.0), estimators):
            rows = table[table["estimator"] == estimator]
            style = {"shift": shift, "height": 0.34, "alpha": opacity}
            stacked_shares(axes, rows["fault"], rows[what], VERDICT_COLORS, **style)
        label_axes(axes, "share of the looks [%]", title=what)
        axes.grid(False)
    name_rows(panels[0], list(table["fault"].unique()))
    patch_legend(figure, VERDICT_COLORS, f"pale: {estimators[0]}, full: {estimators[1]}")
    return figure


def rendered_handovers(runs: pd.DataFrame) -> Figure:
    """Draw steps and final distance of the handovers through rendered images, per controller."""
    names = list(dict.fromkeys(runs["controller"]))
    figure, (left, right) = new_figure(PAGE_WIDTH, 3.3, 1, 2, sharex=True)
    for axes, column in ((left, "steps"), (right, "miss_mm")):
        for key, group in runs.groupby(["plant", "estimator"], sort=False):
            plant, estimator = map(str, key)
            shift = 0.13 * (list(ESTIMATOR_COLORS).index(estimator) - 1) + 0.42 * (plant == "E") - 0.21
            values = group.groupby("controller")[column]
            place = np.arange(len(names)) + shift
            low, middle, high = (values.quantile(q)[names] for q in (0.0, 0.5, 1.0))
            axes.vlines(place, low, high, color=ESTIMATOR_COLORS[estimator], linewidth=1.4)
            style = {"color": ESTIMATOR_COLORS[estimator], "markersize": 4.5}
            axes.plot(place, middle, PLANT_MARKERS[plant], **style, label=f"plant {plant}, {estimator}")
        axes.set_xticks(range(len(names)), [name.replace("thesis, step ", "") for name in names])
    plain_logarithm(left, "y")
    label_axes(left, "step size of the thesis's controller, or best", "steps to the closed gripper")
    label_axes(right, "step size of the thesis's controller, or best", "ball from gripper point [mm]")
    legend(figure, ncols=3)
    return figure


def comparison_with_noise_model(rendered: pd.DataFrame, modelled: Mapping[str, pd.DataFrame]) -> Figure:
    """Draw the steps of runs through rendered images beside those of runs with the measured noise alone.

    Parameters
    ----------
    rendered : DataFrame
        Runs with columns estimator, alpha, steps, of the thesis's controller on one plant.
    modelled : mapping of str to DataFrame
        Runs with columns alpha and steps by estimator.
    """
    figure, axes = new_figure(0.62 * PAGE_WIDTH, 3.0)
    for i, (estimator, runs) in enumerate(modelled.items()):
        color = ESTIMATOR_COLORS[estimator]
        seen = rendered[rendered["estimator"] == estimator]
        for shift, table, marker, name in ((0.0, seen, "o", "rendered"), (0.05, runs, "x", "noise model")):
            steps = table.groupby("alpha")["steps"]
            place = np.arange(steps.ngroups) + 0.2 * (i - 1) + shift
            axes.vlines(place, steps.min(), steps.max(), color=color, linewidth=1.2)
            axes.plot(place, steps.median(), marker, color=color, markersize=5, label=f"{estimator}, {name}")
    step_sizes = sorted(rendered["alpha"].unique())
    axes.set_xticks(range(len(step_sizes)), [f"{size:g}" for size in step_sizes])
    plain_logarithm(axes, "y")
    label_axes(axes, "step size", "steps to the closed gripper")
    legend(axes)
    return figure


def explorer_view(pictures: Sequence[Image], shapes: Mapping[str, Array], ball: Array, status: str) -> Figure:
    """Draw what the explorer shows: both pictures, and the shapes of the arm beside the ball.

    Parameters
    ----------
    pictures : sequence of images
        With what was found in them.
    shapes : mapping of str to ndarray, shape (n, 3)
        True, commanded and estimated backbone [m], frame `arm_base`.
    ball : ndarray, shape (3,)
        True ball [m].
    status : str
        What the arm does.
    """
    figure, panels = new_figure(PAGE_WIDTH, 4.2, 2, 2, width_ratios=(1.25, 1))
    for axes, picture, name in zip(panels[:, 0], pictures, ("left camera", "right camera")):
        show_picture(axes, picture, name)
    grid = panels[0, 1].get_gridspec()
    for axes in panels[:, 1]:
        axes.remove()
    space = figure.add_subplot(grid[:, 1], projection="3d")
    drawn = [1e3 * origin_from_arm_base(ball[None])]
    for name, points in shapes.items():
        drawn.append(1e3 * origin_from_arm_base(points))
        style = {key: value for key, value in SHAPES[name].items() if key != "zorder"}
        space.plot(*drawn[-1].T, **style, label=name)
    space.plot(*drawn[0].T, "o", color=COLORS["green"], markersize=8, label="ball")
    equal_aspect(space, np.concatenate(drawn))
    for axis in (space.xaxis, space.yaxis):
        axis.set_major_locator(MultipleLocator(100))
    label_axes(space, "x [mm]", "y [mm]", "z [mm]", status)
    space.zaxis.labelpad = 10
    legend(figure)
    return figure
