"""From command-line words to run specifications. Every wrong input raises a ConfigError here."""

import dataclasses
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_origin

from swarm_forage_env._internal.fields import MOST_SEEDS, ConfigError, whole
from swarm_forage_env._internal.wording import suggestion
from swarm_forage_env.cli.options import PlaceOptions, WorldOptions
from swarm_forage_env.policies.registry import split_interface
from swarm_forage_env.runs.spec import RunSpec, plan_run
from swarm_forage_env.scenarios.overrides import checked_density, field_types, parse_tuple
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import FILE, World, WorldDescription, describe_file

_FIELD = re.compile(r"[a-z_]+=[^/\\]*")

_EXAMPLES = {
    "further_nests": "boxes such as 20,4,24,12 (x low, y low, x high, y high in m)",
    "obstacles": "boxes such as 10,4,11,12 or 10,4,11,12+20,4,21,12 (x low, y low, x high, y high in m)",
    "object_positions_m": "places such as 10,4 or 10,4+20,4 (x, y in m)",
}
_TRUTH = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


def split_names(text: str) -> tuple[str, ...]:
    """Split a comma-separated list of names, dropping repetitions.

    A word field=value belongs to the policy file before it: "crw,model.zip:observation=compact,decision_ticks=5" are
    two policies.

    Raises:
        ConfigError: there is no name in it.
    """
    words: list[str] = []
    for word in filter(None, map(str.strip, text.split(","))):
        if words and split_interface(words[-1])[1] and _FIELD.fullmatch(word):
            words[-1] += f",{word}"
        else:
            words.append(word)
    names = tuple(dict.fromkeys(words))
    if not names:
        raise ConfigError(f"Expected one or more names separated by commas, got {text!r}.")
    return names


def described_world(options: PlaceOptions) -> tuple[World, str | None]:
    """Return the world that options describe, and which caches were asked for (None = nobody asked).

    Raises:
        ConfigError: unknown names, values of a wrong type or that do not fit together, or a file that cannot be used.
    """
    described = described_fields(options)
    return described.world(), described.fields.get("caches")


def described_fields(options: PlaceOptions) -> WorldDescription:
    """Return what options describe as a file would say it; they override the fields and wrappers of the file.

    Raises:
        ConfigError: see `described_world`; names and values of fields are not looked at here.
    """
    is_file = Path(options.scenario).suffix == FILE
    file = describe_file(options.scenario) if is_file else WorldDescription(preset=options.scenario)
    fields = {**file.fields, **_fields_of(options)}
    wrappers = tuple(parse_wrapper(word) for word in options.wrappers)
    named = {wrapper.name for wrapper in wrappers}
    left = (wrapper for wrapper in file.wrappers if wrapper.name not in named)
    return WorldDescription(preset=file.preset, fields=fields, wrappers=(*wrappers, *left), name=file.name)


def _fields_of(options: PlaceOptions) -> dict[str, Any]:
    """Return the scenario fields that the options set, by name."""
    fields = dict(parse_setting(word) for word in options.settings)
    named = {"n_objects": options.objects, "horizon_s": options.horizon, "performance": options.performance}
    if isinstance(options, WorldOptions):
        named |= {"n_robots": options.robots, "density": parsed_density(options.density)}
    for name, value in named.items():
        if value is not None and name in fields:
            raise ConfigError(f"Expected {name} once, got it from an option and from --set.")
        if value is not None:
            fields[name] = value
    return fields


def parsed_density(text: str | None) -> float | None:
    """Return a density in robots per m^2 from "5%" or "0.05"; None = none given.

    Raises:
        ConfigError: no number, or no share above 0 and at most 1.
    """
    if text is None:
        return None
    number = text.strip().removesuffix("%")
    try:
        value = float(number)
    except ValueError as error:
        raise ConfigError(f"Expected --density as a share such as 5% or 0.05, got {text!r}.") from error
    return checked_density(value / 100.0 if text.strip().endswith("%") else value)


def parse_setting(word: str) -> tuple[str, Any]:
    """Turn "key=value" into a scenario field and its value, by the field's type.

    Raises:
        ConfigError: no "=", an unknown field (with the nearest known one), or a value of another type.
    """
    name, equals, text = word.partition("=")
    if not equals:
        raise ConfigError(f"Expected --set key=value, got {word!r}.")
    if name == "quirks":
        return name, text
    types = {**field_types(), "side_m": float}  # of search_and_rescue
    if name not in types:
        raise ConfigError(f"Unknown scenario field {name!r}.{suggestion(name, types)} See: swarm-forage info SCENARIO.")
    return name, _parse_value(name, text, types[name])


def _parse_value(name: str, text: str, kind: Any) -> Any:
    try:
        if get_origin(kind) is tuple:
            return parse_tuple(text, kind)
        if kind is bool:
            return _TRUTH[text.lower()]
        return kind(text)
    except ConfigError:
        raise
    except (KeyError, ValueError) as error:
        words = {bool: "true or false", int: "a whole number", float: "a number"}
        wanted = words.get(kind, _EXAMPLES.get(name, "numbers separated by commas, like its default"))
        raise ConfigError(f"Expected {name} to be {wanted}, got {text!r}.") from error


def plan_runs(options: WorldOptions, policies: Sequence[str], *, n_seeds: int, first_seed: int) -> tuple[RunSpec, ...]:
    """Return one specification per policy and seed.

    Raises:
        ConfigError: see `described_world`; an unknown policy, or a policy file that cannot be opened.
    """
    whole("--seeds", n_seeds, at_least=1, at_most=MOST_SEEDS)
    world, caches = described_world(options)
    try:
        planned = [plan_run(world, name, caches=caches) for name in policies]
    except ValueError as error:  # of a policy or its file
        raise ConfigError(str(error)) from error
    return tuple(
        dataclasses.replace(spec, seed=seed) for spec in planned for seed in range(first_seed, first_seed + n_seeds)
    )


def default_folder(world: World) -> Path:
    """Return the default folder for results: one per world, so that repeated runs are found and no others are there."""
    return Path("results") / world.file_name
