"""One visual vocabulary: what is true, measured, estimated or demanded looks the same in every figure.

Colours are those of Okabe and Ito, which readers with colour-blindness can tell apart; fonts are those that
matplotlib ships, so that a figure is the same everywhere. Figures are made without pyplot: no window,
nothing to close.
"""

from typing import Any

import matplotlib.style
import mpl_toolkits.mplot3d  # noqa: F401  (registers the 3-D projection)
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

COLORS = {
    "black": "#1a1a1a",
    "blue": "#0072B2",
    "orange": "#E69F00",
    "green": "#009E73",
    "vermillion": "#D55E00",
    "sky": "#56B4E9",
    "purple": "#CC79A7",
    "grey": "#8a8a8a",
    "light": "#d9d9d9",
}
"""The palette, by name."""

SERIES = tuple(COLORS[name] for name in ("blue", "orange", "vermillion", "sky", "green", "black", "purple"))
"""The order in which categories take their colours: neighbours differ in grey, too."""

TRUTH: dict[str, Any] = {"color": COLORS["black"], "linestyle": "-", "linewidth": 1.6, "zorder": 3}
"""What the simulated world really did."""

MEASUREMENT: dict[str, Any] = {
    "color": COLORS["orange"],
    "linestyle": "none",
    "marker": ".",
    "markersize": 4.0,
    "markeredgewidth": 0.0,
    "alpha": 0.7,
    "zorder": 2,
}
"""What a sensor reported."""

ESTIMATE: dict[str, Any] = {"color": COLORS["blue"], "linestyle": "-", "linewidth": 1.6, "zorder": 4}
"""What a filter, model or controller concluded."""

REFERENCE: dict[str, Any] = {
    "color": COLORS["vermillion"],
    "linestyle": "--",
    "linewidth": 1.3,
    "zorder": 3.5,
}
"""What was demanded: a path, a goal, a set point."""

GOAL: dict[str, Any] = {
    "color": COLORS["vermillion"],
    "linestyle": "none",
    "marker": "x",
    "markersize": 7.0,
    "markeredgewidth": 1.8,
    "zorder": 5,
}
"""A single demanded point."""

COLUMN_WIDTH = 3.5
"""Width of a figure that fills one column of a two-column page [in]."""

PAGE_WIDTH = 7.2
"""Width of a figure that fills the page [in]."""

STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "mathtext.fontset": "dejavusans",
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.labelcolor": "#333333",
    "axes.edgecolor": "#666666",
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.prop_cycle": cycler(color=SERIES),
    "axes3d.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "lines.linewidth": 1.5,
    "lines.solid_capstyle": "round",
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "figure.facecolor": "white",
    "figure.titlesize": 11.0,
    "figure.titleweight": "bold",
    "image.cmap": "viridis",
    "path.simplify": False,
    "svg.hashsalt": "soro",
}
"""The matplotlib settings of every figure."""


def new_figure(
    width: float = PAGE_WIDTH, height: float = 3.6, rows: int = 1, columns: int = 1, **options: Any
) -> tuple[Figure, Any]:
    """Return an empty figure in the house style, laid out so that labels never overlap.

    Parameters
    ----------
    width, height
        Size [in]; `PAGE_WIDTH` and `COLUMN_WIDTH` are the usual widths.
    rows, columns
        Grid of axes.
    **options
        Passed to `matplotlib.figure.Figure.subplots` (``sharex``, ``width_ratios``, ...);
        ``projection="3d"`` makes every axes three-dimensional.

    Returns
    -------
    figure : matplotlib.figure.Figure
    axes : matplotlib.axes.Axes or numpy.ndarray of Axes
        One axes, or an array of shape (rows, columns) without its axes of length one.

    Examples
    --------
    >>> figure, axes = new_figure(COLUMN_WIDTH, 2.4)
    >>> _ = axes.plot([0, 1], [0, 1], **ESTIMATE, label="estimate")
    """
    matplotlib.style.use(STYLE)
    if "projection" in options:
        options["subplot_kw"] = {**options.get("subplot_kw", {}), "projection": options.pop("projection")}
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, **options)


def equal_aspect(axes: Any, points: ArrayLike, margin: float = 0.05) -> None:
    """Give a 3-D axes the same scale along x, y and z, around the given points.

    Parameters
    ----------
    axes
        A three-dimensional axes.
    points
        What must be inside, shape (..., 3), in the unit of the axes.
    margin
        Free space around them, as a share of the largest extent [-].
    """
    flat = np.asarray(points, dtype=float).reshape(-1, 3)
    low, high = flat.min(axis=0), flat.max(axis=0)
    extent = np.maximum(high - low, 0.2 * max(float(np.max(high - low)), 1e-9))
    middle, extent = (low + high) / 2.0, extent * (1.0 + 2.0 * margin)
    for setter, centre, size in zip(
        (axes.set_xlim, axes.set_ylim, axes.set_zlim), middle, extent, strict=True
    ):
        setter(centre - size / 2.0, centre + size / 2.0)
    axes.set_box_aspect(extent)


def label_axes(axes: Any, x: str = "", y: str = "", z: str = "", title: str = "") -> None:
    """Write the axis labels ("tip error [mm]") and the title of one axes; empty ones are left alone."""
    for setter, text in (("set_xlabel", x), ("set_ylabel", y), ("set_zlabel", z), ("set_title", title)):
        if text:
            getattr(axes, setter)(text)


def error_band(
    axes: Axes, x: ArrayLike, low: ArrayLike, high: ArrayLike, color: str = COLORS["blue"]
) -> None:
    """Shade what lies between two curves: an interval over seeds, a standard deviation, a tolerance."""
    axes.fill_between(
        np.asarray(x), np.asarray(low), np.asarray(high), color=color, alpha=0.18, linewidth=0.0
    )


def box_groups(axes: Axes, samples: dict[str, ArrayLike], colors: tuple[str, ...] = SERIES) -> None:
    """Draw one box per group: median, quartiles, whiskers at 1.5 interquartile ranges, every outlier.

    Parameters
    ----------
    axes
        Where to draw.
    samples
        Values by group label, one box each, in this order.
    colors
        One per group, taken in turn.
    """
    boxes = axes.boxplot(
        [np.asarray(values, dtype=float) for values in samples.values()],
        tick_labels=list(samples),
        widths=0.55,
        patch_artist=True,
        medianprops={"color": COLORS["black"], "linewidth": 1.4},
        flierprops={"marker": ".", "markersize": 4, "markeredgecolor": COLORS["grey"]},
    )
    for box, color in zip(boxes["boxes"], _cycle(colors, len(samples)), strict=True):
        box.set(facecolor=color, alpha=0.45, edgecolor=color)


def legend(target: Any, **options: Any) -> None:
    """Add the legend of an axes where it covers least, or of a whole figure below all its axes."""
    if isinstance(target, Figure):
        handles: dict[str, Any] = {}
        for axes in target.axes:
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
                handles.setdefault(label, handle)
        placed = {"loc": "outside lower center", "ncols": min(len(handles), 5), **options}
        target.legend(list(handles.values()), list(handles), **placed)
    else:
        target.legend(**{"loc": "best", **options})


def _cycle(colors: tuple[str, ...], count: int) -> list[str]:
    return [colors[index % len(colors)] for index in range(count)]
