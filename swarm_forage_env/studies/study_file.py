"""Study files: TOML that says what a study varies, with budgets that say how much of it to run.

    name = "S1e"
    title = "Noise, small warehouse"
    scenario = "warehouse_small"
    policies = ["crw", "results/my_policy.npz", { policy = "stochx", label = "without caches", caches = "none" }]
    rules = ["described", "program"]       # default both

    [set]                                  # any scenario field
    physics = "compiled"

    [wrappers.population]                  # in all runs
    death_per_tick = 0.0001

    [[axis]]                               # any number; the last one is plotted along x
    criterion = "noise"                    # or "quirk", or field = "n_objects" or "sensor_noise.sigma"
    values = [0.01, 0.02, 0.03]            # default for a criterion: the paper's values; for "quirk": none, and each
    reference = 0.0                        # only on the last axis; default see `load_study`

    [budget.smoke]                         # all keys are optional; default: as in the paper
    seeds = 2
    horizon_s = 1000.0
    interval_s = 100.0
    values = { noise = 2 }                 # number of values besides the reference, evenly spread, or a list of values

The files of the paper's sets are in the folder `sets`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from swarm_forage_env._internal.fields import MOST_SEEDS, ConfigError, known_keys, known_name, several, table, whole
from swarm_forage_env._internal.files import parse_toml
from swarm_forage_env._internal.wording import suggestion
from swarm_forage_env.policies.registry import is_policy_file
from swarm_forage_env.runs.policy_spec import PolicySpec, policy_spec
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.quirks import QUIRK_NAMES
from swarm_forage_env.studies.ladders import BUDGETS, CRITERIA, spread, study_values
from swarm_forage_env.studies.study import (
    NOTHING,
    POLICY_KEYS,
    QUIRK,
    Axis,
    StudySpec,
    Value,
    list_word,
    plain_settings,
    value_words,
)
from swarm_forage_env.wrappers.registry import wrappers_from_mapping
from swarm_forage_env.wrappers.world import SIZE

SETS = Path(__file__).parent / "sets"
"""Folder of the paper's sets."""
PAPER = "paper"
"""Name of the budget that every study has: runs as long, and as many, as in the paper."""
FILE_KEYS = ("name", "title", "scenario", "policies", "rules", "set", "wrappers", "axis", "budget")
AXIS_KEYS = ("criterion", "field", "values", "reference")
BUDGET_KEYS = ("seeds", "horizon_s", "interval_s", "values")


def set_names() -> tuple[str, ...]:
    """Return the names of the paper's sets."""
    return tuple(sorted(file.stem for file in SETS.glob("*.toml")))


def find_study(name: str | Path) -> Path:
    """Return the file of a study.

    Args:
        name: Name of one of the paper's sets, or path of a file.

    Raises:
        ConfigError: there is neither.
    """
    if str(name) in set_names():
        return SETS / f"{name}.toml"
    if not Path(name).is_file():
        raise ConfigError(
            f"Expected a study file that exists, or one of {', '.join(set_names())}, got {str(name)!r}."
            f"{suggestion(str(name), set_names())}"
        )
    return Path(name)


def load_study(
    name: str | Path,
    budget: str | None = None,
    *,
    seeds: int | None = None,
    rules: Sequence[str] | None = None,
) -> StudySpec:
    """Read a study file and return the study with one of its budgets.

    The reference is on the last axis. Default: for swarm sizes, one robot if it is among the sizes, else the smallest
    size; for quirks "none", the rules as they are; for other criteria 0, the ideal conditions; for a field, none. Every
    budget runs the reference.

    Args:
        name: Name of one of the paper's sets, or path of a file.
        budget: Name of a budget; default the first of the file.
        seeds: Number of seeds, 0, 1, 2, ..., in place of the seeds of the budget.
        rules: Rules in place of those in the file.

    Raises:
        ConfigError: the file is missing, is not TOML, or does not describe a study; the message names the file.
    """
    file = find_study(name)
    try:
        spec = _study(_read(file), file.parent, budget, seeds, rules)
    except ConfigError as error:
        raise error if str(file) in str(error) else ConfigError(f"Cannot use {file}: {error}") from error
    return spec if file.parent == SETS else replace(spec, file=str(file))


