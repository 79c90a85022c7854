"""The three-dimensional view of the explorers: shaded tubes on a canvas, turned by dragging."""

from pathlib import Path
from typing import Any

import anywidget
import numpy as np
import traitlets
from numpy.typing import ArrayLike


class ArmView(anywidget.AnyWidget):
    """A live drawing of one arm; assign `scene` (see `arm_scene`) and it is drawn anew."""

    _esm = Path(__file__).with_name("view.js")
    scene = traitlets.Dict().tag(sync=True)


def tube(points: ArrayLike, radius: float, color: str) -> dict[str, Any]:
    """Return one tube of a scene.

    Parameters
    ----------
    points
        Its centre line [m], shape (n, 3).
    radius
        Its radius [m].
    color
        As ``#rrggbb``.
    """
    return {"points": _rounded(points), "radius": radius, "color": color}


def arm_scene(
    tubes: list[dict[str, Any]],
    tip: ArrayLike,
    low: ArrayLike,
    high: ArrayLike,
    *,
    hangs: bool,
    grid: float,
    caption: str,
) -> dict[str, Any]:
    """Return what an `ArmView` draws.

    Parameters
    ----------
    tubes
        The arm, as `tube` gives them.
    tip
        Tip pose in the base frame, shape (4, 4); drawn as a frame.
    low, high
        Corners of the box that fills the view [m], shape (3,).
    hangs
        Whether z points down.
    grid
        Spacing of the lines on the floor [m].
    caption
        Text below the drawing, also read out by screen readers.
    """
    return {
        "tubes": tubes,
        "tip": _rounded(tip),
        "low": _rounded(low),
        "high": _rounded(high),
        "up": -1 if hangs else 1,
        "grid": grid,
        "caption": caption,
    }


def _rounded(values: ArrayLike) -> list:
    """Return nested lists rounded to a micrometre: all that a drawing needs, and short to send."""
    rounded: list = np.asarray(values, dtype=float).round(6).tolist()
    return rounded
