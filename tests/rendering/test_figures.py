"""Figures: formats, fonts, width, style, whole files, and how policies look."""

import re
import subprocess
import sys
import zlib
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

pytest.importorskip("matplotlib")

import matplotlib as mpl
from PIL import Image

from swarm_forage_env import ConfigError
from swarm_forage_env.rendering.figures import (
    COLOURS,
    FORMATS,
    FigureStyle,
    check_picture,
    log_height,
    looks,
    policy_words,
    saved_figure,
    saved_panels,
    size_axis,
)
from swarm_forage_env.rendering.plots import Curve, draw_curves
from tests.support.colours import VISION, seen_lab
from tests.support.pictures import words_in

TIMES = np.array([100.0, 200.0, 300.0])
PLACE = {"PYTHONPATH": str(Path(__file__).resolve().parents[2]), "MPLCONFIGDIR": mpl.get_configdir()}
"""What another process needs to draw."""
PAPER = FigureStyle(width_in=3.5, font_size=7, title=False)


def draw(path, **options):
    curves = [Curve(name, TIMES * k, TIMES * k - 5, TIMES * k + 5) for k, name in enumerate(("crw", "dpo", "$a$ mine"))]
    draw_curves(path, TIMES, curves, title="the headline", ylabel="deliveries", band="bands: two", **options)
    return path


def content_of(pdf: Path) -> bytes:
    """A PDF with its compressed parts unpacked."""
    raw = pdf.read_bytes()
    parts = re.findall(rb"stream\r?\n(.*?)endstream", raw, re.DOTALL)
    return raw + b"".join(zlib.decompressobj().decompress(part) for part in parts if part[:1] == b"\x78")


def test_words_in_svg_are_text(tmp_path):
    words = words_in(draw(tmp_path / "it.svg"))
    assert {"CRW", "DPO", "$a$ mine", "deliveries", "time [s] (bands: two)", "the headline"} <= {*words}


def test_fonts_in_pdf_are_truetype(tmp_path):
    content = content_of(draw(tmp_path / "it.pdf"))
    assert b"/Type3" not in content
    assert b"/FontFile2" in content, "an embedded TrueType font"


@pytest.mark.parametrize("width_in", [3.5, 7.16])
def test_widths_are_exact(tmp_path, width_in):
    style = FigureStyle(width_in=width_in, font_size=7)
    with Image.open(draw(tmp_path / "it.png", style=style)) as picture:
        assert picture.width == round(150 * width_in)
    svg = ET.parse(draw(tmp_path / "it.svg", style=style)).getroot()
    assert float(svg.get("width").removesuffix("pt")) == pytest.approx(72 * width_in)
    box = re.search(rb"/MediaBox \[ ?0 0 ([\d.]+)", draw(tmp_path / "it.pdf", style=style).read_bytes())
    assert float(box[1]) == pytest.approx(72 * width_in)


def test_a_paper_has_its_font_size_and_no_headline(tmp_path):
    assert "the headline" not in words_in(draw(tmp_path / "it.svg", style=PAPER))
    assert " 7px" in (tmp_path / "it.svg").read_text()
    assert " 9px" in draw(tmp_path / "screen.svg").read_text()


@pytest.mark.parametrize("ending", FORMATS)
def test_the_same_numbers_give_the_same_bytes_in_any_process(tmp_path, ending):
    """Without dates and chance; a hash of texts differs from process to process."""
    code = "import sys, tests.rendering.test_figures as it; it.draw(sys.argv[1])"
    files = [tmp_path / f"{name}{ending}" for name in ("here", "there")]
    for seed, file in enumerate(files):
        subprocess.run([sys.executable, "-c", code, file], check=True, env={"PYTHONHASHSEED": str(seed)} | PLACE)
    assert files[0].read_bytes() == files[1].read_bytes()


def settings() -> dict:
    """Those of matplotlib now, but for one that is chosen when somebody asks."""
    return {name: mpl.rcParams[name] for name in mpl.rcParams if name != "backend"}


def test_nobody_elses_settings_have_a_say_and_ours_do_not_stay(tmp_path, monkeypatch):
    first = draw(tmp_path / "a.svg").read_bytes()
    before = settings()
    with mpl.rc_context({"font.size": 30.0, "axes.facecolor": "red", "svg.fonttype": "path"}):
        assert draw(tmp_path / "b.svg").read_bytes() == first
        assert mpl.rcParams["font.size"] == 30.0
    assert settings() == before
    (tmp_path / "matplotlibrc").write_text("font.size: 30\nsavefig.bbox: tight\naxes.facecolor: red\n")
    code = (
        "import sys, tests.rendering.test_figures as it; it.draw('c.svg'); "
        "print(it.mpl.rcParams['font.size'], 'matplotlib.pyplot' in sys.modules)"
    )
    told = subprocess.run([sys.executable, "-c", code], check=True, env=PLACE, cwd=tmp_path, capture_output=True)
    assert told.stdout.split() == [b"30.0", b"False"], "matplotlib has read the file; pyplot would open windows"
    assert (tmp_path / "c.svg").read_bytes() == first


@pytest.mark.parametrize("name", ["it.gif", "it", "it.svgz", ".png"])
def test_other_endings_are_refused_before_anything_is_drawn(tmp_path, name):
    with (
        pytest.raises(ConfigError, match=r"ends in \.png, \.svg, \.pdf, got"),
        saved_figure(tmp_path / name, (2.0, 2.0)),
    ):
        pytest.fail("nothing is drawn")
    with pytest.raises(ConfigError, match=r"ends in \.png, \.svg, \.pdf, got"):
        check_picture(tmp_path / name)


