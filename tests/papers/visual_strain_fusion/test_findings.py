"""Findings answer published ids; the paper's tables hold every published cell once, with ours beside it."""

import numpy as np
import pytest

from soro_lib.papers.visual_strain_fusion.experiments.fusion_runs import camera_accuracy
from soro_lib.papers.visual_strain_fusion.findings import LAYOUTS, fusion_findings, paper_beside_ours
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


def test_findings_answer_published_ids_and_nothing_else(runs, motion):
    light = runs[runs["flight"] == "scene1_light"]
    obstacles = runs[runs["flight"] == "scene1_obstacles"]
    findings = fusion_findings(obstacles, light, camera_accuracy(), motion)
    published = load_published("visual_strain_fusion")
    ids = set(published)
    assert set(findings) <= ids
    ours = {row for row in ids if row.startswith(("s4b_", "s4c1_", "s4c2_"))}
    assert ours == set(findings)
    assert all(isinstance(finding, Finding) and np.isfinite(finding.value) for finding in findings.values())
