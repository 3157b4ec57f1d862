"""ForagingArena: the simulated world of an environment. It owns the state arrays and fixes the order of a tick."""

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from swarm_forage_env._internal.compiling import Calls
from swarm_forage_env._internal.fields import whole
from swarm_forage_env._internal.held import hold
from swarm_forage_env._internal.rng import Stream, TickDraws, stream_rng
from swarm_forage_env.contract.codes import ObjectStatus
from swarm_forage_env.contract.kernel_policy import NO_DRAWS, Driver
from swarm_forage_env.contract.layout import MESSAGES, NEIGHBOURS
from swarm_forage_env.contract.policy import layout_for, refused_action, refused_tasks
from swarm_forage_env.contract.types import ActionArray, BoolArray, CodeArray, FloatArray, IntArray, ObsArray
from swarm_forage_env.scenarios.config import MAX_HANDLING_TICKS, ScenarioConfig
from swarm_forage_env.scenarios.floor import CELLS_PER_M
from swarm_forage_env.world.allocation import new_arrays, new_state
from swarm_forage_env.world.bodies import Bodies
from swarm_forage_env.world.caches import create_dynamic_caches, create_static_caches, restore_static_caches
from swarm_forage_env.world.kernels import tick as kernels
from swarm_forage_env.world.kernels.disturbances import Disturbances
from swarm_forage_env.world.kernels.interact import drop_cargo
from swarm_forage_env.world.kernels.placement import count_objects
from swarm_forage_env.world.kernels.tick import DONE, NO_ROOM, TO_PLACE
from swarm_forage_env.world.neighbourhood import Neighbourhood
from swarm_forage_env.world.placement import (
    draw_ahead,
    draw_source,
    draw_start_poses,
    give_back,
    move_heap,
    new_draws,
    place_all,
    place_objects,
    static_cache_centres,
)
from swarm_forage_env.world.rewards import RewardModel
from swarm_forage_env.world.sensors import light_of_carriers_only, new_sensors, read_slices
from swarm_forage_env.world.state import Source, listed

_NO_TASKS, _NO_SHARES, _UNPAID = np.zeros(0, np.int8), np.zeros(1), np.zeros(0, np.float32)


class Stop(NamedTuple):
    """Where a run of the arena has stopped."""

    tick: int
    """Ticks done since reset."""
    by_python: bool
    """Whether Python has ended the last of them. Then wrappers have not disturbed what robots saw after it."""


