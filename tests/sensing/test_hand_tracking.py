"""Hand recordings: every format is read, every fault is named, and samples follow one hand."""

import gzip
import json

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lzstring import LZString

from soro_lib.project import ROOT
from soro_lib.sensing import load_hand_recording
from soro_lib.sensing.hand_tracking import (
    FINGERS,
    NORMAL,
    PALM,
    HandSample,
    RecordingError,
    hand_samples,
    timing_summary,
)

REAL = ROOT.parent / "shared" / "recordings"


def recording(rows: int = 5) -> pd.DataFrame:
    """Return a sound recording of one flat palm."""
    table = pd.DataFrame({"timestamp_us": 1_000_000 + 8670 * np.arange(rows), "frame_id": np.arange(rows)})
    table["hand_id"], table["hand_type"], table["confidence"] = 7, "right", 1.0
    table[list(PALM)] = (10.0, 200.0, -5.0)
    table[list(NORMAL)] = (0.0, -1.0, 0.0)
    table[list(FINGERS)] = 1
    return table


@pytest.fixture
def saved(tmp_path):
    def save(table: pd.DataFrame, name: str = "hand.csv"):
        table.to_csv(tmp_path / name, index=False)
        return tmp_path / name

    return save


# --- formats ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["hand.csv", "hand.csv.gz"])
def test_csv_is_read(saved, name):
    table = load_hand_recording(saved(recording(), name))
    assert len(table) == 5
    assert table["timestamp_us"].dtype == np.int64
    np.testing.assert_allclose(table[list(NORMAL)], [[0, -1, 0]] * 5)


def playback_frame(index: int, hands: int = 1, extended: bool | None = True) -> dict:
    frame = {"id": index, "timestamp": 1_000_000 + 9000 * index, "hands": [], "pointables": []}
    for hand in range(hands):
        frame["hands"].append(
            {"id": 3 + hand, "type": "right", "direction": [0, 0, -1], "palmNormal": [0, -1, 0],
             "palmPosition": [1.0 * index, 150.0, 2.0], "palmVelocity": [0, 0, 0], "pinchStrength": 0.0,
             "grabStrength": 0.0, "confidence": 0.9}
        )  # fmt: skip
        for finger in range(5):
            tip = [0, 0, -60] if finger != 2 else [0, -20, -20]  # the middle finger is curled back
            bone = {"id": finger, "handId": 3 + hand, "type": finger, "tool": False, "mcpPosition": [0, 0, 0],
                    "pipPosition": [0, 0, -30], "dipPosition": [0, 0, -45], "tipPosition": tip}  # fmt: skip
            if extended is not None:
                bone["extended"] = extended
            frame["pointables"].append(bone)
    return frame


def packed(frames: list[dict]) -> list:
    """Pack frames as LeapJS playback does in its format version 2."""
    hand_keys, bone_keys = list(frames[0]["hands"][0]), list(frames[0]["pointables"][0])
    rows = [
        [f["id"], f["timestamp"], [[h[k] for k in hand_keys] for h in f["hands"]],
         [[p[k] for k in bone_keys] for p in f["pointables"]]]
        for f in frames
    ]  # fmt: skip
    return [["id", "timestamp", {"hands": [hand_keys]}, {"pointables": [bone_keys]}], *rows]


@pytest.mark.parametrize("suffix", [".json", ".json.lz"])
@pytest.mark.parametrize("pack", [True, False])
def test_playback_is_read(tmp_path, suffix, pack):
    frames = [playback_frame(index) for index in range(4)]
    text = json.dumps({"metadata": {"formatVersion": 2}, "frames": packed(frames) if pack else frames})
    path = tmp_path / f"take{suffix}"
    path.write_text(LZString().compressToBase64(text) if suffix.endswith("lz") else text)
    table = load_hand_recording(path)
    np.testing.assert_allclose(table["palm_x_mm"], [0, 1, 2, 3])
    assert (table[list(FINGERS)] == 1).all(axis=None)


def test_playback_without_flags_derives_them_from_the_bones(tmp_path):
    path = tmp_path / "take.json"
    frames = packed([playback_frame(index, extended=None) for index in range(3)])
    path.write_text(json.dumps({"metadata": {}, "frames": frames}))
    assert load_hand_recording(path)[list(FINGERS)].iloc[0].tolist() == [1, 1, 0, 1, 1]


