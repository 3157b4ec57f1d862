"""One arena for learning: environment, wrappers, interface, seeds, and fields overridden for a curriculum."""

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces

from swarm_forage_env._internal.compiling import is_compiled
from swarm_forage_env._internal.fields import ConfigError, table
from swarm_forage_env.contract.policy import ActionError, state_size
from swarm_forage_env.contract.types import BoolArray, ObsArray
from swarm_forage_env.env import ForageEnv, checked_seed
from swarm_forage_env.layer import OPTION_OF_TESTS
from swarm_forage_env.policies.extras import ExtraFunctionError, extra_columns, extra_rewards
from swarm_forage_env.policies.interface import MOTIONS, LearnerInterface
from swarm_forage_env.policies.kernels.network import keep_on
from swarm_forage_env.views.plans import ArenaPlan
from swarm_forage_env.wrappers.base import needs_no_python
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
        self._seeds: np.random.Generator | None = None  # not before it is used: copies draw worlds of their own
        self._build({}, None)

    @property
    def n_robots(self) -> int:
        """Robots of this run, at most as many as there are rows."""
        return self.forage_env.scenario.robots.n_robots

    def _build(self, overrides: dict[str, Any], world: World | None) -> None:
        """Build environment and interface, of which one may be refused; the arena then stays as it is."""
        env = self._plan.build(overrides, world)
        self.interface = LearnerInterface(self._plan.interface, env.unwrapped.swarm_spec)
        self.env = env
        self.forage_env: ForageEnv = env.unwrapped
        self._overrides, self._world = overrides, world

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
        overrides, seed = self._chosen_overrides(options), checked_seed(seed)
        seeds = np.random.default_rng(seed) if seed is not None or self._seeds is None else copy.deepcopy(self._seeds)
        if seed is None:
            seed = int(seeds.integers(2**31))
        sampler = self._plan.sampler
        world = None if sampler is None else sampler.world_of(seed, self._share)
        if (overrides, world) != (self._overrides, self._world):
            before = self.env
            self._build(overrides, world)
            before.close()
        self._seeds = seeds  # not before the world is known to be possible
        self.env.reset_batch(seed)
        env = self.forage_env
        is_paid = env.reward_model.payment is not None
        self._tells_ahead = is_compiled(keep_on) and is_paid and needs_no_python(env, self.env.stack)
        self.interface.forget()

    def _chosen_overrides(self, options: Mapping[str, Any] | None) -> dict[str, Any]:
        """Return the fields that `options` ask for, or those of before."""
        for key in options or {}:
            if key not in (SCENARIO_OPTION, OPTION_OF_TESTS):
                raise ConfigError(
                    f"Expected the reset option {SCENARIO_OPTION!r} only, with fields of the scenario, such as "
                    f"options={{'scenario': {{'n_objects': 100}}}}, got {key!r}."
                )
        if not options or SCENARIO_OPTION not in options:
            return self._overrides
        return dict(table("the reset option 'scenario'", options[SCENARIO_OPTION]))

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
                n_ahead, disturbances = self.env.told_ahead(end - before) if self._tells_ahead else (0, None)
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
        plan, env, extra = self._plan, self.forage_env, None
        if plan.extra_observation is not None:
            try:
                extra = extra_columns(plan.extra_observation, env.arena, plan.interface.extra_columns)
            except ExtraFunctionError:
                env.break_off()
                raise
        decision = plan.interface.decisions_in(env.arena.tick)
        self.interface.show(self.env.last_obs, out[:n_robots], decision, extra)
        return out

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