def test_endings_may_be_in_capitals_and_folders_are_made(tmp_path):
    path = tmp_path / "new" / "IT.PDF"
    check_picture(path)
    assert draw(path).read_bytes().startswith(b"%PDF")


def test_a_figure_that_fails_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "it.png"
    path.write_bytes(b"old")
    with pytest.raises(RuntimeError, match="midway"), saved_figure(path, (2.0, 2.0)):
        raise RuntimeError("midway")

    def full(figure, file, **_):
        file.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", full)
    with pytest.raises(OSError, match=r"No space left on device: .*it\.png"):
        draw(path)
    assert [file.read_bytes() for file in tmp_path.iterdir()] == [b"old"]


def test_sizes_that_would_run_into_each_other_are_on_two_lines_and_the_largest_is_kept(tmp_path):
    def shown(*sizes):
        with saved_figure(tmp_path / "it.svg", (2.0, 2.0)) as figure:
            size_axis(figure.subplots(), sizes)
        return [label.get_text() for label in figure.axes[0].get_xticklabels()]

    assert shown(1, 8, 64) == ["1", "8", "64"]
    assert shown(12, 627, 819) == ["12", "\n627", "819"]
    assert shown(12, 600, 627, 819)[1:] == ["", "\n627", "819"]


@pytest.mark.parametrize("wrong", [{"width_in": 0.5}, {"width_in": float("nan")}, {"font_size": 1.0}])
def test_styles_that_no_page_has_are_refused(wrong):
    with pytest.raises(ConfigError, match=f"Expected {next(iter(wrong))}"):
        FigureStyle(**wrong)


def test_words_that_leave_no_room_are_refused(tmp_path):
    style = FigureStyle(width_in=2.0, font_size=20.0)
    with pytest.raises(ConfigError, match="larger width_in or a smaller font_size"):
        draw(tmp_path / "it.png", style=style)
    assert not (tmp_path / "it.png").exists()


@pytest.mark.parametrize("style", [PAPER, FigureStyle()])
def test_long_words_are_wrapped_in_narrow_panels(tmp_path, style):
    with saved_panels(tmp_path / "it.svg", 2, (3.0, 2.0), style=style) as panels:
        panels[1].set_title("a title that is much longer than the panel below it")
    words = words_in(tmp_path / "it.svg")
    assert " ".join(line for line in words if line.isascii() and line[0].isalpha()) == (
        "a title that is much longer than the panel below it"
    )


def test_narrow_figures_have_fewer_panels_in_a_row():
    assert [FigureStyle().columns(n) for n in (1, 2, 8, 9, 10, 12)] == [1, 2, 2, 3, 4, 4]
    assert [FigureStyle(width_in=width, font_size=8).columns(12) for width in (2.5, 3.5, 7.0)] == [1, 1, 3]


def test_legends_stay_within_the_figure(tmp_path):
    with saved_panels(tmp_path / "it.png", 1, (3.0, 2.0)) as (panel,):
        for k in range(9):
            panel.plot([0, 1], [0, k], label=f"a law with the name {k}")
        figure = panel.figure
    (legend,) = figure.legends
    assert len(legend.get_texts()) == 9
    assert legend.get_window_extent().width <= figure.bbox.width


def test_policies_of_the_paper_have_its_names_and_always_their_own_looks():
    found = looks(["mine", "dpo", "crw", "theirs"])
    assert [look.name for look in found] == ["mine", "DPO", "CRW", "theirs"]
    assert looks(["dpo"])[0] == found[1]
    assert len({look.colour for look in found}) == len({look.marker for look in found}) == 4
    many = looks([f"policy {k}" for k in range(20)])
    assert len({look.colour for look in many}) == len(COLOURS)


@pytest.mark.parametrize(
    ("label", "shown"),
    [
        ("stochm with sensor noise", "STOCHM with sensor noise"),
        ("dpo minus crw", "DPO minus CRW"),
        ("level 1, crw, dpo", "level 1, CRW, DPO"),
        ("results/crw.npz", "results/crw.npz"),
        ("crw2", "crw2"),
    ],
)
def test_only_whole_words_are_names_of_the_paper(label, shown):
    assert policy_words(label) == shown


@pytest.mark.parametrize("vision", VISION.values(), ids=VISION.keys())
def test_policies_are_told_apart_by_colour_blind_readers(vision):
    found = [tuple(bytes.fromhex(look.colour[1:])) for look in looks(["crw", "dpo", "stochm", "stochx", "mine"])]
    assert min(float(np.linalg.norm(seen_lab(a, vision) - seen_lab(b, vision))) for a, b in combinations(found, 2)) > 10


@pytest.mark.parametrize(("values", "shown"), [((30.0, 300.0), ["50", "100", "200"]), ((1.0, 5e4), ["1", "10", "100"])])
def test_heights_on_a_log_axis_have_plain_numbers(tmp_path, values, shown):
    with saved_panels(tmp_path / "it.svg", 1, (3.0, 2.0)) as (panel,):
        panel.plot([0, 1], values)
        log_height(panel)
    words = (tmp_path / "it.svg").read_text()
    assert "$" not in words
    assert [number for number in shown if f">{number}<" in words] == shown