def is_set_of_paper(spec: StudySpec) -> bool:
    """Return whether a study is a set of the paper at one of its budgets, with any seeds, not only by its name."""
    if spec.name not in set_names():  # else a file of that name would be opened
        return False
    try:
        same = load_study(spec.name, spec.budget, rules=spec.rules)
    except ConfigError:  # no such budget of it
        return False
    return replace(same, seeds=spec.seeds).study_id == spec.study_id


def left_out(spec: StudySpec) -> dict[str, tuple[str, ...]]:
    """Return which of the paper's values a set leaves out: axis -> values as they are shown.

        left_out(load_study("S2a", "reduced"))["walk_probability"]  # ("0.026",)

    The mapping is empty for a set with all values, and for any other study.
    """
    if not is_set_of_paper(spec):
        return {}
    lacking: dict[str, tuple[str, ...]] = {}
    for axis, planned in zip(spec.axes, load_study(spec.name, PAPER).axes, strict=True):
        words = value_words(planned.values)
        absent = tuple(words[value] for value in planned.values if value not in axis.values)
        if absent:
            lacking[axis.name] = absent
    return lacking


def left_out_words(spec: StudySpec) -> str:
    """Return `left_out` as one text, "walk_probability 0.026; population_size 460, 627, 819"; "" for nothing."""
    return "; ".join(f"{axis} {', '.join(values)}" for axis, values in left_out(spec).items())


def _read(file: Path) -> dict[str, Any]:
    try:
        return parse_toml(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"Cannot use {file}: {error.strerror or error}.") from error
    except ValueError as error:
        raise ConfigError(f"Cannot use {file}: {error}") from error


def _study(
    content: Mapping[str, Any], folder: Path, budget: str | None, n_seeds: int | None, rules: Sequence[str] | None
) -> StudySpec:
    known_keys(content, FILE_KEYS, "key of a study file")
    for key in ("name", "scenario", "policies"):
        if key not in content:
            raise ConfigError(f"Missing key {key!r} of a study file.")
    budgets = _budgets(content)
    chosen = next(iter(budgets)) if budget is None else budget
    known_name("budget", chosen, budgets)
    allowed, of_paper = budgets[chosen], BUDGETS[PAPER]
    horizon_s = allowed.get("horizon_s", of_paper.horizon_s)
    interval_s = allowed.get("interval_s", of_paper.interval_s)
    settings = plain_settings(table("set", content.get("set", {})))
    axes, reference = _axes(content, settings, allowed)
    told: dict[str, Any] = {}
    if rules is not None or "rules" in content:
        told["rules"] = tuple(_listed("rules", rules or content["rules"]))
    return StudySpec(
        name=content["name"],
        title=content.get("title", ""),
        scenario=content["scenario"],
        settings=settings,
        wrappers=wrappers_from_mapping(table("wrappers", content.get("wrappers", {}))),
        policies=tuple(_policy(entry, folder) for entry in _listed("policies", content["policies"])),
        axes=axes,
        reference=reference,
        budget=chosen,
        seeds=_seeds(allowed.get("seeds", of_paper.n_seeds) if n_seeds is None else n_seeds),
        horizon_s=horizon_s,
        interval_s=interval_s,
        **told,
    )


