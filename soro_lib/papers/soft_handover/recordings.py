"""Look through the rendered cameras again: ``python -m soro_lib.papers.soft_handover.recordings``.

Writes the recordings of the vision study and of the handovers with rendered images, each with its card, and
the noise figures that the other experiments see through (``vision_noise.toml``). The jobs run in parallel,
one on each core. The same seed and the locked packages give the same bytes, whatever the number of cores.
"""

import os
import tomllib
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import product
from pathlib import Path

import cv2
import pandas as pd
from rich.progress import track

from soro_lib.papers.soft_handover.calibration import plant_k
from soro_lib.papers.soft_handover.experiments.rendered_handovers import BEST, CONTROLLERS, rendered_block
from soro_lib.papers.soft_handover.experiments.vision import SEED, accuracy, noise_figures, still_looks
from soro_lib.papers.soft_handover.experiments.vision_limits import degradations, image_faults, occlusion
from soro_lib.papers.soft_handover.world.plant import ElasticPlant
from soro_lib.project import data_directory
from soro_lib.replication.datacards import generator_options, read_card, write_card
from soro_lib.sensing.handover_vision import ESTIMATORS

FOLDER = data_directory("soft_handover")
MEANING = tomllib.loads((FOLDER / "recordings.toml").read_text(encoding="utf-8"))
"""What the recordings, their columns and the camera systems are, in words."""

GENERATOR = "soro_lib.papers.soft_handover.recordings"
BLOCKS = 2
"""Blocks of eight handovers of each controller."""

STUDIES: dict[str, tuple[Callable[..., pd.DataFrame], int]] = {
    "vision_accuracy": (accuracy, 200),
    "vision_occlusion": (occlusion, 200),
    "vision_degradations": (degradations, 40),
    "vision_image_faults": (image_faults, 40),
    "vision_still_looks": (still_looks, 40),
}
"""What the recordings of single looks are made by, and from how many poses."""

Tables = dict[str, pd.DataFrame]
"""Recordings, or parts of them, by name."""


def looks(recording: str, poses: int) -> Tables:
    """Return the recording of a study of single looks."""
    return {recording: STUDIES[recording][0](poses, SEED)}


def handovers(plant: str, estimator: str, block: int, small: bool) -> Tables:
    """Return a block of handovers; in the small form of the best controller alone."""
    arm, settings = plant_k() if plant == "K" else ElasticPlant(), BEST if small else CONTROLLERS
    runs, traces = rendered_block(plant, arm, estimator, block, SEED, settings)
    return {"rendered_runs": runs, "rendered_traces": traces}


def jobs(small: bool = False) -> Mapping[str, Callable[[], Tables]]:
    """Return all jobs by name, the longest first; in the small form two handovers, and two poses of all
    else."""
    eyes = list(zip("KE", ESTIMATORS)) if small else list(product("KE", ESTIMATORS))
    blocks = {
        f"handovers, plant {plant}, {estimator}, block {block}": partial(
            handovers, plant, estimator, block, small
        )
        for plant, estimator in eyes
        for block in range(1 if small else BLOCKS)
    }
    return blocks | {
        name: partial(looks, name, 2 if small else poses) for name, (_, poses) in STUDIES.items()
    }


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
    columns = {column: MEANING["columns"][column] for column in table.columns}
    description = MEANING["recordings"][name]
    write_card(path, description=description, columns=columns, generator=GENERATOR, seed=SEED)
    return path


def write_noise(figures: dict[str, dict[str, float]], poses: int, directory: Path) -> Path:
    """Write the noise figures in the format that `load_vision_noise` reads."""
    lines = [
        "# Error budgets of the camera system, per component [m], of the unit direction [-].",
        "# Jitter changes from look to look at a still arm; bias stays, and changes as the arm moves.",
        f'source = "measured on rendered images of {poses} still arms by {GENERATOR}, seed {SEED}"',
    ]
    for estimator, values in figures.items():
        key = f'"{estimator}"' if " " in estimator else estimator
        lines += ["", f"[estimator.{key}.noise]  # {MEANING['camera_systems'][estimator]}"]
        lines += [f"{name} = {value:.6f}" for name, value in values.items()]
    path = directory / "vision_noise.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def run(job: Callable[[], Tables]) -> Tables:
    """Do a job."""
    return job()


def main() -> None:
    """Record everything and say what was written."""
    options = generator_options("Look through the rendered cameras again.", FOLDER).parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    todo = list(jobs(options.small).values())
    with ProcessPoolExecutor(initializer=cv2.setNumThreads, initargs=(1,)) as pool:
        results = list(track(pool.map(run, todo), "Recording", len(todo)))
    tables = {
        name: pd.concat([result[name] for result in results if name in result], ignore_index=True)
        for name in dict.fromkeys(name for result in results for name in result)
    }
    for name, table in tables.items():
        path = write_table(name, table, options.output)
        print(f"{path.name}  {read_card(path)['sha256']}")
    still = tables["vision_still_looks"]
    figures = noise_figures(still, tables["vision_occlusion"])
    print(write_noise(figures, int(still["pose"].nunique()), options.output).name)


if __name__ == "__main__":
    main()
