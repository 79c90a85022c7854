"""The shipped recordings of simulated hands, and what makes them again (Lai et al., Figs. 5 and 10).

python -m soro_lib.papers.gesture_steering.recordings
"""

import gzip
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from soro_lib.papers.gesture_steering.world import hand
from soro_lib.papers.gesture_steering.world.hand import Array, HandNoise, constant, synthetic_recording
from soro_lib.paths import A4_PAPER
from soro_lib.project import data_directory
from soro_lib.replication.datacards import generator_options, verified, write_card
from soro_lib.sensing.hand_tracking import FINGERS, load_hand_recording

SEED = 20260
HOVER = 8.0
"""Time that a hand hovers [s]."""
ABOUT = {
    "steering_minute": "random steering through all four gestures, with tracking losses and palm flips",
    "a4_palm": "a palm that traces the edges of an A4 sheet held flat",
    "a4_finger": "a finger tip, in the palm columns, that traces the edges of an A4 sheet",
    "hover": "eight seconds of hovering palm, then eight of hovering V-sign",
}
DEVICE_AXES = "(x right, y up, z toward the user)"
COLUMNS = {
    "timestamp_us": "[us] device clock",
    "frame_id": "[-] frame number",
    "hand_id": "[-] identity given by the tracker; empty when no hand is seen",
    "hand_type": "[-] left or right",
    "confidence": "[-] confidence of the tracker, 0 to 1",
    **{f"palm_{axis}_mm": f"[mm] palm centre, device {axis} {DEVICE_AXES}" for axis in "xyz"},
    **{f"palm_n{axis}": f"[-] palm normal, a unit vector, device {axis}" for axis in "xyz"},
    **{f"dir_{axis}": f"[-] direction of the hand, a unit vector, device {axis}" for axis in "xyz"},
    **{finger: "[-] 1 = extended, 0 = curled" for finger in FINGERS},
    **{f"palm_v{axis}_mm_s": f"[mm/s] palm velocity as reported, device {axis}" for axis in "xyz"},
}
"""Columns of the shipped recordings."""
FINGERTIP = HandNoise(tremor=(0.1e-3, 0.12e-3, 0.1e-3), drift=0.7e-3)
"""A finger guided by an edge is steadier than a palm in the air."""


def load_recording(name: str) -> pd.DataFrame:
    """Load a recording: a shipped one by its name, any other by its path.

    Parameters
    ----------
    name : str
        ``steering_minute``, ``a4_palm``, ``a4_finger``, ``hover``, or the path of a file.
    """
    if name in ABOUT:
        name = str(verified(data_directory("gesture_steering") / "recordings" / f"{name}.csv.gz"))
    return load_hand_recording(name)


def shipped_recordings() -> dict[str, pd.DataFrame]:
    """Simulate the recordings under ``data/gesture_steering/recordings``, by name, each with a stream."""
    streams = np.random.default_rng(SEED).spawn(4)
    return {
        "steering_minute": steering_recording(streams[0], 60.0, HandNoise(losses=0.1, flips=0.05)),
        "a4_palm": tracing_recording(streams[1], HandNoise()),
        "a4_finger": tracing_recording(streams[2], FINGERTIP),
        "hover": hover_recording(streams[3]),
    }


def write_recordings(directory: Path) -> None:
    """Write the shipped recordings and their data cards; the same seed gives the same bytes."""
    directory.mkdir(parents=True, exist_ok=True)
    for name, table in shipped_recordings().items():
        path = directory / f"{name}.csv.gz"
        text = table.to_csv(index=False, lineterminator="\n").encode()
        path.write_bytes(gzip.compress(text, mtime=0))
        generator = "soro_lib.papers.gesture_steering.recordings.shipped_recordings"
        description = f"Simulated hand, no person was recorded: {ABOUT[name]}"
        write_card(path, description=description, columns=COLUMNS, generator=generator, seed=SEED)


def steering_recording(
    rng: np.random.Generator, duration: float, noise: HandNoise | None = None
) -> pd.DataFrame:
    """Simulate a person who steers at random through all gestures, inside the allowed box.

    Parameters
    ----------
    rng : Generator
        Source of every draw.
    duration : float
        [s].
    noise : HandNoise, optional
        Restlessness and faults.
    """
    position = hand.wandering(rng, duration, (-0.11, 0.13, -0.11), (0.11, 0.30, 0.11))
    pitch_and_roll = hand.wandering(rng, duration, (-0.4, -0.4), (0.4, 0.4))
    gestures: list[tuple[float, str]] = [(0.0, "palm")]
    coming: list[str] = []
    while gestures[-1][0] < duration - 8.0:
        if not coming:
            coming = rng.permutation(["v_sign", "thumbs_up", "fist"]).tolist()
        name = coming.pop() if gestures[-1][1] == "palm" else "palm"
        gestures.append((gestures[-1][0] + rng.uniform(3.0, 7.0), name))

    def tilt(time: Array) -> Array:
        about_x, about_z = pitch_and_roll(time).T
        turns = Rotation.from_rotvec(np.outer(about_x, [1, 0, 0]))
        return (turns * Rotation.from_rotvec(np.outer(about_z, [0, 0, 1]))).as_rotvec()

    return synthetic_recording(rng, duration, position, tilt, gestures, noise)


def tracing_recording(rng: np.random.Generator, noise: HandNoise) -> pd.DataFrame:
    """Simulate a hand tracing the edges of an A4 sheet 200 mm above the device; Lai et al., Fig. 5."""
    x, z = np.array(A4_PAPER) / 2
    corners = np.array([[-x, 0.2, -z], [x, 0.2, -z], [x, 0.2, z], [-x, 0.2, z], [-x, 0.2, -z]])
    path, duration = hand.tracing(corners, 0.2)
    return synthetic_recording(rng, duration, path, constant(0.0, 0.0, 0.0), noise=noise)


def hover_recording(rng: np.random.Generator) -> pd.DataFrame:
    """Simulate a hovering palm for half the time, then a hovering V-sign; Lai et al., Fig. 10."""
    position, tilt = constant(0.05, 0.15, 0.04), constant(0.15, 0.0, 0.1)
    return synthetic_recording(rng, 2 * HOVER, position, tilt, [(0.0, "palm"), (HOVER, "v_sign")])


if __name__ == "__main__":
    # The recordings take seconds: their small form is the whole one.
    parser = generator_options("Simulate the hands again.", data_directory("gesture_steering"))
    write_recordings(parser.parse_args().output / "recordings")
