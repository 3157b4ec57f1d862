"""Words in pictures, and figures that are saved unpainted: painting takes most of the time of a short command."""

from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

PNG = b"\x89PNG"


def words_in(path: Path) -> list[str]:
    """The lines of text in an SVG picture."""
    return ["".join(text.itertext()) for text in ET.parse(path).iter("{http://www.w3.org/2000/svg}text")]


def keep_figures(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """From now on figures that are saved as PNG are only listed; a mark of the format goes into their files."""
    figures: list[Any] = []
    if find_spec("matplotlib") is None:
        return figures
    from matplotlib.figure import Figure

    save = Figure.savefig

    def keep(self: Figure, file: Any, **options: Any) -> None:
        if Path(file).suffix == ".png":
            figures.append(self)
            Path(file).write_bytes(PNG)
        else:
            save(self, file, **options)

    monkeypatch.setattr(Figure, "savefig", keep)
    return figures
