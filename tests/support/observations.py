"""Synthetic observations, built by the layout, for tests of policies without an environment."""

import dataclasses
import math
from typing import Any, TypeAlias

import numpy as np

from swarm_forage_env.contract.codes import Event
from swarm_forage_env.contract.layout import CACHE_FIELDS, EVENT_SCALE, SERIAL_SCALE, VISIBLE_CACHES, observation_layout
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.scenarios.presets import scenario

GREYS = {"floor": 1.0, "nest": 0.7, "cache": 0.4, "object": 0.0}
CELL_M = 0.2
Cache: TypeAlias = tuple[int, tuple[int, int], int]
"""Serial, centre cell, number of objects."""


def make_spec(n_robots: int = 1, **changes: Any) -> SwarmSpec:
    """The task of the small warehouse, 32 x 16 m with 200 objects, or a variation of it."""
    spec = SwarmSpec.of(scenario("warehouse_small", n_robots=n_robots))
    size_m, n_objects = changes.get("arena_size_m", spec.arena_size_m), changes.get("n_objects", spec.n_objects)
    x, y = changes.get("nest_centre_m", spec.nest_centre_m)
    width, height = changes.get("nest_size_m", spec.nest_size_m)
    derived = {
        "layout": observation_layout(*size_m, n_objects),
        "cache_half_side_cells": round(changes.get("cache_side_m", spec.cache_side_m) / CELL_M) // 2,
        "nest_boxes_m": ((x - width / 2, y - height / 2, x + width / 2, y + height / 2),),
    }
    return dataclasses.replace(spec, **derived | changes)


class Observations:
    """An (N, D) observation array with setters in the units of the world; each acts on all robots unless told."""

    def __init__(self, spec: SwarmSpec) -> None:
        """Robots stand on empty floor at (10, 10) m, facing +x, carrying nothing, moving straight."""
        self.spec = spec
        self.array = np.zeros((spec.n_robots, spec.layout.size), np.float32)
        self.set("active", 1.0)
        self.set("wheel_speed", 0.45)
        self.ground("floor")
        self.pose(10.0, 10.0)

    def set(self, name: str, value: Any, robots: Any = slice(None)) -> None:
        """Write a slice in observation units."""
        self.array[robots, self.spec.layout[name]] = value

    def get(self, name: str, robot: int = 0) -> np.ndarray:
        """Read a slice of one robot."""
        return self.array[robot, self.spec.layout[name]]

    def pose(self, x: float, y: float, heading: float = 0.0, robots: Any = slice(None)) -> None:
        """Set position and heading, and the cell that goes with them."""
        self.believed_position(x, y, robots)
        self.set("heading", (math.cos(heading), math.sin(heading)), robots)
        cell = (int(x / CELL_M), int(y / CELL_M))
        self.set("los_cell", self._share((cell[0] + 0.5) * CELL_M, (cell[1] + 0.5) * CELL_M), robots)

    def believed_position(self, x: float, y: float, robots: Any = slice(None)) -> None:
        """Set the position reading only."""
        self.set("position", self._share(x, y), robots)

    def _share(self, x: float, y: float) -> tuple[float, float]:
        width_m, height_m = self.spec.arena_size_m
        return 2 * x / width_m - 1, 2 * y / height_m - 1

    def ground(self, kind: str, robots: Any = slice(None)) -> None:
        """Let all four ground sensors see one kind of floor."""
        self.set("ground", GREYS[kind], robots)

    def obstacle(self, angle: float | None, robots: Any = slice(None)) -> None:
        """Let the two beams around a body-frame angle see an obstacle, or none."""
        self.set("proximity", self._ring(angle, 0.5), robots)

    def light(self, angle: float, robots: Any = slice(None)) -> None:
        """Let the light shine from a body-frame angle."""
        self.set("light", self._ring(angle, 0.9), robots)

    @staticmethod
    def _ring(angle: float | None, reading: float) -> np.ndarray:
        readings = np.zeros(24)
        if angle is not None:
            first = math.floor(math.degrees(angle) / 15.0 - 0.5)
            readings[[first % 24, (first + 1) % 24]] = reading
        return readings

    def carry(self, object_row: int | None, robots: Any = slice(None)) -> None:
        """Set cargo; None = carrying nothing."""
        self.set("carrying", 0.0 if object_row is None else 1.0, robots)
        self.set("cargo", 0.0 if object_row is None else (object_row + 1) / self.spec.n_objects, robots)

    def event(
        self, event: Event, robots: Any = slice(None), object_row: int | None = None, cache: Cache | None = None
    ) -> None:
        """Set what happened in the last step, and what it was about."""
        self.set("event", int(event) / EVENT_SCALE, robots)
        self.set("event_object", 0.0 if object_row is None else (object_row + 1) / self.spec.n_objects, robots)
        self.set("event_cache", 0.0 if cache is None else self._cache_fields(cache), robots)

    def caches(self, *visible: Cache, robots: Any = slice(None)) -> None:
        """Show caches, nearest first."""
        fields = np.zeros((VISIBLE_CACHES, CACHE_FIELDS))
        for place, cache in enumerate(visible):
            fields[place] = self._cache_fields(cache)
        self.set("los_cache", fields.ravel(), robots)

    def _cache_fields(self, cache: Cache) -> tuple[float, ...]:
        serial, (x, y), count = cache
        share = self._share((x + 0.5) * CELL_M, (y + 0.5) * CELL_M)
        return serial / SERIAL_SCALE, *share, count / self.spec.n_objects

    def window(self, objects: dict[tuple[int, int], int], robots: Any = slice(None)) -> None:
        """Show objects: offset in cells from the robot's own cell, -2 .. 2 each -> object row."""
        view = np.zeros((5, 5))
        for (dx, dy), object_row in objects.items():
            view[dy + 2, dx + 2] = (object_row + 1) / self.spec.n_objects
        self.set("los_object", view.ravel(), robots)
