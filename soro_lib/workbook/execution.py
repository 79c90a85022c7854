"""One notebook in one kernel: papermill with a clean working directory, headless and on one thread."""

import os
import signal
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import nbformat
import papermill
from nbclient.exceptions import CellTimeoutError, DeadKernelError
from papermill.clientwrap import PapermillNotebookClient
from papermill.engines import NBClientEngine, papermill_engines
from papermill.exceptions import PapermillExecutionError

from soro_lib.project import cores
from soro_lib.workbook.notebooks import Notebook

THREAD_COUNTS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMBA_NUM_THREADS",
    "OPENCV_FOR_THREADS_NUM",
)
THREADS = "1"
"""Threads of a notebook: several notebooks run at once; more threads than cores make all of them slower."""

ENGINE = "soro-workbook"


class NotebookFailure(Exception):
    """A cell failed; the message names the cell and the error."""


class Interrupted(Exception):
    """The kernel was ended from outside."""


@dataclass
class Execution:
    """A notebook on its way through a kernel.

    Parameters
    ----------
    notebook : Notebook
        What to run.
    parameters : mapping
        Values to inject after the parameters cell.
    copy : Path
        Where the executed notebook is written when it has ended, well or not.
    environment : mapping
        Environment of the kernel.
    working_directory : Path
        Where the kernel runs.
    cell_timeout : int or None
        Longest time for one cell [s].
    on_cell : callable
        Called with the number of the code cell that starts, counted from 1.
    """

    notebook: Notebook
    parameters: Mapping[str, Any]
    copy: Path
    environment: Mapping[str, str]
    working_directory: Path
    cell_timeout: int | None
    on_cell: Callable[[int], None]
    client: PapermillNotebookClient | None = None
    cell: int = 0
    interrupted: bool = False

    def run(self) -> None:
        """Execute all cells.

        Raises
        ------
        NotebookFailure
            If a cell raises, takes too long or takes the kernel down.
        Interrupted
            If `kill` was called.
        """
        # The kernel of this environment, not one of the same name that the user has installed.
        os.environ["JUPYTER_PREFER_ENV_PATH"] = "1"
        try:
            papermill.execute_notebook(
                self.notebook.path,
                self.copy,
                parameters=dict(self.parameters),
                engine_name=ENGINE,
                kernel_name="python3",
                language="python",
                progress_bar=False,
                request_save_on_cell_execute=False,  # a save validates the whole notebook, twice a cell
                execution=self,
            )
        except Exception as error:
            if self.interrupted:
                raise Interrupted(self.notebook.slug) from None
            self._keep_what_ran()
            where = f"code cell {self.cell}" if self.cell else "before the first cell"
            raise NotebookFailure(f"{where}: {self._explain(error)}") from error

    def kill(self) -> None:
        """End the kernel and everything that it has started, at once."""
        self.interrupted = True
        provisioner = self.client and self.client.km and self.client.km.provisioner
        process = getattr(provisioner, "process", None)
        if process is not None:
            with suppress(ProcessLookupError, PermissionError):
                # The kernel leads its own process group.
                os.killpg(process.pid, signal.SIGKILL)

    def cell_starts(self, cell: Any, cell_index: int) -> None:
        """Count the notebook's own code cells as they start."""
        if self.interrupted:
            self.kill()
        injected = "injected-parameters" in cell.metadata.get("tags", [])
        if cell.cell_type == "code" and cell.source.strip() and not injected:
            self.cell += 1
            self.on_cell(self.cell)

    def _keep_what_ran(self) -> None:
        """Write the notebook as far as it has come, where papermill has not done so."""
        if self.client and not self.copy.exists():
            nbformat.write(self.client.nb, self.copy)

    def _explain(self, error: Exception) -> str:
        match error:
            case PapermillExecutionError():
                return f"{error.ename}: {error.evalue}"
            case CellTimeoutError():
                return f"took longer than {self.cell_timeout} s"
            case DeadKernelError():
                return "the kernel died (out of memory?)"
        return f"{type(error).__name__}: {error}"


class Engine(NBClientEngine):
    """Papermill's engine, with an environment per kernel and a hook per cell."""

    @classmethod
    def execute_managed_notebook(
        cls, nb_man: Any, kernel_name: str, *, execution: Execution, start_timeout: int = 60, **_: Any
    ) -> nbformat.NotebookNode:
        """Run the cells of one notebook in a kernel of its own."""
        execution.client = PapermillNotebookClient(
            nb_man,
            kernel_name=kernel_name,
            startup_timeout=max(start_timeout, 120),
            timeout=execution.cell_timeout,
            resources={"metadata": {"path": str(execution.working_directory)}},
            on_cell_start=execution.cell_starts,
            extra_arguments=["--log-level=CRITICAL"],
        )
        return execution.client.execute(env=dict(execution.environment))


papermill_engines.register(ENGINE, Engine)


def kernel_environment(root: Path, output: Path, figures: Path, scratch: Path, jobs: int) -> dict[str, str]:
    """Return the environment that every notebook runs in, whoever runs it and wherever.

    Parameters
    ----------
    root : Path
        Project whose ``soro_lib`` is imported.
    output : Path
        Folder that the notebook writes to.
    figures : Path
        Folder with the finished figures of this run.
    scratch : Path
        Folder for the settings of IPython, in place of the user's own.
    jobs : int
        Notebooks that run at once and share the cores.
    """
    matplotlib = Path(str(find_spec("matplotlib").origin)).parent  # type: ignore[union-attr]
    modules = (path.relative_to(root).with_suffix("") for path in sorted((root / "soro_lib").rglob("*.py")))
    names = {".".join(part for part in module.parts if part != "__init__") for module in modules}
    return {
        **os.environ,
        **dict.fromkeys(THREAD_COUNTS, THREADS),
        "SORO_OUTPUT": str(output),
        "SORO_FIGURES": str(figures),
        "PYTHONPATH": str(root),
        "PYTHONHASHSEED": "0",
        "PYTHONWARNINGS": ",".join(f"error::DeprecationWarning:{name}" for name in sorted(names)),
        "MPLBACKEND": "Agg",
        "MATPLOTLIBRC": str(matplotlib / "mpl-data" / "matplotlibrc"),
        "LOKY_MAX_CPU_COUNT": str(max(1, cores() // jobs)),
        "IPYTHONDIR": str(scratch / "ipython"),
        "PYDEVD_DISABLE_FILE_VALIDATION": "1",
    }
