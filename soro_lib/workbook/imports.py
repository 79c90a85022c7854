"""Which library modules a notebook depends on, read from the import statements without running them."""

import ast
import hashlib
import json
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

PACKAGE = "soro_lib"


TELLING = (ast.Import, ast.ImportFrom, ast.Attribute, ast.Constant, ast.keyword)
"""Parts of code that are looked at; most of a module is none of these."""
LONGEST_SLUG = 60
"""Characters; longer literals name no data folder."""


def dependencies(sources: Iterable[str], root: Path) -> set[Path]:
    """Return the files of the library that code imports, directly or through other modules of it.

    Parameters
    ----------
    sources : iterable of str
        Code cells; lines that are IPython magics are passed over.
    root : Path
        Folder that holds ``soro_lib``.
    """
    found: set[Path] = set()
    waiting = {path for source in sources for name in imported_names(source) for path in _files(name, root)}
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            package = ".".join(path.relative_to(root).parts[:-1])
            for name in imported_names(path.read_text(encoding="utf-8"), package):
                waiting |= _files(name, root)
    return found


def imported_names(source: str, package: str = "") -> frozenset[str]:
    """Return the dotted names of everything that code takes from the library.

    Where a whole package is bound to a name (``from soro_lib import robots``), what is taken from that name
    (``robots.HelixArm``) is listed, so that the rest of the package does not count.

    Parameters
    ----------
    source : str
        A module or a code cell.
    package : str, optional
        Package that the module is in, to resolve relative imports.
    """
    parsed = _parsed(source)
    names = set()
    for bound, level, target in parsed["imports"]:
        if level:
            parents = package.split(".")[: len(package.split(".")) + 1 - level]
            target = ".".join([*parents, target])
        if target.split(".")[0] == PACKAGE:
            names.add(target)
            names |= {
                target + chain.removeprefix(bound)
                for chain in parsed["chains"]
                if chain.startswith(f"{bound}.")
            }
    return frozenset(names)


def texts(source: str) -> frozenset[str]:
    """Return the string literals of code, apart from the names of a lazily imported package."""
    return frozenset(() if _lazy_names(source) else _parsed(source)["texts"])


@contextmanager
def remembered(path: Path) -> Iterator[None]:
    """Take what modules that have not changed import from a file, and keep there what had to be parsed."""
    try:
        before = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        before = {}
    _known.update(before)
    yield
    if _known.keys() != before.keys():
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_suffix(".partial")
        partial.write_text(json.dumps(_known), encoding="utf-8")
        partial.replace(path)


_known: dict[str, dict[str, Any]] = {}
"""What `_parse` found in a source, by its digest."""


def _parsed(source: str) -> dict[str, Any]:
    digest = hashlib.sha256(source.encode()).hexdigest()
    if digest not in _known:
        _known[digest] = _parse(source)
    return _known[digest]


def _parse(source: str) -> dict[str, Any]:
    """Return what code says about other code.

    ``imports``: the name that is bound, dots of a relative import, dotted name it stands for; ``chains``:
    dotted names that are used; ``texts``: string literals; ``lazy``: submodule per lazily imported name.
    """
    try:
        tree = ast.parse(re.sub(r"^\s*[%!?].*$", "", source, flags=re.MULTILINE))
    except SyntaxError:
        tree = ast.Module([], [])  # It is the run that will fail, and say where.
    nodes = [node for node in ast.walk(tree) if isinstance(node, TELLING)]
    lazy = {}
    for node in nodes:
        if isinstance(node, ast.keyword) and node.arg == "submod_attrs":
            modules = ast.literal_eval(node.value)
            lazy = {name: module for module, names in modules.items() for name in names}
    constants = {node.value for node in nodes if isinstance(node, ast.Constant)}
    return {
        "imports": list(_bindings(nodes)),
        "chains": sorted({_chain(node) for node in nodes if isinstance(node, ast.Attribute)}),
        "texts": sorted(value for value in constants if isinstance(value, str) and len(value) < LONGEST_SLUG),
        "lazy": lazy,
    }


def _bindings(nodes: Iterable[ast.AST]) -> Iterator[tuple[str, int, str]]:
    """Yield every imported name with the dots and the dotted name that it stands for."""
    for node in nodes:
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.asname or alias.name, 0, alias.name
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                target = ".".join(filter(None, [node.module, alias.name]))
                yield alias.asname or alias.name, node.level, target


def _chain(node: ast.expr) -> str:
    """Return the dotted name that an attribute stands for, such as ``robots.HelixArm``; else nothing."""
    names: list[str] = []
    while isinstance(node, ast.Attribute):
        names.append(node.attr)
        node = node.value
    return ".".join([node.id, *reversed(names)]) if isinstance(node, ast.Name) else ""


def _files(dotted: str, root: Path) -> set[Path]:
    """Return the modules that a dotted name runs: its packages, itself, what it stands for lazily."""
    files: set[Path] = set()
    folder = root
    for part in dotted.split("."):
        init = folder / "__init__.py"
        if init.is_file():
            part = _lazy_names(init.read_text(encoding="utf-8")).get(part, part)
        if (folder / f"{part}.py").is_file():
            return files | {folder / f"{part}.py"}
        folder = folder / part
        if not (folder / "__init__.py").is_file():
            break
        files.add(folder / "__init__.py")
    return files


@cache
def _lazy_names(init: str) -> dict[str, str]:
    """Return name -> submodule of the ``lazy_loader.attach`` call of a package, empty if it has none."""
    return dict(_parsed(init)["lazy"])
