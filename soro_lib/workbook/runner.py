"""Runs what is stale, several notebooks at once, and replaces figures only by finished ones."""

import csv
import os
import shutil
import signal
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

from filelock import FileLock, Timeout

from soro_lib.workbook.display import VERDICTS, Display, Outcome
from soro_lib.workbook.imports import remembered
from soro_lib.workbook.notebooks import OVERVIEW, Notebook
from soro_lib.workbook.staleness import Record, current_inputs, current_outputs, stale_because

if TYPE_CHECKING:
    from soro_lib.workbook.execution import Execution


class AlreadyRunning(RuntimeError):
    """Another run is writing to the same place."""


class Stopped(BaseException):
    """A signal asked the run to stop."""

    def __init__(self, signal_number: int) -> None:
        super().__init__(signal.Signals(signal_number).name)
        self.signal_number = signal_number


@dataclass(frozen=True)
class Places:
    """Where a run reads and writes.

    Parameters
    ----------
    root : Path
        The project: ``notebooks``, ``data``, ``soro_lib`` and ``environment.txt``.
    figures : Path
        Receives ``<slug>/`` per notebook.
    build : Path
        Receives executed notebooks, half-executed ones, records and the lock.
    """

    root: Path
    figures: Path
    build: Path

    @classmethod
    def of(cls, root: Path, output: Path | None, quick: bool, changed: bool) -> "Places":
        """Choose the folders of a run: only a full one with default parameters touches ``figures/``."""
        if output is None:
            output = root / ("build/quick" if quick else "build/custom" if changed else "figures")
        output = output.resolve()
        return cls(root, output, root / "build" if output == root / "figures" else output)

    @property
    def staging(self) -> Path:
        """Where notebooks write until they have ended well: beside the figures, to be moved at one stroke."""
        return (self.build if _same_device(self.build, self.figures) else self.figures) / ".staging"

    def record(self, slug: str) -> Path:
        """Return the file that says what the figures of a notebook were made from."""
        return self.build / "state" / f"{slug}.json"


@dataclass
class Run:
    """One call of the runner over some notebooks.

    Parameters
    ----------
    places : Places
        Where to read and write.
    notebooks : mapping
        What to run, by slug.
    parameters : mapping
        Values to inject, by slug; missing ones keep their default.
    jobs : int
        Notebooks at once.
    force : bool
        Run even what is up to date.
    cell_timeout : int or None
        Longest time for one cell [s].
    """

    places: Places
    notebooks: Mapping[str, Notebook]
    parameters: Mapping[str, Mapping[str, Any]]
    jobs: int = 1
    force: bool = False
    cell_timeout: int | None = None
    display: Display = field(default_factory=Display)
    _executions: "dict[str, Execution]" = field(default_factory=dict)

    def start(self) -> list[Outcome]:
        """Run all that is stale and return how each notebook ended.

        Raises
        ------
        AlreadyRunning
            If another run writes to the same place.
        Stopped
            If SIGINT, SIGTERM or SIGHUP arrived; all kernels have been ended and no figure has been touched.
        """
        with _only_run(self.places.build), _stoppable():
            recover(self.places)
            try:
                with self.display, remembered(self.places.build / "state" / "imports.json"):
                    outcomes = self._run_all([slug for slug in self.notebooks if slug != OVERVIEW])
                    # The overview reads the scorecards that the others have just written.
                    outcomes += self._run_all([slug for slug in self.notebooks if slug == OVERVIEW])
            finally:
                shutil.rmtree(self.places.staging, ignore_errors=True)
        return [outcome for slug in self.notebooks for outcome in outcomes if outcome.slug == slug]

    def _run_all(self, slugs: list[str]) -> list[Outcome]:
        outcomes = []
        pool = ThreadPoolExecutor(self.jobs)
        try:
            pending: set[Future[Outcome]] = {pool.submit(self._run_one, slug) for slug in slugs}
            while pending:
                done, pending = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED)
                self.display.beat()
                for future in done:
                    outcomes.append(future.result())
                    self.display.finished(outcomes[-1])
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            while any(future.running() for future in pending):
                for execution in list(self._executions.values()):
                    execution.kill()
                time.sleep(0.05)
            raise
        pool.shutdown()
        return outcomes

    def _run_one(self, slug: str) -> Outcome:
        notebook, places = self.notebooks[slug], self.places
        parameters = self.parameters.get(slug, {})
        inputs = current_inputs(notebook, parameters, places.root, places.figures)
        record = Record.load(places.record(slug))
        reason = stale_because(record, inputs, current_outputs(places.figures / slug))
        if record and not reason and not self.force:
            return Outcome(slug, "up to date", verdicts=record.verdicts)
        # Half a second to import, and a run in which all is up to date does without.
        from soro_lib.workbook.execution import Interrupted, NotebookFailure

        self.display.started(slug, sum(bool(code.strip()) for code in notebook.code), reason or "as asked")
        start = time.monotonic()
        try:
            staged = self._execute(notebook, parameters)
        except Interrupted:
            return Outcome(slug, "interrupted", time.monotonic() - start)
        except NotebookFailure as failure:
            copy = self._keep(notebook, "failed")
            return Outcome(
                slug, "failed", time.monotonic() - start, message=f"{failure}\n    half-executed copy: {copy}"
            )
        verdicts = count_verdicts(staged / "scorecard.csv")
        outputs = current_outputs(staged)
        publish(staged, places.figures / slug)
        self._keep(notebook, "notebooks")
        seconds = time.monotonic() - start
        Record(inputs, outputs, seconds, verdicts).save(places.record(slug))
        return Outcome(slug, "done", seconds, verdicts)

    def _execute(self, notebook: Notebook, parameters: Mapping[str, Any]) -> Path:
        """Run a notebook in a fresh folder and return the folder that it has written."""
        from soro_lib.workbook.execution import Execution, kernel_environment

        folder = self.places.staging / notebook.slug
        output, work = folder / "output", folder / "work"
        output.mkdir(parents=True)
        work.mkdir()
        execution = Execution(
            notebook,
            parameters,
            copy=folder / notebook.path.name,
            environment={
                **kernel_environment(self.places.root, output, self.places.figures, folder, self.jobs),
                "SORO_QUICK": str(int(bool(parameters.get("quick")))),
            },
            working_directory=work,
            cell_timeout=self.cell_timeout,
            on_cell=lambda number: self.display.cell(notebook.slug, number),
        )
        self._executions[notebook.slug] = execution
        execution.run()
        return output

    def _keep(self, notebook: Notebook, folder: str) -> Path:
        """Move the executed copy out of the staging area; an older copy of a failure goes."""
        (self.places.build / "failed" / notebook.path.name).unlink(missing_ok=True)
        kept = self.places.build / folder / notebook.path.name
        kept.parent.mkdir(parents=True, exist_ok=True)
        with suppress(FileNotFoundError):  # nothing is written where not even the kernel has started
            shutil.move(self.places.staging / notebook.slug / notebook.path.name, kept)
        return kept


