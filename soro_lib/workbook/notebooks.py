"""The notebooks on disk and the parameters that each of them takes."""

import ast
import logging
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import lazy_loader
import nbformat

# Half a second to import, and a run without parameters does not ask for it.
papermill = lazy_loader.load("papermill")
# papermill announces every file that it opens.
logging.getLogger("papermill").setLevel(logging.ERROR)

OVERVIEW = "overview"
"""The notebook that merges the scorecards of the others and therefore runs last."""


class NotebookError(ValueError):
    """A file that is named like a notebook and is none."""


class ParameterError(ValueError):
    """A parameter that no selected notebook has, or whose value is not of its type."""


@dataclass(frozen=True)
class Parameter:
    """One line ``name: type = default  # [unit] meaning`` of a parameters cell."""

    name: str
    type: str
    default: str
    help: str

    @property
    def unit(self) -> str:
        """Unit in brackets at the start of the comment, ``-`` for a number without one; empty if missing."""
        match = re.match(r"\[([^\]]+)\]", self.help)
        return match[1] if match else ""

    def parse(self, text: str) -> Any:
        """Return the value that ``text`` from the command line stands for.

        The name of a file is made absolute, since a notebook runs in a folder of its own.

        Raises
        ------
        ParameterError
            If the text is not a value of the declared type.
        """
        if self.type == "str":
            return str(Path(text).resolve()) if Path(text).is_file() else text
        literal = text.capitalize() if self.type == "bool" else text
        try:
            value = ast.literal_eval(literal)
        except (ValueError, SyntaxError):
            value = text
        if self.type == "float" and type(value) is int:
            value = float(value)
        if not conforms(value, ast.parse(self.type, mode="eval").body):
            raise ParameterError(f"{self.name} takes a value of type {self.type}, not {text!r}")
        return value


def conforms(value: Any, annotation: ast.expr) -> bool:
    """Tell whether a value has the annotated type: a plain type, or a list, tuple or dict of them."""
    match annotation:
        case ast.Name(id=name):
            return type(value).__name__ == name
        case ast.Subscript(value=ast.Name(id="dict"), slice=ast.Tuple(elts=[key, item])):
            return isinstance(value, dict) and all(
                conforms(k, key) and conforms(v, item) for k, v in value.items()
            )
        case ast.Subscript(value=ast.Name(id="tuple"), slice=ast.Tuple(elts=elements)):
            return isinstance(value, tuple) and _tuple_conforms(value, elements)
        case ast.Subscript(value=ast.Name(id=container), slice=element):
            return type(value).__name__ == container and all(conforms(v, element) for v in value)
    return False


def _tuple_conforms(value: tuple[Any, ...], elements: list[ast.expr]) -> bool:
    if len(elements) == 2 and isinstance(elements[1], ast.Constant) and elements[1].value is ...:
        return all(conforms(v, elements[0]) for v in value)
    return len(value) == len(elements) and all(conforms(v, e) for v, e in zip(value, elements))


@dataclass(frozen=True)
class Notebook:
    """A notebook file ``NN_<slug>.ipynb``."""

    path: Path

    @property
    def slug(self) -> str:
        """Name without the number: ``01_gesture_steering.ipynb`` is ``gesture_steering``."""
        return self.path.stem.partition("_")[2]

    @cached_property
    def cells(self) -> list[Any]:
        """Cells as nbformat reads them; raises `NotebookError` if they cannot be read."""
        try:
            return nbformat.read(self.path, as_version=4).cells
        except Exception as error:
            raise NotebookError(f"{self.path.name} is not a notebook: {error}") from error

    @property
    def code(self) -> list[str]:
        """Sources of the code cells."""
        return [cell.source for cell in self.cells if cell.cell_type == "code"]

    @property
    def title(self) -> str:
        """First heading, or the slug where there is none."""
        for cell in self.cells:
            heading = re.search(r"^#+\s*(.+)$", cell.source, re.MULTILINE)
            if cell.cell_type == "markdown" and heading:
                return heading[1].strip()
        return self.slug

    @cached_property
    def parameters(self) -> dict[str, Parameter]:
        """Parameters by name, as papermill reads them from the cell tagged ``parameters``."""
        if not self.cells:
            raise NotebookError(f"{self.path.name} has no cells")
        return {
            name: Parameter(name, found["inferred_type_name"], found["default"], found["help"])
            for name, found in papermill.inspect_notebook(self.path).items()
        }


def find_notebooks(directory: Path) -> dict[str, Notebook]:
    """Return the numbered notebooks of a folder by slug, in order; `NotebookError` if there are none."""
    notebooks = [Notebook(path) for path in sorted(directory.glob("[0-9][0-9]_*.ipynb"))]
    if not notebooks:
        raise NotebookError(f"no notebook NN_<slug>.ipynb in {directory}")
    return {notebook.slug: notebook for notebook in notebooks}


def select(notebooks: Mapping[str, Notebook], slugs: Iterable[str]) -> dict[str, Notebook]:
    """Return the named notebooks, all if none is named.

    Raises
    ------
    ParameterError
        If there is no notebook of that name.
    """
    wanted = set(slugs) or set(notebooks)
    unknown = sorted(wanted - set(notebooks))
    if unknown:
        raise ParameterError(f"no notebook {', '.join(unknown)}; there are: {', '.join(notebooks)}")
    return {slug: notebook for slug, notebook in notebooks.items() if slug in wanted}


def parameter_values(
    notebooks: Mapping[str, Notebook], texts: Mapping[str, str]
) -> dict[str, dict[str, Any]]:
    """Return per notebook the values of those parameters that it has, read from the command line.

    Raises
    ------
    ParameterError
        If no notebook has the parameter, or one that has it wants another type; the right ones are listed.
    """
    for name in texts:
        if not any(name in notebook.parameters for notebook in notebooks.values()):
            raise ParameterError(f"no selected notebook has a parameter {name!r}\n{describe(notebooks)}")
    values: dict[str, dict[str, Any]] = {}
    for slug, notebook in notebooks.items():
        own = {name: text for name, text in texts.items() if name in notebook.parameters}
        try:
            values[slug] = {name: notebook.parameters[name].parse(text) for name, text in own.items()}
        except ParameterError as error:
            raise ParameterError(f"{slug}: {error}\n{describe({slug: notebook})}") from None
    return values


def describe(notebooks: Mapping[str, Notebook]) -> str:
    """Return a listing of the notebooks and their parameters with type, default, unit and meaning."""
    lines = []
    for slug, notebook in notebooks.items():
        lines.append(f"{slug}: {notebook.title}")
        lines += [
            f"    {parameter.name}: {parameter.type} = {parameter.default}  # {parameter.help}"
            for parameter in notebook.parameters.values()
        ]
    return "\n".join(lines)
