"""Look through the rendered cameras again: ``python -m soro_lib.papers.soft_handover.recordings``.

Writes the recordings of the vision study and of the handovers with rendered images, each with its card, and
the noise figures that the other experiments see through (``vision_noise.toml``). The jobs run in parallel;
a file is written when it is complete, so an interrupted run leaves whole files only. The same seed and the
locked packages give the same bytes, whatever the number of jobs.
"""

import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, wait
from dataclasses import dataclass
from itertools import product
from multiprocessing import Manager
from pathlib import Path
from typing import Any

import cv2
import pandas as pd
from rich.progress import Progress

from soro_lib.papers.soft_handover.calibration import plant_k
from soro_lib.papers.soft_handover.experiments.rendered_handovers import controllers, rendered_block
from soro_lib.papers.soft_handover.experiments.vision import (
    SEED,
    NoiseSources,
    Report,
    accuracy,
    noise_figures,
    still_looks,
)
from soro_lib.papers.soft_handover.experiments.vision_limits import degradations, image_faults, occlusion
from soro_lib.papers.soft_handover.world.plant import ElasticPlant
from soro_lib.project import data_directory
from soro_lib.replication.datacards import generator_options, read_card, write_card
from soro_lib.sensing.handover_vision import ESTIMATORS

SLUG = "soft_handover"
GENERATOR = "soro_lib.papers.soft_handover.recordings"
POSES = {
    "vision_accuracy": 200,
    "vision_occlusion": 200,
    "vision_degradations": 40,
    "vision_image_faults": 40,
}
BLOCKS = 2
LOOKS_PER_BLOCK = 1200
"""About what a block takes, for the progress."""

LABELS = {
    "pose": "[-] number of the random pose",
    "estimator": "[-] pose estimator: thesis, gated, joint",
    **{
        f"{what}_{axis}_mm": f"[mm] error of the {what}, component {axis} in arm_base"
        for what in ("wrist", "ball")
        for axis in "xyz"
    },
    **{f"direction_{axis}": f"[-] error of the unit direction, component {axis}" for axis in "xyz"},
    "wrist_mm": "[mm] distance of estimated and true wrist",
    "direction_deg": "[deg] angle between estimated and true direction",
    "claimed_mm": "[mm] standard deviation per component that the detection claims",
    "gripper_mm": "[mm] distance of estimated and true gripper point",
    "ball_mm": "[mm] distance of estimated and true ball",
    "gap_mm": "[mm] distance of the cameras' rays to the ball",
    "markers": "[-] markers seen, each camera's counted",
    "flipped": "[-] share of markers whose better solution is the wrong one",
    "condition": "[-] what is switched on or off",
    "camera_system": "[-] estimator, or three cameras with the joint one",
    "look": "[-] number of the look at the still arm",
    "rule": "[-] how the ball is measured",
    "visible": "[-] visible share of the ball, the smaller of both cameras",
    "degradation": "[-] what is wrong with the pictures",
    "fault": "[-] what is wrong with the pictures",
    "gripper": "[-] located (within 15 mm), refused, wrong",
    "ball": "[-] located (within 15 mm), refused, wrong",
    "status": "[-] what the vision says",
    "plant": "[-] K or E",
    "controller": "[-] settings of the controller",
    "alpha": "[-] step size",
    "block": "[-] number of the block; one calibration each",
    "run": "[-] number of the run in its block",
    "step": "[-] number of the look",
    "location": "[-] where the hand holds the ball",
    "steps": "[-] steps until the gripper closed",
    "closed": "[-] whether the gripper closed",
    "success": "[-] whether the true ball was in the true gripper",
    "miss_mm": "[mm] distance of true gripper point and true ball",
    "overshoot_mm": "[mm] farthest past the ball, sideways",
    "reason": "[-] why the arm gave up",
    "error_mm": "[mm] error to the goal, six numbers together",
    "measured_mm": "[mm] measured gripper from its calibrated place",
    "commanded_mm": "[mm] gripper of q_sys from its calibrated place",
    "commanded_gap_mm": "[mm] gripper of q_sys from the measured one",
    "estimated_mm": "[mm] gripper of q_est from its calibrated place",
    "estimated_gap_mm": "[mm] gripper of q_est from the measured one",
    "estimate_residual_mm": "[mm] residual of the state optimisation",
    "true_mm": "[mm] true gripper from its calibrated place",
    "descending": "[-] 1 in the second stage",
}
"""Meaning of the columns of all recordings."""


@dataclass(frozen=True)
class Job:
    """A part of the work that gives one or two tables.

    Attributes
    ----------
    name : str
        For the progress; the recording's, where the job gives all of it.
    arguments : tuple
        What the study is called with.
    looks : int
        About how much it will report.
    """

    name: str
    arguments: tuple[Any, ...]
    looks: int


STUDIES: dict[str, Callable[..., pd.DataFrame]] = {
    "vision_accuracy": accuracy,
    "vision_occlusion": occlusion,
    "vision_degradations": degradations,
    "vision_image_faults": image_faults,
}

DESCRIPTIONS = {
    "vision_accuracy": "Errors of arm and ball at random poses under every condition of the error budget.",
    "vision_still_looks": "Errors of repeated looks at still arms, each pose with its own calibration.",
    "vision_occlusion": "Errors of the ball against how much of it is visible.",
    "vision_degradations": "Errors of arm and ball in blurred, dark, bright and noisy pictures.",
    "vision_image_faults": "What becomes of arm and ball under faults of the pictures.",
    "rendered_runs": "Handovers through rendered images, one row per run.",
    "rendered_traces": "Handovers through rendered images, one row per look.",
}


