"""The steering explorer: a pad for the palm, sliders for its height and tilt, buttons for the gestures.

The controls stand for a hand over the tracker; the arm follows through the real controller, frame by frame.
"""

import asyncio
import math
from pathlib import Path

import anywidget
import ipywidgets
import numpy as np
import traitlets
from IPython.display import Image
from scipy.spatial.transform import Rotation

from soro_lib.controllers.gesture_steering import GestureSteering, SteeringResult, replay
from soro_lib.papers.gesture_steering.figures.hands import MODE_NAMES
from soro_lib.papers.gesture_steering.figures.steering import explorer_view
from soro_lib.papers.gesture_steering.world.hand import FINGER_FLAGS
from soro_lib.replication import as_image
from soro_lib.replication.frontend import is_live
from soro_lib.replication.plotting import COLORS
from soro_lib.replication.view import ArmView, arm_scene, tube
from soro_lib.robots import CableDrivenArm
from soro_lib.sensing.hand_tracking import HandSample

FRAME = 1 / 115
"""Period of the tracker [s]."""
DRAWING = 0.05
"""Time between drawings [s]."""


class PalmPad(anywidget.AnyWidget):
    """A square pad; `x` and `y` run from -1 to 1."""

    _esm = Path(__file__).with_name("explorer.js")
    x = traitlets.Float(0.0).tag(sync=True)
    y = traitlets.Float(0.0).tag(sync=True)
    label = traitlets.Unicode("palm from above").tag(sync=True)


class SteeringExplorer(ipywidgets.VBox):
    """A hand made of controls, and the arm that follows it.

    Attributes
    ----------
    pad : PalmPad
        Palm to the right and away from the user, over the allowed box.
    height, pitch, roll : ipywidgets.FloatSlider
        Height of the palm [mm] and its tilt [deg].
    gesture : ipywidgets.ToggleButtons
        Palm, V-sign, thumbs-up or fist.
    steering : GestureSteering
        The controller.
    view : ArmView
        The drawing.
    """

    def __init__(self) -> None:
        self.steering = GestureSteering(CableDrivenArm())
        self.pad = PalmPad()
        self.gesture = ipywidgets.ToggleButtons(options=[(MODE_NAMES[name], name) for name in FINGER_FLAGS])
        self.gesture.style.button_width = "92px"
        self.height = _slider("height [mm]", 100.0, 400.0, 200.0)
        self.pitch = _slider("pitch [deg]", -35.0, 35.0, 0.0)
        self.roll = _slider("roll [deg]", -35.0, 35.0, 0.0)
        self.message = ipywidgets.HTML()
        self.view = ArmView(layout={"flex": "1 1 420px", "min_width": "320px"})
        self._time = 0.0
        self._task: asyncio.Task[None] | None = None
        for control in (self.height, self.pitch, self.roll, self.gesture):
            control.observe(lambda _: self._wake(), "value")
        self.pad.observe(lambda _: self._wake(), ["x", "y"])
        controls = [self.pad, self.height, self.pitch, self.roll, self.message]
        column = ipywidgets.VBox(controls, layout={"flex": "0 0 380px"})
        stage = ipywidgets.HBox([column, self.view], layout={"width": "100%", "flex_flow": "row wrap"})
        super().__init__([self.gesture, stage])
        self.advance(DRAWING)

    def hand(self) -> HandSample:
        """Return the frame that a tracker would report of the hand that the controls describe."""
        half = self.steering.settings.mapping.half_width
        turn = Rotation.from_euler("xz", [self.pitch.value, self.roll.value], degrees=True)
        nx, ny, nz = turn.apply([0.0, -1.0, 0.0]).tolist()
        palm = (self.pad.x * half, self.height.value * 1e-3, -self.pad.y * half)
        return HandSample(self._time, 1, palm, (nx, ny, nz), FINGER_FLAGS[self.gesture.value])

    def advance(self, duration: float) -> SteeringResult:
        """Hold the hand for some time [s], let the arm follow, draw it, and return the last result."""
        for _ in range(max(round(duration / FRAME), 1)):
            self._time += FRAME
            result = self.steering.update(self.hand())
        self._draw(result)
        return result

    def _wake(self) -> None:
        """Follow the hand in the background until the arm has settled; without an event loop, at once."""
        if self._task is not None and not self._task.done():
            return
        try:
            self._task = asyncio.get_running_loop().create_task(self._follow())
        except RuntimeError:
            self.advance(DRAWING)

    async def _follow(self) -> None:
        quiet = 0
        while quiet < 10:
            before = self.steering.actuation
            self.advance(DRAWING)
            quiet = quiet + 1 if np.abs(self.steering.actuation - before).max() < 1e-4 else 0
            await asyncio.sleep(DRAWING)

    def _draw(self, result: SteeringResult) -> None:
        arm = self.steering.robot
        points = arm.backbone(result.actuation, 20)
        colors = (COLORS["grey"], COLORS["blue"], COLORS["orange"])
        pieces = (points[:21], points[20:41], points[40:])
        tubes = [tube(piece, 0.0045, color) for piece, color in zip(pieces, colors)]
        x, y, z = 1e3 * result.tip
        caption = f"{MODE_NAMES[result.mode.value]}: tip at {x:.1f}, {y:.1f}, {z:.1f} mm"
        self.view.scene = arm_scene(
            tubes, arm.forward(result.actuation), (-0.05, -0.05, 0.0), (0.05, 0.05, 0.16),
            hangs=False, grid=0.02, caption=caption,
        )  # fmt: skip
        distance, angle = 1e3 * result.position_error, math.degrees(result.direction_error)
        self.message.value = result.reason or f"{distance:.2f} mm, {angle:.1f} deg from the target"


def explore() -> SteeringExplorer | Image:
    """Return the explorer, or, where nobody can move its controls, a picture of the arm under one hand."""
    if is_live():
        return SteeringExplorer()
    steering = GestureSteering(CableDrivenArm())
    palm, normal = (0.08, 0.2, -0.06), (0.25, -math.sqrt(1 - 0.25**2), 0.0)
    frames = [HandSample(index * FRAME, 1, palm, normal, (True,) * 5) for index in range(300)]
    results = replay(steering, frames)
    trace = np.array([result.tip for result in results])
    return as_image(explorer_view(results[-1].actuation, results[-1].mode.value, trace))


def _slider(description: str, low: float, high: float, value: float) -> ipywidgets.FloatSlider:
    return ipywidgets.FloatSlider(
        description=description, min=low, max=high, value=value, step=1.0, readout_format=".0f",
        layout={"width": "370px"}, style={"description_width": "90px"},
    )  # fmt: skip
