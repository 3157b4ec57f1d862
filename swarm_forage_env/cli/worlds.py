"""From command-line words to run specifications. Every wrong input raises a ConfigError here."""

import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.files import as_file_name
from swarm_forage_env.cli.options import WorldOptions
from swarm_forage_env.policies.registry import policy_label
from swarm_forage_env.runs.spec import PolicySpec, RunSpec, policy_specs
from swarm_forage_env.scenarios.differences import digest_of, preset_of
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import World, WorldDescription, described

RESULTS = Path("results")
LONGEST_NAME = 100
"""Of a file, in characters; the rest is a digest."""
_COMMA = re.compile(r",(?!\s*[a-z_]+=[^,/\\]*(?:,|$))")
"""Between names; one before a word field=value is part of a name."""
LISTS_OF_PLACES = ("further_nests", "obstacles", "object_positions_m")
"""Fields that are written as boxes or places between plus signs: obstacles=10,4,11,12+20,4,21,12."""


def split_names(text: str) -> tuple[str, ...]:
    """Split a comma-separated list of names, dropping repetitions.

    A word field=value belongs to the policy file before it: "crw,model.zip:observation=compact,decision_ticks=5" are
    two policies.

    Raises:
        ConfigError: there is no name in it.
    """
    names = tuple(dict.fromkeys(filter(None, map(str.strip, _COMMA.split(text)))))
    if not names:
        raise ConfigError(f"Expected one or more names separated by commas, got {text!r}.")
    return names


def described_world(options: WorldOptions) -> tuple[World, str | None]:
    """Return the world that options describe, and which caches were asked for (None = nobody asked).

    Raises:
        ConfigError: unknown names, values of a wrong type or that do not fit together, or a file that cannot be used.
    """
    found = described_fields(options)
    return found.world(), found.fields.get("caches")


def described_runs(options: WorldOptions, policies: Sequence[str]) -> tuple[World, tuple[PolicySpec, ...]]:
    """Return the world that options describe, and policies with the caches that were asked for.

    Raises:
        ConfigError: as `described_world`, or of a policy.
    """
    world, caches = described_world(options)
    return world, policy_specs(policies, caches=caches)


def described_fields(options: WorldOptions) -> WorldDescription:
    """Return what options describe as a file would say it; they override the fields and wrappers of the file.

    Raises:
        ConfigError: see `described_world`; names and values of fields are not looked at here.
    """
    fields = dict(parse_setting(word) for word in options.settings)
    for name, value in (("n_robots", options.robots), ("horizon_s", options.horizon)):
        if value is not None and name in fields:
            raise ConfigError(f"Expected {name} once, got it from an option and from --set.")
        if value is not None:
            fields[name] = value
    return described(options.scenario).changed(fields, map(parse_wrapper, options.wrappers))


def parse_setting(word: str) -> tuple[str, Any]:
    """Turn "key=value" into a name and a value: as TOML says it, else a text; several between commas.

    Raises:
        ConfigError: no "=".
    """
    name, equals, text = word.partition("=")
    if not equals:
        raise ConfigError(f"Expected --set key=value, got {word!r}.")
    if name in LISTS_OF_PLACES:
        return name, [[_value(number) for number in place.split(",")] for place in text.split("+") if place]
    return name, _value(text)


def _value(text: str) -> Any:
    for form in (text, f"[{text}]"):
        try:
            return tomllib.loads(f"value = {form}")["value"]
        except tomllib.TOMLDecodeError:
            continue
    return text.split(",") if "," in text else text


def plan_runs(options: WorldOptions, policies: Sequence[str], seeds: Sequence[int]) -> tuple[RunSpec, ...]:
    """Return one specification per policy and seed; errors as `described_runs`."""
    world, specs = described_runs(options, policies)
    return tuple(spec.run_in(world, seed) for spec in specs for seed in seeds)


def default_folder(world: World) -> Path:
    """Return the default folder for results: one per world, so that repeated runs are found and no others are there."""
    return RESULTS / world.file_name


def default_file(folder: Path, world: World, policies: Sequence[str], ending: str, *, seed: int = 0) -> Path:
    """Return a file named by its world and policies, so that no other question overwrites it.

    Args:
        folder: Where it lies.
        world: Where policies act; another performance than the preset's is part of the name.
        policies: Names and files.
        ending: Of the name, such as "_scores.png".
        seed: The first seed; another one than 0 is part of the name.
    """
    preset = preset_of(world.scenario)
    words = [world.file_name, *map(policy_label, policies)]
    if preset is not None and world.scenario.performance != preset.performance:
        words.append(world.scenario.performance)
    if seed:
        words.append(f"seed_{seed}")
    name = as_file_name("_".join(words))
    if len(name) > LONGEST_NAME:
        name = f"{name[:LONGEST_NAME]}_{digest_of(words, 6)}"
    return folder / f"{name}{ending}"
