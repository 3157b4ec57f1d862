"""Commands that make no sense: words and files made at random, given to the console command in this process.

`malformed_command` draws a command over all subcommands and options, with values and files of which some are broken.
`outcome` gives it to `main` and says what is wrong with how it ended. What a command would run is only begun: a small
world is built and reset, a large one is not built at all.
"""

import contextlib
import io
import json
import os
import shutil
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from random import Random
from typing import Any
from unittest import mock

import numpy as np
import polars as pl

from swarm_forage_env.cli.app import loaded
from swarm_forage_env.cli.commands import COMMANDS
from swarm_forage_env.cli.errors import DEBUG_VARIABLE
from swarm_forage_env.cli.options import EXIT_FAILURE, EXIT_USAGE
from swarm_forage_env.cli.signals import EXIT_INTERRUPTED
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.learned import InterfacePolicy
from swarm_forage_env.policies.pretrained import network_file, plan_file
from swarm_forage_env.runs import run, runner
from swarm_forage_env.studies.study_file import find_study
from tests.support.console import answer

EXIT_CODES = (0, EXIT_FAILURE, EXIT_USAGE, EXIT_INTERRUPTED)
"""What a command may end with; the code of an error that nobody foresaw is not among them."""
MOST_ROBOTS, MOST_OBJECTS, LONGEST_M = 30, 200, 50.0
"""Worlds up to this size are built and reset."""

HUGE = "9" * 320
BAD_WORDS = (
    *("", " ", ",", "-1", "0", "1e308", "-1e308", "1e-320", HUGE, "-" + HUGE, "1.5", "nan", "inf", "-inf", "true"),
    *(
        "[red]",
        "[/red]",
        "$x$",
        "a$",
        "\x1b[31m",
        "\n",
        "\udcff",
        "ü",
        "\u202e",
        "None",
        "../x",
        "/",
        ".",
        "a=b",
        "%",
        "5%",
    ),
    *(
        "1,2",
        "1,,2",
        "x" * 5000,
        "0x10",
        "1_000",
        "٣",
        "--",
        "18446744073709551616",
        "9223372036854775807",
        "0,0",
        "1e9",
    ),
)
BAD_LITERALS = (
    *("1e308", "-1", "0", "0.5", "nan", "inf", HUGE, '""', '"x"', "[]", "{}", "[[]]", "[1]", "true", '"[red]"'),
    *("[" * 60 + "]" * 60, "9223372036854775808", '"evil.zip"', '["a"]', "[nan]", '"\\u0000"', "{a = 1}"),
)
GOOD_WORDS: dict[str, tuple[str, ...]] = {
    "scenario": ("warehouse_small", "search_and_rescue", "warehouse_quad"),
    "policy": ("crw", "random", "dpo", "crw,random", "stochm", "good.npz", "ppo_warehouse_small"),
    "robots": ("2", "3", "16"),
    "objects": ("5", "20"),
    "seeds": ("2", "3"),
    "horizon": ("400", "4", "1000"),
    "caches": ("none", "static", "dynamic"),
    "settings": ("interval_s=2", "n_objects=20", "team=true", "width_m=16", "quirks=none"),
    "wrappers": (
        "sensor_noise:sigma=0.03",
        "population:death_per_tick=0.0001",
        "throttle:waveform=square,amplitude=0.2,period_s=500",
        "actuator_noise:sigma=0.1",
        "handling_cost:amplitude=2",
    ),
    "jobs": ("1",),
    "budget": ("quick", "smoke", "paper", "standard"),
    "measures": ("scalability", "reactivity,adaptability", "raw_performance"),
    "density": ("5%", "0.05"),
    "name": ("warehouse_small", "crw", "S1a", "S2d", "good.npz"),
    "performance": ("collected", "n_active", "1/interference_fraction", "task_balance"),
    "fit": ("1,2,4,8",),
    "hold": ("16",),
    "algorithm": ("ppo", "a2c", "dqn", "sac"),
    "steps": ("1000",),
    "arenas": ("2",),
    "hidden": ("8", "64,64"),
    "arguments": ("learning_rate=0.001", "n_steps=16"),
    "deliver": ("10",),
    "disturbance": ("throttle", "handling_cost"),
    "variant": ("corrected", "paper"),
    "form": ("marginal", "both"),
    "seconds": ("2",),
    "quirks": ("all", "none"),
}
"""Values that make sense, by the name of a parameter."""


