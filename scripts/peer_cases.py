"""What `scripts/bench_peers.py` times: this package and others, each imported only where it is asked for.

Run as a program it reads lines `NAME AGENTS WORLDS SECONDS` from standard input. It makes the worlds when it is asked
for them first, and lets them step for about as many seconds of processor time. It answers each line with agent-steps
per second of processor time: one agent in one step is one agent-step. All actions are random, and drawn before the
clock starts; compiling, making worlds and starting episodes anew do not count.
"""

import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

DRAWN = 100
"""Steps whose actions are drawn beforehand; they are used again and again."""
JAX_STEPS = 25
"""The same in jax, where a compiled loop runs them and keeps all that is seen."""
VMAS_STEPS = 2
"""The same in VMAS, where a step of many worlds takes a second."""
PER_AREA = 50 / (32 * 16)
"""Robots per square metre of warehouse_small; larger swarms get larger arenas."""


@dataclass(frozen=True)
class Work:
    """Worlds of one kind that can go on."""

    block: Callable[[], int]
    """Steps for a while; returns how many agent-steps that was."""
    start_anew: Callable[[], object] = lambda: None
    """What comes between two blocks and is not timed."""

    def rate(self, seconds: float) -> float:
        """Return agent-steps per second of processor time."""
        spent, agent_steps = 0.0, 0
        while spent < seconds:
            self.start_anew()
            started = time.process_time()
            agent_steps += self.block()
            spent += time.process_time() - started
        return agent_steps / spent


def stepping(step: Callable[[Any], object], actions: Any, agents: int) -> Callable[[], int]:
    """Return a block of one step for each of the actions."""

    def block() -> int:
        for action in actions:
            step(action)
        return agents * len(actions)

    return block


def ours(engine: str) -> Callable[[int, int], Work]:
    """Our vector environment for Gymnasium: full observations, wheels and gripper."""

    def make(agents: int, worlds: int) -> Work:
        import gymnasium

        import swarm_forage_env  # noqa: F401 - registers the environments

        envs = gymnasium.make_vec(
            "swarm_forage/warehouse_small-v1",
            n_arenas=worlds,
            n_robots=agents,
            density=PER_AREA,
            physics=engine,
        )
        envs.reset(seed=0)
        actions = np.random.default_rng(0).uniform(-1, 1, (DRAWN, agents * worlds, 3)).astype(np.float32)
        return Work(stepping(envs.step, actions, agents * worlds))

    return make


def vmas(task: str, **fields: Any) -> Callable[[int, int], Work]:
    """A scenario of VMAS, whose agents are discs with two forces."""

    def make(agents: int, worlds: int) -> Work:
        import torch
        from vmas import make_env

        torch.set_num_threads(1)
        torch.set_grad_enabled(False)
        torch.manual_seed(0)
        env = make_env(task, num_envs=worlds, device="cpu", seed=0, n_agents=agents, **fields)
        actions = [[torch.rand(worlds, 2) * 2 - 1 for _ in range(agents)] for _ in range(VMAS_STEPS)]
        return Work(stepping(env.step, actions, agents * worlds))

    return make


def magent2(agents: int, _: int) -> Work:
    """`gather_v5` of MAgent2, by its arrays: agents walk on a grid and break food down."""
    from magent2.environments import gather_v5

    env: Any = gather_v5.parallel_env(seed=0)
    world, handle = env.env, env.handles[0]
    n_actions = world.get_action_space(handle)[0]
    actions = np.random.default_rng(0).integers(0, n_actions, (env.max_cycles, agents), dtype=np.int32)

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


def rware(agents: int, _: int) -> Work:
    """The largest warehouse of RWARE: agents turn and walk on a grid and carry shelves."""
    from rware.warehouse import RewardType, Warehouse

    env = Warehouse(
        shelf_columns=7, column_height=8, shelf_rows=4, n_agents=agents, msg_bits=0, sensor_range=1,
        request_queue_size=agents, max_inactivity_steps=None, max_steps=None, reward_type=RewardType.INDIVIDUAL,
    )  # fmt: skip
    env.reset(seed=0)
    actions = np.random.default_rng(0).integers(0, 5, (DRAWN, agents)).tolist()
    return Work(stepping(env.step, actions, agents))


