"""Draw the docs' pictures of theory: self-organisation over sizes, an example of flexibility, the task graph.

    python scripts/draw_theory.py [FOLDER]    one PNG each; default docs/images

No run is needed. `swarm-forage study plot` and `report` draw the same figures. Needs the plots extra.
"""

import sys
from pathlib import Path

from metrics.scoring.theory import theory_figures
from swarm_forage_env.rendering.figures import SCREEN

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
SHOWN = ("self_organisation", "flexibility", "task_graph")
"""Those that pages show; `swarm-forage predict availability` draws the other one."""


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES
    for figure in theory_figures():
        if figure.kind in SHOWN:
            figure.draw([folder / f"{figure.kind}.png"], SCREEN)
