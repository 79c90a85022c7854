"""The trials of simulated operators that come with the workbook, and their generator.

``python -m soro_lib.papers.shared_control.recordings`` writes them again. The format is that of trials driven
by hand, see `soro_lib.papers.shared_control.experiments.trial_format`.
"""

import gzip
from pathlib import Path

import numpy as np

from soro_lib.papers.shared_control.experiments.demonstrations import KINDS, draw_operators
from soro_lib.papers.shared_control.experiments.recorder import TrialRecorder, recordable, sample_line
from soro_lib.papers.shared_control.experiments.simulation import TIME_LIMIT
from soro_lib.papers.shared_control.experiments.task import operator_view
from soro_lib.papers.shared_control.experiments.trial_format import TrialHeader, trial_columns
from soro_lib.papers.shared_control.world.hand import hand_command
from soro_lib.papers.shared_control.world.loop import operator_start, operator_step, picture_buffer
from soro_lib.papers.shared_control.world.people import DEVICE_SCALE, SAMPLE_TIME, Operator
from soro_lib.papers.shared_control.world.vectors import product
from soro_lib.project import data_directory
from soro_lib.replication.datacards import generator_options, write_card


def record_operator(folder: Path, header: TrialHeader, operator: Operator) -> Path:
    """Let a simulated operator do a trial and record it as one driven by hand is recorded.

    The operator has a random stream of its own, so that the recording can be replayed without him.

    Returns
    -------
    pathlib.Path
        The finished file.
    """
    task, recorder = header.task(), TrialRecorder(folder, header)
    rng = np.random.default_rng(np.random.SeedSequence([*header.seed, 1]))
    rule, start = operator.rule(), header.scene.start
    human, pictures = operator_start(start), picture_buffer(rule, start)
    while not task.done and task.state.sample * SAMPLE_TIME < TIME_LIMIT:
        view = operator_view(task.rule, task.state, task.memory.items)
        human = operator_step(rule, human, pictures, view, rng)
        aim, command = product(DEVICE_SCALE, human.movement.intention), recordable(hand_command(human.hand))
        closed, reported = human.decision.closed, human.decision.reported
        sample = task.step(command, closed, reported)
        recorder.write([sample_line(sample, aim, command, closed, reported, task.state.goal.item)])
    return recorder.finish()


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
            generator="soro_lib.papers.shared_control.recordings",
            seed=SHIPPED_SEED,
        )
        written.append(packed)
    return written


if __name__ == "__main__":
    # The trials take seconds: their small form is the whole one.
    parser = generator_options("Record the simulated operators again.", data_directory("shared_control"))
    write_shipped_trials(parser.parse_args().output / "trials")
