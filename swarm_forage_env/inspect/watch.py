"""Watching a run in a window: `Watch` drives a policy and lets a person look, choose, and disturb."""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import number
from swarm_forage_env.contract.policy import Policy, RememberedPlaces
from swarm_forage_env.inspect.film import size_words
from swarm_forage_env.inspect.levels_by_hand import LEVELS
from swarm_forage_env.inspect.run_by_hand import SPEEDS, RunByHand
from swarm_forage_env.rendering.close_up import render_close_up
from swarm_forage_env.rendering.frame import render_frame
from swarm_forage_env.rendering.view import arena_view, refusing
from swarm_forage_env.rendering.window import CLOSE_UP_PX, Clicked, Closed, Pressed, Scene, Window, WindowEvent
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M
from swarm_forage_env.wrappers.base import WrapperConfig
from swarm_forage_env.wrappers.world import World

HELP = (
    "space: pause   .: one tick   up, down: speed   click, tab: choose a robot   esc: none   +, -: close-up   "
    "t, s, w, h: raise throttle, sensor noise, wheel noise, handling   with shift: lower   shift and click: kill   "
    "q: quit"
)
FRAMES_PER_S = 30.0
_NEAREST_PX = 30.0
"""A click farther from every robot chooses none."""
_MARK_GAP_PX = 4.0
"""How much larger than the thing a mark of memory is."""
_SIDES_M = (0.8, 1.2, 1.6, 2.4, 4.0, 8.0)