class Started(SystemExit):
    """The words were accepted, and a run was about to begin."""


class RefusedLaterError(Exception):
    """The words were accepted, although every run with them fails at once."""


@dataclass(frozen=True)
class Outcome:
    """How a command ended."""

    words: tuple[str, ...]
    code: int
    errors: str
    fault: str
    """What is wrong with that; empty if nothing is."""


def malformed_command(random: Random, folder: Path) -> tuple[str, ...]:
    """Draw a command; its files are written to `folder`."""
    source = network_file("ppo_warehouse_small")
    assert source is not None
    shutil.copyfile(source, folder / "good.npz")
    path, command = random.choice(_commands())
    options = [item for item in command.params if item.opts[0].startswith("-") and item.name != "help"]
    chosen = random.sample(options, random.randint(0, min(5, len(options))))
    chosen += [item for item in options if item.required and item not in chosen]
    words: list[str] = []
    for item in chosen:
        words.append(random.choice(item.opts))
        if not getattr(item, "is_flag", False):
            words.append(_value(random, item, folder))
    arguments = [_value(random, item, folder) for item in command.params if not item.opts[0].startswith("-")]
    if "--dry-run" in {name for item in options for name in item.opts} and random.random() < 0.3:
        words.append("--dry-run")
    return (*path, *arguments, *words)


