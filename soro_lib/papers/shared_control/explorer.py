"""Be the operator: the reader drives the arm through the pick-and-place task, and the trial is recorded.

The browser sends time-stamped positions of the pointer and the states of the keys; the task advances by what
has elapsed between them, 100 samples to a second of these stamps. No other clock enters: a slow kernel or a
busy browser delays a trial but cannot change it, and the recorded commands replay to the same trajectory.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import anywidget
import ipywidgets
import numpy as np
import traitlets
from IPython.display import Image
from numpy.typing import ArrayLike

from soro_lib.checks import Vector, positive
from soro_lib.controllers.shared_control import PARADIGMS
from soro_lib.controllers.shared_control.goal_selection import PHASES
from soro_lib.papers.shared_control.experiments import recorder
from soro_lib.papers.shared_control.experiments.simulation import METRICS, TIME_LIMIT, trial_metrics
from soro_lib.papers.shared_control.experiments.trial_format import VIEWS, TrialHeader
from soro_lib.papers.shared_control.experiments.trials import load_trials
from soro_lib.papers.shared_control.figures.paper import fig02_task
from soro_lib.papers.shared_control.world import vectors
from soro_lib.papers.shared_control.world.people import DEVICE_SCALE, EXPERT
from soro_lib.papers.shared_control.world.plant import NOTHING, SAMPLE_TIME, nearest_item
from soro_lib.project import data_directory, trials_directory
from soro_lib.replication import as_image
from soro_lib.replication.frontend import is_live

LOW, HIGH = (-0.26, -0.33, 0.0), (0.56, 0.33, 0.72)
"""Corners of the workspace that is shown and can be aimed at, base frame [m]."""

TABLE = 0.67
"""Height of the table below the base [m]."""

HAND_STIFFNESSES = (50.0, 75.0, 100.0, 150.0, 225.0, 300.0, 450.0, 600.0)
"""Hands to choose from [N/m]: hardly holding on to gripping firmly."""

SHIPPED_TRIALS = data_directory("shared_control") / "trials"
LONGEST_GAP = 5.0
"""Longest time between two inputs that is believed [s]."""


@dataclass
class CompliantHand:
    """A hand on the haptic device: it aims at a place and gives to the force like a spring and damper.

    Its mass is left out: the reader's own arm has one.

    Parameters
    ----------
    stiffness : float
        [N/m].
    damping : float
        [N s/m].
    friction : float
        Force that the device swallows [N].
    """

    stiffness: float = EXPERT.hand_stiffness
    damping: float = EXPERT.hand_damping
    friction: float = EXPERT.device_friction

    def __post_init__(self) -> None:
        positive("stiffness", self.stiffness)
        self.give = vectors.ZERO

    def command(self, aim: Vector, force: Vector) -> Vector:
        """Position that the device commands after one sample [m]: the aim, and what the hand gives, scaled.

        Parameters
        ----------
        aim : tuple of float
            Where the hand would command the tip to without a force, base frame [m].
        force : tuple of float
            Guidance force on the hand [N].
        """
        share = SAMPLE_TIME / (self.damping / self.stiffness + SAMPLE_TIME)
        rest = vectors.scaled(1.0 / self.stiffness, vectors.after_friction(force, self.friction))
        self.give = vectors.towards(self.give, share, rest)
        return recorder.recordable(vectors.moved(aim, 1.0, vectors.product(DEVICE_SCALE, self.give)))


@dataclass(frozen=True)
class Input:
    """What the browser reports of the operator at one moment.

    Parameters
    ----------
    time : float
        Since the start of the trial [s].
    aim : tuple of float
        Where the pointer and the wheel point, base frame [m].
    closed, confirmed : bool
        Whether the gripper is to be closed, and whether an item is reported in it.
    """

    time: float
    aim: Vector
    closed: bool
    confirmed: bool

    @classmethod
    def parse(cls, values: Any) -> "Input | None":
        """Read time, x, y, z, closed, confirmed as sent; None where they are not six finite numbers.

        An aim outside the workspace is moved to its border.
        """
        if not isinstance(values, Sequence) or len(values) != 6:
            return None
        if not all(isinstance(value, int | float) and math.isfinite(value) for value in values):
            return None
        time, *place, closed, confirmed = values
        x, y, z = np.clip(place, LOW, HIGH).tolist()
        return cls(float(time), (x, y, z), bool(closed), bool(confirmed))


class DrivenTrial:
    """A trial under way: inputs arrive in batches, the task follows, every sample is recorded.

    Parameters
    ----------
    folder : Path
        Where the trial is recorded.
    header : TrialHeader
    """

    def __init__(self, folder: Path, header: TrialHeader) -> None:
        self.header = header
        self.task = header.task()
        self.hand = CompliantHand(header.hand_stiffness)
        self.recorder = recorder.TrialRecorder(folder, header)
        self.input = Input(0.0, header.scene.start, False, False)
        self.skipped = 0
        self.status = "armed"

    @property
    def time(self) -> float:
        """Time since the start [s]."""
        return SAMPLE_TIME * self.task.state.sample

    @property
    def under_way(self) -> bool:
        """Whether further inputs move the arm."""
        return self.status in ("armed", "running")

    def advance(self, batch: Sequence[Any]) -> None:
        """Let the task run up to the last input of a batch; each input holds until the next one.

        A trial that is over stays as it is. Inputs that are not six finite numbers, do not follow the last
        one, or follow it after more than `LONGEST_GAP` are skipped and counted.

        Raises
        ------
        OSError
            If the recording cannot be written.
        """
        if not self.under_way:
            return
        lines: list[str] = []
        for values in batch:
            given = Input.parse(values)
            if given is None or not 0 <= given.time - self.input.time <= LONGEST_GAP:
                self.skipped += 1
                continue
            while self.under_way and self.time + SAMPLE_TIME <= given.time + 1e-9:
                lines.append(self._step())
            self.input = given
        self.recorder.write(lines)
        if self.status in ("done", "time out"):
            self.recorder.finish()

    def _step(self) -> str:
        """One sample of the task, and its line in the recording."""
        now = self.input
        command = self.hand.command(now.aim, self.task.state.force)
        sample = self.task.step(command, now.closed, now.confirmed)
        late = self.time >= TIME_LIMIT - SAMPLE_TIME / 2
        self.status = "done" if sample.done else "time out" if late else "running"
        item = self.task.state.goal.item
        return recorder.sample_line(sample, now.aim, command, now.closed, now.confirmed, item)

    def stop(self, status: str = "stopped") -> None:
        """Leave the trial; its recording stays, marked as cut off."""
        if self.under_way:
            self.status = status
            with suppress(OSError):
                self.recorder.close()

    def metrics(self) -> dict[str, float | None]:
        """The metrics so far, `METRICS`; None for what is not yet known."""
        if not self.task.state.sample:
            return dict.fromkeys(METRICS)
        values = trial_metrics(self.task.rule, self.task.state, self.task.memory)
        return {name: value if math.isfinite(value) else None for name, value in zip(METRICS, values)}

    def reachable(self) -> int:
        """Number of the item that the gripper would catch now, `NOTHING` for none."""
        state, gripper = self.task.state, self.task.rule.gripper
        point = state.desired if gripper.from_command else state.plant.tip
        item, distance = nearest_item(self.task.memory.items, point)
        return item if state.gripper.item == NOTHING and distance < gripper.reach else NOTHING

    def frame(self) -> dict[str, Any]:
        """What the page shows of the trial."""
        state = self.task.state
        return {
            "status": self.status,
            "time": round(self.time, 2),
            "tip": _rounded(state.plant.tip),
            "give": _rounded(vectors.product(DEVICE_SCALE, self.hand.give)),
            "desired": _rounded(state.desired),
            "goal": _rounded(state.goal.goal),
            "force": _rounded(state.force),
            "items": _rounded(self.task.memory.items),
            "held": state.gripper.item,
            "reachable": self.reachable(),
            "phase": PHASES[state.goal.phase],
            "goalItem": min(state.goal.item, len(self.header.scene.items) - 1),
            "stiffness": round(state.assist.stiffness, 1),
            "metrics": self.metrics(),
            "file": str(self.recorder.path.resolve()),
            "skipped": self.skipped,
        }


class OperatorView(anywidget.AnyWidget):
    """The two views of the task in the browser, where pointer, wheel and keys are read."""

    _esm = Path(__file__).with_name("explorer.js")
    scene = traitlets.Dict().tag(sync=True)
    frame = traitlets.Dict().tag(sync=True)


class OperatorExplorer(ipywidgets.VBox):
    """Be the operator: choose a paradigm, an arm and a force law, and do the task by hand.

    Parameters
    ----------
    folder : str or Path, optional
        Where trials are recorded; ``build/trials`` where none is given.
    operator : str
        Name that stands in the recordings.
    seed : int
        With the number of the trial in the folder it seeds what the real arm leaves to chance.

    Attributes
    ----------
    paradigm, environment, law, sight : ipywidgets.Dropdown
        ``sight``: from above and front, or through a camera as the simulated operators see.
    stiffness : ipywidgets.SelectionSlider
        Of the hand [N/m].
    view : OperatorView
    trial : DrivenTrial or None
        The one under way, or the last one.
    """

    def __init__(self, folder: str | Path | None = None, operator: str = "reader", seed: int = 1) -> None:
        self.folder = Path(folder) if folder is not None else trials_directory()
        self.operator, self.seed = operator, seed
        self.trial: DrivenTrial | None = None
        self.runs = 0
        titles = [(value.title, name) for name, value in PARADIGMS.items()]
        self.paradigm = _choice("paradigm", titles, "340px")
        self.environment = _choice("arm", ["simulated", "real"], "170px")
        self.law = _choice("force law", ["printed", "program"], "190px")
        self.stiffness = ipywidgets.SelectionSlider(
            description="hand [N/m]", options=HAND_STIFFNESSES, value=EXPERT.hand_stiffness,
            layout={"width": "280px"}, style={"description_width": "80px"},
        )  # fmt: skip
        self.sight = _choice("view", VIEWS, "230px")
        self.controls = (self.paradigm, self.environment, self.law, self.sight, self.stiffness)
        self.view = OperatorView(layout={"width": "100%"})
        self.view.on_msg(lambda _, content, __: self.receive(content))
        for control in self.controls:
            control.observe(lambda _: self._show(), "value")
        row = ipywidgets.HBox(self.controls, layout={"flex_flow": "row wrap"})
        super().__init__([row, self.view])
        self._show()

    def receive(self, message: dict[str, Any]) -> None:
        """Take a message of the page: start, stop, or a batch of inputs for the trial under way."""
        kind = message.get("type")
        try:
            if kind == "start":
                self.start()
            elif kind == "stop":
                self.stop()
            elif kind == "inputs" and self.trial and message.get("run") == self.runs:
                self.trial.advance(message.get("inputs", []))
                self._show(seq=message.get("seq"))
        except OSError as error:
            if self.trial and self.trial.under_way:
                self.trial.stop("failed")
            self._show(message=f"the trial cannot be recorded: {error}")

    def start(self) -> DrivenTrial:
        """Begin a trial as chosen; one that is under way is cut off.

        Raises
        ------
        OSError
            If the folder cannot be written to.
        """
        self.stop()
        self.runs += 1
        header = TrialHeader(
            self.paradigm.value,
            self.environment.value,
            operator=self.operator,
            force_law=self.law.value,
            seed=(self.seed, recorder.next_number(self.folder)),
            hand_stiffness=float(self.stiffness.value),
            view=self.sight.value,
        )
        self.trial = DrivenTrial(self.folder, header)
        self._show()
        return self.trial

    def stop(self) -> None:
        """Cut off the trial under way, if there is one."""
        if self.trial and self.trial.under_way:
            self.trial.stop()
            self._show()

    def _show(self, **more: Any) -> None:
        """Draw the trial, or the task before it."""
        under_way = self.trial is not None and self.trial.under_way
        for control in self.controls:
            control.disabled = under_way
        self.law.disabled |= PARADIGMS[self.paradigm.value].assistance == "none"
        header = TrialHeader(self.paradigm.value, self.environment.value, operator=self.operator)
        if not under_way:
            self.view.scene = self._scene(header)
        idle: dict[str, Any] = {"status": "ready", "tip": header.scene.start, "items": header.scene.items}
        frame = self.trial.frame() if self.trial else idle
        self.view.frame = {**frame, "run": self.runs, **more}

    def _scene(self, header: TrialHeader) -> dict[str, Any]:
        """What stays as it is during a trial."""
        rule = header.settings().rule()
        return {
            "low": LOW,
            "high": HIGH,
            "table": TABLE,
            "start": header.scene.start,
            "targets": header.scene.targets,
            "title": PARADIGMS[header.paradigm].title,
            "automation": rule.automation,
            "guided": rule.assistance != 0,
            "confirms": rule.confirmed_by_hand,
            "phases": [name for name in PHASES[1:-1] if rule.goals.lift or "lift" not in name],
            "elevation": EXPERT.view_elevation if self.sight.value == "camera" else 0.0,
            "lifted": rule.goals.lifted_height if rule.goals.lift else None,
            "folder": str(self.folder),
        }


def explore(folder: str | Path | None = None) -> OperatorExplorer | Image:
    """Return the explorer, or, where nobody can drive, a picture of a recorded trial."""
    if is_live():
        return OperatorExplorer(folder)
    shown = {"Full Teleoperation": 0, "Assist-as-Needed": 1, "Mostly Autonomous": 5}
    trials = load_trials(SHIPPED_TRIALS)
    traces = {title: trials[number].trace for title, number in shown.items()}
    return as_image(fig02_task(traces, trials[0].header.scene))


def trials_to_show(folder: str | Path | None = None) -> Path:
    """Return the folder with the reader's trials where there are any, else that of the shipped ones.

    Parameters
    ----------
    folder : str or Path, optional
        Where the reader's trials lie; ``build/trials`` where none is given. A run without a reader shows the
        shipped trials unless a folder is given, so that its figures do not depend on who has played before.

    Raises
    ------
    FileNotFoundError
        A folder is given that does not exist.
    """
    if folder is not None:
        if not Path(folder).is_dir():
            raise FileNotFoundError(f"no such folder of trials: {folder}")
        return Path(folder)
    own = trials_directory()
    driven = is_live() and own.is_dir() and load_trials(own)
    return own if driven else SHIPPED_TRIALS


def _choice(description: str, options: Sequence[Any], width: str) -> ipywidgets.Dropdown:
    return ipywidgets.Dropdown(
        description=description, options=options, layout={"width": width}, style={"description_width": "70px"}
    )


def _rounded(values: ArrayLike) -> list:
    """Nested lists rounded to 10 micrometres or micronewtons: all that a drawing needs."""
    return np.asarray(values, dtype=float).round(5).tolist()
