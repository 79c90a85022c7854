"""What a notebook's figures were made from, by content, so that only what has changed is run again."""

import hashlib
import json
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from soro_lib.workbook.imports import dependencies, texts
from soro_lib.workbook.notebooks import OVERVIEW, Notebook


@dataclass(frozen=True)
class Record:
    """What one finished run of a notebook was made from, and what it made."""

    inputs: dict[str, str]
    outputs: dict[str, str]
    seconds: float
    verdicts: dict[str, int] = field(default_factory=dict)

    def save(self, path: Path) -> None:
        """Write the record so that a reader finds the old one or the new one, never a part."""
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_suffix(".partial")
        partial.write_text(json.dumps(asdict(self), indent=1), encoding="utf-8")
        partial.replace(path)

    @classmethod
    def load(cls, path: Path) -> "Record | None":
        """Return the stored record, ``None`` if there is none that can be read."""
        try:
            return cls(**json.loads(path.read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):
            return None


def stale_because(record: Record | None, inputs: Mapping[str, str], outputs: Mapping[str, str]) -> str:
    """Return why a notebook has to run again, an empty string if it does not."""
    if record is None:
        return "no finished run on record"
    for before, now in ((record.inputs, inputs), (record.outputs, outputs)):
        changed = sorted(name for name in {*before, *now} if before.get(name) != now.get(name))
        if changed:
            more = f" and {len(changed) - 1} more" if len(changed) > 1 else ""
            return f"{changed[0]} changed{more}"
    return ""


def current_inputs(
    notebook: Notebook, parameters: Mapping[str, Any], root: Path, figures: Path
) -> dict[str, str]:
    """Return a digest of everything that a notebook's figures follow from.

    These are its cells, the parameters that differ from the defaults, the lock, the Python version, the
    library modules that it imports, the data folders that it or those modules name, and any file that a
    parameter names. The overview follows from the scorecards and file names of all the others.
    """
    modules = dependencies(notebook.code, root)
    named = {Path(value) for value in parameters.values() if isinstance(value, str)}
    files = modules | _package_data(modules) | _data(notebook, modules, root) | named
    cells = [[cell.cell_type, cell.source, cell.metadata.get("tags", [])] for cell in notebook.cells]
    others: set[Path] = set()
    if notebook.slug == OVERVIEW:
        others = {path for path in _figures_to_read(root, figures) if path.parent.name != OVERVIEW}
        files |= {path for path in others if path.name == "scorecard.csv"}
        files |= {path for path in (root / "data").glob("*/*") if path.suffix in {".csv", ".toml"}}
    return {
        "notebook": _digest(cells),
        "parameters": _digest(parameters),
        "Python version": f"{sys.version_info.major}.{sys.version_info.minor}",
        "environment.txt": _digest_file(root / "environment.txt"),
        "names of the figures": _digest(sorted(f"{path.parent.name}/{path.name}" for path in others)),
        **{_shown(path, root): _digest_file(path) for path in sorted(files) if path.is_file()},
    }


def current_outputs(directory: Path) -> dict[str, str]:
    """Return a digest per file of a folder of figures."""
    return {
        path.relative_to(directory).as_posix(): _digest_file(path)
        for path in sorted(_visible_files(directory))
    }


def _visible_files(directory: Path) -> set[Path]:
    return {path for path in directory.rglob("*") if path.is_file() and not path.name.startswith(".")}


def _data(notebook: Notebook, modules: set[Path], root: Path) -> set[Path]:
    """Return the files of the notebook's own data folder and of those named in its code or its modules."""
    # The module that knows the folders names them all.
    sources = [path.read_text(encoding="utf-8") for path in modules if path.name != "project.py"]
    mentioned = {notebook.slug}.union(*map(texts, [*notebook.code, *sources]))
    folders = [folder for folder in (root / "data").glob("*") if folder.name in mentioned]
    return {path for folder in folders for path in _visible_files(folder)}


def _package_data(modules: set[Path]) -> set[Path]:
    """Return the files beside the modules that are not Python, such as the script of a widget."""
    beside = {path for folder in {module.parent for module in modules} for path in folder.iterdir()}
    return {path for path in beside if path.is_file() and path.suffix != ".py" and path.name[0] != "."}


def _figures_to_read(root: Path, figures: Path) -> list[Path]:
    """Return the figures of this run and, of notebooks that it has not run, the committed ones."""
    folders = {path.name: path for path in [*(root / "figures").glob("*/"), *figures.glob("*/")]}
    return [path for folder in folders.values() if folder.is_dir() for path in _visible_files(folder)]


def _shown(path: Path, root: Path) -> str:
    return path.relative_to(root).as_posix() if path.is_relative_to(root) else str(path)


def _digest(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def _digest_file(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "missing"
