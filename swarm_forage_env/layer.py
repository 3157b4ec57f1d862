"""SwarmLayer: what an environment and each wrapper around it offer alike, the dict API and snapshots of the stack."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.contract.policy import COMMANDS, ActionError
from swarm_forage_env.contract.types import ActionArray, BoolArray, CodeArray, FloatArray, ObsArray
from swarm_forage_env.world.arena import Stop
from swarm_forage_env.world.kernels.disturbances import Disturbances
from swarm_forage_env.world.snapshots import Origin, Snapshot, read, take

if TYPE_CHECKING:
    from swarm_forage_env.env import ForageEnv

BatchStep: TypeAlias = tuple[ObsArray, np.ndarray, BoolArray, bool]
"""Observations (N, D), rewards (N,) float32, terminated (N,), truncated."""
DictStep: TypeAlias = tuple[
    dict[str, np.ndarray], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
]
"""Observations, rewards, terminations, truncations and infos by agent."""
OPTION_OF_TESTS = "options"
"""A reset option without a meaning: PettingZoo's own `parallel_api_test` gives it to every environment."""
_PACKAGE = "swarm_forage_env."
_STATE = ("_rewards", "_seeds", "_terminated", "agents", "seed_value")
"""Attributes of a ForageEnv that are state; the arena holds the rest."""


class SwarmLayer(ABC):
    """A ForageEnv, or a wrapper around one. It works on arrays; only `reset`, `step` and `restore` make dicts."""

    @property
    @abstractmethod
    def unwrapped(self) -> "ForageEnv":
        """The ForageEnv at the bottom of the stack."""

    @property
    @abstractmethod
    def stack(self) -> tuple[Any, ...]:
        """All wrappers from this layer inwards."""

    @property
    @abstractmethod
    def last_obs(self) -> ObsArray:
        """(N, D) observations as they are since the last reset, step or restore; another buffer after a restore."""

    @abstractmethod
    def reset_batch(self, seed: int | None = None) -> ObsArray:
        """Start a run and return the first observations, (N, D) float32."""

    @abstractmethod
    def step_batch(
        self, actions: ActionArray, *, wheel_gain: FloatArray | None = None, tasks: CodeArray | None = None
    ) -> BatchStep:
        """Advance by one tick."""

    # Ticks without Python

    def told_ahead(self, n_ticks: int) -> tuple[int, Disturbances | None]:
        """Return in how many ticks, at most `n_ticks`, no hook is needed from here inwards, and what happens in them.

        Raises:
            ValueError: a wrapper from elsewhere wants compiled code to do something.
        """
        if not self.stack:
            return n_ticks, None
        fields: dict[str, Any] = {}
        for wrapper in self.stack:
            n_ticks, told = wrapper.ahead(n_ticks)
            if told and not wrapper.ahead.__module__.startswith(_PACKAGE):
                raise ValueError(
                    f"Expected `ahead` of {type(wrapper).__name__} to return {{}} beside the number of ticks, got "
                    f"{', '.join(told)}; do it in the hooks of these ticks."
                )
            if fields.keys() & told.keys() - {"gain"}:  # two of a kind: the compiled loop has place for one
                n_ticks = 0
            fields |= told
        # The last death may have come between two ticks; then the coming one ends the run.
        n_ticks = 0 if self.unwrapped.terminated.all() else max(0, n_ticks)
        return n_ticks, Disturbances(**fields) if fields else None

    def pass_ticks(self, n_ticks: int, stop: Stop, tasks: CodeArray | None = None) -> None:
        """Note, from here inwards, that ticks have passed as `told_ahead` said.

        Args:
            n_ticks: How many.
            stop: Where the arena has stopped after them.
            tasks: (N,) as in `step_batch`.
        """
        for wrapper in self.stack:
            wrapper.count_ticks(n_ticks)
        if stop.by_python and self.stack:
            self.stack[0].after(tasks)

    # Dict level

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, dict[str, Any]]]:
        """Start a run; returns observations and infos per agent.

        Raises:
            ConfigError: there are `options`; this environment takes none.
        """
        for name in options or ():
            if name != OPTION_OF_TESTS:
                raise ConfigError(
                    f"Expected no reset options, got {name!r}. An environment with an interface changes its scenario "
                    "at a reset: parallel_env(..., interface={}), then reset(options={'scenario': {'n_objects': 50}})."
                )
        return self._by_agent(self.reset_batch(seed).copy()), self._infos()

    def step(self, actions: dict[str, np.ndarray]) -> DictStep:
        """Advance one tick with one action per agent in `agents`; without agents and actions nothing happens."""
        env = self.unwrapped
        if is_over(env.agents, actions, is_reset=env.seed_value is not None):
            return {}, {}, {}, {}, {}
        obs, reward, terminated, truncated = self.step_batch(self._packed(actions))
        rows = self._by_agent(obs.copy())  # one copy of the whole batch; the agents' rows are views and stay valid
        rewards, terminations = self._by_agent(reward.tolist()), self._by_agent(terminated.tolist())
        infos, truncations = self._infos(), dict.fromkeys(env.agents, truncated)
        if truncated:
            env.agents = []
        elif terminated.any():
            env.agents = [agent for agent in env.agents if not terminations[agent]]
        return rows, rewards, terminations, truncations, infos

    def _by_agent(self, rows: Any) -> dict[str, Any]:
        """Return rows by agent, of those in `agents`."""
        env = self.unwrapped
        found = dict(zip(env.possible_agents, rows, strict=True))
        return found if len(env.agents) == len(found) else {agent: found[agent] for agent in env.agents}

    def _infos(self) -> dict[str, dict[str, Any]]:
        return {agent: {"active": active} for agent, active in self._by_agent(self.unwrapped.active.tolist()).items()}

    def _packed(self, actions: dict[str, np.ndarray]) -> ActionArray:
        """Return actions by agent as an array (N, A); robots that are away stand and hold, should they come back."""
        env = self.unwrapped
        n_robots, size = len(env.possible_agents), env.swarm_spec.action_size
        packed = packed_actions(actions, env.agents, env.possible_agents, np.zeros((n_robots, size), np.float32))
        return packed if env.active.all() else at_rest(packed, ~env.active, env.swarm.carried_object >= 0)

    # Snapshots

    def snapshot(self) -> Snapshot:
        """Return the state of the run, of all layers from here inwards, as a value that can be pickled.

        It does not change when the run goes on. Random generators of the spaces are no part of it, nor attributes that
        a subclass of ForageEnv adds.

        Raises:
            RuntimeError: before the first reset, or after a step that failed half done.
            SnapshotError: physics is "chipmunk", whose bodies cannot be copied.
        """
        env = self.unwrapped
        env.require_whole()
        _, seed = env.swarm, env.seed_value  # the first refuses to be asked before a reset
        assert seed is not None, "there is a world"
        own = {name: getattr(env, name) for name in _STATE}
        states = [own, dict(vars(env.arena)), *(wrapper.__getstate__() for wrapper in self.stack)]
        return take(self._origin(), seed, env.tick, states, self._parts())

    def restore(self, snapshot: Snapshot) -> dict[str, np.ndarray]:
        """Go back to a snapshot, of this stack or of one that was made alike; returns observations per agent.

        From here on the run goes on as it did from the snapshot, bit for bit, with the same actions. No reset is needed
        before. Arrays that were taken from the environment earlier, such as `env.swarm.position`, are not updated.

        Raises:
            SnapshotError: not a snapshot, or one of another scenario or stack of wrappers; nothing changes.
        """
        return self._by_agent(self.restore_batch(snapshot).copy())

    def restore_batch(self, snapshot: Snapshot) -> ObsArray:
        """Restore at array level: as `restore`, but returns observations (N, D), a buffer that the next step reuses."""
        env = self.unwrapped
        own, of_arena, *of_wrappers = read(snapshot, self._origin(), self._parts())
        vars(env).update(own)
        vars(env.arena).update(of_arena)
        for wrapper, state in zip(self.stack, of_wrappers, strict=True):
            wrapper.__setstate__(state)
        env.make_whole()
        return self.last_obs

    def _origin(self) -> Origin:
        env = self.unwrapped
        wrappers = tuple((type(wrapper).__qualname__, wrapper.made_from) for wrapper in self.stack)
        return Origin(scenario=env.scenario, max_cycles=env.max_cycles, reads=env.reads, wrappers=wrappers)

    def _parts(self) -> list[object]:
        """What a stack is made of, state aside."""
        env = self.unwrapped
        configs = (wrapper.made_from for wrapper in self.stack if wrapper.made_from is not None)
        return [env, env.arena, env.scenario, env.layout, *self.stack, *configs]


