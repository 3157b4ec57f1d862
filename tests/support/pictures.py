"""Figures that are saved without being painted: painting takes most of the time of a short command that draws."""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

PNG = b"\x89PNG"


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
