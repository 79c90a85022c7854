"""Which library modules a notebook depends on, read from the import statements without running them."""

import ast
import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path

PACKAGE = "soro_lib"


TELLING = (ast.Import, ast.ImportFrom, ast.Attribute, ast.Constant, ast.keyword)
"""Parts of code that are looked at; most of a module is none of these."""


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


@cache
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
    nodes = _nodes(source)
    chains = {_chain(node) for node in nodes if isinstance(node, ast.Attribute)}
    names = set()
    for bound, target in _bindings(nodes, package):
        if target.split(".")[0] == PACKAGE:
            names.add(target)
            names |= {target + chain.removeprefix(bound) for chain in chains if chain.startswith(f"{bound}.")}
    return frozenset(names)


@cache
def texts(source: str) -> frozenset[str]:
    """Return the string literals of code, apart from the names of a lazily imported package."""
    if _lazy_names(source):
        return frozenset()
    constants = (node.value for node in _nodes(source) if isinstance(node, ast.Constant))
    return frozenset(value for value in constants if isinstance(value, str))


def _chain(node: ast.expr) -> str:
    """Return the dotted name that an attribute stands for, such as ``robots.HelixArm``; else nothing."""
    names: list[str] = []
    while isinstance(node, ast.Attribute):
        names.append(node.attr)
        node = node.value
    return ".".join([node.id, *reversed(names)]) if isinstance(node, ast.Name) else ""


@cache
def _nodes(source: str) -> tuple[ast.AST, ...]:
    """Return the parts of code that say what it takes: imports, dotted names, literals, keyword arguments."""
    try:
        tree = ast.parse(re.sub(r"^\s*[%!?].*$", "", source, flags=re.MULTILINE))
    except SyntaxError:
        return ()  # It is the run that will fail, and say where.
    return tuple(node for node in ast.walk(tree) if isinstance(node, TELLING))


def _bindings(nodes: Iterable[ast.AST], package: str) -> Iterable[tuple[str, str]]:
    """Yield every imported name with the dotted name that it stands for."""
    for node in nodes:
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.asname or alias.name, alias.name
        elif isinstance(node, ast.ImportFrom):
            parents = package.split(".")[: len(package.split(".")) + 1 - node.level] if node.level else []
            module = ".".join([*parents, *filter(None, [node.module])])
            for alias in node.names:
                yield alias.asname or alias.name, f"{module}.{alias.name}"


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
    for node in _nodes(init):
        if isinstance(node, ast.keyword) and node.arg == "submod_attrs":
            modules = ast.literal_eval(node.value)
            return {name: module for module, names in modules.items() for name in names}
    return {}
