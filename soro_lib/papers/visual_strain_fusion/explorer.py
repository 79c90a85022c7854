"""The fusion explorer: scrub through a flight, cover the lens or turn off the light, and see who copes.

The picture is rendered anew and searched by the real tracker in the map of the flight. Where a switch takes
the view away, the camera holds its last pose; learning and fusion are run again on the changed flight.
"""

from typing import Any

import cv2
import ipywidgets
import numpy as np
import pandas as pd
from IPython.display import Image

from soro_lib.papers.visual_strain_fusion.experiments.camera_runs import FLIGHTS, load_flight
from soro_lib.papers.visual_strain_fusion.experiments.camera_views import CameraView, FlightViewer
from soro_lib.papers.visual_strain_fusion.experiments.fusion_runs import blind, fuse_flight
from soro_lib.papers.visual_strain_fusion.figures.camera import annotated, explorer_plots, fig06a_views
from soro_lib.papers.visual_strain_fusion.world.motion import glued_shifts
from soro_lib.papers.visual_strain_fusion.world.scene import ViewConditions
from soro_lib.replication import as_image
from soro_lib.replication.frontend import is_live

SWITCHES = {
    "as flown": None,
    "cover the lens": ViewConditions(covered=True, phase=4),
    "turn off the light": ViewConditions(light=0.0, phase=2),
}
"""What the switch does to the view, by its label."""


class FusionExplorer(ipywidgets.VBox):
    """A flight to scrub through, with a switch that takes the view away.

    Attributes
    ----------
    flight : ipywidgets.Dropdown
        Which flight.
    time : ipywidgets.FloatSlider
        Which moment [s].
    switch : ipywidgets.ToggleButtons
        Whether the lens is covered or the light turned off, from :attr:`start` on. Where that lies elsewhere,
        it moves to a second before the moment shown, so that the switch does what it says to the picture.
    start, duration : ipywidgets.FloatSlider
        When the view is taken away, and for how long [s].
    run : DataFrame
        The fused flight as it is shown.

    Parameters
    ----------
    seed : int, optional
        Of the fibre, the hidden nodes and the noise.
    """

    def __init__(self, seed: int = 1) -> None:
        self._seed = seed
        names = list(FLIGHTS)
        self.flight = ipywidgets.Dropdown(options=names, value="scene1_obstacles", description="flight")
        self.time = _slider("time [s]", 0.0, 199.95, 105.0, 0.05)
        self.switch = ipywidgets.ToggleButtons(options=list(SWITCHES))
        self.start = _slider("from [s]", 0.0, 195.0, 60.0, 0.5)
        self.duration = _slider("for [s]", 0.5, 20.0, 5.0, 0.5)
        self.message = ipywidgets.HTML()
        self.picture = ipywidgets.Image(format="jpeg", layout={"width": "480px"})
        self.plots = ipywidgets.Image(format="png", layout={"flex": "1 1 560px", "max_width": "820px"})
        self.flight.observe(lambda _: self._load(), "value")
        self.switch.observe(lambda _: self._switched(), "value")
        for control in (self.start, self.duration):
            control.observe(lambda _: self._fuse(), "value")
        self.time.observe(lambda _: self.draw(), "value")
        controls = ipywidgets.VBox([self.flight, self.time, self.switch, self.start, self.duration])
        left = ipywidgets.VBox([controls, self.picture, self.message])
        super().__init__([ipywidgets.HBox([left, self.plots], layout={"flex_flow": "row wrap"})])
        self._load()

    @property
    def conditions(self) -> ViewConditions | None:
        """What the switch does to the moment shown; None if it does nothing."""
        return SWITCHES[self.switch.value] if self._in_window else None

    def view(self) -> CameraView:
        """Return the picture of the moment shown, searched by the tracker."""
        return self._viewer.view(self._step, np.random.default_rng([self._seed, self._step]), self.conditions)

    def draw(self) -> None:
        """Draw the moment."""
        view = self.view()
        _, coded = cv2.imencode(".jpg", annotated(view.image, view.frame))
        self.picture.value = coded.tobytes()
        truth = self._viewer.motion.pose[:, :3]
        self.plots.value = as_image(explorer_plots(self.run, self._shifts, self._step, truth)).data
        self.message.value = describe(view, self.run.iloc[self._step])

    @property
    def _step(self) -> int:
        return round(self.time.value / 0.05)

    @property
    def _in_window(self) -> bool:
        return self.start.value <= self.time.value < self.start.value + self.duration.value

    def _switched(self) -> None:
        if SWITCHES[self.switch.value] is None or self._in_window:
            self._fuse()
        else:
            self.start.value = max(self.time.value - 1.0, self.start.min)

    def _load(self) -> None:
        self._viewer = FlightViewer(self.flight.value)
        self._frames = load_flight(self.flight.value)
        self._fuse()

    def _fuse(self) -> None:
        frames = self._frames
        if SWITCHES[self.switch.value] is not None:
            frames = blind(frames, self.start.value, self.duration.value)
        self.run = fuse_flight(frames, self._viewer.motion, np.random.default_rng(self._seed))
        # The same draws as those of the run.
        self._shifts = glued_shifts(self._viewer.motion, np.random.default_rng(self._seed))
        self.draw()


def describe(view: CameraView, moment: pd.Series) -> str:
    """Return a line of text about a moment: what the tracker found, and the errors of the three estimates."""
    names = {"camera": "camera", "fibre": "fibre", "fused": "fusion"}
    errors = ", ".join(f"{label} {moment[f'{name}_mm']:.2f} mm" for name, label in names.items())
    return f"{view.found}; errors: {errors}; weight of the fibre {moment['weight']:.2f}"


def explore() -> FusionExplorer | Image:
    """Return the explorer, or, where nobody can move its controls, three moments of a flight."""
    if is_live():
        return FusionExplorer()
    viewer = FlightViewer("scene1_obstacles")
    views: list[Any] = [viewer.view(step, np.random.default_rng(step)) for step in (1200, 2700, 3540)]
    return as_image(fig06a_views(views))


def _slider(description: str, low: float, high: float, value: float, step: float) -> ipywidgets.FloatSlider:
    return ipywidgets.FloatSlider(
        description=description, min=low, max=high, value=value, step=step, readout_format=".2f",
        continuous_update=False, layout={"width": "470px"}, style={"description_width": "70px"},
    )  # fmt: skip
