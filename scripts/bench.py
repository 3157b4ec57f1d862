"""Measure speed where one version says enough: large swarms, wrappers, learning, pictures, the first run.

    scripts/bench                   all cases
    scripts/bench --quick           fewer repeats, shorter runs
    scripts/bench --only wrappers   cases whose name contains "wrappers"

`scripts/compare_speed.py` has the speed of runs, as ratios to another version; `scripts/tick_phases.py` has the phases
of a tick. Bodies are compiled unless a row says otherwise.

A robot-tick is one robot for one control step of 0.2 s. Times are processor time of the one measuring process, so that
other work on the machine counts as little as possible. Machines differ: compare ratios within one table, not single
numbers between tables.
"""

import argparse
import importlib.util
import itertools
import math
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from site_search import share_of_run
from speed_cases import WRAPPERS, large_world

from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import LiveRun, build_stack
from swarm_forage_env.runs.spec import RunSpec, plan_run
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.scenarios.presets import warehouse_medium
from swarm_forage_env.views.pettingzoo import parallel_env
from swarm_forage_env.wrappers.base import WrapperConfig
from swarm_forage_env.wrappers.kernels.gaussian import to_normal
from swarm_forage_env.wrappers.registry import parse_wrapper


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    case: str
    value: float
    unit: str
    target: str
    met: bool | None
    note: str = ""


def run_spec(scenario: ScenarioConfig, policy: str, ticks: int) -> RunSpec:
    """A run of `ticks` control steps in one recording interval."""
    seconds = ticks * scenario.dt_s
    return plan_run(with_overrides(scenario, horizon_s=seconds, interval_s=seconds), policy)


@contextmanager
def stopwatch(owner: Any, name: str, total: list[float]) -> Iterator[None]:
    """Add the time spent in `owner.name` to total[0] while the context lasts."""
    original: Callable[..., Any] = getattr(owner, name)

    def timed(*args: Any, **options: Any) -> Any:
        started = time.process_time()
        result = original(*args, **options)
        total[0] += time.process_time() - started
        return result

    setattr(owner, name, timed)
    try:
        yield
    finally:
        setattr(owner, name, original)


def learning_rows(ticks: int, repeats: int) -> Iterator[Row]:
    """The vector environment of stable-baselines3 with random actions, and what PPO adds around it, 50 robots."""
    ticks //= 2
    case = "VecEnv, N = 50, random actions"
    if importlib.util.find_spec("stable_baselines3") is None:
        yield Row(case, math.nan, "k robot-steps/s", "-", None, "needs the train extra")
        return
    import torch
    from stable_baselines3 import PPO

    from swarm_forage_env.training.sb3 import ActiveRolloutBuffer, SwarmVecEnv

    env = SwarmVecEnv("warehouse_small", physics="compiled")
    env.seed(0)
    env.reset()
    drawn = np.random.default_rng(0).uniform(-1, 1, (100, env.num_envs, 3)).astype(np.float32)
    env.step(drawn[0])
    rates = []
    for _ in range(repeats):
        started = time.process_time()
        for tick in range(ticks):
            env.step(drawn[tick % len(drawn)])
        rates.append(ticks * env.num_envs / (time.process_time() - started))
    rate = statistics.median(rates)
    yield Row(case, rate / 1e3, "k robot-steps/s", "-", None)

    torch.set_num_threads(1)  # processor time of two threads would count twice
    n_steps = max(128, ticks // 10)
    model = PPO(
        "MlpPolicy",
        env,
        n_steps=n_steps,
        batch_size=n_steps * env.num_envs // 4,
        n_epochs=4,
        rollout_buffer_class=ActiveRolloutBuffer,
        rollout_buffer_kwargs=env.rollout_buffer_kwargs,
        device="cpu",
    )
    spent = [0.0]
    with stopwatch(env, "step_wait", spent):
        started = time.process_time()
        model.learn(n_steps * env.num_envs)
        total = time.process_time() - started
    note = f"environment {spent[0] / total:.0%}, PPO itself {1 - spent[0] / total:.0%} (4 epochs, 64 x 64)"
    yield Row("PPO on it", n_steps * env.num_envs / total / 1e3, "k robot-steps/s", "-", None, note)


IMPORT = """
import time
started = time.process_time()
import swarm_forage_env
print(time.process_time() - started)
"""
FIRST_RUN = ("run", "--policy", "crw", "--robots", "50", "--horizon", "200", "--seeds", "1", "--jobs", "1")
"""Words of the command whose first run is timed; `--jobs 1` compiles in two processes where two cores are free."""
PEAK_MEMORY = """
import resource, sys
sys.path.insert(0, {scripts!r})
from bench import run_spec
from speed_cases import large_world
from swarm_forage_env import run_one, scenario
run_one(run_spec(scenario("warehouse_medium", physics="compiled", **large_world(16384)), "crw", 20))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20)
"""


def in_fresh_process(program: str, **environment: str) -> float:
    """Run a small program that prints one number, in a new interpreter."""
    output = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, env={**os.environ, **environment}
    )
    return float(output.stdout.split()[-1])