def packed_actions(
    actions: Mapping[str, Any], agents: Collection[str], possible_agents: Collection[str], out: np.ndarray
) -> np.ndarray:
    """Write actions by agent into the rows of the agents, and return these.

    Args:
        actions: One for each agent that is left, or for each possible one: those of the dead are ignored.
        agents: Those that are left.
        possible_agents: All.
        out: (N, ...) zeros.

    Raises:
        ActionError: no such actions, or one of another shape or type.
    """
    if not isinstance(actions, Mapping):
        raise ActionError(f"Expected actions as a dict by agent, got {type(actions).__name__}.")
    if actions.keys() != set(agents) and actions.keys() != set(possible_agents):
        missing = [agent for agent in agents if agent not in actions]
        foreign = [agent for agent in actions if agent not in agents]
        raise ActionError(
            f"Expected one action for each of the {len(agents)} agents in env.agents, "
            f"missing {missing[:3] or 'none'}, not in env.agents {foreign[:3] or 'none'}."
        )
    try:
        given = np.array([actions[agent] for agent in agents])  # a third of the time of numpy.stack
        if given.shape != (len(agents), *out.shape[1:]):
            raise ValueError("another shape")
        given = given.astype(out.dtype, casting="same_kind")
    except (TypeError, ValueError) as error:
        shapes = sorted({np.shape(actions[agent]) for agent in agents})
        raise ActionError(
            f"Expected each action as {out.dtype} of shape {out.shape[1:]}, got shapes {shapes}: {error}."
        ) from error
    if len(agents) == len(out):
        return given
    out[[int(agent.removeprefix("robot_")) for agent in agents]] = given
    return out


def at_rest(actions: np.ndarray, away: BoolArray, carrying: BoolArray) -> np.ndarray:
    """Return actions (N, A) in which robots that are away (N,) stand and hold their cargo, should they come back."""
    actions = actions.copy()
    actions[away] = 0.0
    actions[away, COMMANDS - 1] = np.where(carrying[away], Grip.GRASP, Grip.RELEASE)
    return actions


def is_over(agents_left: Collection[str], actions: Any, *, is_reset: bool) -> bool:
    """Return whether a step has nothing to do, because no agent is left and no action was given.

    Libraries that step many environments side by side ask for it until all of them are done.

    Args:
        agents_left: Agents of the environment.
        actions: What its `step` was given.
        is_reset: Whether it was reset.

    Raises:
        RuntimeError: no agent is left, but there are actions, or it was never reset.
    """
    if agents_left:
        return False
    if not is_reset:
        raise RuntimeError("Call reset before step.")
    if actions:
        raise RuntimeError("All agents are done; call reset first.")
    return True