class Watch(RunByHand):
    """A run, and how somebody looks at it: `Watch(scenario, "crw").show()` opens a window.

    Attributes:
        robot: Row of the chosen robot, None for none.
        note: What the last key or click has done.
        is_closed: Whether the user wants to see no more.
    """

    def __init__(
        self,
        scenario: ScenarioConfig,
        policy: str | Policy,
        *,
        seed: int = 0,
        speed: float = 10.0,
        size_px: int = 900,
        theme: str = "dark",
        caches: str | None = None,
        parameters: Mapping[str, Any] | None = None,
        wrappers: Iterable[WrapperConfig] = (),
    ) -> None:
        """Start the run; arguments and errors are those of `RunByHand`, and two more.

        `size_px` is the longer side of the drawn arena, and `theme` is "dark" or "light".

        Raises:
            RenderError: `size_px` or `speed` out of range, or no such theme.
            ImportError: Pillow is not installed.
        """
        with refusing():
            number("speed", speed, above=0.0)
        arena_view(scenario, size_px, theme)  # refuses a bad size or theme before the run starts
        super().__init__(
            scenario, policy, seed=seed, speed=speed, caches=caches, parameters=parameters, wrappers=wrappers
        )
        self._headline = World(self.scenario, self.given).title(self.name, size_words(self.scenario), digests=False)
        self._size_px, self._theme = size_px, theme
        self._view = arena_view(self.scenario, size_px, theme)
        self.robot: int | None = None
        self.note = ""
        self._side = _SIDES_M.index(1.6)
        self.is_closed = False

    def show(self) -> None:
        """Show the run in a window until the user closes it. A run that is over stays on the screen.

        Raises:
            RenderError: There is no display.
            ImportError: pygame is not installed.
        """
        window = Window()
        try:
            while not self.is_closed:
                window.show(self.scene())
                self.advance(window.wait(FRAMES_PER_S))
                for event in window.events():
                    self.handle(event)
        finally:
            window.close()

    # Keys and clicks

    def handle(self, event: WindowEvent) -> None:
        """Do what a key or a click asks for; others do nothing."""
        if isinstance(event, Closed):
            self.is_closed = True
        elif isinstance(event, Clicked):
            self._click(event)
        elif event.key in LEVELS:
            self.note = self.levels.change(event.key, up=not event.shift)
        elif event.key in _KEYS:
            _KEYS[event.key](self, event)

    def _click(self, click: Clicked) -> None:
        robot = self._robot_at(click.x, click.y)
        if not click.shift:
            self.robot = robot
        elif robot is not None:
            self.note = self.levels.kill(robot)

    def _robot_at(self, x: float, y: float) -> int | None:
        """Return the robot nearest to a pixel, None if none is near."""
        distance = np.hypot(*(self._view.pixels(self.world.swarm.position) - (x, y)).T)
        distance[~self.world.swarm.present] = math.inf
        nearest = int(np.argmin(distance))
        return nearest if distance[nearest] <= _NEAREST_PX else None

    def _choose_next(self, pressed: Pressed) -> None:
        alive = np.flatnonzero(self.world.swarm.present)
        if len(alive) == 0:
            return
        if self.robot is None:
            self.robot = int(alive[-1 if pressed.shift else 0])
        elif pressed.shift:
            self.robot = int(alive[np.searchsorted(alive, self.robot) - 1])
        else:
            self.robot = int(alive[np.searchsorted(alive, self.robot, side="right") % len(alive)])

    def _choose_none(self, _: Pressed) -> None:
        self.robot = None

    def _pause(self, _: Pressed) -> None:
        self.paused = not self.paused

    def _one_tick(self, _: Pressed) -> None:
        self.paused = True
        self.step()

    def _faster(self, _: Pressed) -> None:
        self.speed = min((speed for speed in SPEEDS if speed > self.speed), default=SPEEDS[-1])

    def _slower(self, _: Pressed) -> None:
        self.speed = max((speed for speed in SPEEDS if speed < self.speed), default=SPEEDS[0])

    def _closer(self, _: Pressed) -> None:
        self._side = max(0, self._side - 1)

    def _wider(self, _: Pressed) -> None:
        self._side = min(len(_SIDES_M) - 1, self._side + 1)

    def _quit(self, _: Pressed) -> None:
        self.is_closed = True

    # What is shown

    def scene(self) -> Scene:
        """Draw the run as it is now."""
        world = self.world
        state = (world.swarm, world.objects, world.caches)
        frame = render_frame(
            self.scenario,
            *state,
            world.events,
            tick=world.tick,
            size_px=self._size_px,
            title=self._headline,
            theme=self._theme,
        )
        ring = close_up = None
        marks: tuple[tuple[float, float, float], ...] = ()
        if self.robot is not None and world.swarm.present[self.robot]:
            column, row = self._view.pixels(world.swarm.position[self.robot]).tolist()
            ring = (column, row, 2.5 * self._view.robot_px + 4.0)
            remembered = self.remembered_places(self.robot)
            marks = self._marks(remembered)
            close_up = render_close_up(
                self.scenario,
                *state,
                robot=self.robot,
                obs=world.arena.obs[self.robot],
                layout=world.layout,
                remembered=remembered,
                side_m=_SIDES_M[self._side],
                size_px=CLOSE_UP_PX,
                theme=self._theme,
            )
        return Scene(
            frame=frame,
            title=self.title(),
            ring=ring,
            marks=marks,
            close_up=close_up,
            lines=tuple(self._lines()),
            help=HELP,
            palette=self._view.palette,
        )

    def _marks(self, remembered: RememberedPlaces | None) -> tuple[tuple[float, float, float], ...]:
        """Return squares of the frame, around the places of objects and of caches."""
        if remembered is None:
            return ()
        view, cache_m = self._view, self.scenario.cache_side_cells * CELL_M
        return tuple(
            (column, row, side_px + _MARK_GAP_PX)
            for places_m, side_px in (
                (remembered.objects_m, view.object_px),
                (remembered.caches_m, cache_m * view.scale),
            )
            for column, row in view.pixels(places_m).tolist()
        )

    def title(self) -> str:
        """Return the text of the title bar; it names all that was changed by hand."""
        return f"{self._headline}, seed {self.seed}{self.changes_in_words(' - changed by hand: ')}"

    def _lines(self) -> list[str]:
        clock = "over" if self.run.over else "paused" if self.paused else f"{self.speed:g} times real time"
        tick = f"tick {self.world.tick:,}"
        levels = [f"{kind.name} {_told(self.levels.level(key))}" for key, kind in LEVELS.items()]
        lines = [f"{tick}, {clock}", "; ".join(levels)]
        if self.levels.changes:
            lines.append(self.changes_in_words("changed by hand: "))
        if self.note:
            lines.append(self.note)
        return [*lines, "", *self._robot_lines()]

    def _robot_lines(self) -> list[str]:
        robot, world = self.robot, self.world
        if robot is None:
            return ["click on a robot to see what it sees and does"]
        if not world.swarm.present[robot]:
            return [f"robot {robot}: not in the arena"]
        swarm, (x, y) = world.swarm, world.swarm.position[robot]
        signs = [
            sign
            for sign, is_so in (
                ("in repair", not swarm.active[robot]),
                ("carrying", swarm.carried_object[robot] >= 0),
                ("in interference", world.events.interfering[robot]),
            )
            if is_so
        ]
        lines = [f"robot {robot} at ({x:.2f}, {y:.2f}) m", ", ".join(signs) or "carries nothing"]
        left, right = swarm.wheel_speed[robot]
        if kind := world.scenario.robots.kind_of(robot):
            lines.append(f"kind: {kind}")
        lines.append(f"wheels {100 * left:.1f}, {100 * right:.1f} cm/s")
        return [*lines, *self._policy_lines(robot)]

    def _policy_lines(self, robot: int) -> list[str]:
        """Return what the policy tells of a robot: task, activity, memory."""
        policy, lines = self.policy, [f"{name}: {text}" for name, text in self.told_of(robot)]
        if hasattr(policy, "describe_robots"):
            known = policy.describe_robots().n_remembered  # type: ignore[attr-defined] - optional, see Policy
            if known is not None:
                shown = ", in thin frames" if hasattr(policy, "describe_memories") else ""
                lines.append(f"remembers: {known[robot]}{shown}")
        elif (places := self.remembered_places(robot)) is not None:
            lines.append(f"remembers: {len(places.objects_m) + len(places.caches_m)}, in thin frames")
        return lines or [f"{self.name} does not tell what its robots are doing"]


_KEYS: dict[str, Callable[[Watch, Pressed], None]] = {
    "space": Watch._pause,
    ".": Watch._one_tick,
    "right": Watch._one_tick,
    "up": Watch._faster,
    "down": Watch._slower,
    "tab": Watch._choose_next,
    "escape": Watch._choose_none,
    "+": Watch._closer,
    "=": Watch._closer,
    "-": Watch._wider,
    "q": Watch._quit,
}
"""Names of keys -> what they do. "=" is the key with the plus sign on many keyboards."""


def _told(level: float | None) -> str:
    return "as given" if level is None else f"{level:g}"