def scaling_rows(ticks: int, repeats: int) -> Iterator[Row]:
    """Cost per robot-tick of large swarms and of 200 robots, measured in turn."""
    large = (warehouse_medium(physics="compiled", **large_world(n_robots)) for n_robots in (4096, 16_384))
    worlds = [warehouse_medium(physics="compiled"), *large]
    costs: dict[int, list[float]] = {200: [], 4096: [], 16_384: []}
    for _ in range(repeats):
        for scenario in worlds:
            n_robots = scenario.robots.n_robots
            costs[n_robots].append(_cost_of_a_run(scenario, max(20, ticks * 200 // n_robots)))
    base = costs[200]
    yield Row("CRW, N = 200, as reference", statistics.median(base), "us per robot-tick", "-", None)
    for n_robots in (4096, 16_384):
        ratio = statistics.median(cost / reference for cost, reference in zip(costs[n_robots], base, strict=True))
        note = f"{statistics.median(costs[n_robots]):.2f} us per robot-tick"
        yield Row(f"CRW, N = {n_robots:,}, cost over N = 200", ratio, "x", "<= 1.3", ratio <= 1.3, note)
    scripts = str(Path(__file__).resolve().parent)
    memory = in_fresh_process(PEAK_MEMORY.format(scripts=scripts))
    yield Row("CRW, N = 16,384, peak memory", memory, "GiB", "< 2", memory < 2)


def _cost_of_a_run(scenario: ScenarioConfig, ticks: int) -> float:
    """Microseconds per robot-tick of a run under CRW, after a short run-in."""
    policy = load_policy("crw")
    spec = run_spec(scenario, "crw", ticks + 20)
    run = LiveRun(build_stack(spec.scenario, reads=getattr(policy, "reads", None)), policy, seed=0)
    run.advance(to_tick=20)
    started = time.process_time()
    run.advance()
    return (time.process_time() - started) / ticks / scenario.robots.n_robots * 1e6


def _cost_of_steps(
    scenario: ScenarioConfig,
    ticks: int,
    wrappers: Sequence[WrapperConfig] = (),
    beside: Callable[[], object] = lambda: None,
) -> float:
    """Microseconds per robot-tick of a stack that is stepped with CRW's actions; `beside` is called in every tick."""
    policy = load_policy("crw")
    stack = build_stack(run_spec(scenario, "crw", ticks + 20).scenario, wrappers)
    policy.reset(stack.unwrapped.swarm_spec, np.random.default_rng(0))
    obs = stack.reset_batch(0)
    started = 0.0
    for tick in range(ticks + 20):
        if tick == 20:
            started = time.process_time()
        beside()
        obs = stack.step_batch(policy.act(obs, stack.unwrapped.active))[0]
    return (time.process_time() - started) / ticks / scenario.robots.n_robots * 1e6


def wrapper_rows(ticks: int, repeats: int) -> Iterator[Row]:
    """What four active wrappers add for 200 robots, and how much of it are the random numbers that they draw.

    The adversities are very weak: the wrappers do their full work, but the swarm behaves as without them, and so the
    rest of the tick costs the same. The draws are measured in a run without wrappers that draws the same numbers in
    every tick.
    """
    for physics in ("chipmunk", "compiled"):
        yield from _wrapper_rows_of(warehouse_medium(physics=physics), ticks, repeats)


def _wrapper_rows_of(scenario: ScenarioConfig, ticks: int, repeats: int) -> Iterator[Row]:
    wrappers, rng = [parse_wrapper(text) for text in WRAPPERS], np.random.default_rng(0)
    columns = sum(part.size for part in parallel_env(scenario).layout if part.noise_group) - 1  # heading: one angle
    readings, wheels = np.zeros((200, columns), np.float32), np.zeros((200, 2), np.float32)

    def draw() -> None:
        for numbers in (readings, wheels):
            rng.random(out=numbers, dtype=np.float32)
            to_normal(numbers)

    _cost_of_steps(scenario, 5, wrappers)
    costs: list[tuple[float, float, float]] = []
    for _ in range(repeats):
        bare = _cost_of_steps(scenario, ticks)
        costs.append((bare, _cost_of_steps(scenario, ticks, beside=draw), _cost_of_steps(scenario, ticks, wrappers)))
    drawing = statistics.median(drawn / bare - 1.0 for bare, drawn, _ in costs)
    wrapped = statistics.median(full / bare - 1.0 for bare, _, full in costs)
    beyond = statistics.median((full - drawn) / bare for bare, drawn, full in costs)
    note = f"{statistics.median(bare for bare, _, _ in costs):.3f} us per robot-tick without them"
    yield Row(f"{scenario.physics}: four wrappers over none", 100 * wrapped, "%", "-", None, note)
    yield Row(f"{scenario.physics}: their random draws alone", 100 * drawing, "%", "-", None)
    yield Row(f"{scenario.physics}: four wrappers beyond their draws", 100 * beyond, "%", "<= 10", beyond <= 0.1)


def site_rows(ticks: int, repeats: int) -> Iterator[Row]:
    """What share of a run the search for cache sites takes; the run is of 10,000 s, with --quick of 2,000 s."""
    spec = run_spec(warehouse_medium(caches="dynamic", physics="compiled"), "stochx", 5 * ticks)
    share, note = share_of_run(spec, repeats)
    yield Row(f"STOCHX's cache sites, {spec.scenario.horizon_s:,.0f} s", 100 * share, "%", "-", None, note)


def start_rows(ticks: int, repeats: int) -> Iterator[Row]:  # noqa: ARG001 - a case like the others; ticks are few
    """Import, and the first run of a command after an installation; by the clock, because two processes compile."""
    seconds = statistics.median(in_fresh_process(IMPORT) for _ in range(repeats))
    yield Row("import swarm_forage_env", seconds, "s", "< 0.3", seconds < 0.3)
    for physics in ("chipmunk", "compiled"):
        with tempfile.TemporaryDirectory() as folder:
            first = _seconds_of_first_run(physics, folder)
            later = statistics.median(_seconds_of_first_run(physics, folder) for _ in range(3))
        note = f"{first:.1f} s by the clock, of which {later:.1f} s are a later run"
        yield Row(f"{physics}: compiling in the first run", first - later, "s", "< 20", first - later < 20, note)


def _seconds_of_first_run(physics: str, folder: str) -> float:
    """Seconds by the clock of a short run whose compiled kernels are kept in a folder."""
    command = [str(Path(sys.executable).with_name("swarm-forage")), *FIRST_RUN, "--set", f"physics={physics}"]
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as results:
        kept = {**os.environ, "NUMBA_CACHE_DIR": folder}
        subprocess.run([*command, "--out", results], check=True, capture_output=True, env=kept)
    return time.perf_counter() - started


def frame_rows(ticks: int, repeats: int) -> Iterator[Row]:  # noqa: ARG001 - a case like the others; ticks are few
    """Pictures of a large swarm that moves, and the window of a smaller one: a robot is chosen, with beams and memory.

    The window's display is none, so the time in which a real one shows the picture is not in it.
    """
    from swarm_forage_env.inspect.watch import Watch
    from swarm_forage_env.rendering.window import Pressed, Window

    env = parallel_env("search_and_rescue", n_robots=819, physics="compiled", render_mode="rgb_array")
    env.reset(seed=0)
    actions = {agent: env.action_space(agent).sample() for agent in env.agents}
    rate = pictures_per_second(env.render, 10 * repeats, before=lambda: env.step(actions))
    yield Row("rgb_array, N = 819, 900 pixels", rate, "pictures/s", ">= 60", rate >= 60)

    os.environ["SDL_VIDEODRIVER"] = "dummy"
    for policy, caches in (("dpo", "none"), ("stochx", "dynamic")):
        window = Window()
        watch = Watch(warehouse_medium(physics="compiled", caches=caches), policy, speed=6.0)
        watch.handle(Pressed("tab"))
        for _ in range(WARM_TICKS):
            watch.step()

        def show(window: Window = window, watch: Watch = watch) -> None:
            watch.advance(1.0 / 30.0)
            window.show(watch.scene())
            window.events()

        rate = pictures_per_second(show, 10 * repeats)
        window.close()
        name = f"window, N = 200, {policy.upper()}, one tick a picture"
        yield Row(name, rate, "pictures/s", ">= 30", rate >= 30)


WARM_TICKS = 600
"""Ticks before pictures are timed, so that robots have spread and remember something."""


def pictures_per_second(
    draw: Callable[[], object], n_pictures: int, before: Callable[[], object] = lambda: None
) -> float:
    """Median rate of a function that draws one picture, without its first calls; `before` each, time stands still."""
    for _ in range(3):
        before()
        draw()
    seconds = []
    for _ in range(n_pictures):
        before()
        started = time.process_time()
        draw()
        seconds.append(time.process_time() - started)
    return 1.0 / statistics.median(seconds)


Case = Callable[[int, int], Iterable[Row]]
"""Measures a case; arguments: ticks, repeats."""


def cases() -> dict[str, Case]:
    """Name -> what it measures, in the order of the table."""
    return {
        "scaling: CRW, N = 4,096 and 16,384": scaling_rows,
        "four wrappers, N = 200": wrapper_rows,
        "search for cache sites: STOCHX, N = 200": site_rows,
        "learning: VecEnv and PPO": learning_rows,
        "pictures: rgb_array and window": frame_rows,
        "start: import and first run": start_rows,
    }


def main() -> None:
    """Run the cases and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer repeats, shorter runs")
    parser.add_argument("--only", default="", help="cases whose name contains this text")
    arguments = parser.parse_args()
    only = arguments.only.lower()
    chosen = {name: case for name, case in cases().items() if only in name.lower()}
    if not chosen:
        parser.error(
            f"expected --only to be part of the name of a case, got {arguments.only!r}; the cases are:\n  "
            + "\n  ".join(cases())
        )
    ticks, repeats = (2_000, 3) if arguments.quick else (10_000, 7)
    console = Console(width=150)
    table = Table(title=f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, one core")
    for heading in ("case", "measured", "unit", "target", "met", "note"):
        table.add_column(heading, justify="right" if heading in ("measured", "target") else "left")
    for row in itertools.chain.from_iterable(case(ticks, repeats) for case in chosen.values()):
        met = "" if row.met is None else ("yes" if row.met else "NO")
        console.print(f"{row.case}: {row.value:.3g} {row.unit}", style="dim")
        table.add_row(row.case, f"{row.value:.3g}", row.unit, row.target, met, row.note)
    console.print(table)


if __name__ == "__main__":
    main()
