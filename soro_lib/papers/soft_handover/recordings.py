"""Look through the rendered cameras again: ``python -m soro_lib.papers.soft_handover.recordings``.

Writes the recordings of the vision study and of the handovers with rendered images, each with its card, and
the noise figures that the other experiments see through (``vision_noise.toml``). The jobs run in parallel;
a file is written when it is complete, so an interrupted run leaves whole files only. The same seed and the
locked packages give the same bytes, whatever the number of jobs.
"""

import os
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, wait
from dataclasses import dataclass
from functools import partial
from itertools import product
from multiprocessing import Manager
from pathlib import Path
from typing import Any

import cv2
import pandas as pd
from rich.progress import Progress

from soro_lib.papers.soft_handover.calibration import plant_k
from soro_lib.papers.soft_handover.experiments.rendered_handovers import BEST, CONTROLLERS, rendered_block
from soro_lib.papers.soft_handover.experiments.vision import SEED, accuracy, noise_figures, still_looks
from soro_lib.papers.soft_handover.experiments.vision_limits import degradations, image_faults, occlusion
from soro_lib.papers.soft_handover.world.plant import ElasticPlant
from soro_lib.project import data_directory
from soro_lib.replication.datacards import generator_options, read_card, write_card
from soro_lib.sensing.handover_vision import ESTIMATORS

SLUG = "soft_handover"
GENERATOR = "soro_lib.papers.soft_handover.recordings"
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


STUDIES: dict[str, tuple[Callable[..., pd.DataFrame], int]] = {
    "vision_accuracy": (accuracy, 200),
    "vision_occlusion": (occlusion, 200),
    "vision_degradations": (degradations, 40),
    "vision_image_faults": (image_faults, 40),
    "vision_still_looks": (still_looks, 40),
}
"""What the recordings of single looks are made by, and from how many poses."""

DESCRIPTIONS = {
    "vision_accuracy": "Errors of arm and ball at random poses under every condition of the error budget.",
    "vision_still_looks": "Errors of repeated looks at still arms, each pose with its own calibration.",
    "vision_occlusion": "Errors of the ball against how much of it is visible.",
    "vision_degradations": "Errors of arm and ball in blurred, dark, bright and noisy pictures.",
    "vision_image_faults": "What becomes of arm and ball under faults of the pictures.",
    "rendered_runs": "Handovers through rendered images, one row per run.",
    "rendered_traces": "Handovers through rendered images, one row per look.",
}


@dataclass(frozen=True)
class Job:
    """A part of the work.

    Attributes
    ----------
    name : str
        For the progress.
    recordings : tuple of str
        What the study gives a table for each of, or a part of it.
    study : callable
        Returns the table, or the tables; is told whom to report to.
    looks : int
        About how much it will report.
    """

    name: str
    recordings: tuple[str, ...]
    study: Callable[..., Any]
    looks: int

    def run(self, progress: Any) -> dict[str, pd.DataFrame]:
        """Return the tables by recording; ``progress[name]`` counts the looks."""
        cv2.setNumThreads(1)
        progress[self.name] = 0

        def report(looks: int) -> None:
            progress[self.name] += looks

        tables = self.study(report=report)
        return dict(zip(self.recordings, tables if isinstance(tables, tuple) else (tables,)))


def jobs(small: bool = False) -> list[Job]:
    """Return all jobs, the longest first; in the small form two handovers, and two poses of all else."""
    plants = {"K": plant_k(), "E": ElasticPlant()}
    eyes = list(zip(plants, ESTIMATORS)) if small else list(product(plants, ESTIMATORS))
    handovers = [
        Job(
            f"handovers, plant {plant}, {estimator}, block {block}",
            ("rendered_runs", "rendered_traces"),
            partial(
                rendered_block, plant, plants[plant], estimator, block, SEED, BEST if small else CONTROLLERS
            ),
            LOOKS_PER_BLOCK,
        )
        for plant, estimator in eyes
        for block in range(1 if small else BLOCKS)
    ]
    looks = [
        Job(name, (name,), partial(study, 2 if small else count, SEED), 2 if small else count)
        for name, (study, count) in STUDIES.items()
    ]
    return [*handovers, *looks]


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
    todo = [job for job in jobs(options.small) if job.name.startswith(options.only or "")]
    with Manager() as manager, ProcessPoolExecutor(options.jobs) as pool, Progress() as progress:
        counts = manager.dict()
        bars = {job.name: progress.add_task(job.name, total=job.looks) for job in todo}
        futures = [pool.submit(job.run, counts) for job in todo]
        while wait(futures, timeout=0.5).not_done:
            for name, bar in bars.items():
                progress.update(bar, completed=counts.get(name, 0))
        results = [future.result() for future in futures]
    parts: dict[str, list[pd.DataFrame]] = {}
    for name, table in (item for result in results for item in result.items()):
        parts.setdefault(name, []).append(table)
    tables = {name: pd.concat(found, ignore_index=True) for name, found in parts.items()}
    for name, table in tables.items():
        path = write_table(name, table, options.output)
        print(f"{path.name}  {read_card(path)['sha256']}")
    if "vision_still_looks" in tables:
        still = tables["vision_still_looks"]
        figures = noise_figures(still, tables["vision_occlusion"])
        print(write_noise(figures, int(still["pose"].nunique()), options.output).name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
