"""What a notebook's figures were made from, by content, so that only what has changed is run again."""

import hashlib
import json
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from soro_lib.workbook.imports import data_slugs, dependencies
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
    texts = [*notebook.code, *(path.read_text(encoding="utf-8") for path in modules)]
    slugs = {notebook.slug}.union(*map(data_slugs, texts))
    files = modules | _package_data(modules)
    for slug in slugs:
        files |= _visible_files(root / "data" / slug)
    if notebook.slug == OVERVIEW:
        files |= {path for path in (root / "data").glob("*/*") if path.suffix in {".csv", ".toml"}}
        others = [path for path in _figures_to_read(root, figures) if path.parent.name != OVERVIEW]
        files |= {path for path in others if path.name == "scorecard.csv"}
        names = [f"{path.parent.name}/{path.name}" for path in others]
    else:
        names = []
    files |= {
        Path(value) for value in parameters.values() if isinstance(value, str) and Path(value).is_file()
    }
    cells = [[cell.cell_type, cell.source, cell.metadata.get("tags", [])] for cell in notebook.cells]
    return {
        "notebook": _digest(json.dumps(cells)),
        "parameters": _digest(json.dumps(parameters, sort_keys=True)),
        "Python version": f"{sys.version_info.major}.{sys.version_info.minor}",
        "environment.txt": _digest_file(root / "environment.txt"),
        "names of the figures": _digest(json.dumps(sorted(names))),
        **{_shown(path, root): _digest_file(path) for path in sorted(files)},
    }


def current_outputs(directory: Path) -> dict[str, str]:
    """Return a digest per file of a folder of figures."""
    return {
        path.relative_to(directory).as_posix(): _digest_file(path)
        for path in sorted(_visible_files(directory))
    }


def _visible_files(directory: Path) -> set[Path]:
    return {path for path in directory.rglob("*") if path.is_file() and not path.name.startswith(".")}


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


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _digest_file(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "missing"
