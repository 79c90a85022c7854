"""Figures of the overview: the four arms."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from soro_lib.papers.cross_robot.world.four_arms import Specimen
from soro_lib.replication.plotting import COLORS, PAGE_WIDTH, SERIES, equal_aspect, new_figure


def piece_colors(specimen: Specimen, count: int) -> list[str]:
    """Return one colour per piece of an arm: grey where it is rigid, else the category colours in turn."""
    flexible = iter(SERIES)
    return [COLORS["grey"] if index in specimen.rigid else next(flexible) for index in range(count)]


def four_arms(specimens: Sequence[Specimen], poses: int = 5) -> Figure:
    """Draw every arm on its way from one pose to another, the last in full colour."""
    figure, axes = new_figure(PAGE_WIDTH, 2.6, columns=len(specimens), projection="3d")
    for panel, specimen in zip(axes, specimens, strict=True):
        sweep = specimen.sweep(poses)
        for index, actuation in enumerate(sweep, start=1):
            draw_arm(
                panel, specimen, actuation, strength=1.0 if index == poses else 0.1 + 0.25 * index / poses
            )
        _frame(panel, specimen, sweep)
    return figure


def one_arm(specimen: Specimen, actuation: ArrayLike) -> Figure:
    """Draw one arm alone: what an explorer shows where nobody can move its sliders."""
    figure, axes = new_figure(4.0, 4.0, projection="3d")
    draw_arm(axes, specimen, actuation, width=11.0)
    _frame(axes, specimen, np.atleast_2d(actuation))
    return figure


def draw_arm(
    axes: Any, specimen: Specimen, actuation: ArrayLike, strength: float = 1.0, width: float = 5.0
) -> None:
    """Draw the pieces of an arm [mm] as tubes `width` points wide; a low strength makes them a pale ghost."""
    pieces = 1e3 * specimen.pieces(actuation)
    layers = ((1.0, 0.72), (0.76, 1.0), (0.28, 1.45)) if strength == 1.0 else ((0.9, 1.0),)
    for order, (piece, color) in enumerate(zip(pieces, piece_colors(specimen, len(pieces)), strict=True)):
        for share, shade in layers:
            line = {"color": _shaded(color, shade, strength), "linewidth": share * width}
            axes.plot(*piece.T, **line, zorder=10 * strength + order, solid_capstyle="butt")


def _shaded(color: str, shade: float, strength: float) -> tuple[float, ...]:
    """Return the colour darker (shade < 1) or lighter (> 1), mixed with white below a strength of 1."""
    rgb = np.array(to_rgb(color))
    lit = rgb * shade if shade <= 1.0 else rgb + (1.0 - rgb) * (shade - 1.0)
    return tuple(float(value) for value in 1.0 - strength * (1.0 - lit))


def _frame(axes: Any, specimen: Specimen, actuations: ArrayLike) -> None:
    """Set limits around the drawn poses, the title and a plain box with labels in mm."""
    points = 1e3 * np.concatenate([specimen.pieces(actuation) for actuation in np.asarray(actuations)])
    low, high = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    half = np.maximum((high - low) / 2.0, 0.3 * np.max(high - low))
    equal_aspect(axes, [(low + high) / 2.0 - half, (low + high) / 2.0 + half], margin=0.02)
    if specimen.hangs:
        axes.invert_zaxis()
        axes.invert_yaxis()
    axes.set_title(specimen.name, loc="center", pad=13)
    source = f"{specimen.source}, in mm"
    axes.text2D(0.5, 1.0, source, transform=axes.transAxes, ha="center", va="bottom", fontsize=7.5)
    axes.tick_params(labelsize=6, pad=-3)
    axes.locator_params(nbins=4)
    axes.set_xlabel("x", fontsize=7, labelpad=-8)
    axes.set_yticklabels([])
    axes.view_init(elev=15, azim=-68)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.pane.set(facecolor="white", edgecolor=COLORS["light"])
