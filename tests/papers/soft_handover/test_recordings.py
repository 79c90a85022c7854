"""The recordings: whole, explained, and made by named jobs."""

from soro_lib.papers.soft_handover import recordings as record
from soro_lib.papers.soft_handover.experiments import vision
from soro_lib.papers.soft_handover.world.observer import load_vision_noise

NOISE = ("wrist_jitter", "wrist_bias", "direction_jitter", "direction_bias", "ball_jitter", "ball_bias")


def test_recordings_are_whole_and_every_column_is_explained(tmp_path):
    table = vision.accuracy(1, 3, vision.CAUSES[:1])
    path = record.write_table("vision_accuracy", table, tmp_path)
    assert not list(tmp_path.glob("*.part"))
    again = path.read_bytes()
    record.write_table("vision_accuracy", table, tmp_path)
    assert path.read_bytes() == again
    record.write_noise({"three cameras": dict.fromkeys(NOISE, 0.001)}, 4, tmp_path)
    assert load_vision_noise("three cameras", tmp_path / "vision_noise.toml").wrist_bias == 0.001


def test_jobs_cover_all_recordings_and_shrink_in_the_small_form():
    names = list(record.jobs())
    assert len(names) == len(set(names))
    assert set(record.STUDIES) <= set(names)
    assert len(record.jobs(small=True)) < len(names)
