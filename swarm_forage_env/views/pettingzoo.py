"""The learner's interface under the PettingZoo API: for libraries that want one agent per robot and dictionaries."""

from typing import Any

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv
from pettingzoo.utils.conversions import parallel_to_aec

from swarm_forage_env.env import ForageEnv
from swarm_forage_env.layer import is_over, packed_actions
from swarm_forage_env.policies.interface import LearnerInterface
from swarm_forage_env.views.learner_arena import LearnerArena
from swarm_forage_env.views.plans import constructor_takes, plan_arena, takes

Infos = dict[str, dict[str, Any]]


class ParallelLearnerEnv(ParallelEnv[str, np.ndarray, Any]):
    """`ForageEnv` with the observations and actions of an `InterfaceConfig`; agents appear and terminate as there.

    `infos[agent]` holds `active` and, for discrete actions, `action_mask`: int8 (number of actions,), 1 = makes sense.
    A step is one decision of `decision_ticks` ticks. With a sampler `possible_agents` are those of the largest world,
    and `agents` those of the run. Trainers that need a fixed number of agents take "population:deaths=absorbing,..."
    among the wrappers. Dictionaries take more time than the simulation itself; if a library takes vector environments,
    `SwarmVectorEnv` is faster.
    """

    metadata: dict[str, Any] = {**ForageEnv.metadata, "name": "swarm_forage_learner_v0"}  # noqa: RUF012 - as PettingZoo

    @constructor_takes(plan_arena)
    def __init__(self, *args: Any, **options: Any) -> None:
        """Create the environment."""
        plan = plan_arena(*args, **options)
        self._is_discrete = plan.interface.actions == "discrete"
        self._arena = LearnerArena(plan)
        self.render_mode = plan.render_mode
        self.possible_agents = list(self._arena.forage_env.possible_agents)
        self.agents: list[str] = []
        self._row_of = {agent: row for row, agent in enumerate(self.possible_agents)}
        # One space object per agent: each has a random state of its own.
        self._observation_space = {agent: self.interface.new_observation_space() for agent in self.possible_agents}
        self._action_space = {agent: self.interface.new_action_space() for agent in self.possible_agents}

    @property
    def interface(self) -> LearnerInterface:
        """Spaces and layout of what learners see and do; another object after a reset that changed the scenario."""
        return self._arena.interface

    @property
    def forage_env(self) -> ForageEnv:
        """The parallel environment at the bottom; another object after a reset that changed the scenario."""
        return self._arena.forage_env

    @property
    def np_random(self) -> np.random.Generator:
        """Generator for wrappers of other libraries; every reset starts it. Runs themselves draw elsewhere."""
        return self.forage_env.np_random

    def observation_space(self, agent: str) -> spaces.Box:
        """(d,) float32 in [-1, 1]."""
        return self._observation_space[agent]

    def action_space(self, agent: str) -> spaces.Box | spaces.Discrete:
        """Space of one robot's actions."""
        return self._action_space[agent]

    @property
    def state_space(self) -> spaces.Box:
        """Space of `state()`; with a sampler, as large as the most robots and the most objects need."""
        return self._arena.state_space

    def state(self) -> np.ndarray:
        """Return the global view, see `ForageEnv.state`; zeros for robots and objects that this run does not have."""
        return self._arena.state()

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], Infos]:
        """Start a run; returns observations and infos per agent.

        Args:
            seed: Seed of this run and of the sequence of those after it.
            options: `{"scenario": {field: value}}` overrides scenario fields from now on; see `LearnerArena.reset`.
        """
        self._arena.reset(seed, options)
        self.agents = self.possible_agents[: self._arena.n_robots]
        return self._per_agent(self._arena.observe()), self._infos()

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[dict[str, np.ndarray], dict[str, float], dict[str, bool], dict[str, bool], Infos]:
        """Advance by one decision, with one action per agent in `agents`; without agents and actions nothing happens.

        Raises:
            RuntimeError: not reset, or actions although all agents are done.
            ActionError: an agent without an action, or actions outside of its action space.
        """
        if is_over(self.agents, actions, is_reset=self.forage_env.seed_value is not None):
            return {}, {}, {}, {}, {}
        space, n_robots = self.interface.action_space, self._arena.n_robots
        rows = np.zeros((n_robots, *(space.shape or ())), space.dtype)
        chosen = packed_actions(actions, self.agents, self.possible_agents, rows)
        rewards = np.zeros(n_robots, np.float32)
        self._arena.step(chosen, rewards)
        dead, truncated = self.forage_env.terminated, self.forage_env.tick >= self.forage_env.max_cycles
        results = (
            self._per_agent(self._arena.observe()),
            self._per_agent(rewards.tolist()),
            self._per_agent(dead.tolist()),
            dict.fromkeys(self.agents, truncated),
            self._infos(),
        )
        self.agents = [] if truncated else [agent for agent in self.agents if not dead[self._row_of[agent]]]
        return results

    def _per_agent(self, rows: Any) -> dict[str, Any]:
        return {agent: rows[self._row_of[agent]] for agent in self.agents}

    def _infos(self) -> Infos:
        active = self.forage_env.active
        infos: Infos = {agent: {"active": bool(active[self._row_of[agent]])} for agent in self.agents}
        if self._is_discrete:
            mask = self._arena.mask().astype(np.int8)
            for agent, info in infos.items():
                info["action_mask"] = mask[self._row_of[agent]]
        return infos

    def render(self) -> np.ndarray | None:
        """Return a picture (height, width, 3) uint8 when created with render_mode="rgb_array", else None."""
        return self.forage_env.render()

    def close(self) -> None:
        """Close the stack."""
        self._arena.env.close()


@takes(plan_arena)
def parallel_env(*args: Any, **options: Any) -> ForageEnv | Any:
    """Create a parallel environment; `pettingzoo.make("parallel", id, ...)` calls this function, too.

    It is a `ForageEnv`; with wrappers the outermost of them; with an interface, a sampler or something extra a
    `ParallelLearnerEnv` around them all.
    """
    if any(options.get(name) is not None for name in ("interface", "sampler", "extra_reward", "extra_observation")):
        return ParallelLearnerEnv(*args, **options)
    return plan_arena(*args, **options).build({})


@takes(plan_arena)
def env(*args: Any, **options: Any) -> Any:
    """Create the agent-by-agent (AEC) form of `parallel_env` by PettingZoo's own conversion."""
    parallel = parallel_env(*args, **options)
    return parallel_to_aec(parallel)  # pyright: ignore[reportArgumentType] - its type asks for actions that may be None


aec_env = env
"""Another name for `env`, by which the package offers it; modules of PettingZoo have `env` and `parallel_env`."""
