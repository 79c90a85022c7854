"""The simulated prototype: errors of Table II and Figs. 10, 11 of Lai et al., over many sessions."""

import numpy as np
import pandas as pd

from soro_lib.papers.gesture_steering.calibration import POINTS, printed_positions, table2_poses
from soro_lib.papers.gesture_steering.experiments import steering
from soro_lib.papers.gesture_steering.recordings import HOVER, hover_recording
from soro_lib.papers.gesture_steering.world import plant
from soro_lib.papers.gesture_steering.world.plant import Array, Prototype, PrototypeRanges, drawn_prototype
from soro_lib.robots import CableDrivenArm
from soro_lib.robots.cable_driven_kernels import compiled_kinematics

MARKER_DISTANCE = 0.020
"""Distance of the blue marker from the tip [m]; not printed, ours."""
CAUSES: dict[str, tuple[str, ...]] = {
    "stiffness (Table I)": ("bending_rigidity", "axial_rigidity"),
    "cable holes": ("cable_radius_sd",),
    "friction": ("friction",),
    "cable zero": ("tension_zero_sd", "length_zero_sd"),
    "base offset": ("base_offset_sd",),
    "base lean": ("base_lean_sd",),
    "camera": ("camera_sd", "depth_resolution"),
}
"""The stated causes of error and the ranges that they stand for."""
ERRORS = [f"error_{axis}_mm" for axis in "xyz"]
"""Columns of the errors per axis."""


def experiment_error(simulated: Array, measured: Array) -> Array:
    """Return norms (...) of the difference of positions (..., 3); e_x in Lai et al., Eq. (28)."""
    return np.linalg.norm(np.asarray(simulated) - np.asarray(measured), axis=-1)


def table2_sessions(
    rng: np.random.Generator,
    sessions: int = 400,
    ranges: PrototypeRanges | None = None,
    by_length: bool = False,
    registered_at_tip: bool = False,
) -> pd.DataFrame:
    """Repeat the experiment of Table II with many prototypes.

    Parameters
    ----------
    rng : Generator
        Source of the prototypes and of the camera noise.
    sessions : int
        Prototypes [-].
    ranges : PrototypeRanges, optional
        How far they are from the model.
    by_length : bool
        Wind cables to lengths instead of pulling with forces.
    registered_at_tip : bool
        Lay the camera frame so that the straight tip of configuration 0 reads (0, 0) in X and Y, as the
        printed readings suggest.

    Returns
    -------
    DataFrame
        ``session``, ``configuration``, ``point``, ``error_{x,y,z}_mm`` (sim. minus exp.), ``norm_mm``.
    """
    arm = CableDrivenArm()
    prototype = drawn_prototype(arm, rng, sessions, ranges)
    kinematics = compiled_kinematics(arm)
    errors = np.empty((sessions, 4, 3, 3))
    for configuration, pose in enumerate(table2_poses(arm)):
        branch = float(rng.choice([-1.0, 1.0]))
        points, _ = prototype.points(pose.actuation, by_length, branch)
        model = kinematics(pose.actuation)
        simulated = np.array([[0.0, 0.0, pose.actuation[0]], model.mid, model.tip])
        errors[:, configuration] = simulated - prototype.measured(points, rng)
    if registered_at_tip:
        errors[..., :2] -= errors[:, :1, 2:, :2]
    index = pd.MultiIndex.from_product(
        [range(sessions), range(4), POINTS], names=["session", "configuration", "point"]
    )
    table = pd.DataFrame(errors.reshape(-1, 3) * 1e3, index=index, columns=ERRORS)
    return table.assign(norm_mm=np.linalg.norm(table, axis=1)).reset_index()


def within_claim(sessions: pd.DataFrame, bound_mm: float = 2.0) -> Array:
    """Return, per session, whether every axis of every point is within the bound: 0 or 1."""
    return np.asarray(largest_errors(sessions).max(axis=1) <= bound_mm, dtype=np.float64)


