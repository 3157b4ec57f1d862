"""Figures: formats, fonts, width, style, whole files, and how policies look."""

import re
import subprocess
import sys
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
    looks,
    saved_figure,
)
from swarm_forage_env.rendering.plots import Curve, draw_curves
from tests.support.pictures import words_in

TIMES = np.array([100.0, 200.0, 300.0])
PLACE = {"PYTHONPATH": str(Path(__file__).resolve().parents[2]), "MPLCONFIGDIR": mpl.get_configdir()}
"""What another process needs to draw."""


def draw(path, names=("crw", "dpo", "$a$ mine"), **options):
    curves = [Curve(name, TIMES * k, TIMES * k - 5, TIMES * k + 5) for k, name in enumerate(names)]
    words = {"title": "the headline", "ylabel": "deliveries", "band": "bands: two"}
    draw_curves(path, TIMES, curves, **words | options)
    return path


def test_words_in_svg_are_text(tmp_path):
    words = words_in(draw(tmp_path / "it.svg", title="the headline\nits second line"))
    told = {"CRW", "DPO", "$a$ mine", "deliveries", "time (s)", "bands: two", "the headline", "its second line"}
    assert told <= {*words}


def test_widths_and_sizes_of_letters_are_exact(tmp_path):
    width_in, style = 3.5, FigureStyle(width_in=3.5, font_size=7)
    with Image.open(draw(tmp_path / "it.png", style=style)) as picture:
        assert picture.width == round(150 * width_in)
    svg = ET.parse(draw(tmp_path / "it.svg", style=style)).getroot()
    assert " 7px" in (tmp_path / "it.svg").read_text()
    assert float(svg.get("width").removesuffix("pt")) == pytest.approx(72 * width_in)
    box = re.search(rb"/MediaBox \[ ?0 0 ([\d.]+)", draw(tmp_path / "it.pdf", style=style).read_bytes())
    assert float(box[1]) == pytest.approx(72 * width_in)


@pytest.mark.parametrize("ending", [FORMATS[0], *(pytest.param(one, marks=pytest.mark.slow) for one in FORMATS[1:])])
def test_the_same_numbers_give_the_same_bytes_in_any_process_and_place(tmp_path, ending):
    """Without dates and chance, whatever hash texts have, and whatever matplotlibrc lies in the folder."""
    code = (
        "import sys, tests.rendering.test_figures as it; it.draw(sys.argv[1]); "
        "print(it.mpl.rcParams['font.size'], 'matplotlib.pyplot' in sys.modules)"
    )
    (tmp_path / "matplotlibrc").write_text("font.size: 30\nsavefig.bbox: tight\naxes.facecolor: red\n")
    files = [tmp_path / f"{name}{ending}" for name in ("here", "there")]
    before = {name: mpl.rcParams[name] for name in mpl.rcParams if name != "backend"}
    draw(files[0])
    assert before == {name: mpl.rcParams[name] for name in mpl.rcParams if name != "backend"}
    call = [sys.executable, "-c", code, files[1]]
    told = subprocess.run(call, check=True, env={"PYTHONHASHSEED": "7"} | PLACE, cwd=tmp_path, capture_output=True)
    assert told.stdout.split() == [b"30.0", b"False"], "matplotlib has read the file; pyplot would open windows"
    assert files[0].read_bytes() == files[1].read_bytes()


@pytest.mark.parametrize("name", ["it.gif", "it", ".png"])
def test_other_endings_are_refused_before_anything_is_drawn(tmp_path, name):
    with (
        pytest.raises(ConfigError, match=r"ends in \.png, \.svg, \.pdf, got"),
        saved_figure(tmp_path / name, (2.0, 2.0)),
    ):
        pytest.fail("nothing is drawn")
    with pytest.raises(ConfigError, match=r"ends in \.png, \.svg, \.pdf, got"):
        check_picture(tmp_path / name)


def test_policies_of_the_paper_have_its_names_and_always_their_own_looks(tmp_path):
    found = looks(["mine", "dpo", "crw", "theirs"])
    assert [look.name for look in found] == ["mine", "DPO", "CRW", "theirs"]
    assert looks(["dpo"])[0] == found[1]
    assert len({look.colour for look in found}) == len({look.marker for look in found}) == 4
    assert len({look.colour for look in looks([f"policy {k}" for k in range(20)])}) == len(COLOURS)
    words = words_in(draw(tmp_path / "it.svg", names=("mine", "dpo", "crw")))
    assert [word for word in words if word in ("mine", "DPO", "CRW")] == ["CRW", "DPO", "mine"], "in the paper's order"
