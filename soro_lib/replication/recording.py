"""What a figure draws, as a list of calls: the same list has the same digest and gives the same picture.

Two computers whose linear algebra differs in the last bits draw the same picture but for coordinates that
differ by a billionth of a pixel, and sometimes that is enough for another pixel. The digest sees what is
drawn before it becomes pixels, and leaves such differences out.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partialmethod
from io import BytesIO
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backend_bases import GraphicsContextBase
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.ft2font import __freetype_version__
from matplotlib.image import imsave
from matplotlib.path import Path
from matplotlib.text import Text
from matplotlib.transforms import Transform, TransformedPath
from numpy.typing import ArrayLike, NDArray

from soro_lib.replication.picture import DIGEST

GRID = 0.02
"""Smallest change of one coordinate that is sure to change the digest [pixels, levels of 255, degrees]."""

FAR = 1e5
"""Coordinates beyond are as good as this one: so far outside that only a line's direction shows [pixels]."""

PROJECTIONS = 2
"""Weighted sums of all coordinates in a digest: what cancels in one does not in the other."""


@dataclass(frozen=True)
class Call:
    """One call of a drawing method of a renderer.

    Parameters
    ----------
    method : str
        Name of the method.
    context : GraphicsContextBase
        Colour of lines, their width, what they are clipped to.
    arguments, options : tuple, dict
        What else it was called with.
    """

    method: str
    context: GraphicsContextBase
    arguments: tuple[Any, ...]
    options: dict[str, Any]


class Recorder(RendererAgg):
    """A renderer that writes down what it is told to draw; it measures text as Agg does."""

    def __init__(self, width: float, height: float, dpi: float) -> None:
        super().__init__(width, height, dpi)
        self.calls: list[Call] = []

    def _record(self, method: str, context: GraphicsContextBase, *arguments: Any, **options: Any) -> None:
        frozen = tuple(item.frozen() if isinstance(item, Transform) else item for item in arguments)
        self.calls.append(Call(method, _frozen_context(context), frozen, options))

    draw_path = partialmethod(_record, "draw_path")
    draw_markers = partialmethod(_record, "draw_markers")
    draw_path_collection = partialmethod(_record, "draw_path_collection")
    draw_quad_mesh = partialmethod(_record, "draw_quad_mesh")
    draw_gouraud_triangles = partialmethod(_record, "draw_gouraud_triangles")
    draw_image = partialmethod(_record, "draw_image")
    draw_text = partialmethod(_record, "draw_text")

    def clear(self) -> None:
        """Forget all calls."""
        self.calls.clear()

    def _update_methods(self) -> None:
        """Keep the methods above, which Agg would replace by its own."""

    def _refuse(self, *_: Any, **__: Any) -> None:
        raise ValueError(
            "a figure must have neither TeX nor filtered artists: a recording does not hold them"
        )

    draw_tex = start_filter = stop_filter = _refuse


class RecordingCanvas(FigureCanvasAgg):
    """A canvas whose one renderer records; layout and drawing share what it has measured."""

    def get_renderer(self) -> Recorder:
        """Return the recorder."""
        if not isinstance(getattr(self, "renderer", None), Recorder):
            self.renderer = Recorder(*self.get_width_height(), self.figure.dpi)
        return self.renderer


