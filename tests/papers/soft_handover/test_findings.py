"""Every published number has its finding."""

import pandas as pd

from soro_lib.papers.soft_handover import beyond as improvements
from soro_lib.papers.soft_handover import findings
from soro_lib.papers.soft_handover.calibration import plant_k, timestep
from soro_lib.papers.soft_handover.experiments import guidance, handover, use_case, variants
from soro_lib.papers.soft_handover.world.observer import NoisyObserver, load_vision_noise
from soro_lib.papers.soft_handover.world.plant import ElasticPlant
from soro_lib.replication.scorecard import build_scorecard

EYES = NoisyObserver(load_vision_noise("thesis"))
PLANTS = {"K": plant_k(), "E": ElasticPlant()}


def test_findings_fill_the_scorecard():
    runs, traces = handover.compare(
        handover.by_step_size((0.1, 0.2, 0.4)), PLANTS, handover.Blocks(EYES, 1, 1)
    )
    guided, _ = handover.compare(
        handover.by_step_size((0.1, 0.2)), PLANTS, handover.Blocks(EYES, 1, 1), guide=guidance.GuidingHand()
    )
    cases = pd.concat(
        use_case.use_cases(handover.thesis_parameters(0.4), plant, handover.Blocks(EYES, 1, 1), plant=name)
        for name, plant in PLANTS.items()
    )
    bare, _ = handover.compare(
        variants.with_and_without_estimation(0.4), PLANTS, handover.Blocks(EYES, 1, 1), step_limit=30
    )
    suggested, _ = handover.compare(
        improvements.suggestions(), PLANTS, handover.Blocks(EYES, 1, 1), step_limit=150
    )
    tables = findings.HandoverTables(runs, traces, guided, cases, bare, suggested)
    result = findings.findings(tables, {a: timestep(a) for a in (0.1, 0.2, 0.4)})
    card = build_scorecard("soft_handover", result).set_index("id")
    open_rows = card[(card["verdict"] == "not attempted") & (card["kind"] != "hardware")].index
    vision = {
        "s54_third_camera_better",
        "fig14_side_limits",
        "fig15_occlusion_hurts",
        "s32_baseline",
        "s324_marker_size",
    }
    assert set(open_rows) <= vision
    assert (
        card.loc[card["kind"] == "definition", "verdict"].drop(list(vision), errors="ignore") == "reproduced"
    ).all()
    assert findings.claims_on_both(tables)["holds on both"].any()