def outcome(words: Sequence[str]) -> Outcome:
    """Give a command to the application, in the current folder, and look at how it ended."""
    out, err = _stream(), _stream()
    fault, code = "", 0
    with (
        _beginnings_only(trains="train" in words),
        mock.patch.dict(os.environ, {DEBUG_VARIABLE: "1"}),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            code = answer(*words)
        except BaseException as error:  # noqa: BLE001 - whatever it is, it is a fault
            fault = "".join(traceback.format_exception(error))
    errors = _text(err)
    if not fault and code not in EXIT_CODES:
        fault = f"exit code {code}"
    if not fault and "Traceback" in errors:
        fault = "a traceback on stderr"
    lines = [line for line in errors.splitlines() if line.startswith("swarm-forage: ")]
    if not fault and code == EXIT_USAGE and len(lines) != 1:
        fault = f"{len(lines)} lines of complaint"
    return Outcome(tuple(words), code, errors, fault)


def _commands() -> list[tuple[tuple[str, ...], Any]]:
    """All commands with their words."""
    return [(tuple(one.words.split()), loaded(one)) for group in COMMANDS.values() for one in group if one.place]


def _value(random: Random, item: Any, folder: Path) -> str:
    if random.random() < 0.12:
        return random.choice(BAD_WORDS)
    name = str(item.name)
    name = {"policies": "policy", "named_policies": "policy", "beside": "policy"}.get(name, name)
    of_files = {"curves": _table, "place": _table, "plan": _plan, "page": _page, "file": _stored}
    if name in of_files or (name == "name" and random.random() < 0.6):
        return str(of_files.get(name, _study)(random, folder))
    if name == "scenario" and random.random() < 0.4:
        return str(_scenario(random, folder))
    if name == "policy" and random.random() < 0.3:
        return str(_network(random, folder))
    if name in ("settings", "wrappers", "arguments") and random.random() < 0.5:
        return _changed_setting(random, random.choice(GOOD_WORDS[name]))
    if name in GOOD_WORDS:
        return random.choice(GOOD_WORDS[name])
    if name == "out":
        return random.choice(("out", "out.gif", "out.png", "out/deep/er", "out.html", "out.parquet"))
    if name == "picture":
        return random.choice(("out.png", "out.svg", "out/deep.pdf", "out"))
    return random.choice(("2", "2.0", "x"))


def _changed_setting(random: Random, word: str) -> str:
    head, _, _ = word.rpartition("=")
    return f"{head}={random.choice(BAD_WORDS)}"


def _broken_lines(random: Random, text: str) -> str:
    """Return TOML of which some values are others, and some lines are gone."""
    lines = text.splitlines()
    places = [k for k, line in enumerate(lines) if "=" in line]
    for place in random.sample(places, min(len(places), random.randint(0, 3))):
        key, _, _ = lines[place].partition("=")
        lines[place] = f"{key}= {random.choice(BAD_LITERALS)}" if random.random() < 0.9 else ""
    return "\n".join(lines)


def _written(random: Random, folder: Path, suffix: str, text: str) -> Path:
    file = folder / f"{random.choice(('a', 'b$x$', '[red]', 'deep'))}{suffix}"
    if random.random() < 0.05:
        text = random.choice(("", "\0", "[" * 2000, "a = " + "[" * 5000, "{" * 2000, "null", "[]", "1"))
    file.write_text(text, encoding="utf-8")
    return file


def _scenario(random: Random, folder: Path) -> Path:
    head = random.choice(("[set]\n", 'scenario = "warehouse_small"\n[set]\n'))
    text = f"{head}n_robots = 3\nn_objects = 20\nnest_size_m = [2.0, 4.0]\nphysics_substeps = [0.2, 0.8]\n"
    text += '[wrappers.throttle]\nwaveform = "square"\namplitude = 0.2\nperiod_s = 500.0\n'
    text += "[wrappers.sensor_noise]\nsigma = 0.1\n[wrappers.sensor_noise.sigmas]\nposition = 0.1\n"
    text += "[wrappers.population]\ndeath_per_tick = 0.1\n"
    return _written(random, folder, ".toml", _broken_lines(random, text))


def _plan(random: Random, folder: Path) -> Path:
    shipped = plan_file("ppo_warehouse_small")
    assert shipped is not None
    return _written(random, folder, ".toml", _broken_lines(random, shipped.read_text(encoding="utf-8")))


def _study(random: Random, folder: Path) -> Path:
    text = find_study(random.choice(("S1a", "S1e", "S2a"))).read_text(encoding="utf-8")
    return _written(random, folder, ".toml", _broken_lines(random, text))


def _page(random: Random, folder: Path) -> Path:
    replay = '{"format": "swarm_forage_env replay"}'
    header = random.choice(("{}", "[]", "[" * 200 + "]" * 200, '{"format": 1}', replay))
    text = f'<html><script type="application/json" id="header">{header}</script></html>'
    return _written(random, folder, ".html", text)


def _stored(random: Random, folder: Path) -> Path:
    if random.random() < 0.5:
        return _table(random, folder)
    from swarm_forage_env.runs.spec import RunSpec
    from swarm_forage_env.scenarios.presets import scenario
    from swarm_forage_env.wrappers.world import World

    spec = RunSpec(world=World(scenario("warehouse_small", n_robots=3, n_objects=20)), policy="random").to_mapping()
    content: dict[str, Any] = {"run": "x", "error": "e", "traceback": ["t"], "spec": spec}
    _break(random, random.choice((content, spec, spec["scenario"], spec["scenario"]["arena"])))
    return _written(random, folder, ".json", json.dumps(content))


def _break(random: Random, table: dict[str, Any]) -> None:
    deep: Any = []
    for _ in range(80):
        deep = [deep]
    bad: tuple[Any, ...] = (None, -1, 0, 1e308, float("nan"), int(HUGE), "", [], {}, [1, 2, 3], deep)
    bad += ("evil.zip", True, {"a": 1}, "\ud800")
    table[random.choice(list(table))] = random.choice(bad)


def _network(random: Random, folder: Path) -> Path:
    """A network file that is whole, or damaged in one of many ways."""
    source = network_file("ppo_warehouse_small")
    assert source is not None
    with np.load(source) as stored:
        parts = dict(stored)
    about = json.loads(str(parts["about"]))
    kind = random.randrange(8)
    if kind == 1:
        _break(random, random.choice((about, about["interface"], about["card"])))
    elif kind == 2:
        parts[random.choice([*parts])] = np.zeros(random.choice(((0,), (3, 3), (1, 1, 1))))
    elif kind == 3:
        about["card"] = {"\x1b[31m": "\x1b]0;x\x07", "a": {"[red]": "[/red]"}}
    parts["about"] = np.array(json.dumps(about))
    if kind == 4:
        parts["about"] = np.array("[" * 3000)
    file = folder / random.choice(("a.npz", "b$x$.npz", "[red].npz", "x.NPZ"))
    with file.open("wb") as opened:  # np.savez would add a suffix to the name
        np.savez(opened, **parts)
    content = file.read_bytes()
    if kind == 5:
        file.write_bytes(content[: random.randrange(len(content))])
    elif kind == 6:
        at = random.randrange(len(content))
        file.write_bytes(content[:at] + b"\xff\xff\xff\xff" + content[at + 4 :])
    elif kind == 7:
        file.write_bytes(content.replace(b"(", b"(99999999", 1))
    return file


def _table(random: Random, folder: Path) -> Path:
    """A table of curves of which some columns have types that no curve has."""
    rows = 8
    columns: dict[str, Any] = {
        "n_robots": [2] * 4 + [4] * 4,
        "seed": [0, 0, 1, 1] * 2,
        "interval": [0, 1] * 4,
        "performance": [float(k) for k in range(rows)],
        "interference_fraction": [0.1] * rows,
        "controller": ["a"] * rows,
        "criterion": ["size"] * rows,
    }
    odd = (
        *([[1]] * rows, [{"a": 1}] * rows, [b"x"] * rows, [None] * rows, [2**63] * rows, [-(2**62)] * rows),
        *([1e308] * rows, [float("nan")] * rows, ["\x1b[31m"] * rows, ["[red]$x$"] * rows, [2**62] * rows),
        *([True] * rows, [10**20 / 1.0] * rows, [1e-320] * rows),
    )
    series = {name: pl.Series(name, values) for name, values in columns.items()}
    for _ in range(random.randint(0, 2)):
        name = random.choice(list(series))
        values = random.choice(odd)
        series[name] = pl.Series(name, values, dtype=pl.UInt64 if values == [2**63] * rows else None)
        if random.random() < 0.2:
            series[name] = pl.Series(name, ["1"] * rows, dtype=pl.Categorical)
    frame = pl.DataFrame(list(series.values()))
    suffix = random.choice((".parquet", ".parquet", ".csv"))
    file = folder / f"{random.choice(('a', 'b$x$', '[red]'))}{suffix}"
    if suffix == ".csv":
        plain = [name for name, one in series.items() if not one.dtype.is_nested() and one.dtype != pl.Binary]
        frame.select(plain).write_csv(file)
    else:
        keys = ("swarm_forage_env.schema_version", "swarm_forage_env.spec")
        keys += ("swarm_forage_env.provenance", "swarm_forage_env.digest")
        values = ("2", random.choice(("{}", "[" * 3000, "null")), random.choice(("{}", "[" * 3000)), "x")
        frame.write_parquet(file, metadata=dict(zip(keys, values, strict=True)) if random.random() < 0.5 else None)
    return file


@contextlib.contextmanager
def _beginnings_only(*, trains: bool) -> Iterator[None]:
    """While the context lasts, nothing runs: small worlds are built and reset, then `Started` ends the command."""
    build, begin = ForageEnv.__init__, run.LiveRun.__init__

    def build_small(env: ForageEnv, config: Any, *given: Any, **named: Any) -> None:
        arena = config.arena
        is_small = config.robots.n_robots <= MOST_ROBOTS and config.objects.n_objects <= MOST_OBJECTS
        if not is_small or max(arena.width_m, arena.height_m) > LONGEST_M:
            raise Started(0)
        build(env, config, *given, **named)

    def begin_and_stop(live: run.LiveRun, stack: Any, policy: Any, seed: int, **named: Any) -> None:
        if isinstance(policy, InterfacePolicy):
            begin(live, stack, policy, seed, **named)
        else:  # a scripted controller refuses nothing then, and compiles for a minute
            stack.reset_batch(seed)
        raise Started(0)

    def first_of(specs: Any, **_: Any) -> None:
        for spec in specs:
            try:
                run.run_one(spec)
            except Started:
                raise
            except Exception as error:
                raise RefusedLaterError(str(error)) from error
        raise Started(0)

    def stop(*_: Any, **__: Any) -> None:
        raise Started(0)

    with contextlib.ExitStack() as stack:
        for owner, name, stub in (
            (ForageEnv, "__init__", build_small),
            (run.LiveRun, "__init__", begin_and_stop),
            (runner, "run_each", first_of),
        ):
            stack.enter_context(mock.patch.object(owner, name, stub))
        if trains and find_spec("stable_baselines3"):
            training = import_module("swarm_forage_env.training.sb3.training")
            stack.enter_context(mock.patch.object(training, "SwarmVecEnv", stop))
        yield


def _stream() -> io.TextIOWrapper:
    return io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True)


def _text(stream: io.TextIOWrapper) -> str:
    return stream.buffer.getvalue().decode("utf-8", "replace")  # type: ignore[attr-defined] - a BytesIO, see _stream