@dataclass(frozen=True)
class Recording:
    """What a figure draws.

    Parameters
    ----------
    calls : sequence of Call
        In the order of drawing.
    width, height : int
        Size [pixels].
    dpi : float
        Resolution [pixels per inch].
    """

    calls: Sequence[Call]
    width: int
    height: int
    dpi: float

    @classmethod
    def of(cls, figure: Figure, dpi: float) -> "Recording":
        """Lay out a figure once and record it; its resolution, canvas and layout engine stay its own."""
        before, canvas_before, engine = figure.dpi, figure.canvas, figure.get_layout_engine()
        try:
            figure.set_dpi(dpi)
            canvas = RecordingCanvas(figure)
            if engine is not None:
                engine.execute(figure)
                figure.set_layout_engine("none")
            canvas.draw()
            return cls(tuple(canvas.get_renderer().calls), *canvas.get_width_height(), dpi)
        finally:
            if engine is not None:
                figure.set_layout_engine(engine)
            figure.set_canvas(canvas_before)
            figure.set_dpi(before)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of what is drawn, and of what turns it into pixels, in hexadecimal digits."""
        digest = _Digest()
        digest.add_words(matplotlib.__version__, __freetype_version__, matplotlib.rcParams["text.hinting"])
        digest.add_words(self.width, self.height, self.dpi)
        for call in self.calls:
            digest.add_call(call)
        return digest.hexadecimal()

    def png(self) -> bytes:
        """Return the picture as a PNG that holds the digest; the same recording gives the same bytes."""
        renderer = RendererAgg(self.width, self.height, self.dpi)
        for call in self.calls:
            getattr(renderer, call.method)(call.context, *call.arguments, **call.options)
        buffer = BytesIO()
        metadata: dict[str, Any] = {"Software": None, DIGEST: self.digest}
        imsave(buffer, renderer.buffer_rgba(), format="png", origin="upper", dpi=self.dpi, metadata=metadata)
        return buffer.getvalue()


def _frozen_context(context: GraphicsContextBase) -> GraphicsContextBase:
    """Copy a context so that what it clips to no longer moves with the figure."""
    copy = GraphicsContextBase()
    copy.copy_properties(context)
    rectangle: Any = context.get_clip_rectangle()
    if rectangle is not None:
        copy.set_clip_rectangle(rectangle.frozen())
    clip: Any = context.get_clip_path()
    path, transform = clip
    if path is not None:
        copy.set_clip_path(TransformedPath(path, transform.frozen()))
    return copy


class _Digest:
    """The digest of calls: words count exactly, numbers by weighted sums over all of them.

    Rounding every coordinate by itself would leave one among many thousand so close to a boundary that a last
    bit crosses it; a sum has one boundary. All weights are between 1 and 2 in size, so that no change of a
    single coordinate by `GRID` or more goes unseen, and of random sign, so that errors do not add up.
    """

    def __init__(self) -> None:
        self._hash = hashlib.sha256()
        self._numbers: list[NDArray[np.float64]] = [np.zeros(0)]

    def add_words(self, *words: Any) -> None:
        """Add what has to be equal: names, counts, switches."""
        self._hash.update(repr(words).encode())

    def add_numbers(self, numbers: ArrayLike, scale: float = 1.0) -> None:
        """Add coordinates [pixels] or whatever else becomes that by a scale; masked ones count as NaN."""
        if isinstance(numbers, np.ma.MaskedArray):
            numbers = np.ma.filled(numbers.astype(float), np.nan)
        array = np.asarray(numbers, dtype=float)
        self.add_words(array.shape)
        self._numbers.append(scale * array.ravel())

    def add_colors(self, *colors: Any) -> None:
        """Add colours [0 to 1], or None for what is not drawn."""
        for color in colors:
            if color is None:
                self.add_words(None)
            else:
                self.add_numbers(color, 255.0)

    def add_paths(self, paths: Sequence[Any], transform: Any) -> None:
        """Add paths, transformed to pixels."""
        for path in paths:
            codes = None if path.codes is None else path.codes.tobytes()
            self.add_words(len(path), codes, path.should_simplify)
        if paths:
            self.add_numbers(transform.transform(np.concatenate([path.vertices for path in paths])))

    def add_context(self, context: GraphicsContextBase) -> None:
        """Add how lines are drawn and where everything is clipped."""
        clip, (path, transform) = context.get_clip_rectangle(), context.get_clip_path()
        self.add_words(context.get_antialiased(), context.get_capstyle(), context.get_joinstyle())
        self.add_words(context.get_snap(), context.get_sketch_params(), context.get_forced_alpha())
        self.add_words(context.get_hatch())
        self.add_numbers(context.get_linewidth())
        self.add_dashes(*context.get_dashes())
        self.add_colors(context.get_rgb(), context.get_alpha())
        if context.get_hatch():
            self.add_colors(context.get_hatch_color())
            self.add_numbers(context.get_hatch_linewidth())
        if clip is not None:
            self.add_numbers(clip.extents)
        if path is not None:
            self.add_paths([path], transform)

    def add_call(self, call: Call) -> None:
        """Add a call in full."""
        self.add_words(call.method)
        self.add_context(call.context)
        getattr(self, f"add_{call.method}")(*call.arguments, **call.options)

    def add_dashes(self, offset: float | None, dashes: Any) -> None:
        """Add a dash pattern, None for an unbroken line."""
        self.add_numbers([] if dashes is None else [offset or 0.0, *dashes])

    def add_draw_path(self, path: Path, transform: Transform, face: Any = None) -> None:
        """Add a line or a filled shape."""
        self.add_paths([path], transform)
        self.add_colors(face)

    def add_draw_markers(
        self, marker: Path, marker_transform: Transform, path: Path, transform: Transform, face: Any = None
    ) -> None:
        """Add the same shape at every vertex of a path."""
        self.add_paths([marker], marker_transform)
        self.add_paths([path], transform)
        self.add_colors(face)

    def add_draw_path_collection(
        self,
        transform: Transform,
        paths: Sequence[Path],
        scales: ArrayLike,
        offsets: ArrayLike,
        offset_transform: Transform,
        faces: ArrayLike,
        edges: ArrayLike,
        widths: ArrayLike,
        styles: Sequence[tuple[float, Sequence[float] | None]],
        antialiased: ArrayLike,
        urls: object,
        offset_position: object,
        *,
        hatchcolors: ArrayLike = (),
    ) -> None:
        """Add shapes with sizes (matrices, to pixels), places and looks of their own."""
        self.add_paths(paths, transform)
        self.add_numbers(scales)
        self.add_numbers(offset_transform.transform(offsets))
        self.add_colors(faces, edges, hatchcolors)
        self.add_numbers(widths)
        for style in styles:
            self.add_dashes(*style)
        self.add_words(np.asarray(antialiased, dtype=bool).tobytes())

    def add_draw_quad_mesh(
        self,
        transform: Transform,
        columns: int,
        rows: int,
        corners: ArrayLike,
        offsets: ArrayLike,
        offset_transform: Transform,
        faces: ArrayLike,
        antialiased: bool,
        edges: ArrayLike,
    ) -> None:
        """Add a grid of quadrilaterals, its corners of shape (rows + 1, columns + 1, 2)."""
        self.add_words(columns, rows, bool(antialiased))
        self.add_numbers(transform.transform(np.reshape(corners, (-1, 2))))
        self.add_numbers(offset_transform.transform(offsets))
        self.add_colors(faces, edges)

    def add_draw_gouraud_triangles(
        self, triangles: ArrayLike, colors: ArrayLike, transform: Transform
    ) -> None:
        """Add triangles, shape (N, 3, 2), with a colour per corner."""
        self.add_numbers(transform.transform(np.reshape(triangles, (-1, 2))))
        self.add_colors(colors)

    def add_draw_image(self, x: float, y: float, pixels: NDArray[np.uint8]) -> None:
        """Add an image as it is drawn, pixel by pixel."""
        self.add_numbers([x, y])
        self.add_words(pixels.shape)
        self._hash.update(np.ascontiguousarray(pixels).tobytes())

    def add_draw_text(
        self,
        x: float,
        y: float,
        text: str,
        font: FontProperties,
        angle: float,
        ismath: bool = False,
        mtext: Text | None = None,
    ) -> None:
        """Add a text or a formula."""
        self.add_words(text, str(font), font.get_math_fontfamily(), ismath)
        self.add_words(*(getattr(mtext, name, None) for name in ("_fontfeatures", "_language")))
        self.add_numbers([x, y, angle])

    def hexadecimal(self) -> str:
        """Return the digest of all that has been added."""
        numbers = np.nan_to_num(np.concatenate(self._numbers), nan=-FAR / 100.0).clip(-FAR, FAR)
        # Raw bits, since numpy promises them, but not its random numbers, to stay the same.
        bits = np.random.PCG64(0).random_raw((PROJECTIONS, numbers.size))
        weights = (1.0 + bits / 2.0**64) * np.where(bits & 1, 1.0, -1.0)
        steps = np.floor(np.sum(weights * numbers, axis=1) / GRID)
        self.add_words(*steps.tolist())
        return self._hash.hexdigest()
