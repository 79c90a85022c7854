"""Hand recordings of an optical tracker: reading, checking and turning them into samples.

Device axes (right-handed, origin at the top centre of the device): x to the user's right, y up, z toward
the user. Tables keep the device's own units (millimetres, microseconds); :class:`HandSample` is SI.
"""

from __future__ import annotations

import gzip
import json
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

FINGERS = ("thumb", "index", "middle", "ring", "pinky")
PALM = ("palm_x_mm", "palm_y_mm", "palm_z_mm")
NORMAL = ("palm_nx", "palm_ny", "palm_nz")
DIRECTION = ("dir_x", "dir_y", "dir_z")
TIME_COLUMNS = ("timestamp_us", "frame_id")
HAND_COLUMNS = ("hand_id", *PALM, *NORMAL, *FINGERS)
OPTIONAL_COLUMNS = ("hand_type", "confidence", *DIRECTION, "grab_strength", "pinch_strength")
VELOCITY = ("palm_vx_mm_s", "palm_vy_mm_s", "palm_vz_mm_s")

MAXIMUM_ROWS = 1_000_000
"""Rows read at most: two and a half hours of one hand at 115 Hz."""
NORMAL_LENGTH = (0.9, 1.1)
"""Lengths of a palm normal that still count as a unit vector."""
MAXIMUM_COORDINATE = 2000.0
"""Largest palm coordinate believed [mm]: three times the depth of the interaction zone."""


class RecordingError(ValueError):
    """A hand recording that cannot be used; the message names file, row, column and bound."""


@dataclass(frozen=True, slots=True)
class HandSample:
    """One frame of the tracker, in SI units and the device frame.

    Parameters
    ----------
    time : float
        Device clock [s].
    hand_id : int or None
        The tracker's identity of the hand; None when no hand was seen (the other fields are then unused).
    palm : tuple of 3 floats
        Palm centre [m].
    normal : tuple of 3 floats
        Unit palm normal [-], pointing out of the palm: a flat hand facing the device has (0, -1, 0).
    fingers : tuple of 5 bools
        Thumb, index, middle, ring, pinky: True when extended (Lai et al., Eqs. (17), (18)).
    velocity : tuple of 3 floats
        Palm velocity reported by the tracker [m/s]; NaN when unknown.
    confidence : float
        The tracker's confidence in the hand, 0 to 1; NaN when unknown.
    """

    time: float
    hand_id: int | None = None
    palm: tuple[float, float, float] = (np.nan, np.nan, np.nan)
    normal: tuple[float, float, float] = (np.nan, np.nan, np.nan)
    fingers: tuple[bool, bool, bool, bool, bool] = (False, False, False, False, False)
    velocity: tuple[float, float, float] = (np.nan, np.nan, np.nan)
    confidence: float = np.nan


