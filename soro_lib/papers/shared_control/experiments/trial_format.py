"""The format of recorded trials: one file each, a header of comment lines in TOML, then samples by time.

    # soro_lib trial 1
    # paradigm = "msae"
    # environment = "simulated"
    # ...
    time_s,aim_x_m,...
    0.01,0.0,...

`HEADER` and `COLUMNS` document every entry. ``.csv`` (or ``.csv.gz``) is a trial that came to its end;
``.csv.part`` is one that was cut off, by the operator or with the machine that recorded it.
"""

import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any

import numpy as np

from soro_lib.checks import one_of, positive, vector
from soro_lib.controllers.shared_control import PARADIGMS
from soro_lib.controllers.shared_control.assist_as_needed import MOTIONS
from soro_lib.controllers.shared_control.goal_selection import PHASES, goal_points
from soro_lib.papers.shared_control.experiments.task import Scene, TaskSettings, Trial
from soro_lib.papers.shared_control.world.people import EXPERT

MAGIC = "# soro_lib trial 1"
"""First line of every trial file; the number is that of the format."""

SUFFIXES = (".csv", ".csv.gz", ".csv.part")
"""Endings of trial files; the last is that of a trial that was cut off."""

MAXIMUM_ROWS = 360_000
"""Samples read at most: an hour at 100 Hz."""

LARGEST = {"m": 5.0, "N": 100.0, "N/m": 10_000.0}
"""Largest value believed, by unit: more is a file in other units."""

HEADER = {
    "paradigm": f"[-] one of {', '.join(PARADIGMS)}",
    "environment": "[-] simulated or real: which arm and gripper",
    "force_law": "[-] printed or program: which reading of the guidance force",
    "operator": "[-] who was at the controls",
    "kind": "[-] group of operators that the trial is shown with, such as expert, naive or own",
    "view": "[-] above and front, or camera: what the operator saw of the task",
    "seed": "[-] entropy of the arm's chance; empty for a trial that no simulator can replay",
    "hand_stiffness_n_per_m": "[N/m] of the hand through which the force acts",
    "start_m": "[m] tip at the start, base frame, z down",
    "items_m": "[m] centres of the items, in the order of the task",
    "targets_m": "[m] centres of their targets",
}
"""Entries of the header and their units; those not `NEEDED` may be left out."""

AXES = ("x", "y", "z")

VIEWS = ("above and front", "camera")
"""What an operator may see of the task: two views that leave no doubt about depth, or one that does."""


def _axes(name: str, unit: str, meaning: str) -> dict[str, str]:
    return {f"{name}_{axis}_{unit.lower()}": f"[{unit}] {meaning}, {axis}" for axis in AXES}


def unit_of(meaning: str) -> str:
    """The unit with which the meaning of a column begins, "N/m" of "[N/m] stiffness"."""
    return meaning[1:].partition("]")[0]


COLUMNS = {
    "time_s": "[s] since the start, increasing, above 0",
    **_axes("aim", "m", "where the operator's hand would command the tip to without any force"),
    **_axes("command", "m", "where the hand does command the tip to: aim plus yield to the force, scaled"),
    "gripper_closed": "[-] 1 while the gripper's button is held",
    "confirmed": "[-] 1 while the operator reports an item in the gripper",
    **_axes("tip", "m", "end-effector, base frame (z down)"),
    **_axes("desired", "m", "where the arm is sent: command and goal, blended by the paradigm"),
    **_axes("goal", "m", "current goal"),
    **_axes("force", "N", "guidance force on the hand"),
    "magnitude_n": "[N] |f| before the direction is applied",
    "stiffness_n_per_m": "[N/m] stiffness k of the assistance",
    "motion": f"[-] state of Fig. 5: {', '.join(MOTIONS)}",
    "phase": f"[-] state of Fig. 4: {', '.join(PHASES)}",
    "goal_item": "[-] number of the item that the goal machine is busy with, from 1",
    "item_held": "[-] number of the item in the gripper, from 1; 0 for none",
}
"""Columns of a trial and their units; ``item<i>_x_m``, ``item<i>_y_m`` and ``item<i>_z_m`` follow, see
`trial_columns`."""

STATES = {"motion": MOTIONS, "phase": PHASES}


class TrialError(ValueError):
    """A trial file that cannot be used; the message names file, row, column and bound."""


