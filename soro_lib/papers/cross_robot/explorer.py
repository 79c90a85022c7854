"""The four-arm explorer: one slider per actuator, limits from the robot, the arm bending as they move."""

import ipywidgets
import numpy as np
from IPython.display import Image
from numpy.typing import NDArray

from soro_lib.papers.cross_robot.figures.four_arms import one_arm, piece_colors
from soro_lib.papers.cross_robot.world.four_arms import Specimen, four_arms
from soro_lib.replication import as_image
from soro_lib.replication.frontend import is_live
from soro_lib.replication.view import ArmView, arm_scene, tube

DISPLAY_UNITS = {"m": ("mm", 1e3), "rad": ("deg", 180.0 / np.pi), "-N": ("-N", 1.0)}
"""How an actuator's unit is shown: unit and factor."""

SLIDER_STEPS = 200
"""Steps from one end of a slider to the other, about [count]."""


class ArmExplorer(ipywidgets.VBox):
    """Buttons that choose an arm, a slider per actuator, and a drawing that can be turned by hand.

    Parameters
    ----------
    specimens
        The arms to choose from.

    Attributes
    ----------
    sliders : list of ipywidgets.FloatSlider
        One per actuator of the chosen arm, in display units.
    view : ArmView
        The drawing.
    """

    def __init__(self, specimens: tuple[Specimen, ...] | None = None) -> None:
        self.specimens = specimens or four_arms()
        self.choice = ipywidgets.ToggleButtons(options=[specimen.name for specimen in self.specimens])
        self.choice.style.button_width = "110px"
        self.home_button = ipywidgets.Button(description="home", icon="home", layout={"width": "90px"})
        self.message = ipywidgets.HTML()
        self.view = ArmView(layout={"flex": "1 1 420px", "min_width": "320px"})
        self.controls = ipywidgets.VBox(layout={"flex": "0 0 380px"})
        self.sliders: list[ipywidgets.FloatSlider] = []
        self.choice.observe(lambda _: self._choose(), "value")
        self.home_button.on_click(lambda _: self._go(self.specimen.robot.home))
        stage = ipywidgets.HBox([self.controls, self.view], layout={"width": "100%", "flex_flow": "row wrap"})
        super().__init__([self.choice, stage])
        self._choose()

    @property
    def specimen(self) -> Specimen:
        """The chosen arm."""
        return self.specimens[self.choice.index]

    @property
    def actuation(self) -> NDArray[np.float64]:
        """What the sliders say, in the robot's units, shape (n,)."""
        shown = np.array([slider.value for slider in self.sliders])
        return shown / self._factors

    def _choose(self) -> None:
        """Give the chosen arm its sliders."""
        robot = self.specimen.robot
        names, units = zip(*(_name_and_unit(name) for name in robot.actuator_names))
        shown, factors = zip(*(DISPLAY_UNITS[unit] for unit in units))
        self._factors = np.array(factors)
        self._low, self._high = self.specimen.reach()
        self.sliders = [
            ipywidgets.FloatSlider(
                description=f"{name} [{unit}]",
                min=low,
                max=high,
                step=_round_number((high - low) / SLIDER_STEPS),
                value=value,
                readout_format=".1f",
                style={"description_width": "118px"},
                layout={"width": "370px"},
            )
            for name, unit, low, high, value in zip(
                names,
                shown,
                robot.lower * self._factors,
                robot.upper * self._factors,
                robot.home * self._factors,
                strict=True,
            )
        ]
        for slider in self.sliders:
            slider.observe(lambda _: self._draw(), "value")
        self.controls.children = [*self.sliders, self.home_button, self.message]
        self._draw()

    def _go(self, actuation: NDArray[np.float64]) -> None:
        """Move the sliders, and with them the arm."""
        for slider, value in zip(self.sliders, actuation * self._factors, strict=True):
            slider.value = value

    def _draw(self) -> None:
        """Draw the arm at the nearest admissible actuation, and say so where the sliders ask for more."""
        specimen, robot = self.specimen, self.specimen.robot
        admissible = robot.clip(self.actuation)
        names = [_name_and_unit(name)[0] for name in robot.actuator_names]
        limited = ", ".join(name for name, clipped in zip(names, admissible.clipped, strict=True) if clipped)
        self.message.value = f"limited by the arm: {limited}" if limited else ""
        pieces, tip = specimen.pieces(admissible.actuation), robot.forward(admissible.actuation)
        x, y, z = 1e3 * tip[:3, 3]
        self.view.scene = arm_scene(
            [
                tube(piece, specimen.radius, color)
                for piece, color in zip(pieces, piece_colors(specimen, len(pieces)), strict=True)
            ],
            tip,
            self._low,
            self._high,
            hangs=specimen.hangs,
            grid=_round_number(float(np.max(self._high - self._low)) / 8.0),
            caption=f"{specimen.name} arm, tip at ({x:.1f}, {y:.1f}, {z:.1f}) mm",
        )


def explore() -> ArmExplorer | Image:
    """Return the explorer, or, where nobody can move its sliders, a picture of one arm."""
    if is_live():
        return ArmExplorer()
    helix = four_arms()[-1]
    return as_image(one_arm(helix, helix.end))


def _name_and_unit(actuator_name: str) -> tuple[str, str]:
    """Split ``"slide [m]"`` into name and unit."""
    name, _, unit = actuator_name.removesuffix("]").partition(" [")
    return name, unit


def _round_number(value: float) -> float:
    """Return the nearest of 1, 2, 5 or 10 times a power of ten.

    Examples
    --------
    >>> _round_number(0.45), _round_number(9.9)
    (0.5, 10.0)
    """
    power = 10.0 ** np.floor(np.log10(value))
    return float(min((1.0, 2.0, 5.0, 10.0), key=lambda factor: abs(factor * power - value)) * power)
