"""Tables in the paper's layout: every published cell is there once, with ours beside it."""

import pytest

from soro_lib.papers.visual_strain_fusion.figures.tables import LAYOUTS, paper_beside_ours
from soro_lib.replication.findings import Finding
from soro_lib.replication.published import load_published


@pytest.mark.parametrize("table", LAYOUTS)
def test_every_published_cell_is_in_its_table(table):
    wide = paper_beside_ours({}, table)
    cells = wide.to_numpy().ravel().tolist()
    published = [
        number for name, number in load_published("visual_strain_fusion").items() if name.startswith(table)
    ]
    assert sum(" / –" in str(cell) for cell in cells) == len(published)


def test_ours_stands_beside_the_published_number():
    wide = paper_beside_ours({"table1_kp04_hybrid_error_mean": Finding([2.0, 2.2])}, "table1")
    assert wide.set_index("Kp").loc["04", "hybrid error mean"] == "2.305 / 2.1"
