"""From a figure of a paper to the file that rebuilds it."""

import importlib
import importlib.util
import inspect
import pkgutil
import re
from types import ModuleType

import pandas as pd

from soro_lib.project import figures_directory


def figure_map(slugs: tuple[str, ...]) -> pd.DataFrame:
    """List every figure and table that the notebooks have written.

    Parameters
    ----------
    slugs
        The notebooks, in order.

    Returns
    -------
    pandas.DataFrame
        Columns ``paper``, ``place`` in the paper (empty for what the workbook adds), ``shows`` (first line of
        the docstring of the function that draws it) and ``file``.
    """
    rows = [
        {
            "paper": slug,
            "place": place_in_paper(path.stem),
            "shows": _shows(slug, path.stem),
            "file": f"figures/{slug}/{path.name}",
        }
        for slug in slugs
        for path in sorted(figures_directory(slug).glob("*"))
        if path.suffix in (".png", ".csv") and path.stem != "scorecard"
    ]
    return pd.DataFrame(rows, columns=["paper", "place", "shows", "file"])


def place_in_paper(name: str) -> str:
    """Return the paper's own name for a figure or table, read off the file name.

    Examples
    --------
    >>> [place_in_paper(name) for name in ("fig07a_infinity_path", "table2_configurations", "four_arms")]
    ['Fig. 7a', 'Table 2', '']
    """
    match = re.match(r"(fig|table)0*(\d+[a-z]?)(_|$)", name)
    return f"{'Fig.' if match[1] == 'fig' else 'Table'} {match[2]}" if match else ""


def _shows(slug: str, name: str) -> str:
    """Return the first line of what draws the figure, or its name in words where nothing has that name."""
    found = (getattr(module, name, None) for module in _figure_modules(slug))
    text = next((inspect.getdoc(function) for function in found if inspect.isfunction(function)), None)
    words = re.sub(r"^(fig|table)\w*?_", "", name).replace("_", " ")
    return text.splitlines()[0].rstrip(".") if text else words


def _figure_modules(slug: str) -> list[ModuleType]:
    """Return the module that draws the figures of a notebook, and those inside it where it is a package."""
    name = f"soro_lib.papers.{slug}.figures"
    if importlib.util.find_spec(name) is None:
        return []
    module = importlib.import_module(name)
    inside = pkgutil.iter_modules(getattr(module, "__path__", []))
    return [module, *(importlib.import_module(f"{name}.{item.name}") for item in inside)]