def in_jax(reset: Callable[..., Any], step: Callable[..., Any], actions: Any, agents: int, worlds: int) -> Work:
    """Worlds that a compiled loop steps, as jax is meant to be used.

    Args:
        reset: key -> what is seen, state.
        step: key, state, actions -> what is seen, state, more.
        actions: Array or tree of arrays (steps, worlds, ...).
        agents: In each world.
        worlds: Side by side.
    """
    import jax

    def one_step(states: Any, given: tuple[Any, Any]) -> tuple[Any, Any]:
        seen, states, *more = jax.vmap(step)(given[0], states, given[1])
        return states, (seen, more)  # given back, or the compiler would leave it out

    steps = len(jax.tree.leaves(actions)[0])
    keys = jax.random.split(jax.random.key(0), (steps, worlds))
    states = jax.vmap(lambda key: reset(key)[1])(keys[0])
    loop = jax.jit(lambda states, keys, actions: jax.lax.scan(one_step, states, (keys, actions)))

    def block() -> int:
        jax.block_until_ready(loop(states, keys, actions))
        return steps * worlds * agents

    return Work(block)


def camar(agents: int, worlds: int) -> Work:
    """CAMAR with differential drive, between walls."""
    import jax
    from camar.make_env import make_env

    walls = {"num_agents": agents, "obstacle_density": 0.0}
    env = make_env("random_grid", dynamic="DiffDriveDynamic", map_kwargs=walls)
    actions = jax.random.uniform(jax.random.key(1), (JAX_STEPS, worlds, agents, env.action_size), minval=-1)
    return in_jax(env.reset, env.step, actions, agents, worlds)


def jaxmarl(agents: int, worlds: int) -> Work:
    """`MPE_simple_spread_v3` of JaxMARL with continuous actions."""
    import jax
    import jaxmarl

    env = jaxmarl.make("MPE_simple_spread_v3", num_agents=agents, num_landmarks=3, action_type="Continuous")
    drawn = jax.random.uniform(jax.random.key(1), (agents, JAX_STEPS, worlds, 5))
    actions = dict(zip(env.agents, drawn, strict=True))
    return in_jax(env.reset, env.step_env, actions, agents, worlds)


MAKERS: dict[str, Callable[[int, int], Work]] = {
    "ours-chipmunk": ours("chipmunk"),
    "ours-compiled": ours("compiled"),
    "vmas-discovery": vmas("discovery", x_semidim=4, y_semidim=2),
    "vmas-transport": vmas("transport"),
    "magent2": magent2,
    "rware": rware,
    "camar": camar,
    "jaxmarl": jaxmarl,
}
"""By name: (agents, worlds) -> worlds to time."""


def answer(line: str, made: dict[tuple[str, int, int], Work]) -> str:
    """Return the rate that a line asks for; worlds that are new are added to those made."""
    name, agents, worlds, seconds = line.split()
    key = name, int(agents), int(worlds)
    if key not in made:
        made[key] = MAKERS[name](*key[1:])
        made[key].rate(float(seconds))  # compiles
    return str(made[key].rate(float(seconds)))


def main() -> None:
    """Answer one line after the other; a line that cannot be answered gets "failed" and the reason."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what packages print is no answer
    made: dict[tuple[str, int, int], Work] = {}
    for line in sys.stdin:
        try:
            said = answer(line, made)
        except Exception as error:  # noqa: BLE001 - whatever goes wrong in a package is its reason
            said = f"failed {type(error).__name__}: {error}".replace("\n", " ")
        print(said, file=answers, flush=True)


if __name__ == "__main__":
    main()
