"""The paper's tables in its layout, each cell as "published / ours" (Wang et al., Tables I to VII)."""

from __future__ import annotations

import re
from collections.abc import Mapping

import pandas as pd

from soro_lib.replication.findings import Finding
from soro_lib.replication.scorecard import build_scorecard

LAYOUTS: dict[str, tuple[str, tuple[str, ...], tuple[str, ...]]] = {
    "table1": (r"table1_kp(?P<Kp>\d+)_(?P<what>\w+)", ("Kp",), ("what",)),
    "table2": (r"table2_kp(?P<Kp>\d+)_(?P<what>\w+)", ("Kp",), ("what",)),
    "table3": (
        r"table3_(?P<scene>lego|abdomen)_(?P<case>[a-z]+\d)_(?P<estimator>\w+)_(?P<error>mean|max|sd)",
        ("scene", "error"),
        ("case", "estimator"),
    ),
    "table4": (
        r"table4_(?P<case>[a-z]+\d)_(?P<estimator>\w+)_(?P<error>mean|max|sd)",
        ("error",),
        ("case", "estimator"),
    ),
    "table5": (
        r"table5_(?P<case>[a-z]+)_(?P<estimator>\w+)_(?P<error>mean|max|sd)",
        ("error",),
        ("case", "estimator"),
    ),
    "table6": (
        r"table6_n(?P<samples>\d+)_case(?P<case>\d)_(?P<estimator>\w+)_(?P<error>mean|max|sd)",
        ("error",),
        ("samples", "case", "estimator"),
    ),
    "table7": (
        r"table7_(?P<shape>\w+)_(?P<fibre>bare|cover)_(?P<what>shift|percent)",
        ("shape",),
        ("fibre", "what"),
    ),
}
"""Pattern of the ids of a table, and which parts of them name its rows and its columns."""


def paper_beside_ours(findings: Mapping[str, Finding], table: str) -> pd.DataFrame:
    """Lay out one table of the paper with the obtained number beside every published one.

    Parameters
    ----------
    findings
        Findings by the id of the published row.
    table
        One of `LAYOUTS`.

    Returns
    -------
    pandas.DataFrame
        Cells "published / ours"; a dash where nothing was attempted.
    """
    pattern, rows, columns = LAYOUTS[table]
    cells = []
    for number in build_scorecard("visual_strain_fusion", findings).to_dict("records"):
        parts = re.fullmatch(pattern, str(number["id"]))
        if parts:
            ours = "–" if pd.isna(number["ours"]) else f"{number['ours']:.3g}"
            cells.append({**parts.groupdict(), "cell": f"{number['published']:g} / {ours}"})
    wide = pd.DataFrame(cells).pivot(index=list(rows), columns=list(columns), values="cell")
    order = pd.DataFrame(cells)
    wide = wide.loc[list(dict.fromkeys(_keys(order, rows))), list(dict.fromkeys(_keys(order, columns)))]
    wide = wide.reset_index()
    wide.columns = [
        " ".join(part for part in _parts(column) if part).replace("_", " ") for column in wide.columns
    ]
    return wide


def _keys(cells: pd.DataFrame, names: tuple[str, ...]) -> list[object]:
    """Labels of the cells along one side, in the order of the paper."""
    if len(names) == 1:
        return list(cells[names[0]])
    return list(cells[list(names)].itertuples(index=False, name=None))


def _parts(column: object) -> tuple[str, ...]:
    return tuple(str(part) for part in column) if isinstance(column, tuple) else (str(column),)
