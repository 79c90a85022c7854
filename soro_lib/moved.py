"""Old import paths: what has moved is found under its old name, with a deprecation warning.

``moved.csv`` says where modules and single names were and are. A row goes when its warning has been there for
two releases.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Sequence
from functools import cache
from importlib import import_module
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

TYPE_CHECKING = False  # that of typing would make every import of the library a third slower
if TYPE_CHECKING:
    from typing import Any


@cache
def moved() -> dict[str, str]:
    """Return the new dotted name of each old one; one that ends with ``()`` is called for its value."""
    import csv  # every import of the library comes past here

    with Path(__file__).with_suffix(".csv").open(encoding="utf-8", newline="") as file:
        return {row["old"]: row["new"] for row in csv.DictReader(file)}


def old_names(module: str, present: Callable[[str], Any] | None = None) -> Callable[[str], Any]:
    """Return a ``__getattr__`` for a module that some names have left, or that has left altogether.

    Parameters
    ----------
    module : str
        Its dotted name.
    present : callable, optional
        A ``__getattr__`` for the names that are still there.
    """

    def attribute(name: str) -> Any:
        new = moved().get(f"{module}.{name}")
        if new is None and module in moved():
            new = f"{moved()[module]}.{name}"
        if new is None and present:
            return present(name)
        if new is None or name.startswith("__"):
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        found = resolved(new, f"{module}.{name}")
        warnings.warn(f"{module}.{name} is now {new}", DeprecationWarning, stacklevel=2)
        return found

    return attribute


def resolved(new: str, old: str) -> Any:
    """Return what stands at a new name; `AttributeError` names the old one if nothing does."""
    from pkgutil import resolve_name

    try:
        found = resolve_name(new.removesuffix("()"))
        return found() if new.endswith("()") else found
    except ImportError as error:
        raise AttributeError(f"{old} is now {new}, which cannot be imported: {error}") from error


class OldModules:
    """Offers the modules of `moved`, and the packages they were in, where Python finds no module."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> Any:
        """Return how to import an old module, None for any other."""
        if name.startswith("soro_lib.") and any(f"{old}.".startswith(f"{name}.") for old in moved()):
            return ModuleSpec(name, self, is_package=True)  # type: ignore[arg-type]
        return None

    def create_module(self, spec: ModuleSpec) -> None:
        """Leave it to Python."""

    def exec_module(self, module: ModuleType) -> None:
        """Fill an old module: it looks up at the new place whatever is asked of it."""
        new = moved().get(module.__name__)
        if new:
            there = import_module(new)
            public = [name for name in vars(there) if not name.startswith("_")]
            module.__all__ = getattr(there, "__all__", public)  # type: ignore[attr-defined]
            module.__doc__ = f"Moved to `{new}`."
        module.__getattr__ = old_names(module.__name__)  # type: ignore[method-assign]


def install() -> None:
    """Let Python ask here for modules that it finds nowhere else."""
    if not any(type(finder).__name__ == OldModules.__name__ for finder in sys.meta_path):
        sys.meta_path.append(OldModules())