class ForagingArena:
    """The simulated world of one scenario, reset for each run and stepped one tick at a time.

    Attributes:
        config: The scenario.
        layout: Layout of the observation rows.
        reads: Names of the observation slices that are used; sensors of others may stay zero.
        light_of_carriers_only: Whether robots that carry nothing read no light.
        tick: Ticks done since reset.
        swarm, objects, caches, events: The state; read freely, write through the methods.
        obs: (N, D) the observation, rewritten in every tick.
        has_changed: Whether robots came or went since they last looked around.
    """

    def __init__(self, config: ScenarioConfig, *, reads: Collection[str] | None = None) -> None:
        """Prepare the arena; `reset` must be called before `step`.

        Args:
            config: The scenario.
            reads: Observation slices that are used; the sensors of others may stay zero. Default: all. "light if
                carrying" reads light in rows of robots that carry only.

        Raises:
            ConfigError: `reads` holds an unknown name.
        """
        self.config = config
        self.layout = layout_for(config)
        self.reads = read_slices(reads, self.layout)
        self.light_of_carriers_only = light_of_carriers_only(reads)
        self._needs_python = not {NEIGHBOURS, MESSAGES}.isdisjoint(self.reads)
        self._given_reads = reads
        self._static_caches = len(static_cache_centres(config)) if config.caches == "static" else 0
        self._unit_gain = np.ones((config.robots.n_robots, 2))
        self._nothing = np.zeros((1, config.robots.n_robots))
        self.tick = 0

    def reset(self, seed: int) -> ObsArray:
        """Build a fresh world from `seed` and return the first observation, (N, D)."""
        config = self.config
        n_robots = config.robots.n_robots
        self.tick = 0
        state = new_state(config)
        self.swarm, self.objects, self.caches, self.events, self._requests = state
        self._placement_rng = stream_rng(seed, Stream.PLACEMENT)
        self._walk_chance = TickDraws(stream_rng(seed, Stream.OBJECT_MOTION), config.objects.n_objects)
        self._pick_chance = TickDraws(stream_rng(seed, Stream.INTERACTION), n_robots)
        self._cache_rng = stream_rng(seed, Stream.CACHE)
        source, placement_draws = self._furnish(), new_draws()
        draw_ahead(placement_draws, self._placement_rng)
        position, heading = draw_start_poses(config, stream_rng(seed, Stream.START_POSE))
        self.swarm.position[:], self.swarm.heading[:] = position, heading
        self.swarm.facing[:] = np.column_stack((np.cos(heading), np.sin(heading)))
        sensors = new_sensors(config, self.layout, self._given_reads)
        if config.physics == "compiled":
            self._physics = Bodies(config, position, heading, sensors.near, sensors.bins)
        else:
            from swarm_forage_env.world.chipmunk import ChipmunkBodies  # pymunk is loaded where it is asked for

            self._physics = ChipmunkBodies(config, position, heading)
        self.obs = sensors.obs
        twist = self._physics.twist
        self._arrays = new_arrays(config, state, sensors, twist, source, placement_draws, self._static_caches)
        self._held = hold(self._arrays)
        self._call = Calls()
        self._neighbourhood = Neighbourhood(config.robots, self.layout, self.reads)
        self.has_changed = False
        return self.observe()

    def observe(self) -> ObsArray:
        """Return the observation (N, D) of the world as it is now; only needed after a change between two steps."""
        self._call(kernels.observe, self._held, self._phases)
        self._sense_further()
        return self.obs

    def _sense_further(self) -> None:
        """Fill in neighbours and messages; robots that are not in the world sense nothing."""
        if self._neighbourhood.is_used:
            self._neighbourhood.sense(self.swarm, self.obs)

    def _furnish(self) -> Source:
        """Place all objects and create static caches: before the clusters if placement is "power_law", else after.

        Returns the regions that objects come from.
        """
        config = self.config
        clustered = config.objects.placement == "power_law"
        if self._static_caches and clustered:
            create_static_caches(config, self.objects, self.caches, self.events, supply=ObjectStatus.WAITING)
        source = draw_source(config, self.objects.floor, self._placement_rng)
        place_all(self.objects, source, config.arena.distributable_cells, self._placement_rng)
        if config.objects.placement == "heap":
            source.capacity[0] = 0  # what is delivered waits for the next
        if self._static_caches and not clustered:
            create_static_caches(config, self.objects, self.caches, self.events)
        return source

    def step(
        self,
        actions: ActionArray,
        *,
        wheel_gain: FloatArray | None = None,
        tasks: CodeArray | None = None,
    ) -> ObsArray:
        """Advance the world by one tick and return the observation, (N, D); the buffer is reused.

        The order of a tick stands in `kernels.tick`.

        Args:
            actions: (N, A) float32, contiguous, in [-1, 1]: left wheel, right wheel, gripper, message.
            wheel_gain: (N, 2) factor on each wheel's limited speed, or None.
            tasks: (N,) int8 `Task` codes, if the policy tells them.

        Raises:
            ActionError: an active robot's action or gain is NaN or infinite; nothing has happened.
        """
        tick = self.tick + 1
        gain = self._unit_gain if wheel_gain is None else np.ascontiguousarray(wheel_gain, np.float64)
        call, arrays, phases, physics = self._call, self._held, self._phases, self._physics
        picks, walks = self.draws(tick)
        draws = picks[0], walks[0]
        if isinstance(physics, Bodies):
            outcome = call(kernels.whole, arrays, physics.held, phases, actions, gain, tick, self.has_changed, *draws)
        else:
            outcome = call(kernels.set_out, arrays, phases, actions, gain, tick, self.has_changed)
            if outcome == DONE:
                physics.advance(self.swarm)
                outcome = call(kernels.meet_and_close, arrays, phases, actions, tick, *draws)
        self.conclude(outcome, actions, gain, tasks)
        return self.obs

    def draws(self, tick: int) -> tuple[FloatArray, FloatArray]:
        """Return random numbers of a tick and some after it: for pick-ups (ticks, N), for walking objects (ticks, M).

        Where they are not needed there is one row of zeros for all.
        """
        config = self.config
        nothing = self._nothing
        return (
            self._pick_chance.rows(tick) if config.caches != "none" else nothing,
            self._walk_chance.rows(tick) if config.objects.walk_probability > 0.0 else nothing,
        )

    def conclude(self, outcome: int, actions: ActionArray, gain: FloatArray, tasks: CodeArray | None = None) -> None:
        """Do what is left of the next tick after its compiled part, and count it.

        Args:
            outcome: What the compiled part returned, see `kernels.tick`.
            actions: (N, A) what it was called with; without a message, (N, 3) from compiled policies.
            gain: (N, 2) likewise.
            tasks: (N,) or None, see `step`.

        Raises:
            ActionError: see `step`.
        """
        if outcome >= 0:
            raise refused_action(outcome, actions[outcome], gain[outcome])
        self.tick, self.has_changed = self.tick + 1, False
        if outcome != DONE:
            self._finish(outcome, actions, tasks)
        if self._needs_python:
            self._neighbourhood.listen(actions, self.swarm.active)
            self._sense_further()

    def _finish(self, outcome: int, actions: ActionArray, tasks: CodeArray | None) -> None:
        """Do what of a tick compiled code cannot do: more room for pairs of robots, and placing the rest."""
        picks, walks = self.draws(self.tick)
        if outcome == NO_ROOM:
            self._physics.advance(self.swarm)
            outcome = self._call(
                kernels.meet_and_close, self._held, self._phases, actions, self.tick, picks[0], walks[0]
            )
        if outcome == TO_PLACE:
            self._create_dynamic_caches()
            self._replace_displaced()
            self._restore_caches(tasks)
            self._arrays.sensors.kept[0] = False  # nobody has listed which squares of the floor have changed
            self._call(kernels.close, self._held, self._phases, walks[0])

    def run(
        self,
        driver: Driver,
        n_ticks: int,
        *,
        disturbances: Disturbances | None = None,
        wheel_gain: FloatArray | None = None,
        acts: bool = True,
        kept: bool = False,
        task_shares: FloatArray | None = None,
        rewards: RewardModel | None = None,
        paid: ObsArray = _UNPAID,
    ) -> Stop:
        """Let a driver and the world act in turn for a while; what happens is what `act` and `step` do by turns.

        Args:
            driver: A compiled policy, or a decision of a learner.
            n_ticks: At most so many ticks, and at least one; it ends earlier where Python draws numbers or places
                objects. With 0 the driver acts, and that is all.
            disturbances: What wrappers do in so many ticks, if anything.
            wheel_gain: See `step`.
            acts: Whether the driver acts; else its actions stand as they are.
            kept: Whether nobody has written into the observation since the last call.
            task_shares: (codes,) gets the share of active robots in each task, tick by tick; None = they do not count.
            rewards: What makes the rewards; it must have a `payment`. None = there are none.
            paid: (N,) float32, the rewards are added.

        Raises:
            ActionError: as in `step`; the ticks before have happened.
            ValueError: task codes that cannot be counted; their tick has happened.
            RuntimeError: bodies that are not compiled.
        """
        first = self.tick + 1
        tasks = _NO_TASKS if task_shares is None or driver.task is None else driver.task
        gain = self._unit_gain if wheel_gain is None else np.ascontiguousarray(wheel_gain, np.float64)
        now, driver_draws = driver.next_ticks()
        picks, walks = self.draws(first)
        if n_ticks > 1:
            drawn = (rows for rows in (driver_draws, picks, walks) if rows is not NO_DRAWS)
            n_ticks = min([n_ticks, *(len(rows) for rows in drawn if rows is not self._nothing)])
        is_kept = self._arrays.sensors.kept
        is_kept[0] = kept  # the world may rely on the observation, but not longer than this call lasts
        try:
            n_begun, outcome, tasks_counted = driver.calls[disturbances is not None](
                kernels.run,
                self._held,
                self._bodies.held,
                self._phases,
                disturbances,
                driver.held,
                None if rewards is None else rewards.payment,
                paid,
                gain,
                first,
                n_ticks,
                self.has_changed,
                acts,
                now,
                driver.decision_ticks,
                driver_draws,
                picks,
                walks,
                tasks,
                _NO_SHARES if task_shares is None else task_shares,
            )
            if acts:
                driver.count_ticks(max(1, n_begun))
            if not n_begun:
                return Stop(self.tick, by_python=False)
            self.tick, self.has_changed = first + n_begun - 2, self.has_changed and n_begun == 1
            if disturbances is not None and len(disturbances.gain):
                gain = disturbances.gain
            self.conclude(outcome, driver.actions, gain, driver.task)
        finally:
            is_kept[0] = False
        if rewards is not None and outcome != DONE:
            paid += rewards.reward()
        if not tasks_counted:
            raise refused_tasks(tasks, len(self.swarm.active))
        return Stop(self.tick, by_python=outcome != DONE)

    @property
    def _phases(self) -> kernels.Phases:
        """The phases of a tick, compiled for this arena."""
        bodies = self._physics.held if isinstance(self._physics, Bodies) else None
        return self._call.once(kernels.phases_of, self._held, bodies)

    @property
    def needs_python(self) -> bool:
        """Whether Python is needed in every tick: for neighbours or messages."""
        return self._needs_python

    @property
    def _bodies(self) -> Bodies:
        """The compiled bodies of the run; raises RuntimeError where Chipmunk has them."""
        if not isinstance(self._physics, Bodies):
            raise RuntimeError('Expected physics "compiled", got "chipmunk".')
        return self._physics

    def _create_dynamic_caches(self) -> None:
        creators = listed(self._requests.creators)
        if len(creators):
            create_dynamic_caches(
                creators,
                self.config,
                self._arrays.source,
                self._robot_squares(),
                self.objects,
                self.caches,
                self.events,
                self._cache_rng,
            )

    def _robot_squares(self) -> IntArray:
        nx, ny = self.config.arena.n_cells
        squares = np.floor(self.swarm.position * CELLS_PER_M).astype(np.int32)
        return np.clip(squares, 0, (nx - 1, ny - 1))

    def _replace_displaced(self) -> None:
        rows = listed(self._requests.displaced)
        if len(rows):
            area, draws = self.config.arena.distributable_cells, self._arrays.placement_draws
            source, floor = self._arrays.source, self.objects.floor
            is_heap = self.config.objects.placement == "heap"
            give_back(draws, self._placement_rng)
            if is_heap and count_objects(floor, *source.regions[0]) == 0:
                move_heap(self.config, floor, source, self._placement_rng)
            place_objects(rows, self.objects, source, area, self._placement_rng)
            if is_heap:
                source.capacity[0] = 0  # what is delivered waits for the next
            draw_ahead(draws, self._placement_rng)

    def _restore_caches(self, tasks: CodeArray | None) -> None:
        if np.count_nonzero(self.caches.alive) < self._static_caches:
            restore_static_caches(
                self.config, self.swarm, self.objects, self.caches, self.events, tasks, self._cache_rng
            )

    def set_handling_ticks(self, *, pickup: int, drop: int) -> None:
        """Set how many ticks pick-ups and drops take that start from the next step on; a reset restores the scenario's.

        What is running keeps its end.

        Args:
            pickup: Ticks of a pick-up, 1 to `scenarios.config.MAX_HANDLING_TICKS`.
            drop: Ticks of a drop, likewise.

        Raises:
            ConfigError: a number of ticks that is not whole or out of range.
        """
        for name, ticks in (("pickup", pickup), ("drop", drop)):
            whole(f"{name}, in ticks,", ticks, at_least=1, at_most=MAX_HANDLING_TICKS)
        self._requests.handling_ticks[:] = pickup, drop

    def set_population(self, *, active: BoolArray, present: BoolArray) -> None:
        """Set which robots are in the world and which are at work; takes effect in the next step.

        A robot that leaves the world drops its cargo where it is (into a cache, onto the floor, or re-placed) and its
        body is parked. A robot that comes (back) takes the pose in `swarm.position` and `swarm.heading`.

        Args:
            active: (N,) present and not in repair.
            present: (N,) born and not dead.

        Raises:
            ValueError: wrong shapes, or a robot that is active but not present.
        """
        swarm = self.swarm
        if active.shape != swarm.active.shape or present.shape != swarm.present.shape:
            raise ValueError(
                f"Expected active and present with shape {swarm.active.shape}, got {active.shape} and {present.shape}."
            )
        if np.any(active & ~present):
            raise ValueError("Expected active robots to be present; a robot that is not in the world cannot work.")
        leaving = np.flatnonzero(swarm.present & ~present)
        for robot in leaving.tolist():
            drop_cargo(self._arrays.state, self._arrays.rules, robot)
            self._replace_displaced()
            self._physics.park(robot)
            swarm.wheel_speed[robot] = 0.0
        for robot in np.flatnonzero(~swarm.present & present).tolist():
            x, y = swarm.position[robot].tolist()
            angle = float(swarm.heading[robot])
            swarm.facing[robot] = np.cos(angle), np.sin(angle)
            self._physics.place(robot, x, y, angle)
        self.has_changed |= not np.array_equal(swarm.present, present)
        swarm.dead[:] = (swarm.dead | swarm.present) & ~present
        swarm.active[:], swarm.present[:] = active, present