def test_playback_frame_without_a_hand(tmp_path):
    path = tmp_path / "take.json"
    path.write_text(
        json.dumps({"frames": [playback_frame(0), playback_frame(1, hands=0), playback_frame(2)]})
    )
    assert [sample.hand_id for sample in hand_samples(load_hand_recording(path))] == [3, None, 3]


# --- samples ------------------------------------------------------------------------------------------------


def test_samples_are_si():
    sample = next(hand_samples(recording()))
    assert sample.palm == pytest.approx((0.01, 0.2, -0.005))
    assert sample.time == pytest.approx(1.0)
    assert sample.fingers == (True,) * 5
    assert HandSample(0.0).hand_id is None


def test_samples_stay_on_one_hand_of_several():
    one, two = recording(6), recording(6)
    two["hand_id"], two["palm_x_mm"] = 4, 99.0
    both = (
        pd.concat([two.iloc[3:], one]).sort_values("timestamp_us", kind="stable").astype({"hand_id": "Int64"})
    )
    assert {sample.hand_id for sample in hand_samples(both)} == {7}


def test_frame_without_a_hand_is_a_sample_without_a_hand(saved):
    table = recording().astype({"hand_id": "Int64"})
    hand = [column for column in table if column not in ("timestamp_us", "frame_id")]
    table.loc[2, hand] = None
    samples = list(hand_samples(load_hand_recording(saved(table))))
    assert [sample.hand_id for sample in samples] == [7, 7, None, 7, 7]


def test_timing_summary_sees_a_hole():
    table = recording(200)
    table.loc[100:, "timestamp_us"] += 2 * 8670
    summary = timing_summary(table)
    assert summary["base_period_ms"] == pytest.approx(8.67)
    assert summary["tripled"] == pytest.approx(1 / 199)


@settings(max_examples=30, deadline=None)
@given(st.floats(0.901, 1.099), st.floats(-1500, 1500))
def test_slightly_wrong_normals_are_renormalised(tmp_path_factory, length, x):
    table = recording()
    table[list(NORMAL)] *= length
    table["palm_x_mm"] = x
    path = tmp_path_factory.mktemp("r") / "hand.csv"
    table.to_csv(path, index=False)
    read = load_hand_recording(path)
    np.testing.assert_allclose(np.linalg.norm(read[list(NORMAL)], axis=1), 1.0)


# --- bad input ----------------------------------------------------------------------------------------------


def test_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"hand recording not found: .*nowhere\.csv"):
        load_hand_recording(tmp_path / "nowhere.csv")


@pytest.mark.parametrize("name", ["a.csv", "a.json", "a.json.lz", "a.csv.gz"])
def test_empty_file(tmp_path, name):
    (tmp_path / name).write_bytes(b"")
    with pytest.raises(RecordingError, match=rf"{name}: the file is empty"):
        load_hand_recording(tmp_path / name)


def test_header_alone(saved):
    with pytest.raises(RecordingError, match=r"hand\.csv: no rows below the header"):
        load_hand_recording(saved(recording().iloc[:0]))


def test_wrong_columns_are_listed(saved):
    table = recording().drop(columns=["palm_nx", "thumb"])
    with pytest.raises(RecordingError, match="not a hand recording, columns missing: palm_nx, thumb"):
        load_hand_recording(saved(table))


def test_text_file_named_csv(tmp_path):
    path = tmp_path / "letter.csv"
    path.write_text("Dear Sir,\nthis is, after all, no table, is it?\nYours, x\n")
    with pytest.raises(RecordingError, match=r"letter\.csv: not a (table|hand recording)"):
        load_hand_recording(path)


def test_binary_file_named_csv(tmp_path):
    path = tmp_path / "photo.csv"
    path.write_bytes(b"\x89PNG\r\n\x1a\n\xff\xfe" * 9)
    with pytest.raises(RecordingError, match=r"photo\.csv: not a text file"):
        load_hand_recording(path)


