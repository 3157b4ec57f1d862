"""Other packages beside ours, for `scripts/bench --peers FOLDER`: each is imported only where it is asked for.

Run as a program it answers lines as `bench_cases.py` does: one agent in one step is one agent-step. All actions are
random and drawn before the clock starts; compiling, making worlds and starting episodes anew do not count.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from bench_cases import Measure, answer_lines

DRAWN = 100
"""Steps whose actions are drawn beforehand; they are used again and again."""
JAX_STEPS = 25
"""The same in jax, where a compiled loop runs them and keeps all that is seen."""
VMAS_STEPS = 2
"""The same in VMAS, where a step of many worlds takes a second."""


@dataclass(frozen=True)
class Work:
    """Worlds of one kind that can go on."""

    block: Callable[[], int]
    """Steps for a while; returns how many agent-steps that was."""
    start_anew: Callable[[], object] = lambda: None
    """What comes between two blocks and is not timed."""


def measure(make: Callable[[], Work]) -> Measure:
    """Return what tells the nanoseconds of an agent-step; worlds are made once."""
    made: list[Work] = []

    def nanoseconds(_engine: str, effort: float) -> float:
        if not made:
            made.append(make())
        spent, agent_steps = 0.0, 0
        while spent < effort:  # seconds
            made[0].start_anew()
            started = time.process_time()
            agent_steps += made[0].block()
            spent += time.process_time() - started
        return spent / agent_steps * 1e9

    return nanoseconds


def stepping(step: Callable[[Any], object], actions: Any, agents: int) -> Work:
    """Return work of which a block is one step for each of the actions."""

    def block() -> int:
        for action in actions:
            step(action)
        return agents * len(actions)

    return Work(block)


def vmas(task: str, worlds: int, **fields: Any) -> Measure:
    """A scenario of VMAS, whose agents are discs with two forces."""

    def make() -> Work:
        import torch
        from vmas import make_env

        torch.set_num_threads(1)
        torch.set_grad_enabled(False)
        torch.manual_seed(0)
        env = make_env(task, num_envs=worlds, device="cpu", seed=0, n_agents=50, **fields)
        actions = [[torch.rand(worlds, 2) * 2 - 1 for _ in range(50)] for _ in range(VMAS_STEPS)]
        return stepping(env.step, actions, 50 * worlds)

    return measure(make)


def magent2() -> Work:
    """`gather_v5` of MAgent2, by its arrays: agents walk on a grid and break food down."""
    from magent2.environments import gather_v5

    env: Any = gather_v5.parallel_env(seed=0)
    world, handle = env.env, env.handles[0]
    n_actions = world.get_action_space(handle)[0]
    actions = np.random.default_rng(0).integers(0, n_actions, (env.max_cycles, 495), dtype=np.int32)

    def block() -> int:
        agent_steps = 0
        for action in actions:
            alive = world.get_num(handle)
            world.set_action(handle, action[:alive])
            world.step()
            world.get_reward(handle)
            world.get_alive(handle)
            world.get_observation(handle)
            world.clear_dead()
            agent_steps += alive
        return agent_steps

    return Work(block, env.reset)


def rware() -> Work:
    """The largest warehouse of RWARE: agents turn and walk on a grid and carry shelves."""
    from rware.warehouse import RewardType, Warehouse

    env = Warehouse(
        shelf_columns=7, column_height=8, shelf_rows=4, n_agents=50, msg_bits=0, sensor_range=1,
        request_queue_size=50, max_inactivity_steps=None, max_steps=None, reward_type=RewardType.INDIVIDUAL,
    )  # fmt: skip
    env.reset(seed=0)
    return stepping(env.step, np.random.default_rng(0).integers(0, 5, (DRAWN, 50)).tolist(), 50)


def in_jax(reset: Callable[..., Any], step: Callable[..., Any], actions: Any, worlds: int) -> Work:
    """Worlds of 50 agents that a compiled loop steps, as jax is meant to be used.

    Args:
        reset: key -> what is seen, state.
        step: key, state, actions -> what is seen, state, more.
        actions: Array or tree of arrays (steps, worlds, ...).
        worlds: Side by side.
    """
    import jax

    def one_step(states: Any, given: tuple[Any, Any]) -> tuple[Any, Any]:
        seen, states, *more = jax.vmap(step)(given[0], states, given[1])
        return states, (seen, more)  # given back, or the compiler would leave it out

    keys = jax.random.split(jax.random.key(0), (JAX_STEPS, worlds))
    states = jax.vmap(lambda key: reset(key)[1])(keys[0])
    loop = jax.jit(lambda states, keys, actions: jax.lax.scan(one_step, states, (keys, actions)))

    def block() -> int:
        jax.block_until_ready(loop(states, keys, actions))
        return JAX_STEPS * worlds * 50

    return Work(block)


def camar(worlds: int) -> Measure:
    """CAMAR with differential drive, between walls."""

    def make() -> Work:
        import jax
        from camar.make_env import make_env

        walls = {"num_agents": 50, "obstacle_density": 0.0}
        env = make_env("random_grid", dynamic="DiffDriveDynamic", map_kwargs=walls)
        actions = jax.random.uniform(jax.random.key(1), (JAX_STEPS, worlds, 50, env.action_size), minval=-1)
        return in_jax(env.reset, env.step, actions, worlds)

    return measure(make)


def jaxmarl(worlds: int) -> Measure:
    """`MPE_simple_spread_v3` of JaxMARL with continuous actions."""

    def make() -> Work:
        import jax
        import jaxmarl

        env = jaxmarl.make("MPE_simple_spread_v3", num_agents=50, num_landmarks=3, action_type="Continuous")
        drawn = jax.random.uniform(jax.random.key(1), (50, JAX_STEPS, worlds, 5))
        return in_jax(env.reset, env.step_env, dict(zip(env.agents, drawn, strict=True)), worlds)

    return measure(make)


@dataclass(frozen=True)
class Peer:
    """Another package, and the task of it that comes closest to ours."""

    about: str
    requirements: tuple[str, ...]
    """What pip installs, the package itself first."""
    measure: Measure
    ours: str
    """The case of ours beside it."""

    @property
    def folder(self) -> str:
        """Name of the virtual environment: that of the package."""
        return self.requirements[0].partition("==")[0]


VMAS = ("vmas==1.5.2", "torch==2.13.0")
WIDE = {"x_semidim": 4, "y_semidim": 2}
PEERS = {
    "vmas-discovery": Peer("VMAS, `discovery`", VMAS, vmas("discovery", 1, **WIDE), "vec-50"),
    "vmas-discovery-512": Peer("the same, 512 worlds", VMAS, vmas("discovery", 512, **WIDE), "vec-8x50"),
    "vmas-transport": Peer("VMAS, `transport`", VMAS, vmas("transport", 1), "vec-50"),
    "vmas-transport-512": Peer("the same, 512 worlds", VMAS, vmas("transport", 512), "vec-8x50"),
    "magent2": Peer("MAgent2, `gather_v5`, 495 agents", ("magent2==0.3.4",), measure(magent2), "vec-495"),
    "rware": Peer("RWARE, 38 x 22 squares", ("rware==2.0.0",), measure(rware), "vec-50"),
    "camar": Peer("CAMAR, `random_grid`, no obstacles", ("camar==0.4.0",), camar(1), "vec-50"),
    "camar-32": Peer("the same, 32 worlds", ("camar==0.4.0",), camar(32), "vec-8x50"),
    "jaxmarl": Peer("JaxMARL, `MPE_simple_spread_v3`", ("jaxmarl==0.2.0",), jaxmarl(1), "vec-50"),
    "jaxmarl-32": Peer("the same, 32 worlds", ("jaxmarl==0.2.0",), jaxmarl(32), "vec-8x50"),
}
"""Name -> package, 50 agents where nothing else is said."""


if __name__ == "__main__":
    answer_lines({name: peer.measure for name, peer in PEERS.items()}, set())
