"""Render and track the flights again: ``python -m soro_lib.papers.visual_strain_fusion.recordings``.

Each flight takes some minutes; they run in parallel. A flight is written when it is complete, so an
interrupted run leaves whole files only. The same seed and the locked packages give the same bytes.
"""

import os
import signal
import sys
import time
from collections.abc import MutableMapping, Sequence
from multiprocessing import Manager, Pool
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress

from soro_lib.papers.visual_strain_fusion.experiments.camera_runs import COLUMNS, FLIGHTS, MAP_ARRAYS, fly
from soro_lib.project import data_directory
from soro_lib.replication.datacards import generator_options, read_card, write_card

SEED = 5
STEPS, SMALL_STEPS = 4000, 40
GENERATOR = "soro_lib.papers.visual_strain_fusion.recordings"


def record(name: str, directory: Path, progress: MutableMapping[str, int], steps: int = STEPS) -> list[Path]:
    """Fly once and write frames and map, each with its card.

    Parameters
    ----------
    name : str
        One of :data:`~soro_lib.papers.visual_strain_fusion.experiments.camera_runs.FLIGHTS`.
    directory : Path
        Where to.
    progress : mutable mapping
        ``progress[name]`` counts the frames.
    steps : int, optional
        Frames of the run.

    Returns
    -------
    list of Path
        The two files.
    """
    flight = FLIGHTS[name]
    frames, point_map = fly(flight, SEED, steps, lambda done: progress.update({name: done}))
    table, points = directory / f"{name}.csv.gz", directory / f"{name}_map.npz"
    unfinished = table.with_suffix(".part"), points.with_suffix(".part.npz")
    form: dict[str, Any] = {"float_format": "%.5f", "lineterminator": "\n", "index": False}
    frames.to_csv(unfinished[0], compression={"method": "gzip", "compresslevel": 9, "mtime": 0}, **form)
    np.savez_compressed(unfinished[1], allow_pickle=False, **point_map)
    os.replace(unfinished[0], table)
    os.replace(unfinished[1], points)
    where = f"scene {flight.scene}, {flight.disturbance}"
    told = "Told: the similarity of Eq. (30), from a sweep before the run; nothing else but images."
    poses = f"Camera poses per rendered frame, {where}. {told}"
    depth = f"Map of the tracker after the run, {where}; depth by triangulation between keyframes."
    write_card(table, description=poses, columns=COLUMNS, generator=GENERATOR, seed=SEED)
    write_card(points, description=depth, columns=MAP_ARRAYS, generator=GENERATOR, seed=SEED)
    return [table, points]


def _record_all(names: Sequence[str], directory: Path, jobs: int, steps: int) -> list[Path]:
    """Record flights in parallel and show their progress; leaving early stops the processes."""
    ignore_interrupts = (signal.SIGINT, signal.SIG_IGN)
    with (
        Manager() as manager,
        Pool(min(jobs, len(names)), signal.signal, ignore_interrupts) as pool,
        Progress() as progress,
    ):
        counts = manager.dict()
        tasks = {name: progress.add_task(name, total=steps) for name in names}
        results = [pool.apply_async(record, (name, directory, counts, steps)) for name in names]
        while not all(result.ready() for result in results):
            for name, task in tasks.items():
                progress.update(task, completed=counts.get(name, 0))
            time.sleep(0.3)
        return [path for result in results for path in result.get()]


def main(arguments: list[str] | None = None) -> int:
    """Record all flights, show the progress and say which files changed."""
    folder = data_directory("visual_strain_fusion")
    parser = generator_options("Render and track the camera flights again.", folder)
    parser.add_argument("--jobs", type=int, default=min(len(FLIGHTS), os.cpu_count() or 1))
    parser.add_argument("--only", choices=list(FLIGHTS), help="record one flight only")
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    names = [options.only] if options.only else list(FLIGHTS)[:: 5 if options.small else 1]
    steps = SMALL_STEPS if options.small else STEPS
    try:
        written = _record_all(names, options.output, options.jobs, steps)
    except KeyboardInterrupt:
        for unfinished in options.output.glob("*.part*"):
            unfinished.unlink()
        print("interrupted; the flights that were complete are kept", file=sys.stderr)
        return 130
    for path in written:
        print(f"{path.name}  {read_card(path)['sha256']}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
