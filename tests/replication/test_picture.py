"""The digest of a picture sees every change that a reader could see, and no last bits."""

import os
import platform
import subprocess
import sys
from functools import cache

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.path import Path
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from soro_lib.replication import policy
from soro_lib.replication.picture import DIGEST, stored_digest
from soro_lib.replication.plotting import equal_aspect, legend, new_figure
from soro_lib.replication.recording import FAR, GRID, Recording, _Digest

LENGTHS = np.random.default_rng(5).uniform(1.0, 9.0, 200)


def digest(figure: Figure) -> str:
    return Recording.of(figure, policy.DPI).digest


@cache
def unchanged(make) -> str:
    return digest(make())


def lines(
    data=None, color="#0072B2", width=1.5, style="-", marker="none", label="truth", top=10.0, ticks=None
):
    """Lines beside a second scale, a legend, a note, a table and a span."""
    figure, axes = new_figure(columns=2)
    curve = LENGTHS if data is None else data
    axes[0].plot(curve, color=color, linewidth=width, linestyle=style, marker=marker, label=label)
    axes[0].set_ylim(0.0, top)
    axes[0].axvspan(20, 40, alpha=0.3, hatch="//")
    axes[0].annotate(r"$\sqrt{\alpha}$", (10, 5), (30, 8), arrowprops={"arrowstyle": "->"})
    if ticks:
        axes[0].set_yticks(ticks)
    axes[0].twinx().fill_between(range(200), 0.5 * curve)
    axes[1].errorbar(range(5), curve[:5], yerr=1.0, capsize=2)
    axes[1].table([["a", "b"]], loc="bottom")
    legend(figure)
    return figure


def maps(data=None, pixel=200, color="red", clip=None):
    """Images, a mesh, two kinds of collections and a colour bar."""
    figure, axes = new_figure(columns=4)
    grid = (LENGTHS if data is None else data).reshape(10, 20)
    figure.colorbar(axes[0].pcolormesh(grid, rasterized=True), ax=axes[0])
    axes[1].tripcolor(grid[0], grid[1], grid[2], shading="gouraud")
    picture = np.full((6, 8, 3), 100, dtype=np.uint8)
    picture[2, 3] = pixel
    axes[2].imshow(picture)
    dots = axes[3].scatter(grid[:, 0], grid[:, 1], s=10 * grid[:, 2], c=grid[:, 3], edgecolors=color)
    if clip is not None:
        dots.set_clip_path(clip, transform=axes[3].transAxes)
    axes[3].fill_between(grid[:, 0], grid[:, 4])
    return figure


def space(data=None, size=20):
    """A curve, points with shaded depth and a surface in three dimensions."""
    figure, axes = new_figure(projection="3d")
    points = (LENGTHS if data is None else data)[:198].reshape(-1, 3)
    axes.plot(*points.T, color="black")
    axes.scatter(*points.T, s=size)
    axes.plot_trisurf(*points[:20].T)
    equal_aspect(axes, points)
    return figure


def on_pixels(data=None):
    """Points in the middle and on the corners of pixels, ticks at the limits."""
    figure = Figure(figsize=(4.0, 2.0))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    values = np.arange(1.0, 201.0) if data is None else data * np.arange(1.0, 201.0) / LENGTHS
    axes.plot(values, 0.5 * values, marker="s")
    axes.set(xlim=(0.0, 600.0), ylim=(values[0], 0.5 * values[-1]))
    return figure


@pytest.mark.parametrize("make", [lines, maps, space, on_pixels])
def test_noise_in_the_last_bits_leaves_the_digest(make):
    noise = 1e-12 * np.random.default_rng(1).standard_normal(LENGTHS.size)
    assert digest(make(LENGTHS * (1.0 + noise))) == unchanged(make)


@pytest.mark.parametrize(
    ("make", "change"),
    [
        (lines, {"color": "#0072B3"}),
        (lines, {"width": 1.6}),
        (lines, {"style": "--"}),
        (lines, {"marker": "."}),
        (lines, {"label": "Truth"}),
        (lines, {"top": 10.1}),
        (lines, {"ticks": [0, 5, 10]}),
        (maps, {"pixel": 201}),
        (maps, {"color": "#ff0100"}),
        (space, {"size": 21}),
    ],
    ids=lambda part: getattr(part, "__name__", str(part)),  # a function's str differs from process to process
)
def test_any_change_that_shows_changes_the_digest(make, change):
    assert digest(make(**change)) != unchanged(make)


@pytest.mark.parametrize("make", [lines, maps, space, on_pixels])
@pytest.mark.parametrize("index", [0, 197])
def test_one_number_by_a_percent_changes_the_digest(make, index):
    changed = LENGTHS.copy()
    changed[index] *= 1.01
    assert digest(make(changed)) != unchanged(make)


def test_clip_path_changes_the_digest():
    clipped = [digest(maps(clip=Path.circle((0.5, 0.5), radius))) for radius in (0.3, 0.4)]
    assert len({*clipped, unchanged(maps)}) == 3


