"""What networks do in worlds that they see turned or mirrored: have they learnt the compass by heart?

    python scripts/turned_worlds.py                         generalist, the table of docs/generalist.md
    python scripts/turned_worlds.py --policy a.npz,b.npz    other networks

A turned world has the same physics, and a network sees it as if its arena were turned (`policies.turns`). So a network
without a compass has the same performance in all columns of a world, but for chance.
"""

import argparse
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from arguments import whole

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.wording import counted
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.inspect.saliency import open_network_of
from swarm_forage_env.policies.network import Network, NetworkError
from swarm_forage_env.policies.registry import policy_label
from swarm_forage_env.policies.turns import Turn
from swarm_forage_env.runs.answer import Sheet
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.views.learner_arena import LearnerArena
from swarm_forage_env.views.plans import ArenaPlan
from swarm_forage_env.wrappers.world import World

TURNS = {
    "as drawn": Turn(),
    "quarter": Turn(quarters=1),
    "half": Turn(quarters=2),
    "mirrored": Turn(is_mirrored=True),
}
WORLDS: dict[str, dict[str, Any]] = {
    "warehouse_small": {"n_robots": 32},
    "warehouse_medium": {"n_robots": 64},
    "search_and_rescue": {"n_robots": 32},
}
_FIRST_SEED = 60_000


def performance(network: Network, config: ScenarioConfig, turn: Turn, seed: int) -> float:
    """Return the performance of a run per 1,000 s; actions are drawn."""
    arena = LearnerArena(ArenaPlan(world=World(config), interface=network.about.interface))
    arena.reset(seed)
    arena.turn = turn
    rng, rewards = np.random.default_rng(seed), np.zeros(arena.n_rows, np.float32)
    over = False
    while not over:
        preferences = network.outputs(arena.observe())
        _, _, over = arena.step(np.argmax(preferences + rng.gumbel(size=preferences.shape), axis=1), rewards)
    counters = arena.forage_env.events.counters
    counter = Counter.COLLECTED if config.performance == "collected" else Counter.FIRST_PICKED
    return 1000.0 * float(counters[counter]) / config.horizon_s


def rows_of(policy: str, seeds: Sequence[int], horizon_s: float) -> Iterator[tuple[str, ...]]:
    """Yield the row of a network in each world: means of runs with these seeds."""
    network = open_network_of(policy)
    for name, fields in WORLDS.items():
        config = scenario(name, physics="compiled", horizon_s=horizon_s, **fields)
        means = [
            np.mean([performance(network, config, turn, _FIRST_SEED + seed) for seed in seeds])
            for turn in TURNS.values()
        ]
        label = f"{policy_label(policy)}, {name}, {config.robots.n_robots} robots"
        yield (label, *(f"{mean:.1f}" for mean in means))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--policy", default="generalist", help="shipped networks or files, separated by commas")
    parser.add_argument("--seeds", type=whole(at_least=1), default=4, help="runs of each (default: 4)")
    parser.add_argument("--horizon", type=float, default=2000.0, help="seconds of a run (default: 2000)")
    words = parser.parse_args()
    try:
        rows = [row for policy in words.policy.split(",") for row in rows_of(policy, range(words.seeds), words.horizon)]
    except (ConfigError, NetworkError, OSError) as error:
        raise SystemExit(str(error)) from error
    title = f"Performance per 1,000 s, means of {counted(words.seeds, 'run')} of {words.horizon:,.0f} s"
    print(Sheet(title=title, header=("network and world", *TURNS), rows=rows, notes=[]).text())


if __name__ == "__main__":
    main()
