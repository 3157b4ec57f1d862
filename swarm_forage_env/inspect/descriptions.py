"""Which scenarios, policies, wrappers and columns there are, and everything about one scenario or policy."""

import dataclasses
import inspect
import re
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from swarm_forage_env._internal.fields import ConfigError, known_name
from swarm_forage_env.contract.policy import SwarmSpec, state_size
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.policies.network import Network
from swarm_forage_env.policies.pretrained import network_file
from swarm_forage_env.policies.python_files import classes_of
from swarm_forage_env.policies.registry import POLICIES, file_of, is_policy_file, policy_class
from swarm_forage_env.runs.spec import stated_caches
from swarm_forage_env.scenarios import presets
from swarm_forage_env.scenarios.columns import ALL_COLUMNS, CONTRIBUTED_COLUMNS
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.differences import as_setting
from swarm_forage_env.sheet import Sheet
from swarm_forage_env.wrappers.registry import WRAPPERS, wrapper_config_class
from swarm_forage_env.wrappers.world import FILE, read_world

_MOST_LETTERS = 160
"""Of an entry of a network's card."""


def overview(what: str | None = None) -> Sheet:
    """Return which scenarios and policies there are, or what else `LISTS` has.

    Raises:
        ConfigError: there is no such list.
    """
    if what is None:
        return dataclasses.replace(overview("scenarios"), below=[overview("policies")])
    known_name("list", what, LISTS)
    header, rows = LISTS[what]
    return Sheet.of(title=what, header=header, rows=[*rows()])


def _scenarios() -> Iterator[tuple[Any, ...]]:
    for name in presets.SCENARIO_NAMES:
        config = presets.scenario(name)
        arena = f"{config.arena.width_m:g} x {config.arena.height_m:g} m"
        counts = str(config.robots.n_robots), str(config.objects.n_objects)
        yield name, *counts, arena, _first_line(presets.PRESETS[name])


def _policies() -> Iterator[tuple[Any, ...]]:
    for name in POLICIES:
        policy = policy_class(name)
        yield name, stated_caches(policy) or "the scenario's", _first_line(policy)


def _wrappers() -> Iterator[tuple[Any, ...]]:
    for name in WRAPPERS:
        config = wrapper_config_class(name)
        yield name, f"{name}:{config.example}", ", ".join(field.name for field in dataclasses.fields(config))


def _columns() -> Iterator[tuple[Any, ...]]:
    for name, column in ALL_COLUMNS.items():
        yield name, column.unit or "-", column.meaning + (" (optional)" if name in CONTRIBUTED_COLUMNS else "")


LISTS: dict[str, tuple[tuple[str, ...], Callable[[], Iterable[tuple[Any, ...]]]]] = {
    "scenarios": (("scenario", "robots", "objects", "arena", "what it is"), _scenarios),
    "policies": (("policy", "caches", "what it is"), _policies),
    "wrappers": (("wrapper", "example", "fields"), _wrappers),
    "columns": (("column", "unit", "meaning"), _columns),
}
"""What can be listed -> header and rows of its table."""


def describe(name: str) -> Sheet:
    """Return everything about a scenario (by name, environment id or file) or a policy (by name or file).

    Raises:
        ConfigError: nothing has that name, or the file holds none.
    """
    return Sheet(notes=tuple(_lines(name)))


def _lines(name: str) -> Iterator[str]:
    name = re.sub(r"^swarm_forage/(\w+)-v\d+$", r"\1", name)
    if is_policy_file(name):
        yield from _file_lines(Path(file_of(name)))
    elif Path(name).suffix == FILE:
        world = read_world(name)
        yield from _scenario_lines(world.scenario, world.title())
    else:
        known_name("scenario or policy", name, (*presets.SCENARIO_NAMES, *POLICIES))
        if name in presets.PRESETS:
            yield from _scenario_lines(presets.scenario(name), f"{name}: {_first_line(presets.PRESETS[name])}")
        else:
            yield from _policy_lines(name)