def largest_errors(sessions: pd.DataFrame) -> pd.DataFrame:
    """Return, per session, the largest error of all points along each axis [mm]."""
    return sessions[ERRORS].abs().groupby(sessions["session"]).max()


def printed_percentiles(sessions: pd.DataFrame) -> pd.DataFrame:
    """Place the paper's error norms in the simulated distribution.

    Returns
    -------
    DataFrame
        ``configuration``, ``point``, ``printed_mm``, ``median_mm``, ``low_mm``, ``high_mm`` (95 % of
        sessions), ``percentile`` of the printed norm.
    """
    printed = experiment_error(printed_positions("sim"), printed_positions("exp")) * 1e3
    rows = []
    for (configuration, point), group in sessions.groupby(["configuration", "point"], sort=True):
        norm, ours = printed[int(str(configuration)), POINTS.index(str(point))], group["norm_mm"]
        low, median, high = np.percentile(ours, [2.5, 50, 97.5])
        rows.append((configuration, point, norm, median, low, high, 100 * float((ours < norm).mean())))
    columns = ["configuration", "point", "printed_mm", "median_mm", "low_mm", "high_mm", "percentile"]
    return pd.DataFrame(rows, columns=columns)


def cause_study(seed: np.random.SeedSequence, sessions: int = 400) -> pd.DataFrame:
    """Switch on one cause at a time, for force and for length control.

    Returns
    -------
    DataFrame
        ``control``, ``cause``, ``claim`` (probability that every axis is within 2 mm), ``x_mm``, ``y_mm``,
        ``z_mm`` (median over sessions of the largest error).
    """
    rows = []
    for control in ("force", "length"):
        for cause, names in (*CAUSES.items(), ("all", None)):
            ranges = PrototypeRanges() if names is None else PrototypeRanges().only(*names)
            rng = np.random.default_rng(seed)
            table = table2_sessions(rng, sessions, ranges, by_length=control == "length")
            rows.append((control, cause, within_claim(table).mean(), *largest_errors(table).median()))
    return pd.DataFrame(rows, columns=["control", "cause", "claim", "x_mm", "y_mm", "z_mm"])