@pytest.mark.parametrize("column", ["palm_y_mm", "palm_nz", "index"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_non_finite_values_are_named(saved, column, value):
    table = recording().astype({column: float})
    table.loc[3, column] = value
    with pytest.raises(
        RecordingError, match=rf"hand\.csv: row 4, {column} = (nan|inf), expected a finite number"
    ):
        load_hand_recording(saved(table))


def test_words_among_numbers(saved):
    table = recording().astype({"palm_x_mm": object})
    table.loc[1, "palm_x_mm"] = "left"
    with pytest.raises(RecordingError, match="row 2, palm_x_mm = 'left', expected a number"):
        load_hand_recording(saved(table))


def test_normal_that_is_no_unit_vector(saved):
    table = recording()
    table.loc[2, list(NORMAL)] = (0.0, -0.5, 0.0)
    with pytest.raises(RecordingError, match=r"row 3, palm_normal = 0\.5, expected .* 0\.9 to 1\.1"):
        load_hand_recording(saved(table))


def test_finger_flag_out_of_range(saved):
    table = recording()
    table.loc[0, "ring"] = 2
    with pytest.raises(RecordingError, match=r"row 1, ring = 2.*, expected 0 or 1"):
        load_hand_recording(saved(table))


def test_palm_beyond_belief(saved):
    table = recording()
    table.loc[0, "palm_z_mm"] = 1e5
    with pytest.raises(RecordingError, match=r"row 1, palm_z_mm = 100000.*, expected at most 2000 mm"):
        load_hand_recording(saved(table))


def test_unsorted_time_stamps(saved):
    table = recording().iloc[[0, 2, 1, 3, 4]]
    with pytest.raises(RecordingError, match=r"row 3, timestamp_us = \d+ is earlier than the row before"):
        load_hand_recording(saved(table))


def test_repeated_time_stamp_of_one_hand(saved):
    table = recording().iloc[[0, 1, 1, 2]]
    with pytest.raises(RecordingError, match=r"row 3, timestamp_us = \d+ is repeated for the same hand"):
        load_hand_recording(saved(table))


def test_two_hands_may_share_a_time_stamp(saved):
    other = recording()
    other["hand_id"] = 8
    table = pd.concat([recording(), other]).sort_values("timestamp_us", kind="stable")
    assert len(load_hand_recording(saved(table))) == 10


def test_truncated_gzip(saved, tmp_path):
    whole = saved(recording(500), "hand.csv.gz").read_bytes()
    path = tmp_path / "cut.csv.gz"
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(RecordingError, match=r"cut\.csv\.gz: truncated or damaged gzip file"):
        load_hand_recording(path)


def test_plain_text_named_gz(tmp_path):
    path = tmp_path / "hand.csv.gz"
    path.write_text("timestamp_us\n1\n")
    with pytest.raises(RecordingError, match="truncated or damaged gzip file"):
        load_hand_recording(path)


@pytest.mark.parametrize("name", ["long.csv", "long.csv.gz"])
def test_ten_million_rows_are_refused_before_they_are_parsed(tmp_path, name):
    path = tmp_path / name
    block = b"1,2,3\n" * 1_000_000
    with gzip.open(path, "wb", compresslevel=1) if name.endswith("gz") else path.open("wb") as stream:
        for _ in range(10):
            stream.write(block)
    with pytest.raises(RecordingError, match=rf"{name}: more than 1,000,000 rows; cut the recording"):
        load_hand_recording(path)


@pytest.mark.parametrize(
    "text", ["{}", "[1, 2]", "{", '{"frames": [1, 2]}', '{"frames": [{"id": 1}, {"id": 2}]}']
)
@pytest.mark.parametrize("suffix", [".json", ".json.lz"])
def test_playback_that_is_none(tmp_path, text, suffix):
    path = tmp_path / f"take{suffix}"
    path.write_text(LZString().compressToBase64(text) if suffix.endswith("lz") else text)
    with pytest.raises(RecordingError, match=r"take\.json"):
        load_hand_recording(path)


def test_playback_that_is_no_base64(tmp_path):
    path = tmp_path / "take.json.lz"
    path.write_text("%%% not base64 %%%")
    with pytest.raises(RecordingError, match="not a LeapJS playback file"):
        load_hand_recording(path)


# --- real recordings ----------------------------------------------------------------------------------------


@pytest.mark.skipif(not REAL.is_dir(), reason="the real recordings are not here")
@pytest.mark.parametrize("path", sorted(REAL.glob("*.csv")), ids=lambda path: path.stem)
def test_real_recordings_are_read(path):
    table = load_hand_recording(path)
    summary = timing_summary(table)
    assert 8.4 < summary["base_period_ms"] < 9.2
    assert len(list(hand_samples(table))) == len(table)