def test_order_of_drawing_changes_the_digest():
    def crossing(*colors):
        figure, axes = new_figure()
        for color in colors:
            axes.plot([0, 1], [0, 1], color=color)
        return figure

    assert digest(crossing("red", "blue")) != digest(crossing("blue", "red"))


def test_size_and_background_count():
    first, second, third = Figure(figsize=(2, 2)), Figure(figsize=(2, 2.01)), Figure(facecolor="#fffffe")
    third.set_size_inches(2, 2)
    assert len({digest(first), digest(second), digest(third)}) == 3


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300, 10 * FAR])
def test_numbers_far_outside_have_a_digest_of_their_own(value):
    def with_number(number):
        numbers = _Digest()
        numbers.add_numbers([1.0, number, 3.0])
        return numbers.hexadecimal()

    assert with_number(value) == with_number(value)
    assert with_number(value) != with_number(2.0)


def test_a_single_number_by_one_step_is_always_seen():
    numbers = np.random.default_rng(0).uniform(0.0, 1000.0, 300)

    def digest_of(values):
        total = _Digest()
        total.add_numbers(values)
        return total.hexadecimal()

    before = digest_of(numbers)
    for index in range(numbers.size):
        moved = numbers.copy()
        moved[index] += GRID
        assert digest_of(moved) != before


def test_digest_is_the_same_whichever_kernels_multiply():
    if platform.machine() not in ("x86_64", "AMD64"):
        pytest.skip("the two kernels are those of x86")
    script = (
        "import numpy as np; from soro_lib.replication import plotting, recording\n"
        "a, b = np.random.default_rng(3).standard_normal((2, 300, 300))\n"
        "c = a @ b @ a @ b\n"
        "figure, axes = plotting.new_figure(columns=2)\n"
        "axes[0].plot(c[:, :5]); axes[1].scatter(c[0], c[1], c=c[2])\n"
        "print(recording.Recording.of(figure, 150).digest, c.tobytes().hex())"
    )
    digests, products = zip(
        *(
            subprocess.run(
                [sys.executable, "-c", script],
                check=True,
                env={**os.environ, "OPENBLAS_CORETYPE": kernel},
                capture_output=True,
                text=True,
            ).stdout.split()
            for kernel in ("Prescott", "Haswell")
        ),
        strict=True,
    )
    if products[0] == products[1]:
        pytest.skip("this linear algebra has one kernel for both")
    assert digests[0] == digests[1]


@pytest.mark.parametrize("make", [lines, maps, space, on_pixels])
def test_recording_gives_the_pixels_that_matplotlib_draws(tmp_path, make):
    (tmp_path / "ours.png").write_bytes(Recording.of(make(), policy.DPI).png())
    make().savefig(tmp_path / "theirs.png", dpi=policy.DPI)
    with Image.open(tmp_path / "ours.png") as ours, Image.open(tmp_path / "theirs.png") as theirs:
        assert ours.info["dpi"] == theirs.info["dpi"]
        assert np.array_equal(np.asarray(ours), np.asarray(theirs))


def test_recording_leaves_the_figure_as_it_was(tmp_path):
    figure = lines()
    before = figure.dpi, figure.canvas, figure.get_layout_engine()
    first = Recording.of(figure, policy.DPI)
    assert (figure.dpi, figure.canvas, figure.get_layout_engine()) == before
    figure.axes[0].set_ylim(0, 1)
    figure.set_size_inches(1, 1)
    assert first.png() == Recording.of(lines(), policy.DPI).png()


def test_tex_and_filters_are_refused():
    figure, axes = new_figure()
    (line,) = axes.plot([0, 1])
    line.set_agg_filter(lambda image, dpi: (image, 0, 0))
    with pytest.raises(ValueError, match="neither TeX nor filtered artists"):
        Recording.of(figure, policy.DPI)


def test_digest_is_stored_in_the_picture(tmp_path):
    recording = Recording.of(lines(), policy.DPI)
    path = tmp_path / "figure.png"
    path.write_bytes(recording.png())
    assert stored_digest(path) == recording.digest


def test_what_is_no_whole_picture_with_a_digest_has_none(tmp_path):
    path = tmp_path / "figure.png"
    assert stored_digest(path) is None
    assert stored_digest(tmp_path) is None
    info = PngInfo()
    info.add_text(DIGEST, "abc")
    image = Image.fromarray(np.arange(3000, dtype=np.uint8).reshape(30, 100))
    image.save(path, pnginfo=info)
    whole = path.read_bytes()
    assert stored_digest(path) == "abc"
    middle = len(whole) // 2
    flipped = whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
    for damaged in (b"", b"text", whole[:20], whole[:middle], whole[:-12], flipped, whole[8:]):
        path.write_bytes(damaged)
        assert stored_digest(path) is None
    image.save(path)
    assert stored_digest(path) is None
    image.save(path, format="jpeg")
    assert stored_digest(path) is None


def test_reading_a_digest_does_not_import_matplotlib():
    script = "import sys, soro_lib.replication.picture; sys.exit('matplotlib' in sys.modules)"
    subprocess.run([sys.executable, "-c", script], check=True)