def _budgets(content: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Name -> keys of each budget; `PAPER` is always there."""
    given = {name: table(f"budget.{name}", keys) for name, keys in table("budget", content.get("budget", {})).items()}
    for name, keys in given.items():
        known_keys(keys, BUDGET_KEYS, "key of a budget", prefix=f"budget.{name}.")
    return {**given, PAPER: given.get(PAPER, {})}


def _listed(where: str, value: Any) -> list[Any]:
    if not isinstance(value, list | tuple):
        raise ConfigError(f"Expected {where} to be a list, got {value!r}.")
    return list(value)


def _seeds(given: Any) -> tuple[int, ...]:
    """The seeds of a budget, which gives their number or a list."""
    if isinstance(given, list):
        return tuple(given)
    whole("seeds", given, at_least=1, at_most=MOST_SEEDS)
    return tuple(range(given))


def _policy(entry: Any, folder: Path) -> PolicySpec:
    """A policy from its name or its table; the path of a policy file starts at the study file."""
    keys: dict[str, Any] = {"policy": entry} if isinstance(entry, str) else dict(table("a policy", entry))
    known_keys(keys, POLICY_KEYS, "key of a policy")
    word = keys.pop("policy", None)
    if not isinstance(word, str):
        raise ConfigError(f"Missing key 'policy', a name or a file, in {entry!r}.")
    table(f"parameters of {word!r}", keys.get("parameters", {}))
    return policy_spec(_beside(word, folder), **keys)


def _beside(word: str, folder: Path) -> str:
    """Return a policy with the path of its file relative to a folder."""
    return str(folder / word) if is_policy_file(word) else word


def _axes(
    content: Mapping[str, Any], settings: Mapping[str, Any], allowed: Mapping[str, Any]
) -> tuple[tuple[Axis, ...], Value | None]:
    """The axes with the values of a budget, and the reference on the last one."""
    entries = [table("an axis", entry) for entry in _listed("axis", content.get("axis", []))]
    chosen = table("values of a budget", allowed.get("values", {}))
    axes: list[Axis] = []
    reference: Value | None = None
    for number, entry in enumerate(entries, 1):
        known_keys(entry, AXIS_KEYS, "key of an axis")
        name = _axis_name(entry)
        given = _listed(
            f"values of axis {name}", entry["values"] if "values" in entry else _of_paper(content, settings, name)
        )
        several(f"the values of axis {name}", tuple(given), "values")
        values = [_place(value) for value in given]
        is_last = number == len(entries)
        if "reference" in entry and not is_last:
            raise ConfigError(f"Expected a reference on the last axis only, got one on {name}.")
        if is_last:
            reference = _place(entry.get("reference", _usual_reference(name, values)))
            if reference is not None and reference not in values:
                values = [reference, *values]
        axes.append(Axis(name=name, values=_chosen(name, values, reference if is_last else None, chosen.get(name))))
    known_keys(chosen, [axis.name for axis in axes], "axis", prefix="values.")
    return tuple(axes), reference


def _place(value: Any) -> Any:
    """A value of the file as a place on an axis: lists are texts there."""
    return list_word(value) if isinstance(value, list) else value


def _axis_name(entry: Mapping[str, Any]) -> str:
    names = [entry[key] for key in ("criterion", "field") if key in entry]
    if len(names) != 1 or not isinstance(names[0], str):
        raise ConfigError(f"Expected either criterion or field of an axis, as a text, got {dict(entry)!r}.")
    if "criterion" in entry:
        known_name("criterion", names[0], (*CRITERIA, QUIRK))
    return names[0]


def _of_paper(content: Mapping[str, Any], settings: Mapping[str, Any], name: str) -> list[Value]:
    if name == QUIRK:
        return [NOTHING, *QUIRK_NAMES]
    if name not in CRITERIA:
        raise ConfigError(f"Missing key 'values' of axis {name}; only criteria have values of their own.")
    return list(study_values(scenario(content["scenario"], **settings), name))


def _usual_reference(name: str, values: Sequence[Value]) -> Value | None:
    if name == SIZE:
        return min(values)
    if name == QUIRK:
        return NOTHING
    return 0.0 if name in CRITERIA else None


def _chosen(name: str, values: list[Value], reference: Value | None, asked: Any) -> tuple[Value, ...]:
    """The values that a budget runs: all, a list, or a number of values besides the reference."""
    if asked is None:
        return tuple(values)
    if isinstance(asked, list):
        asked = [_place(value) for value in asked]
        several(f"values.{name}", tuple(asked), "values")
        unknown = [value for value in asked if value not in values]
        if unknown:
            raise ConfigError(f"Expected values.{name} to be some of {values!r}, got {unknown[0]!r}.")
        return tuple(value for value in values if value in asked or value == reference)
    whole(f"values.{name}", asked, at_least=1)
    others = spread([value for value in values if value != reference], asked)
    return tuple(value for value in values if value in others or value == reference)