def _scenario_lines(config: ScenarioConfig, headline: str) -> Iterator[str]:
    spec = SwarmSpec.of(config)
    interface = LearnerInterface(InterfaceConfig(), spec)
    yield headline
    yield "\nFields (change them with --set name=value):"
    for item in dataclasses.fields(config):
        value = getattr(config, item.name)
        if dataclasses.is_dataclass(value):
            yield f"  [{item.name}]"
            for inner in dataclasses.fields(value):
                yield f"    {inner.name:<34}{as_setting(getattr(value, inner.name))}"
        else:
            yield f"  {item.name:<36}{as_setting(value)}"
    yield "\nSpaces, per robot:"
    yield f"  action       {interface.action_space}: left wheel, right wheel, gripper"
    yield f"  observation  {interface.observation_space}"
    yield f"  state()      Box(-1.0, 1.0, ({state_size(spec.n_robots, spec.n_objects)},), float32)"
    yield "\nObservation:"
    yield spec.layout.describe()


def _policy_lines(name: str) -> Iterator[str]:
    policy, file = policy_class(name), network_file(name)
    caches = stated_caches(policy)
    reads = getattr(policy, "reads", None) if file is None else Network.load(file).about.interface.reads
    yield f"{name}: {_first_paragraph(policy)}"
    yield f"\n  defined in  {policy.__module__}"
    made_for = "the scenario's" if caches is None else f"{caches} (the caches it is made for)"
    yield f"  caches      {made_for}"
    yield f"  reads       {'all slices' if reads is None else ', '.join(reads) or 'nothing'}"
    settings = [*_settings(policy)]
    if settings:
        yield "\nParameters (change them in a study file, or in Python with plan_run(..., parameters={name: value})):"
        yield from (f"  {field:<34}{in_words(value)}" for field, value in settings)
    else:
        yield "  parameters  none"
    if file is not None:
        yield ""
        yield from _file_lines(file)


def _settings(policy: Callable[..., Any]) -> Iterator[tuple[str, Any]]:
    """What a policy can be told by name, with the values that it has by default."""
    arguments = inspect.signature(policy).parameters
    if "parameters" in arguments and arguments["parameters"].default is None:  # numbers of a controller, see baselines
        yield from dataclasses.asdict(policy().parameters).items()
        return
    for name, argument in arguments.items():
        if argument.kind not in (argument.VAR_KEYWORD, argument.VAR_POSITIONAL):
            yield name, "to be given" if argument.default is argument.empty else argument.default


def _file_lines(file: Path) -> Iterator[str]:
    if not file.is_file():
        raise ConfigError(f"Cannot read the policy file {file}: there is no such file.")
    if file.suffix.lower() == ".py":
        yield f"{file}: Python. It is only read here, and not run."
        yield f"  classes  {', '.join(classes_of(file)) or 'none'}; as a policy: {file}:NAME"
        return
    if file.suffix.lower() != ".npz":
        yield f"{file}: a model of stable-baselines3. Opening it runs code that it contains, so it is not opened here."
        return
    try:
        network = Network.load(file)
    except ValueError as error:
        raise ConfigError(str(error)) from error
    yield from _network_lines(file, network)


def _network_lines(file: Path, network: Network) -> Iterator[str]:
    """The lines about a network file; its card may hold anything, and long entries are cut."""
    about = network.about
    sizes = [len(network.weights[0]), *(weight.shape[1] for weight in network.weights)]
    yield f"{file}: a network of {' x '.join(map(str, sizes))} units ({about.activation})"
    for part, values in {
        "interface": {**dataclasses.asdict(about.interface), "samples": about.samples, "caches": about.caches},
        **about.card,
    }.items():
        yield ""
        yield f"  [{part}]"
        for name, value in values.items() if isinstance(values, Mapping) else (("", values),):
            yield f"    {name:<24}{textwrap.shorten(in_words(value), _MOST_LETTERS, placeholder=' ...')}".rstrip()


def in_words(value: Any) -> str:
    """Return a value as readers like it: sizes as "4 x 6", fields after their names."""
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {in_words(inner)}" for name, inner in value.items())
    if isinstance(value, tuple | list):
        is_size = all(isinstance(part, int | float) for part in value)
        return " x ".join(f"{part:g}" for part in value) if is_size else ", ".join(map(in_words, value))
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def _first_paragraph(documented: Any) -> str:
    return (inspect.getdoc(documented) or "no description").split("\n\n")[0]


def _first_line(documented: Any) -> str:
    return _first_paragraph(documented).splitlines()[0]
