"""Slow twin of site memory: one robot, plain Python."""

import math

import numpy as np

from swarm_forage_env.contract.layout import ObservationLayout
from tests.reference.compact_view import direction


class RobotSites:
    """What one robot remembers: `pickup` and `sighting`, places in m from the middle of the arena, or None."""

    def __init__(self) -> None:
        self.pickup: tuple[float, float] | None = None
        self.sighting: tuple[float, float] | None = None
        self.carried = False

    def look(self, row: np.ndarray, layout: ObservationLayout) -> list[float]:
        """Bring the memory up to date with a row of the environment, and return the eight columns."""
        part = {name: row[layout[name]] for name in layout.names}
        cos, sin = (float(value) for value in part["heading"])
        if cos == sin == 0.0:
            self.__init__()
            return [0.0] * 8
        half_x, half_y = layout.part("position").scale
        here = float(part["position"][0]) * half_x, float(part["position"][1]) * half_y
        carries = part["carrying"][0] == 1.0
        seen = self._nearest(part, here, (half_x, half_y))
        if carries and not self.carried:
            self.pickup = here
            if self._is_near(self.sighting, here):
                self.sighting = None
        if carries and seen is not None:
            self.sighting = seen
        if not carries and seen is None:
            self.pickup = None if self._is_near(self.pickup, here) else self.pickup
            self.sighting = None if self._is_near(self.sighting, here) else self.sighting
        self.carried = carries
        columns = []
        for site in (self.pickup, self.sighting):
            if site is None:
                columns += [0.0] * 4
            else:
                x, y = site[0] - here[0], site[1] - here[1]
                columns += [*direction(x, y, cos, sin), min(1.0, math.hypot(x, y) / 20.0)]
        return columns

    def _is_near(self, site: tuple[float, float] | None, here: tuple[float, float]) -> bool:
        return site is not None and max(abs(site[0] - here[0]), abs(site[1] - here[1])) < 0.4

    @staticmethod
    def _nearest(part: dict, here: tuple[float, float], half: tuple[float, float]) -> tuple[float, float] | None:
        cell = [float(share) * extent for share, extent in zip(part["los_cell"], half, strict=True)]
        off = [min(0.1, max(-0.1, h - c)) for h, c in zip(here, cell, strict=True)]
        found = [
            ((k % 5 - 2) * 0.2 - off[0], (k // 5 - 2) * 0.2 - off[1]) for k in range(25) if part["los_object"][k] > 0.0
        ]
        if not found:
            return None
        closest = min(math.hypot(*there) for there in found)
        x, y = next(there for there in found if there[0] ** 2 + there[1] ** 2 < closest**2 + 1e-6)
        return here[0] + x, here[1] + y
