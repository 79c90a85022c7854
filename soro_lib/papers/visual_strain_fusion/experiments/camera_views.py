"""Pictures from the camera flights: single views with their features, and many views stitched in space."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.papers.visual_strain_fusion.experiments.camera_runs import FLIGHTS, load_map
from soro_lib.papers.visual_strain_fusion.world import scene as surroundings
from soro_lib.papers.visual_strain_fusion.world.motion import spiral
from soro_lib.papers.visual_strain_fusion.world.scene import ENDOSCOPE, ViewConditions, tip_camera
from soro_lib.sensing.camera import Camera, Image, look_at, transform_points
from soro_lib.sensing.monocular_vision import MonocularTracker, PointMap, TrackedFrame
from soro_lib.worlds.rendering import TexturedQuad, render

Array = NDArray[np.float64]

SIGHT = 0.10
"""Distance before the camera at which a stitched picture hangs [m]: about that of the bricks."""

FRONT = Camera(900, 900, focal_length=520.0)
SIDE = Camera(1100, 620, focal_length=1000.0)
"""The cameras that look at the stitched pictures."""


@dataclass(frozen=True)
class CameraView:
    """One picture of a flight and what the tracker finds in it, with the map that the flight left.

    Attributes
    ----------
    time : float
        [s]
    conditions : ViewConditions
        What disturbed the view.
    image : array (h, w) or (h, w, 3), uint8
        The picture.
    frame : TrackedFrame
        Features, inliers and pose; the map is in metres, so the pose is in the world.
    """

    time: float
    conditions: ViewConditions
    image: Image
    frame: TrackedFrame

    @property
    def found(self) -> str:
        """What the tracker found, in words."""
        return f"{self.frame.inliers} of {self.frame.features} features fit" if self.frame.tracked else "lost"


class FlightViewer:
    """Renders any frame of a stored flight again, and locates it in the map of that flight.

    Parameters
    ----------
    name : str
        One of :data:`~soro_lib.papers.visual_strain_fusion.experiments.camera_runs.FLIGHTS`.
    color : bool, optional
        Whether to render in colour; the tracker turns it to grey.
    """

    def __init__(self, name: str, color: bool = True) -> None:
        self.flight, self.motion = FLIGHTS[name], spiral()
        self.scene = surroundings.BrickScene(self.flight.scene, color)
        stored = load_map(name)
        point_map = PointMap()
        point_map.positions = stored["positions"].astype(float)
        point_map.descriptors = stored["descriptors"]
        point_map.directions = stored["directions"].astype(float)
        self._tracker = MonocularTracker(ENDOSCOPE, point_map=point_map)

    def photograph(
        self, step: int, rng: np.random.Generator, conditions: ViewConditions | None = None
    ) -> Image:
        """Return the picture of a step, under the conditions of the flight or other ones."""
        conditions = conditions or self.flight.timeline(self.motion.time[step])
        channels = (3,) if self.scene.color else ()
        noise = rng.standard_normal((ENDOSCOPE.height, ENDOSCOPE.width, *channels), dtype=np.float32)
        return surroundings.photograph(self.scene, self.motion.pose[step], conditions, noise)

    def view(
        self, step: int, rng: np.random.Generator, conditions: ViewConditions | None = None
    ) -> CameraView:
        """Return the picture of a step with its features and inliers.

        Parameters
        ----------
        step : int
            Step of 0.05 s.
        rng : numpy.random.Generator
            Draws the sensor noise.
        conditions : ViewConditions, optional
            Other conditions than those of the flight.
        """
        conditions = conditions or self.flight.timeline(self.motion.time[step])
        image = self.photograph(step, rng, conditions)
        frame = self._tracker.find(image, tip_camera(self.motion.pose[step]))
        return CameraView(float(self.motion.time[step]), conditions, image, frame)


def stitch(images: Sequence[Image], poses: ArrayLike, sight: float = SIGHT) -> list[TexturedQuad]:
    """Hang every picture in space where its camera pose says it looks (Wang et al., Figs. 5(c) and 8).

    Parameters
    ----------
    images : sequence of arrays (h, w, 3)
        Pictures of the camera in the tip.
    poses : array (n, 7)
        Estimated tip poses [m, -].
    sight : float, optional
        Distance of the pictures from their camera [m].

    Returns
    -------
    list of TexturedQuad
    """
    width, height = ENDOSCOPE.width - 0.5, ENDOSCOPE.height - 0.5
    ends = np.array([(-0.5, -0.5), (width, -0.5), (width, height), (-0.5, height)])
    corners = sight * ENDOSCOPE.rays(ends)
    return [
        TexturedQuad(transform_points(tip_camera(pose), corners), image)
        for image, pose in zip(images, np.asarray(poses, dtype=float), strict=True)
    ]


def stitched_views(
    viewer: FlightViewer, poses: ArrayLike, steps: Sequence[int], rng: np.random.Generator
) -> tuple[Image, Image]:
    """Return the stitched pictures of a flight seen from the front and from the side.

    Parameters
    ----------
    viewer : FlightViewer
        The flight, in colour.
    poses : array (n, 7)
        Estimated tip poses of the whole flight [m, -].
    steps : sequence of int
        Which frames.
    rng : numpy.random.Generator
        Draws the sensor noise.
    """
    steps = list(steps)
    quads = stitch([viewer.photograph(step, rng) for step in steps], np.asarray(poses, dtype=float)[steps])
    white = (255, 255, 255)
    front = render(FRONT, look_at([0, 0, -0.17], [0, 0, 0.1], up=(0, -1, 0)), quads, white)
    side = render(SIDE, look_at([0, -0.30, -0.13], [0, 0, 0.045], up=(0, 0, -1)), quads, white)
    return front, side