def followed(prototype: Prototype, commands: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Let prototypes follow the commands of a steering session and measure them; Lai et al., Eq. (28).

    Parameters
    ----------
    prototype : Prototype
        n sessions.
    commands : DataFrame
        From :func:`soro_lib.papers.gesture_steering.experiments.steering.result_table`.
    rng : Generator
        Camera noise.

    Returns
    -------
    DataFrame
        Per session and time: ``session``, ``time_s``, ``sim_*_mm``, ``mea_*_mm``, ``position_error_mm``,
        ``direction_error_deg``.
    """
    actuations, kinematics = steering.actuations(commands), compiled_kinematics(prototype.arm)
    frames = []
    for time, actuation, sign in zip(commands["time_s"], actuations, _branches(actuations)):
        points, direction = prototype.points(actuation, branch=sign)
        tip, marker = points[:, 2], points[:, 2] + MARKER_DISTANCE * direction
        seen_tip, seen_marker = prototype.measured(np.stack([tip, marker], axis=1), rng).transpose(1, 0, 2)
        model = kinematics(actuation)
        ideal = plant.pointing_angle(model.tip, model.tip + MARKER_DISTANCE * model.direction)
        frame = {"session": np.arange(prototype.sessions), "time_s": time}
        frame |= {f"sim_{axis}_mm": 1e3 * value for axis, value in zip("xyz", model.tip)}
        frame |= {f"mea_{axis}_mm": values for axis, values in zip("xyz", 1e3 * seen_tip.T)}
        frame["position_error_mm"] = 1e3 * experiment_error(model.tip, seen_tip)
        frame["direction_error_deg"] = np.degrees(np.abs(ideal - plant.pointing_angle(seen_tip, seen_marker)))
        frames.append(pd.DataFrame(frame))
    return pd.concat(frames, ignore_index=True)


def _branches(actuations: Array) -> Array:
    """Return the sign of friction per time: +1 while tension mostly rises, -1 while it falls."""
    rising = -np.diff(actuations[:, 1:].sum(axis=1), prepend=actuations[0, 1:].sum())
    return np.where(rising >= 0, 1.0, -1.0)


def fig10_commands(seed: int = 1) -> dict[str, pd.DataFrame]:
    """Return the steering sessions of Fig. 10: two hovers of eight seconds, two paths, by panel a to d.

    (a) palm hovering, (b) V-sign hovering, (c) a slanted circle, (d) an arc with the tip turning.
    """
    streams = np.random.default_rng(seed).spawn(3)
    steps = steering.steered(hover_recording(streams[0]), interval=steering.CONTROL_PERIOD)
    hover = steering.result_table(steps)
    panels = {"a": hover.query("time_s < @HOVER").copy(), "b": hover.query("time_s >= @HOVER").copy()}
    panels["b"]["time_s"] -= HOVER
    panels["c"] = steering.steered_by_hand(streams[1], 12.0, _slanted_circle, _leaning_in)
    panels["d"] = steering.steered_by_hand(streams[2], 12.0, _rising_arc, _swaying)
    return panels


def fig10(
    commands: dict[str, pd.DataFrame], rng: np.random.Generator, sessions: int = 20, every: int = 3
) -> pd.DataFrame:
    """Let prototypes follow the sessions of Fig. 10; every so many frames are measured.

    Returns
    -------
    DataFrame
        As :func:`followed`, with ``panel``.
    """
    prototype = drawn_prototype(CableDrivenArm(), rng, sessions)
    tables = {panel: followed(prototype, table.iloc[::every], rng) for panel, table in commands.items()}
    return pd.concat(tables, names=["panel"]).reset_index("panel").reset_index(drop=True)


def steady_state(measured: pd.DataFrame) -> pd.DataFrame:
    """Return the mean errors per panel and session after the first two seconds."""
    late = measured[measured["time_s"] >= 2.0].groupby(["panel", "session"])
    return late[["position_error_mm", "direction_error_deg"]].mean().reset_index()


def tip_scatter(actuations: Array, rng: np.random.Generator, sessions: int) -> list[tuple[Array, Array]]:
    """Return mean (3,) [m] and covariance (3, 3) [m^2] of the true tip, per row of actuations (n, 7)."""
    prototype = drawn_prototype(CableDrivenArm(), rng, sessions)
    tips = [prototype.points(actuation)[0][:, 2] for actuation in actuations]
    return [(tip.mean(axis=0), np.cov(tip.T)) for tip in tips]


def _slanted_circle(time: Array) -> Array:
    phase = 2 * np.pi * np.asarray(time) / 6.0
    return np.column_stack([0.018 * np.cos(phase), 0.018 * np.sin(phase), 0.115 + 0.006 * np.sin(phase)])


def _leaning_in(time: Array) -> Array:
    phase = 2 * np.pi * np.asarray(time) / 6.0
    return _unit(0.2 * np.cos(phase), 0.2 * np.sin(phase))


def _rising_arc(time: Array) -> Array:
    phase = 2 * np.pi * np.asarray(time) / 12.0
    return np.column_stack([0.020 * np.sin(phase), -0.008 + 0.0 * phase, 0.110 + 0.010 * np.cos(phase)])


def _swaying(time: Array) -> Array:
    phase = 2 * np.pi * np.asarray(time) / 12.0
    return _unit(0.35 * np.sin(phase), 0.1 * np.cos(phase))


def _unit(x: Array, y: Array) -> Array:
    return np.column_stack([x, y, np.sqrt(1.0 - x * x - y * y)])