def trial_columns(items: int) -> dict[str, str]:
    """Columns of a trial with so many items, with their meanings: `COLUMNS` and where each item is."""
    places = [_axes(f"item{number}", "m", f"centre of item {number}") for number in range(1, items + 1)]
    return COLUMNS | {name: meaning for place in places for name, meaning in place.items()}


# --- The header -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class TrialHeader:
    """What stays fixed during a trial; the fields are those of `HEADER`, without units in their names.

    Raises
    ------
    ValueError
        If a field is out of bounds or a goal out of reach; the message names it.
    """

    paradigm: str
    environment: str
    operator: str
    force_law: str = "printed"
    kind: str = "own"
    view: str = "camera"
    seed: tuple[int, ...] = ()
    hand_stiffness: float = EXPERT.hand_stiffness
    scene: Scene = field(default_factory=Scene)

    def __post_init__(self) -> None:
        one_of("paradigm", self.paradigm, PARADIGMS)
        one_of("view", self.view, VIEWS)
        positive("hand_stiffness_n_per_m", self.hand_stiffness)
        for name in ("operator", "kind"):
            if not getattr(self, name):
                raise ValueError(f"{name} must not be empty")
        self.settings().rule()

    def settings(self) -> TaskSettings:
        """The task as it was set."""
        conditions: dict[str, Any] = {"environment": self.environment, "force_law": self.force_law}
        return TaskSettings(PARADIGMS[self.paradigm], scene=self.scene, **conditions)

    def task(self) -> Trial:
        """The task before its first sample; what is left to chance depends on the seed alone."""
        return Trial(self.settings(), np.random.default_rng(np.random.SeedSequence(self.seed)))

    def text(self) -> str:
        """The comment lines at the top of a trial file."""
        values = {name: attrgetter(ATTRIBUTES.get(name, name))(self) for name in HEADER}
        entries = [f"# {name} = {json.dumps(value, ensure_ascii=False)}" for name, value in values.items()]
        return "\n".join([MAGIC, *entries]) + "\n"

    @classmethod
    def parse(cls, lines: Sequence[str]) -> "TrialHeader":
        """Read the comment lines of a trial file.

        Raises
        ------
        ValueError
            If a line is no TOML, an entry is missing, unknown or out of bounds.
        """
        first = lines[0].strip() if lines else ""
        if first != MAGIC:
            raise ValueError(f'the first line must be "{MAGIC}", got {first[:60]!r}')
        try:
            values = tomllib.loads("\n".join(line.lstrip("#").strip() for line in lines[1:]))
        except tomllib.TOMLDecodeError as error:
            raise ValueError(f"the header is not TOML: {error}") from None
        unknown = [name for name in values if name not in HEADER]
        if unknown:
            raise ValueError(f"unknown entry {unknown[0]!r} in the header; known are {', '.join(HEADER)}")
        for name, kind in ENTRY_TYPES.items():
            if name in values and not isinstance(values[name], kind):
                raise ValueError(f"{name} must be {HEADER[name]}, got {values[name]!r}")
        missing = [name for name in NEEDED if name not in values]
        if missing:
            raise ValueError(f"the header lacks {', '.join(missing)}")
        start = vector("start_m", values.pop("start_m"))
        goals = [goal_points(name, values.pop(name), LARGEST["m"]) for name in ("items_m", "targets_m")]
        stiffness = values.pop("hand_stiffness_n_per_m", EXPERT.hand_stiffness)
        values |= {"seed": tuple(values.get("seed", ())), "hand_stiffness": float(stiffness)}
        return cls(**values, scene=Scene(start, *goals))


ATTRIBUTES = {
    "hand_stiffness_n_per_m": "hand_stiffness",
    **{f"{name}_m": f"scene.{name}" for name in ("start", "items", "targets")},
}
"""Where a header's entry stands in `TrialHeader`, if not under its own name."""

NEEDED = ("paradigm", "environment", "operator", "start_m", "items_m", "targets_m")
ENTRY_TYPES: Mapping[str, Any] = {
    **dict.fromkeys(("paradigm", "environment", "force_law", "operator", "kind", "view"), str),
    **dict.fromkeys(("seed", "start_m", "items_m", "targets_m"), list),
    "hand_stiffness_n_per_m": (int, float),
}
