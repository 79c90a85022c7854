"""The generator of the stored flights makes them again."""

import numpy as np
import pandas as pd

from soro_lib.papers.visual_strain_fusion import recordings as record
from soro_lib.papers.visual_strain_fusion.experiments import camera_runs
from soro_lib.papers.visual_strain_fusion.experiments.camera_runs import load_flight
from soro_lib.replication.datacards import card_path, verified


def test_the_generator_makes_the_stored_flight_again_and_leaves_whole_files_only(
    tmp_path, sweep, monkeypatch
):
    def swept(scene, rng):
        assert (scene, rng.bit_generator.state) == (sweep.scene, sweep.before)
        rng.bit_generator.state = sweep.after
        return sweep.copy(), sweep.similarity

    monkeypatch.setattr(camera_runs, "start_tracker", swept)
    progress: dict[str, int] = {}
    paths = record.record("scene1_light", tmp_path, progress, steps=4)
    assert progress == {"scene1_light": 4}
    written = [path for path in paths for path in (path, card_path(path))]
    assert sorted(tmp_path.iterdir()) == sorted(written)
    again = pd.read_csv(verified(paths[0]))
    stored = load_flight("scene1_light").iloc[:4]
    # Equal to the byte on one machine; another processor may round otherwise and choose other matches.
    np.testing.assert_allclose(again[["x_mm", "y_mm", "z_mm"]], stored[["x_mm", "y_mm", "z_mm"]], atol=0.3)
