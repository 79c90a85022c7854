"""Writing trials: a file that grows with the trial and is whole at any moment."""

import gzip
import os
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import TextIO

import numpy as np

from soro_lib.checks import Vector
from soro_lib.papers.shared_control.experiments.demonstrations import KINDS, draw_operators
from soro_lib.papers.shared_control.experiments.simulation import TIME_LIMIT, next_place
from soro_lib.papers.shared_control.experiments.task import Sample, Trial
from soro_lib.papers.shared_control.experiments.trial_format import TrialHeader, trial_columns
from soro_lib.papers.shared_control.world.hand import hand_command
from soro_lib.papers.shared_control.world.loop import View, operator_start, operator_step, picture_buffer
from soro_lib.papers.shared_control.world.people import DEVICE_SCALE, Operator
from soro_lib.papers.shared_control.world.plant import NOTHING, SAMPLE_TIME
from soro_lib.replication.datacards import write_card

RESOLUTION = 6
"""Decimals of a command [m]: what is written is what the arm was given, so that a trial can be replayed."""


def recordable(command: Sequence[float]) -> Vector:
    """A command as the file will hold it [m]; give this one to the task."""
    x, y, z = (round(float(value), RESOLUTION) for value in command)
    return (x, y, z)


def next_number(folder: Path) -> int:
    """The number that the next trial recorded to a folder will bear."""
    taken = [path.name.partition("_")[0] for path in folder.iterdir()] if folder.is_dir() else []
    return max((int(name) for name in taken if name.isdigit()), default=0) + 1


class TrialRecorder:
    """A trial file under way: ``<name>.csv.part``, which `finish` turns into ``<name>.csv``.

    Every `write` is followed by a flush: what was written survives the death of this process.

    Parameters
    ----------
    folder : Path
        Made where there is none.
    header : TrialHeader

    Attributes
    ----------
    path : Path
        Where the trial lies now. Names are counted on, nothing is ever overwritten.

    Raises
    ------
    OSError
        If the folder cannot be written to.
    """

    def __init__(self, folder: Path, header: TrialHeader) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.header = header
        self.file = self._create(folder)
        self.file.write(header.text() + ",".join(trial_columns(len(header.scene.items))) + "\n")
        self.file.flush()

    def _create(self, folder: Path) -> TextIO:
        """Open a file with the next free number."""
        number = next_number(folder)
        while True:
            name = f"{number:04d}_{self.header.paradigm}_{self.header.environment}.csv.part"
            try:
                file = (folder / name).open("x", encoding="utf-8", newline="\n")
            except FileExistsError:
                number += 1
                continue
            self.number, self.path = number, folder / name
            return file

    def write(self, lines: Sequence[str]) -> None:
        """Append samples, as `sample_line` gives them, and hand them to the operating system."""
        self.file.write("".join(lines))
        self.file.flush()

    def finish(self) -> Path:
        """The trial is over: put the file to disk and give it its final name, in one step."""
        self.file.flush()
        os.fsync(self.file.fileno())
        self.file.close()
        final = self.path.with_suffix("")
        os.replace(self.path, final)
        self.path = final
        return final

    def close(self) -> None:
        """Leave the trial as it is, cut off."""
        self.file.close()

    def __enter__(self) -> "TrialRecorder":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not self.file.closed:
            self.close()


def sample_line(
    sample: Sample, aim: Sequence[float], command: Vector, closed: bool, confirmed: bool, goal_item: int
) -> str:
    """One line of a trial file; ``goal_item`` counts from 0, as in the goal machine."""
    numbers = [
        *aim,
        *command,
        int(closed),
        int(confirmed),
        *sample.tip,
        *sample.desired,
        *sample.goal,
        *sample.force,
        sample.magnitude,
        sample.stiffness,
    ]
    item = min(goal_item + 1, len(sample.items))
    texts = [f"{sample.time:.2f}", *(f"{value:.8g}" for value in numbers), sample.motion, sample.phase]
    places = (f"{value:.8g}" for value in sample.items.ravel())
    return ",".join([*texts, str(item), str(sample.item + 1), *places]) + "\n"


# --- Trials of simulated operators, in the same format ----------------------------------------------------


def record_operator(folder: Path, header: TrialHeader, operator: Operator) -> Path:
    """Let a simulated operator do a trial and record it as one driven by hand is recorded.

    The operator has a random stream of its own, so that the recording can be replayed without him.

    Returns
    -------
    pathlib.Path
        The finished file.
    """
    task = header.task()
    rng = np.random.default_rng(np.random.SeedSequence([*header.seed, 1]))
    rule, start = operator.rule(), header.scene.start
    human, pictures = operator_start(start), picture_buffer(rule, start)
    with TrialRecorder(folder, header) as recorder:
        while not task.done and task.state.sample * SAMPLE_TIME < TIME_LIMIT:
            human = operator_step(rule, human, pictures, operator_view(task), rng)
            aim = tuple(scale * hand for scale, hand in zip(DEVICE_SCALE, human.movement.intention))
            command = recordable(hand_command(human.hand))
            closed, reported = human.decision.closed, human.decision.reported
            sample = task.step(command, closed, reported)
            recorder.write([sample_line(sample, aim, command, closed, reported, task.state.goal.item)])
        return recorder.finish()


def operator_view(task: Trial) -> View:
    """What a simulated operator sees and feels of a trial."""
    state, rule = task.state, task.rule
    wanted = next_place(rule, state, task.memory.items)
    held = state.gripper.item != NOTHING
    return View(state.plant.tip, state.desired, wanted, state.force, held, rule.automation)


SHIPPED = (
    ("full_teleoperation", "simulated", "expert"),
    ("assist_as_needed", "simulated", "naive"),
    ("fixed_assistance", "simulated", "expert"),
    ("msae", "simulated", "naive"),
    ("asme", "simulated", "naive"),
    ("mostly_autonomous", "simulated", "expert"),
    ("assist_as_needed", "real", "expert"),
    ("mostly_autonomous", "real", "naive"),
)
"""Paradigm, environment and kind of operator of the trials that come with the workbook."""

SHIPPED_SEED = 20260


def write_shipped_trials(folder: Path) -> list[Path]:
    """Record the trials that come with the workbook, compressed, each with its data card."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.csv*"):
        old.unlink()
    written = []
    for number, (paradigm, environment, kind) in enumerate(SHIPPED):
        operator = draw_operators(kind, len(SHIPPED), SHIPPED_SEED)[number]
        header = TrialHeader(
            paradigm,
            environment,
            operator=f"simulated {kind} {number + 1}",
            kind=kind,
            seed=(SHIPPED_SEED, 3, KINDS.index(kind), number),
            hand_stiffness=operator.hand_stiffness,
        )
        plain = record_operator(folder, header, operator)
        packed = plain.with_suffix(".csv.gz")
        packed.write_bytes(gzip.compress(plain.read_bytes(), mtime=0))
        plain.unlink()
        write_card(
            packed,
            description=f"Simulated {kind} operator, no person was recorded: {paradigm}, {environment} arm",
            columns=trial_columns(len(header.scene.items)),
            generator="soro_lib.papers.shared_control.experiments.recorder.write_shipped_trials",
            seed=SHIPPED_SEED,
        )
        written.append(packed)
    return written