def publish(staged: Path, target: Path) -> None:
    """Replace a folder by a finished one; what a kill in between leaves undone, `recover` does."""
    aside = staged.with_suffix(".old")
    target.parent.mkdir(parents=True, exist_ok=True)
    if target.exists():
        target.rename(aside)
    staged.rename(target)
    shutil.rmtree(aside, ignore_errors=True)


def recover(places: Places) -> None:
    """Put back the figures that a killed run had set aside and not replaced yet; clear what else it left."""
    for aside in places.staging.glob("*/output.old"):
        target = places.figures / aside.parent.name
        if not target.exists():
            aside.rename(target)
    shutil.rmtree(places.staging, ignore_errors=True)


def count_verdicts(scorecard: Path) -> dict[str, int]:
    """Return how often each verdict occurs in a scorecard, nothing if there is none."""
    if not scorecard.is_file():
        return {}
    with scorecard.open(encoding="utf-8", newline="") as file:
        counts = Counter(row.get("verdict", "") for row in csv.DictReader(file))
    return {verdict: counts[verdict] for verdict in VERDICTS if counts[verdict]}


@contextmanager
def _only_run(build: Path) -> Iterator[None]:
    build.mkdir(parents=True, exist_ok=True)
    owner = build / "run.pid"
    try:
        with FileLock(build / "run.lock", timeout=0):
            owner.write_text(str(os.getpid()), encoding="utf-8")
            try:
                yield
            finally:
                owner.unlink(missing_ok=True)
    except Timeout:
        pid = owner.read_text(encoding="utf-8") if owner.is_file() else "unknown"
        raise AlreadyRunning(
            f"another run (pid {pid}) is writing to {build}; wait until it has ended, or end it"
        ) from None


@contextmanager
def _stoppable() -> Iterator[None]:
    """Turn the signals that end a process into `Stopped`, so that kernels and files are left in order."""

    def stop(signal_number: int, frame: FrameType | None) -> None:
        for number in before:
            signal.signal(number, signal.SIG_IGN)
        raise Stopped(signal_number)

    before = {}
    hang_up = [] if signal.getsignal(signal.SIGHUP) == signal.SIG_IGN else [signal.SIGHUP]  # nohup
    for number in (signal.SIGINT, signal.SIGTERM, *hang_up):
        with suppress(ValueError):  # outside the main thread there is nothing to catch
            before[number] = signal.signal(number, stop)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _same_device(one: Path, other: Path) -> bool:
    def device(path: Path) -> int:
        return device(path.parent) if not path.exists() else path.stat().st_dev

    return device(one) == device(other)
