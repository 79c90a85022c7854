"""The handover explorer: both cameras' pictures, in which the ball and the arm are grabbed and dragged.

Every step renders, detects, estimates and controls as the study does; a dragged arm is human guidance.
"""

import asyncio
from dataclasses import replace
from pathlib import Path

import anywidget
import cv2
import ipywidgets
import numpy as np
import traitlets
from IPython.display import Image as Picture

from soro_lib.arcs import backbone
from soro_lib.controllers.handover import HandoverCommand, HandoverController, Mode, goal_over
from soro_lib.controllers.virtual_stiffness import VirtualStiffnessController
from soro_lib.papers.soft_handover.calibration import plant_k
from soro_lib.papers.soft_handover.experiments.handover import CALIBRATED_GRIPPER
from soro_lib.papers.soft_handover.figures.vision import annotated, explorer_view
from soro_lib.papers.soft_handover.world.observer import RenderedObserver, calibrate_on_box
from soro_lib.papers.soft_handover.world.plant import Array, ElasticPlant, Gripper, HelixPlant, HoldingHand
from soro_lib.papers.soft_handover.world.scene import STEREO
from soro_lib.replication import as_image
from soro_lib.replication.frontend import is_live
from soro_lib.replication.plotting import COLORS
from soro_lib.replication.view import ArmView, arm_scene, tube
from soro_lib.sensing.camera import Image
from soro_lib.sensing.handover_vision import ESTIMATORS, HandoverVision

PACE = 0.25
"""Time between steps while the arm runs [s]; the thesis needs 1.4 s on its own computer."""

BALL = CALIBRATED_GRIPPER + np.array([-0.14, -0.03, -0.06])
"""Where the ball is at first [m]."""

LOW, HIGH = np.array([-0.35, -0.35, 0.0]), np.array([0.35, 0.35, 0.9])
"""Space in which the ball can be put [m], frame `arm_base`."""