def jobs(small: bool = False) -> list[Job]:
    """Return all jobs, the longest first; in the small form two handovers, and two poses of all else."""
    plants = ("K", "E")
    eyes = list(zip(plants, ESTIMATORS)) if small else list(product(plants, ESTIMATORS))
    handovers = [
        Job(
            f"handovers, plant {plant}, {estimator}, block {block}",
            (plant, estimator, block, ["best"] if small else list(controllers())),
            LOOKS_PER_BLOCK,
        )
        for plant, estimator in eyes
        for block in range(1 if small else BLOCKS)
    ]
    poses = dict.fromkeys(POSES, 2) if small else POSES
    still = NoiseSources(poses=2) if small else NoiseSources()
    return [
        *handovers,
        *(Job(name, (count,), count) for name, count in poses.items()),
        Job("vision_still_looks", (still,), still.poses),
    ]


def run_job(job: Job, progress: Any = None) -> dict[str, pd.DataFrame]:
    """Return the tables of a job by recording; ``progress[job.name]`` counts its looks."""
    cv2.setNumThreads(1)
    done = 0

    def report(looks: int) -> None:
        nonlocal done
        done += looks
        if progress is not None:
            progress[job.name] = done

    if job.name in STUDIES:
        return {job.name: STUDIES[job.name](*job.arguments, SEED, report=report)}
    if job.name == "vision_still_looks":
        return {job.name: still_looks(job.arguments[0], SEED, report)}
    plant, estimator, block, names = job.arguments
    return _handovers(plant, estimator, block, names, report)


def _handovers(
    plant: str, estimator: str, block: int, names: Sequence[str], report: Report
) -> dict[str, pd.DataFrame]:
    arm = plant_k() if plant == "K" else ElasticPlant()
    settings = {name: controllers()[name] for name in names}
    runs, traces = rendered_block(plant, arm, estimator, block, SEED, report, settings)
    return {"rendered_runs": runs, "rendered_traces": traces}


def write_table(name: str, table: pd.DataFrame, directory: Path) -> Path:
    """Write a table and its card, whole or not at all."""
    path = directory / f"{name}.csv.gz"
    unfinished = path.with_suffix(".part")
    table.to_csv(
        unfinished,
        index=False,
        float_format="%.4f",
        lineterminator="\n",
        compression={"method": "gzip", "compresslevel": 9, "mtime": 0},
    )
    os.replace(unfinished, path)
    columns = {name: LABELS[name] for name in table.columns}
    write_card(path, description=DESCRIPTIONS[name], columns=columns, generator=GENERATOR, seed=SEED)
    return path


NOISE_COMMENTS = {
    "thesis": "average over the markers of both cameras",
    "gated": "consensus among both solutions of every marker",
    "joint": "one robust fit of the known ring to all corners",
    "three cameras": "joint fit with a camera from the side",
}


def write_noise(figures: dict[str, dict[str, float]], poses: int, directory: Path) -> Path:
    """Write the noise figures in the format that `load_vision_noise` reads."""
    lines = [
        "# Error budgets of the camera system, per component [m], of the unit direction [-].",
        "# Jitter changes from look to look at a still arm; bias stays, and changes as the arm moves.",
        f'source = "measured on rendered images of {poses} still arms by {GENERATOR}, seed {SEED}"',
    ]
    for estimator, values in figures.items():
        key = f'"{estimator}"' if " " in estimator else estimator
        lines += ["", f"[estimator.{key}.noise]  # {NOISE_COMMENTS[estimator]}"]
        lines += [f"{name} = {value:.6f}" for name, value in values.items()]
    path = directory / "vision_noise.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def main(arguments: list[str] | None = None) -> int:
    """Record everything, show the progress and say what was written."""
    parser = generator_options("Look through the rendered cameras again.", data_directory(SLUG))
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes at once")
    parser.add_argument("--only", choices=("vision", "handovers"), help="a part of the recordings")
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    todo = [job for job in jobs(options.small) if options.only in (None, part_of(job))]
    with Manager() as manager, ProcessPoolExecutor(options.jobs) as pool, Progress() as progress:
        counts = manager.dict()
        bars = {job.name: progress.add_task(job.name, total=job.looks) for job in todo}
        futures = [pool.submit(run_job, job, counts) for job in todo]
        while wait(futures, timeout=0.5).not_done:
            for name, bar in bars.items():
                progress.update(bar, completed=counts.get(name, 0))
        results = [future.result() for future in futures]
    names = dict.fromkeys(name for result in results for name in result)
    tables = {
        name: pd.concat([result[name] for result in results if name in result], ignore_index=True)
        for name in names
    }
    written = [write_table(name, table, options.output) for name, table in tables.items()]
    for path in written:
        print(f"{path.name}  {read_card(path)['sha256']}")
    if "vision_still_looks" in tables:
        still = tables["vision_still_looks"]
        figures = noise_figures(still, tables["vision_occlusion"])
        print(write_noise(figures, int(still["pose"].nunique()), options.output).name)
    return 0


def part_of(job: Job) -> str:
    """Return which part of the recordings a job belongs to."""
    return "vision" if job.name.startswith("vision") else "handovers"


if __name__ == "__main__":
    sys.exit(main())
