"""One arena for learning: environment, wrappers, interface, seeds, and fields overridden for a curriculum."""

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces

from swarm_forage_env._internal.compiling import is_compiled
from swarm_forage_env._internal.fields import ConfigError, table
from swarm_forage_env.contract.policy import ActionError, state_size
from swarm_forage_env.contract.types import BoolArray, FloatArray, ObsArray
from swarm_forage_env.env import ForageEnv, checked_seed
from swarm_forage_env.layer import OPTION_OF_TESTS
from swarm_forage_env.policies.extras import ExtraFunctionError, extra_columns, extra_rewards
from swarm_forage_env.policies.interface import MOTIONS, LearnerInterface
from swarm_forage_env.policies.kernels.network import keep_on
from swarm_forage_env.views.plans import ArenaPlan
from swarm_forage_env.world.kernels.disturbances import Disturbances
from swarm_forage_env.wrappers.base import SwarmWrapper, needs_no_python
from swarm_forage_env.wrappers.world import World

SCENARIO_OPTION = "scenario"
"""The only reset option."""


class LearnerArena:
    """One arena for learning, and the sequence of its episodes.

    Where a sampler draws the worlds there are as many rows as the largest has robots. The last rows of a run with fewer
    are *spare*: nobody is at work there, observations are zeros, and the only action that makes sense is to stand.

    Attributes:
        n_rows: Rows of what a learner sees, one for each robot.
        env: Environment and wrappers as one stack.
        forage_env: The ForageEnv at its bottom.
        interface: Translates for the learner; its spaces stay the same, but a reset may make a new object.
    """

    def __init__(self, plan: ArenaPlan, share: float | None = None) -> None:
        """Build the environment.

        Args:
            plan: What it is made from.
            share: Which of a sampler's worlds this arena has, see `ScenarioSampler.draw`; None = any.

        Raises:
            ConfigError: it cannot be built.
        """
        self._plan = plan
        self._share = share
        self.n_rows = plan.world.n_robots
        self._overrides: dict[str, Any] = {}
        self._world: World | None = None
        self._seeds: np.random.Generator | None = None  # not before it is used: copies draw worlds of their own
        self._adopt(*self._built({}, None))

    @property
    def n_robots(self) -> int:
        """Robots of this run, at most as many as there are rows."""
        return self.forage_env.scenario.robots.n_robots

    def _built(
        self, overrides: Mapping[str, Any], world: World | None
    ) -> tuple[ForageEnv | SwarmWrapper, LearnerInterface]:
        """Build an environment and its interface, of which one may be refused; the arena stays as it is."""
        env = self._plan.build(overrides, world)
        return env, LearnerInterface(self._plan.interface, env.unwrapped.swarm_spec)

    def _adopt(self, env: ForageEnv | SwarmWrapper, interface: LearnerInterface) -> None:
        self.env = env
        self.forage_env: ForageEnv = env.unwrapped
        self.interface = interface

    def reset(self, seed: int | None = None, options: Mapping[str, Any] | None = None) -> None:
        """Start a run.

        Args:
            seed: Seed of the run and of those that follow it; None continues the sequence of the last seed given.
            options: `{"scenario": {field: value}}` overrides fields of the plan's scenario, in this run and all later
                ones; `{"scenario": {}}` goes back to the plan. Without that key nothing changes.

        Raises:
            ConfigError: another option, a scenario field beside `scenario`, an unknown field, another number of robots,
                or more objects than a sampler's worlds have; the arena stays as it was.
        """
        overrides = _scenario_overrides(options)
        if overrides is None:
            overrides = self._overrides
        seed = checked_seed(seed)
        seeds = np.random.default_rng(seed) if seed is not None or self._seeds is None else copy.deepcopy(self._seeds)
        if seed is None:
            seed = int(seeds.integers(2**31))
        sampler = self._plan.sampler
        self._change(overrides, None if sampler is None else sampler.world_of(seed, self._share))
        self._seeds = seeds  # not before the world is known to be possible
        self.env.reset_batch(seed)
        self._begin()
        self.interface.forget()

    def _begin(self) -> None:
        """Find out, once per run, whether several ticks can be one compiled call."""
        env = self.forage_env
        is_paid = env.reward_model.payment is not None
        self._tells_ahead = is_compiled(keep_on) and is_paid and needs_no_python(env, self.env.stack)

    def _change(self, overrides: dict[str, Any], world: World | None) -> None:
        """Build another environment, if the one that there is has another world."""
        if (overrides, world) != (self._overrides, self._world):
            before = self.env
            self._adopt(*self._built(overrides, world))
            self._overrides, self._world = overrides, world
            before.close()

    def step(self, actions: np.ndarray, rewards: np.ndarray) -> None:
        """Carry out a decision: step until its ticks are done or the run ends.

        Ticks of which wrappers tell ahead what they do are one compiled call; Python steps where something needs it.
        There is at least one tick: where all died between two decisions, it ends the run.

        Args:
            actions: One action of the interface per robot, see `LearnerInterface.checked`.
            rewards: (N,) the rewards of the robots are added to this array.

        Raises:
            RuntimeError: before the first reset, or after a step that failed half done.
            ActionError: actions that the interface or the drive refuses; nothing has happened.
            ExtraFunctionError: the user's `extra_reward` failed; the run does not go on from here.
        """
        env, interface = self.forage_env, self.interface
        env.require_whole()
        arena, chosen = env.arena, interface.checked(actions)
        swarm = arena.swarm
        if np.count_nonzero(swarm.active) < len(swarm.active):
            chosen = interface.resting(chosen, ~swarm.active, swarm.carried_object >= 0)
        start = before = arena.tick
        if self.env.stack:  # wrappers may draw numbers before the world looks at actions
            env.refuse_bad_step(env.checked_actions(interface.carry_out(chosen, self.env.last_obs)), None)
        driver = interface.driver(chosen)
        end = min(start + self._plan.interface.decision_ticks, env.max_cycles)
        try:
            while True:
                n_ahead, disturbances = self._told_ahead(end - before)
                if n_ahead == 0:
                    rewards += self.env.step_batch(interface.carry_out(chosen, self.env.last_obs))[1]
                else:
                    stop = arena.run(driver, n_ahead, disturbances=disturbances, rewards=env.reward_model, paid=rewards)
                    self.env.pass_ticks(stop.tick - before, stop)
                before = arena.tick
                if before >= end or env.is_over:
                    break
            self._add_extra(rewards)
        except BaseException as error:
            if not isinstance(error, ActionError) or arena.tick > start:
                env.break_off()
            raise

    def _told_ahead(self, n_ticks: int) -> tuple[int, Disturbances | None]:
        """Return how many ticks can be one compiled call, and what wrappers do in them; 0 = Python steps one."""
        return self.env.told_ahead(n_ticks) if self._tells_ahead else (0, None)

    def _add_extra(self, rewards: np.ndarray) -> None:
        """Add the user's `extra_reward` of a decision to the rewards of the robots (N,)."""
        function, env = self._plan.extra_reward, self.forage_env
        if function is not None:
            values = extra_rewards(function, env.arena)
            if env.scenario.reward.team:
                values = values.sum() / max(1, np.count_nonzero(env.active)) * env.active
            rewards += values

    @property
    def active(self) -> BoolArray:
        """Which rows are at work, (rows,): a new array."""
        return self._with_spare_rows(self.forage_env.active)

    @property
    def _decision(self) -> int:
        return self._plan.interface.decisions_in(self.forage_env.tick)

    def observe(self, out: ObsArray | None = None) -> ObsArray:
        """Return what the learner sees now, (rows, d): a new array, or `out`.

        Raises:
            ExtraFunctionError: the user's `extra_observation` failed; the run does not go on from here.
        """
        if out is None:
            out = np.empty((self.n_rows, self.interface.layout.size), np.float32)
        n_robots = self.n_robots
        if n_robots < self.n_rows:
            out[n_robots:] = 0.0
        self.interface.show(self.env.last_obs, out[:n_robots], self._decision, self._extra_columns())
        return out

    def _extra_columns(self) -> FloatArray | None:
        function = self._plan.extra_observation
        if function is None:
            return None
        try:
            return extra_columns(function, self.forage_env.arena, self._plan.interface.extra_columns)
        except ExtraFunctionError:
            self.forage_env.break_off()
            raise

    @property
    def state_space(self) -> spaces.Box:
        """Space of `state()`; with a sampler, as large as the most robots and the most objects need."""
        sampler = self._plan.sampler
        if sampler is None:
            return self.forage_env.state_space
        return spaces.Box(-1.0, 1.0, (state_size(sampler.n_robots, sampler.n_objects),), np.float32)

    def state(self) -> ObsArray:
        """Return the global view, see `ForageEnv.state`; zeros for robots and objects that this run does not have."""
        state = self.forage_env.state()
        if self._plan.sampler is None:
            return state
        robots, things = np.split(state, [state_size(self.n_robots, 0)])
        padded = np.zeros(self.state_space.shape, np.float32)
        padded[: len(robots)] = robots
        first_object = state_size(self.n_rows, 0)
        padded[first_object : first_object + len(things)] = things
        return padded

    def mask(self) -> BoolArray:
        """Return which discrete actions make sense now, (rows, number of actions); see `LearnerInterface.mask`.

        Spare rows can stand, because algorithms with masks draw an action for each row.
        """
        mask = self._with_spare_rows(self.interface.mask(self.env.last_obs))
        mask[self.n_robots :, MOTIONS.index("stand")] = True
        return mask

    def _with_spare_rows(self, rows: np.ndarray) -> np.ndarray:
        padded = np.zeros((self.n_rows, *rows.shape[1:]), rows.dtype)
        padded[: len(rows)] = rows
        return padded


def _scenario_overrides(options: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Return the overridden fields that `options` asks for, None when it has no such key."""
    for key in options or {}:
        if key not in (SCENARIO_OPTION, OPTION_OF_TESTS):
            raise ConfigError(
                f"Expected the reset option {SCENARIO_OPTION!r} only, with fields of the scenario, such as "
                f"options={{'scenario': {{'n_objects': 100}}}}, got {key!r}."
            )
    if not options or SCENARIO_OPTION not in options:
        return None
    return dict(table("the reset option 'scenario'", options[SCENARIO_OPTION]))