class HandoverSession:
    """An arm, its eyes and a ball, one step at a time.

    Parameters
    ----------
    seed : int
        Seed of the camera noise and of the calibration.

    Attributes
    ----------
    ball : ndarray, shape (3,)
        True place of the ball [m].
    push : ndarray, shape (3,), or None
        Where a hand pulls the gripper [m].
    covered : set of int
        Cameras with a hand on the lens.
    command : HandoverCommand or None
        What followed from the last look.
    estimate : ndarray, shape (9,), or None
        The last ``q_est``.
    state : ndarray, shape (9,)
        True state of the arm.
    """

    def __init__(self, seed: int = 1) -> None:
        self.rng = np.random.default_rng(seed)
        self.cameras = calibrate_on_box(STEREO, self.rng)
        self.covered: set[int] = set()
        self.ball = BALL.copy()
        self.start("K", "thesis", 0.2)

    def start(self, plant: str, estimator: str, step_size: float) -> None:
        """Put the arm back to its calibrated state."""
        self.plant: HelixPlant = plant_k() if plant == "K" else ElasticPlant()
        self.controller = HandoverController()
        self.set_step_size(step_size)
        self.observer = RenderedObserver(HandoverVision(self.cameras, estimator), spoil=self._cover)
        self.push: Array | None = None
        self.command: HandoverCommand | None = None
        self.estimate: Array | None = None
        self.steps = 0
        self.state = self.plant.settle(self.controller.parameters.motors.pull(np.zeros(9)))
        self.look()

    def set_step_size(self, step_size: float) -> None:
        """Change alpha, and nothing else, in the middle of a run."""
        control = VirtualStiffnessController(step_size=step_size)
        self.controller.parameters = replace(self.controller.parameters, control=control)

    def look(self) -> None:
        """Take pictures of the arm and the ball as they are."""
        self.seen = self.observer.observe(self.state, self.ball, self.rng)

    def step(self) -> bool:
        """Decide from the last look, move, and look again; return whether the run goes on."""
        self.command = self.controller.update(self.seen)
        self.estimate = self.estimate if self.command.q_est is None else self.command.q_est
        if self.finished:
            return False
        hand = None
        if self.push is not None:
            hand = HoldingHand(goal_over(self.push, 0.0, self.controller.arm.gripper_length))
        pulled = self.controller.parameters.motors.pull(self.command.tendon_change)
        self.state = self.plant.settle(pulled, hand)
        self.steps += 1
        self.look()
        return True

    @property
    def finished(self) -> bool:
        """Return whether the gripper has closed or the arm has given up."""
        return self.command is not None and self.command.mode in (Mode.GRASP, Mode.STOPPED)

    @property
    def gripper(self) -> Array:
        """Return the true gripper point (3,) [m]."""
        return self.controller.arm.tip_points(self.state)[3:]

    def status(self) -> str:
        """Return in words what the arm does."""
        miss = 1e3 * float(np.linalg.norm(self.gripper - self.ball))
        if self.command is None:
            return "ready"
        if self.command.mode is Mode.GRASP:
            held = Gripper().holds(self.controller.arm.tip_points(self.state), self.ball)
            outcome = "held" if held else "missed"
            return f"closed after {self.steps} steps: the ball is {outcome}, {miss:.0f} mm off"
        trouble = self.command.reason or self.seen.status
        error = "" if np.isnan(self.command.error) else f", error {1e3 * self.command.error:.0f} mm"
        return f"step {self.steps}, {self.command.mode}{error}" + (f": {trouble}" if trouble else "")

    def dragged(self, index: int, pixel: Array, point: Array) -> Array:
        """Return a point (3,) [m] moved to a pixel (2,) of a camera, at the same distance from its plane."""
        pose = self.observer.views[index].pose
        depth = float(pose[:3, 2] @ (point - pose[:3, 3]))
        ray = pose[:3, :3] @ self.observer.views[index].camera.rays([pixel])[0]
        return np.clip(pose[:3, 3] + depth * ray, LOW, HIGH)

    def shapes(self) -> dict[str, Array]:
        """Return the true, commanded and estimated backbones with the gripper (n, 3) [m]."""
        states = {"true": self.state, "commanded": self.controller.q_sys}
        if self.estimate is not None:
            states["estimated"] = self.estimate
        arm = self.controller.arm
        return {
            name: np.concatenate([backbone(q.reshape(3, 3), 12), arm.tip_points(q)[None, 3:]])
            for name, q in states.items()
        }

    def pictures(self) -> list[Image]:
        """Return the last pictures with what was found in them."""
        look = self.observer.look
        assert look is not None
        images = self._cover(0, self.observer.images)
        return [annotated(image, self.cameras[i], look, i) for i, image in enumerate(images)]

    def _cover(self, number: int, images: list[Image]) -> list[Image]:
        """Return the pictures with those of covered cameras almost black."""
        dark = [np.asarray(image // 32, dtype=np.uint8) for image in images]
        return [dark[i] if i in self.covered else image for i, image in enumerate(images)]


class CameraPicture(anywidget.AnyWidget):
    """A picture whose drags come back as (x, y, number of the gesture, 1 while the button is down)."""

    _esm = Path(__file__).with_name("explorer.js")
    picture = traitlets.Bytes(b"").tag(sync=True)
    label = traitlets.Unicode("").tag(sync=True)
    drag = traitlets.List([0.0, 0.0, 0, 0]).tag(sync=True)


SHAPE_LOOKS = {
    "true": (0.012, COLORS["grey"]),
    "commanded": (0.006, COLORS["purple"]),
    "estimated": (0.006, COLORS["blue"]),
}
"""Radius [m] and colour of the arm's shapes in the drawing."""

SIDES = ("left", "right")

CAPTION = "grey: true arm, purple: commanded, blue: estimated; drag to turn"

GRAB = 90.0
"""How near to ball or gripper a drag must begin [px]."""


class HandoverExplorer(ipywidgets.VBox):
    """Pictures to drag in, buttons to run, and the arm's three shapes.

    Attributes
    ----------
    session : HandoverSession
    cameras : list of CameraPicture
    run, one_step, again : ipywidgets.Button or ToggleButton
    plant, estimator : ipywidgets.ToggleButtons
    step_size : ipywidgets.FloatSlider
    covers : list of ipywidgets.Checkbox
    view : ArmView
    """

    def __init__(self) -> None:
        self.session = HandoverSession()
        self.cameras = [CameraPicture(layout={"flex": "1 1 380px"}) for _ in STEREO]
        self.run = ipywidgets.ToggleButton(description="run", icon="play", layout={"width": "90px"})
        self.one_step = ipywidgets.Button(description="step", icon="step-forward", layout={"width": "90px"})
        self.again = ipywidgets.Button(description="again", icon="undo", layout={"width": "90px"})
        self.plant = ipywidgets.ToggleButtons(options=["K", "E"], description="arm")
        self.estimator = ipywidgets.ToggleButtons(options=ESTIMATORS, description="eyes")
        for buttons in (self.plant, self.estimator):
            buttons.style.button_width = "70px"
        self.step_size = ipywidgets.FloatSlider(description="alpha", min=0.05, max=1.0, step=0.05, value=0.2)
        self.covers = [
            ipywidgets.Checkbox(description=f"cover the {side} camera", indent=False) for side in SIDES
        ]
        self.message = ipywidgets.HTML()
        self.view = ArmView(layout={"flex": "1 1 420px", "min_width": "320px"})
        self._task: asyncio.Task[None] | None = None
        self._grabbed = ("", -1)
        self._connect()
        hint = ipywidgets.HTML("Drag the ball, or the gripper to lead the arm, in either picture.")
        buttons_row = ipywidgets.HBox([self.run, self.one_step, self.again])
        controls = [buttons_row, self.step_size, self.plant, self.estimator, *self.covers, hint, self.message]
        column = ipywidgets.VBox(controls, layout={"flex": "0 0 340px"})
        pictures = ipywidgets.HBox(self.cameras, layout={"width": "100%", "flex_flow": "row wrap"})
        stage = ipywidgets.HBox([column, self.view], layout={"width": "100%", "flex_flow": "row wrap"})
        super().__init__([pictures, stage])
        self._draw()

    def _connect(self) -> None:
        """Let the controls act."""
        self.run.observe(lambda _: self._wake(), "value")
        self.one_step.on_click(lambda _: self.advance())
        self.again.on_click(lambda _: self.restart())
        self.plant.observe(lambda _: self.restart(), "value")
        self.estimator.observe(lambda _: self.restart(), "value")
        self.step_size.observe(lambda _: self.session.set_step_size(self.step_size.value), "value")
        for i, box in enumerate(self.covers):
            box.observe(lambda _, i=i: self._cover(i), "value")
        for i, camera in enumerate(self.cameras):
            camera.observe(lambda change, i=i: self._drag(i, *change["new"]), "drag")

    def restart(self) -> None:
        """Put the arm back; ball and covers stay."""
        self.session.start(self.plant.value, self.estimator.value, self.step_size.value)
        self._draw()

    def advance(self) -> bool:
        """Take one step, draw it, and return whether the run goes on."""
        goes_on = self.session.step()
        self._draw()
        return goes_on

    def _wake(self) -> None:
        """Run in the background while the button is down; without an event loop take one step."""
        if not self.run.value or (self._task is not None and not self._task.done()):
            return
        try:
            self._task = asyncio.get_running_loop().create_task(self._keep_running())
        except RuntimeError:
            self.advance()
            self.run.value = False

    async def _keep_running(self) -> None:
        while self.run.value and self.advance():
            await asyncio.sleep(PACE)
        self.run.value = False

    def _cover(self, index: int) -> None:
        (self.session.covered.add if self.covers[index].value else self.session.covered.discard)(index)
        self._look()

    def _look(self) -> None:
        """Look again at what has changed, unless the next step does so anyway."""
        if not self.run.value:
            self.session.look()
            self._draw()

    def _drag(self, index: int, x: float, y: float, gesture: int, down: int) -> None:
        """Move what was grabbed when this gesture began: the ball, or the gripper as a guiding hand would."""
        session, pixel = self.session, np.array([x, y])
        if gesture != self._grabbed[1]:
            self._grabbed = self._nearest(index, pixel), gesture
        what = self._grabbed[0]
        if what == "ball":
            session.ball = session.dragged(index, pixel, session.ball)
            self._look()
        elif what == "gripper":
            session.push = session.dragged(index, pixel, session.gripper) if down else None
            if not self.run.value:
                self.advance()

    def _nearest(self, index: int, pixel: Array) -> str:
        """Return whether ball or gripper is near a pixel of a camera, or ""."""
        places = {"ball": self.session.ball, "gripper": self.session.gripper}
        seen = self.session.cameras[index].project(list(places.values()))
        distances = dict(zip(places, np.linalg.norm(seen - pixel, axis=1)))
        nearest = min(distances, key=lambda name: distances[name])
        return nearest if distances[nearest] < GRAB else ""

    def _draw(self) -> None:
        session = self.session
        for camera, picture, side in zip(self.cameras, session.pictures(), SIDES):
            camera.label = f"{side} camera: {session.status()}"
            camera.picture = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes()
        tubes = [tube(points, *SHAPE_LOOKS[name]) for name, points in session.shapes().items()]
        tubes.append(tube([session.ball, session.ball + 1e-3], 0.020, COLORS["green"]))
        wrist = session.observer.scene.wrist(session.state)
        self.view.scene = arm_scene(tubes, wrist, LOW, HIGH, hangs=True, grid=0.1, caption=CAPTION)
        self.message.value = session.status()


def explore() -> HandoverExplorer | Picture:
    """Return the explorer, or, where nobody can move its controls, a picture of a run on its way."""
    if is_live():
        return HandoverExplorer()
    session = HandoverSession()
    for _ in range(8):
        session.step()
    return as_image(explorer_view(session.pictures(), session.shapes(), session.ball, session.status()))
