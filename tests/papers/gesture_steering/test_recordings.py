"""The shipped recordings are what their generator makes, and a missing one is named."""

import pytest

from soro_lib.papers.gesture_steering import recordings
from soro_lib.project import data_directory
from soro_lib.replication.datacards import DataCardError
from soro_lib.sensing.hand_tracking import load_hand_recording


def test_shipped_recordings_are_what_their_generator_makes(tmp_path):
    recordings.write_recordings(tmp_path)
    shipped = data_directory("gesture_steering") / "recordings"
    for made in sorted(tmp_path.iterdir()):
        if made.suffix == ".gz":  # compressed bytes may differ between zlib versions, the table may not
            assert load_hand_recording(made).equals(load_hand_recording(shipped / made.name))
        else:
            assert made.read_text().split("sha256")[0] == (shipped / made.name).read_text().split("sha256")[0]


def test_a_missing_shipped_recording_is_named_with_its_place(monkeypatch, tmp_path):
    folder = tmp_path / "gesture_steering" / "recordings"
    folder.mkdir(parents=True)
    card = "steering_minute.csv.gz.card.toml"
    (folder / card).write_bytes((data_directory("gesture_steering") / "recordings" / card).read_bytes())
    monkeypatch.setattr(recordings, "data_directory", lambda slug: tmp_path / slug)
    with pytest.raises(DataCardError, match=r"recordings/steering_minute\.csv\.gz: no such"):
        recordings.load_recording("steering_minute")
