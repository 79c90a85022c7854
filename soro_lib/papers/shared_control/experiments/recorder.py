"""Writing trials: a file that grows with the trial and is whole at any moment."""

import os
from collections.abc import Sequence
from pathlib import Path

from soro_lib.checks import Vector
from soro_lib.papers.shared_control.experiments.task import Sample
from soro_lib.papers.shared_control.experiments.trial_format import TrialHeader, trial_columns

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
        self.number = next_number(folder)
        while True:
            name = f"{self.number:04d}_{header.paradigm}_{header.environment}.csv.part"
            try:
                self.file = (folder / name).open("x", encoding="utf-8", newline="\n")
                break
            except FileExistsError:
                self.number += 1
        self.path = folder / name
        self.file.write(header.text() + ",".join(trial_columns(len(header.scene.items))) + "\n")
        self.file.flush()

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


def sample_line(
    sample: Sample, aim: Sequence[float], command: Vector, closed: bool, confirmed: bool, goal_item: int
) -> str:
    """One line of a trial file; ``goal_item`` counts from 0, as in the goal machine."""
    numbers = [*aim, *command, closed, confirmed]
    numbers += [*sample.tip, *sample.desired, *sample.goal, *sample.force, sample.magnitude, sample.stiffness]
    item = min(goal_item + 1, len(sample.items))
    texts = [f"{sample.time:.2f}", *(f"{value:.8g}" for value in numbers), sample.motion, sample.phase]
    places = (f"{value:.8g}" for value in sample.items.ravel())
    return ",".join([*texts, str(item), str(sample.item + 1), *places]) + "\n"
