"""What `scripts/bench` measures of this package: public names only, so that it fits several commits.

Run as a program it reads lines `CASE ENGINE EFFORT` from standard input and answers each with a number in the unit of
the case, or with "failed" and the reason. Effort 1 is a whole measurement, less is a shorter one. Times are processor
time of this process. Whatever a user waits for counts, such as making the environment; compiling does not: a little of
a case is run before it is measured first.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Measure = Callable[[str, float], float]
"""(engine, effort) -> value."""
TICK = "ns per robot-tick"
"""One robot for one control step of 0.2 s: policy, environment and record, as `run_one` makes them."""
STEP = "ns per robot-step"
"""The same for an environment that somebody else steps, without policy and record."""
NO_EFFECT = 1e-9
"""Strength of disturbances that do their full work, but leave the swarm what it is."""
NOISE = (f"sensor_noise:sigma={NO_EFFECT}", f"actuator_noise:sigma={NO_EFFECT}")
THROTTLE = (f"throttle:waveform=sine,amplitude={NO_EFFECT},offset={NO_EFFECT},period_s=10000",)
FAILURES = ("population:malfunction_per_tick=0.001,repair_per_tick=0.001005556",)
FIRST_EFFORT = 0.1
"""Enough for every kernel to be compiled: someone has delivered an object by then."""
SHORT_TICKS = 20
"""Of a run that tells what making a world costs."""
SMALL, MEDIUM = "warehouse_small", "warehouse_medium"
EXAMPLE = "beeline"


@dataclass(frozen=True)
class Case:
    """Something to measure."""

    about: str
    measure: Measure
    unit: str = TICK
    target: str = ""
    """What we want it to be, in its unit or as a multiple of another case; our choice."""
    beside: str = ""
    """The case of which it is told to be a multiple, where both are measured."""
    once: bool = False
    """Whether it is measured in one round only, because it takes long."""


def world(name: str, engine: str, ticks: int, **fields: Any) -> Any:
    """Return a preset that lasts `ticks`, in one recording interval."""
    from swarm_forage_env import scenario

    seconds = ticks * 0.2
    return scenario(name, horizon_s=seconds, interval_s=seconds, **{"physics": engine, **fields})


def spent(act: Callable[[int], object], times: int) -> float:
    """Return the nanoseconds of processor time of calling `act` with 0, 1, ..."""
    started = time.process_time()
    for number in range(times):
        act(number)
    return (time.process_time() - started) * 1e9


def spent_on_runs(
    policy: str, name: str, engine: str, ticks: int, *, wrappers: Sequence[str] = (), n_seeds: int = 1, **fields: Any
) -> float:
    """Return the nanoseconds of processor time per robot of runs one after the other, as a study makes them."""
    from swarm_forage_env import parse_wrapper, plan_run, run_one

    scene, made = world(name, engine, ticks, **fields), [parse_wrapper(text) for text in wrappers]
    specs = [plan_run(scene, policy, seed=seed, wrappers=made) for seed in range(n_seeds)]
    return spent(lambda number: run_one(specs[number]), n_seeds) / n_seeds / scene.robots.n_robots


def runs(policy: str, name: str, ticks: int, **options: Any) -> Measure:
    """Whole runs; options are those of `spent_on_runs`."""

    def measure(engine: str, effort: float) -> float:
        n_ticks = round(ticks * effort)
        return spent_on_runs(policy, name, engine, n_ticks, **options) / n_ticks

    return measure


class Avoiding:
    """A policy of numpy, not compiled: drives, and turns away from what is near."""

    reads = ("proximity",)

    def reset(self, spec: Any, rng: np.random.Generator) -> None:
        """Begin a run."""
        self._columns = spec.layout["proximity"]
        beams = self._columns.stop - self._columns.start
        self._sides = np.sin(2.0 * np.pi / beams * np.arange(beams)).astype(np.float32)
        self._actions = np.zeros((spec.n_robots, 3), np.float32)

    def act(self, obs: np.ndarray, active: np.ndarray) -> np.ndarray:
        """Return one row per robot."""
        turn = np.clip(obs[:, self._columns] @ self._sides, -0.5, 0.5)
        self._actions[:, 0], self._actions[:, 1] = 0.5 + turn, 0.5 - turn
        return self._actions


def numpy_policy(engine: str, effort: float) -> float:
    """A run of a policy object."""
    from swarm_forage_env import RunSpec, World, run_policy

    scene = world(MEDIUM, engine, n_ticks := round(5_000 * effort))
    spec = RunSpec(world=World(scene), policy="avoiding")
    return spent(lambda _: run_policy(Avoiding(), spec), 1) / n_ticks / scene.robots.n_robots


def dicts(engine: str, effort: float) -> float:
    """The dict API with actions drawn beforehand."""
    from swarm_forage_env import parallel_env

    env: Any = parallel_env(world(MEDIUM, engine, (n_ticks := round(500 * effort)) + 1))
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    drawn = [{name: rng.uniform(-1, 1, 3).astype(np.float32) for name in env.agents} for _ in range(20)]
    return spent(lambda tick: env.step(drawn[tick % 20]), n_ticks) / n_ticks / len(drawn[0])


def vector_env(ticks: int, *, n_arenas: int = 1, **fields: Any) -> Measure:
    """The vector environment for Gymnasium with actions drawn beforehand: full observations, wheels and gripper."""

    def measure(engine: str, effort: float) -> float:
        import gymnasium

        import swarm_forage_env  # noqa: F401 - registers the environments

        envs: Any = gymnasium.make_vec(f"swarm_forage/{SMALL}-v0", n_arenas=n_arenas, physics=engine, **fields)
        envs.reset(seed=0)
        drawn = np.random.default_rng(0).uniform(-1, 1, (100, envs.num_envs, 3)).astype(np.float32)
        n_ticks = round(ticks * effort)
        return spent(lambda tick: envs.step(drawn[tick % 100]), n_ticks) / n_ticks / envs.num_envs

    return measure


def learning(engine: str, effort: float) -> float:
    """PPO of stable-baselines3: 4 epochs, 64 x 64."""
    import torch
    from stable_baselines3 import PPO

    from swarm_forage_env.training.sb3 import ActiveRolloutBuffer, SwarmVecEnv

    torch.set_num_threads(1)  # processor time of two threads would count twice
    env = SwarmVecEnv(SMALL, physics=engine)
    n_steps = max(64, round(1_000 * effort))
    model = PPO(
        "MlpPolicy",
        env,
        n_steps=n_steps,
        batch_size=n_steps * env.num_envs // 4,
        n_epochs=4,
        rollout_buffer_class=ActiveRolloutBuffer,
        rollout_buffer_kwargs=env.rollout_buffer_kwargs,
        device="cpu",
        seed=0,
    )
    return spent(lambda _: model.learn(n_steps * env.num_envs), 1) / n_steps / env.num_envs


def median_ms(act: Callable[[int], object], times: int) -> float:
    """Return the median of the milliseconds of processor time of a call."""
    return float(np.median([spent(act, 1) for _ in range(times)])) / 1e6


def frame(engine: str, effort: float) -> float:
    """A picture of a large swarm between two ticks."""
    from swarm_forage_env import parallel_env

    env: Any = parallel_env("search_and_rescue", n_robots=819, physics=engine, render_mode="rgb_array")
    env.reset(seed=0)
    return median_ms(lambda _: env.render(), max(4, round(40 * effort)))


def import_seconds(_engine: str, _effort: float) -> float:
    """Processor time of the import in a new process."""
    program = "import time; t = time.process_time(); import swarm_forage_env; print(time.process_time() - t)"
    return float(printed_by([sys.executable, "-c", program]))


def first_run(engine: str, _effort: float) -> float:
    """Seconds by the clock."""
    words = ["run", "crw", "--robots", "50", "--horizon", "200", "--set", f"physics={engine}"]
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        program = [sys.executable, "-m", "swarm_forage_env.cli", *words, "--out", f"{folder}/results"]
        printed_by(program, NUMBA_CACHE_DIR=f"{folder}/cache")
    return time.perf_counter() - started


def most_memory(name: str) -> Measure:
    """Memory of a process of its own that makes the run of a case."""

    def measure(engine: str, _effort: float) -> float:
        return float(printed_by([sys.executable, __file__], f"{name} {engine} 0.1\nheld {engine} 1\n").split()[-1])

    return measure


def held(_engine: str, _effort: float) -> float:
    """Memory that this process has held at most."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def printed_by(command: Sequence[str], given: str = "", **environment: str) -> str:
    """Run a program; returns what it prints."""
    environ = {**os.environ, **environment}
    done = subprocess.run(command, input=given, capture_output=True, text=True, check=False, env=environ)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} ended with {done.returncode}: {done.stderr}")
    return done.stdout