def load_hand_recording(path: str | Path, maximum_rows: int = MAXIMUM_ROWS) -> pd.DataFrame:
    """Read and check a hand recording.

    Parameters
    ----------
    path : str or Path
        ``.csv``, ``.csv.gz``, or a LeapJS playback file (``.json``; ``.json.lz`` = LZ-string, base64).
    maximum_rows : int
        Longer recordings are refused before they are parsed.

    Returns
    -------
    DataFrame
        One row per hand and frame, in time order: ``timestamp_us``, ``frame_id``, ``hand_id`` (missing when
        no hand was seen), ``palm_*_mm``, ``palm_n*`` (unit, device frame), five finger flags (1 = extended)
        and what else the file holds. Units are in the names.

    Raises
    ------
    FileNotFoundError
        No such file.
    RecordingError
        Empty, truncated, not a recording, too long, non-finite, a normal that is not a unit vector, or time
        stamps that do not increase; names the file, the row (1 = first after the header) and the column.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"hand recording not found: {path}")
    if path.stat().st_size == 0:
        raise RecordingError(f"{path.name}: the file is empty")
    suffixes = "".join(path.suffixes[-2:]).lower()
    if suffixes.endswith((".json", ".lz")):
        table = _read_playback(path, maximum_rows)
    else:
        table = _read_csv(path, maximum_rows)
    return _checked(table, path.name)


def hand_samples(table: pd.DataFrame) -> Iterator[HandSample]:
    """Turn a recording into samples, one per frame, staying on one hand.

    When two hands are seen, the one followed so far is kept; it is never averaged with the other.

    Parameters
    ----------
    table : DataFrame
        As returned by :func:`load_hand_recording`.

    Yields
    ------
    HandSample
        In time order, SI units, device frame.
    """
    seen = table["hand_id"].notna().to_numpy()
    identity = table["hand_id"].fillna(-1).to_numpy(dtype=np.int64).tolist()
    time = (table["timestamp_us"].to_numpy(dtype=np.int64) * 1e-6).tolist()
    palm = _triples(table, PALM, 1e-3)
    normal = _triples(table, NORMAL)
    fingers = [tuple(row) for row in (table[list(FINGERS)].fillna(0).to_numpy() == 1).tolist()]
    velocity = _triples(table, VELOCITY, 1e-3)
    confidence = table.get("confidence", pd.Series(np.nan, table.index)).to_numpy(float).tolist()

    current: int | None = None
    for rows in _frames(table["timestamp_us"].to_numpy()):
        hands = [row for row in rows if seen[row]]
        if not hands:
            yield HandSample(time[rows[0]])
            continue
        row = next((row for row in hands if identity[row] == current), hands[0])
        current = identity[row]
        yield HandSample(
            time[row], current, palm[row], normal[row], fingers[row], velocity[row], confidence[row]
        )


def timing_summary(table: pd.DataFrame) -> pd.Series:
    """Describe the clock of a recording.

    Parameters
    ----------
    table : DataFrame
        As returned by :func:`load_hand_recording`.

    Returns
    -------
    Series
        ``frames``, ``duration_s``, ``mean_rate_hz``, ``base_period_ms`` (median interval), ``doubled`` and
        ``tripled`` (fractions of intervals near 2 and 3 base periods), ``longest_gap_ms``, ``lost_frames``.
    """
    per_frame = table.drop_duplicates("timestamp_us")
    interval = np.diff(per_frame["timestamp_us"].to_numpy(dtype=float)) * 1e-3
    if interval.size == 0:
        raise RecordingError("timing needs at least two frames, got 1")
    period = float(np.median(interval))
    ratio = interval / period
    return pd.Series(
        {
            "frames": len(per_frame),
            "duration_s": interval.sum() * 1e-3,
            "mean_rate_hz": 1e3 / interval.mean(),
            "base_period_ms": period,
            "doubled": np.mean((ratio > 1.5) & (ratio < 2.5)),
            "tripled": np.mean((ratio > 2.5) & (ratio < 3.5)),
            "longest_gap_ms": interval.max(),
            "lost_frames": int(per_frame["hand_id"].isna().sum()),
        }
    )


# --- reading -----------------------------------------------------------------------------------------------


def _read_csv(path: Path, maximum_rows: int) -> pd.DataFrame:
    """Read a plain or gzipped CSV after counting its lines."""
    zipped = path.suffix.lower() == ".gz"
    try:
        _refuse_too_long(path, zipped, maximum_rows)
        table = pd.read_csv(path, compression="gzip" if zipped else None)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise RecordingError(f"{path.name}: truncated or damaged gzip file ({error})") from error
    except UnicodeDecodeError as error:
        raise RecordingError(f"{path.name}: not a text file (byte {error.start} is not UTF-8)") from error
    except pd.errors.ParserError as error:
        raise RecordingError(f"{path.name}: not a table of comma-separated values ({error})") from error
    except pd.errors.EmptyDataError as error:
        raise RecordingError(f"{path.name}: the file is empty") from error
    return table


def _refuse_too_long(path: Path, zipped: bool, maximum_rows: int) -> None:
    """Count lines in blocks and stop at the limit, so that a huge file costs neither memory nor time."""
    with gzip.open(path, "rb") if zipped else path.open("rb") as stream:
        lines = 0
        while block := stream.read(1 << 20):
            lines += block.count(b"\n")
            if lines > maximum_rows + 1:
                raise RecordingError(
                    f"{path.name}: more than {maximum_rows:,} rows; cut the recording or raise maximum_rows"
                )


def _read_playback(path: Path, maximum_rows: int) -> pd.DataFrame:
    """Read a LeapJS playback file, packed (format version 2) or as plain frames."""
    try:
        text = path.read_text(encoding="utf-8")
        if path.suffix.lower() == ".lz":
            from lzstring import LZString

            text = LZString().decompressFromBase64(text.strip())
        document = json.loads(text)
    except (ValueError, TypeError, KeyError, IndexError) as error:
        raise RecordingError(f"{path.name}: not a LeapJS playback file ({error})") from error
    frames = document.get("frames") if isinstance(document, dict) else None
    if not isinstance(frames, list) or len(frames) < 2:
        raise RecordingError(f"{path.name}: not a LeapJS playback file (no list of frames)")
    if len(frames) > maximum_rows:
        raise RecordingError(
            f"{path.name}: {len(frames):,} frames, at most {maximum_rows:,}; cut the recording"
        )
    if isinstance(frames[0], list):
        frames = [_unpacked(frames[0], packed) for packed in frames[1:]]
    try:
        rows = [row for frame in frames for row in _playback_rows(frame)]
    except (KeyError, TypeError, IndexError) as error:
        raise RecordingError(f"{path.name}: a frame lacks the field {error}") from error
    return pd.DataFrame(rows)


def _unpacked(structure: list[Any], packed: list[Any]) -> Any:
    """Give a packed LeapJS array its keys back; ``structure`` is the first entry of the file."""
    if structure and isinstance(structure[0], list):
        return [_unpacked(structure[0], item) for item in packed]
    frame: dict[str, Any] = {}
    for key, value in zip(structure, packed):
        if isinstance(key, dict):
            (name, inner), *_ = key.items()
            frame[name] = _unpacked(inner, value)
        else:
            frame[key] = value
    return frame


def _playback_rows(frame: dict[str, Any]) -> list[dict[str, Any]]:
    """Flatten one LeapJS frame into table rows."""
    stamp = {"timestamp_us": frame["timestamp"], "frame_id": frame["id"]}
    if not frame.get("hands"):
        return [stamp]
    rows = []
    for hand in frame["hands"]:
        row = stamp | {
            "hand_id": hand["id"],
            "hand_type": hand.get("type"),
            "confidence": hand.get("confidence"),
        }
        row |= zip(PALM, hand["palmPosition"])
        row |= zip(NORMAL, hand["palmNormal"])
        row |= zip(DIRECTION, hand.get("direction", ()))
        row |= zip(VELOCITY, hand.get("palmVelocity", ()))
        row |= {"grab_strength": hand.get("grabStrength"), "pinch_strength": hand.get("pinchStrength")}
        fingers = [item for item in frame.get("pointables", ()) if item.get("handId") == hand["id"]]
        fingers = [item for item in fingers if not item.get("tool")]
        fingers.sort(key=lambda item: item.get("type", 0))
        row |= {name: int(_extended(finger)) for name, finger in zip(FINGERS, fingers)}
        rows.append(row)
    return rows


def _extended(finger: dict[str, Any]) -> bool:
    """Return the stored flag; where the packer dropped it, a finger bent below 60 degrees is extended."""
    if "extended" in finger:
        return bool(finger["extended"])
    knuckle, middle, last = (np.asarray(finger[key]) for key in ("mcpPosition", "pipPosition", "dipPosition"))
    proximal, distal = middle - knuckle, np.asarray(finger["tipPosition"]) - last
    cosine = proximal @ distal / max(float(np.linalg.norm(proximal) * np.linalg.norm(distal)), 1e-9)
    return bool(cosine > 0.5)


# --- checking ----------------------------------------------------------------------------------------------


def _checked(table: pd.DataFrame, name: str) -> pd.DataFrame:
    """Return the table in its final types, or raise with the first offending row."""
    if "frame_id" not in table and "timestamp_us" in table:
        table = table.assign(frame_id=np.arange(len(table)))
    missing = [column for column in (*TIME_COLUMNS, *HAND_COLUMNS) if column not in table]
    if missing:
        raise RecordingError(f"{name}: not a hand recording, columns missing: {', '.join(missing)}")
    if table.empty:
        raise RecordingError(f"{name}: no rows below the header")
    numeric = [c for c in (*TIME_COLUMNS, *HAND_COLUMNS, *OPTIONAL_COLUMNS, *VELOCITY) if c != "hand_type"]
    table = table.copy()
    for column in (column for column in numeric if column in table):
        number = pd.to_numeric(table[column], errors="coerce")
        _require(number.notna() | table[column].isna(), table, column, name, "a number")
        table[column] = number

    _require(np.isfinite(table["timestamp_us"]), table, "timestamp_us", name, "a finite time stamp")
    hand = table["hand_id"].notna()
    for column in HAND_COLUMNS:
        _require(
            np.isfinite(table[column]) | ~hand, table, column, name, "a finite number where a hand is seen"
        )
    for column in PALM:
        near = table[column].abs() <= MAXIMUM_COORDINATE
        _require(near | ~hand, table, column, name, f"at most {MAXIMUM_COORDINATE:g} mm from the device")
    for column in FINGERS:
        _require(table[column].isin((0, 1)) | ~hand, table, column, name, "0 or 1")

    length = np.linalg.norm(table[list(NORMAL)].to_numpy(), axis=1)
    unit = (length > NORMAL_LENGTH[0]) & (length < NORMAL_LENGTH[1])
    bound = f"a palm normal of length {NORMAL_LENGTH[0]} to {NORMAL_LENGTH[1]}"
    _require(
        pd.Series(unit, table.index) | ~hand, table.assign(palm_normal=length), "palm_normal", name, bound
    )
    table[list(NORMAL)] = table[list(NORMAL)].to_numpy() / np.where(unit, length, 1.0)[:, None]

    _require_order(table, name)
    return table.astype({"timestamp_us": np.int64, "hand_id": "Int64"})


def _require(good: Any, table: pd.DataFrame, column: str, name: str, bound: str) -> None:
    """Raise for the first row where ``good`` is False."""
    wrong = ~np.asarray(good, dtype=bool)
    if wrong.any():
        row = int(np.argmax(wrong))
        value = table[column].tolist()[row]
        raise RecordingError(f"{name}: row {row + 1}, {column} = {value!r}, expected {bound}")


def _require_order(table: pd.DataFrame, name: str) -> None:
    """Time must increase from frame to frame; only different hands may share a time stamp."""
    stamp = table["timestamp_us"].to_numpy()
    backward = np.flatnonzero(np.diff(stamp) < 0)
    if backward.size:
        row = int(backward[0]) + 1
        late = f"timestamp_us = {stamp[row]:.0f} is earlier than the row before ({stamp[row - 1]:.0f})"
        raise RecordingError(f"{name}: row {row + 1}, {late}")
    repeated = np.flatnonzero(table.duplicated(["timestamp_us", "hand_id"]))
    if repeated.size:
        row = int(repeated[0])
        again = f"timestamp_us = {stamp[row]:.0f} is repeated for the same hand"
        raise RecordingError(f"{name}: row {row + 1}, {again}")


def _triples(
    table: pd.DataFrame, columns: tuple[str, ...], scale: float = 1.0
) -> list[tuple[float, float, float]]:
    """Return three columns as a list of triples; NaN where the table lacks them."""
    values: NDArray[np.float64] = table.reindex(columns=list(columns)).to_numpy(float) * scale
    return [tuple(row) for row in values.tolist()]


def _frames(stamp: NDArray[Any]) -> Iterator[range]:
    """Yield the row numbers of each frame (equal time stamps)."""
    starts = np.flatnonzero(np.diff(stamp, prepend=stamp[0] - 1))
    for start, stop in zip(starts.tolist(), [*starts[1:].tolist(), len(stamp)]):
        yield range(start, stop)