def large(n_robots: int, ticks: int) -> Measure:
    """CRW in a large `warehouse_medium`, without making it: a robot per 20 m², 0.35 objects per m²."""
    side = 4.8 * round((n_robots / 0.05) ** 0.5 / 4.8)
    floor = {"width_m": side, "height_m": side, "nest_centre_m": (side / 2, side / 2), "nest_size_m": (side / 5,) * 2}
    fields = {**floor, "n_robots": n_robots, "n_objects": int(0.35 * side * side)}

    def measure(engine: str, effort: float) -> float:
        short, long = SHORT_TICKS, SHORT_TICKS + round(ticks * effort)
        made, whole = (spent_on_runs("crw", MEDIUM, engine, n_ticks, **fields) for n_ticks in (short, long))
        return (whole - made) / (long - short)

    return measure


CASES = {
    "crw-50": Case("CRW, 50 robots, small warehouse", runs("crw", SMALL, 40_000), target="130"),
    "crw-200": Case("CRW, 200 robots, medium warehouse", runs("crw", MEDIUM, 10_000), target="130"),
    "dpo-200": Case("DPO", runs("dpo", MEDIUM, 10_000), target="170"),
    "stochm-200": Case("STOCHM, static caches", runs("stochm", MEDIUM, 10_000, caches="static"), target="200"),
    "stochx-200": Case("STOCHX, dynamic caches", runs("stochx", MEDIUM, 10_000, caches="dynamic"), target="200"),
    "network-50": Case("a trained network, small", runs("generalist", SMALL, 10_000), target="400"),
    "network-200": Case("a trained network, medium", runs("generalist", MEDIUM, 5_000), target="250"),
    "numpy-200": Case("a policy of numpy", numpy_policy),
    "function-200": Case("a function for one robot, compiled", runs(EXAMPLE, MEDIUM, 10_000), beside="dpo-200"),
    "noise-200": Case("DPO, noise on sensors and wheels", runs("dpo", MEDIUM, 5_000, wrappers=NOISE), TICK, "360"),
    "throttle-200": Case("DPO, throttle", runs("dpo", MEDIUM, 5_000, wrappers=THROTTLE), TICK, "240"),
    "failures-200": Case("DPO, failures and repairs", runs("dpo", MEDIUM, 5_000, wrappers=FAILURES), TICK, "240"),
    "adverse-200": Case("DPO, all of these", runs("dpo", MEDIUM, 5_000, wrappers=NOISE + THROTTLE + FAILURES)),
    "crw-1": Case("CRW, one robot", runs("crw", SMALL, 50_000, n_robots=1)),
    "seeds-50": Case("CRW, 16 runs of 1,000 s", runs("crw", SMALL, 5_000, n_seeds=16), beside="crw-50"),
    "chipmunk-50": Case("CRW, Chipmunk's bodies", runs("crw", SMALL, 10_000, physics="chipmunk"), beside="crw-50"),
    "chipmunk-200": Case("CRW, Chipmunk's bodies", runs("crw", MEDIUM, 5_000, physics="chipmunk"), beside="crw-200"),
    "crw-4096": Case("CRW, 5 % density", large(4_096, 500), beside="crw-200"),
    "crw-16384": Case("CRW, 5 % density", large(16_384, 200), TICK, "1.2 x crw-200", "crw-200"),
    "crw-131072": Case("CRW, 5 % density", large(131_072, 40), TICK, "190", "crw-200"),
    "dict-200": Case("dict API", dicts, STEP),
    "vec-50": Case("vector environment, one arena", vector_env(3_000), STEP),
    "vec-495": Case("vector environment, as dense", vector_env(500, n_robots=495, density=50 / (32 * 16)), STEP),
    "vec-8x50": Case("vector environment, eight arenas", vector_env(500, n_arenas=8), STEP),
    "ppo-50": Case("PPO of stable-baselines3, one arena", learning, STEP, beside="vec-50"),
    "frame-819": Case("frame of 900 pixels", frame, "ms", "16"),
    "import": Case("import of the package", import_seconds, "s", "0.2"),
    "first-run": Case("first run after installation", first_run, "s", "12", once=True),
    "memory-16384": Case("most memory of a run", most_memory("crw-16384"), "GiB", "2", once=True),
    "memory-131072": Case("most memory of a run", most_memory("crw-131072"), "GiB", "1", once=True),
}
"""Name -> case, in the order of the table."""


def answer_lines(measures: dict[str, Measure], warm: set[str]) -> None:
    """Answer the lines of standard input; cases whose names are not in `warm` are run for a moment first."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what packages print is no answer
    for line in sys.stdin:
        name, engine, effort = line.split()
        try:
            if name not in warm:
                measures[name](engine, FIRST_EFFORT)
                warm.add(name)
            said = str(measures[name](engine, float(effort)))
        except Exception as error:  # noqa: BLE001 - whatever goes wrong in a case is its reason
            said = f"failed {type(error).__name__}: {error}".replace("\n", " ")
        print(said, file=answers, flush=True)


if __name__ == "__main__":
    answer_lines(
        {"held": held, **{name: case.measure for name, case in CASES.items()}},
        {"held", *(name for name, case in CASES.items() if case.unit in ("s", "GiB"))},
    )
