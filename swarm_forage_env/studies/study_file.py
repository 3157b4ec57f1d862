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
    reference = 0.0                        # only on the last axis; default see `StudySpec.reference`

    [budget.smoke]                         # all keys are optional; default: as in the paper
    seeds = 2                              # 0 and 1; from `first_seed` on, or a list
    horizon_s = 1000.0
    interval_s = 100.0
    values = { noise = 2 }                 # number of values besides the reference, evenly spread, or a list of values

The folder of a study keeps the file with a table `[run]` at its end: the budget, seeds and rules that were chosen, and
which policy files were run. The files of the paper's sets are in the folder `sets`.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import msgspec

from swarm_forage_env._internal.fields import MOST_SEEDS, ConfigError, known_keys, known_name, whole
from swarm_forage_env._internal.files import parse_toml
from swarm_forage_env.scenarios.overrides import field_sections
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.quirks import QUIRK_NAMES
from swarm_forage_env.studies.ladders import BUDGETS, CRITERIA, spread, study_values
from swarm_forage_env.wrappers.registry import wrapper_config_class
from swarm_forage_env.wrappers.world import SIZE

Value: TypeAlias = float | str | bool | tuple[Any, ...]
"""Value on an axis; a tuple for a field that holds a list."""

SETS = Path(__file__).parent / "sets"
"""Folder of the paper's sets."""
PAPER = "paper"
"""Name of the budget that every study has: runs as long, and as many, as in the paper."""
RULES_NAMES = {"described": "DESCRIBED", "program": "AUTHORS_PROGRAM"}
"""Word of studies -> name of the rules in `scenarios.quirks.RULES`."""
OBJECT_DENSITY = "object_density"
"""Objects per m^2 of floor, in place of n_objects: their number follows the arena, however the swarm grows."""
SCENARIO_FIELDS = (*field_sections(), "density", "side_m", OBJECT_DENSITY)
"""Scenario fields that a study may set and vary: all arguments that `scenarios.presets.scenario` takes by name, and the
density of objects."""
OF_THE_STUDY = {
    "horizon_s": "the budget of a study sets it",
    "interval_s": "the budget of a study sets it",
    "quirks": "the rules of a study set them",
}
"""Scenario field that a study must not set -> what decides it instead."""
NOTHING = "none"
"""An empty list in words, and no switched quirk."""
QUIRK = "quirk"
"""Axis whose values are `NOTHING` and names of quirks, each of which is switched alone: on under the described rules,
off under the program's."""
RUN = "\n[run]  # what was chosen; written by 'swarm-forage study run'\n"


class _Strict(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A table of the file that refuses other keys."""


class PolicyTable(_Strict, frozen=True):
    """A policy with options; a text alone is its name or file."""

    policy: str
    label: str = ""
    parameters: dict[str, Any] = {}  # msgspec copies the default
    caches: str | None = None


class AxisTable(_Strict, frozen=True):
    """What the study varies."""

    criterion: str | None = None
    field: str | None = None
    values: tuple[int | float | str | bool | list[Any], ...] | None = None
    reference: int | float | str | bool | list[Any] | None = None


class BudgetTable(_Strict, frozen=True):
    """How much to run."""

    seeds: int | tuple[int, ...] = BUDGETS[PAPER].n_seeds
    """Their number, or a list."""
    first_seed: int = 0
    """The first of a number of seeds."""
    horizon_s: float = BUDGETS[PAPER].horizon_s
    interval_s: float = BUDGETS[PAPER].interval_s
    values: dict[str, int | tuple[int | float | str | bool | list[Any], ...]] = {}


class RunTable(_Strict, frozen=True):
    """What was chosen of a study."""

    budget: str
    seeds: tuple[int, ...]
    rules: tuple[str, ...]
    policies: tuple[PolicyTable, ...] = ()
    """As they are run, where there are files among them: with their whole paths, digests and caches."""


class StudyFile(_Strict, frozen=True):
    """The content of a study file."""

    name: str
    scenario: str
    policies: tuple[str | PolicyTable, ...]
    title: str = ""
    rules: tuple[str, ...] = tuple(RULES_NAMES)
    set: dict[str, Any] = {}
    wrappers: dict[str, dict[str, Any]] = {}
    axis: tuple[AxisTable, ...] = ()
    budget: dict[str, BudgetTable] = {}
    run: RunTable | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class Axis:
    """What a study varies, and its values.

    Raises:
        ConfigError: an unknown name, no values, equal values, or values of several kinds.
    """

    name: str
    """A criterion (`ladders.CRITERIA`), a scenario field, a field of a wrapper ("sensor_noise.sigma",
    "throttle.waveform.amplitude"), or `QUIRK`."""
    values: tuple[Value, ...]

    def __post_init__(self) -> None:
        wrapper, dot, _ = self.name.partition(".")
        if dot:
            wrapper_config_class(wrapper)  # refuses unknown names; the field is checked with its values
        else:
            allowed = (*CRITERIA, QUIRK, *(name for name in SCENARIO_FIELDS if name not in OF_THE_STUDY))
            others = ", ".join((*CRITERIA, QUIRK))
            shown_by = f"{others}, and the fields that swarm-forage info warehouse_small lists"
            known_name("axis", self.name, allowed, all_by=shown_by)
        for value in self.values if self.name == QUIRK else ():
            known_name("quirk", value, (NOTHING, *QUIRK_NAMES))
        kinds = {float if isinstance(value, int) and type(value) is not bool else type(value) for value in self.values}
        if len(kinds) != 1 or len({*self.values}) < len(self.values):
            raise ConfigError(
                f"Expected one or more different numbers, texts, truth values or lists on axis {self.name}, got "
                f"{list(self.values)!r}."
            )

    @property
    def is_criterion(self) -> bool:
        """Whether it varies a criterion, not a single field."""
        return self.name in CRITERIA


def content_of(text: str) -> StudyFile:
    """Return what a study file says; ConfigError says where it says something else."""
    try:
        return msgspec.convert(parse_toml(text), StudyFile)
    except msgspec.ValidationError as error:
        told, _, where = str(error).partition(" - at ")
        raise ConfigError(f"{told}{' in ' + where.strip('`').removeprefix('$.') if where else ''}.") from error


def seeds_of(given: int | Sequence[int], first: int) -> tuple[int, ...]:
    """Return seeds that are given by their number, with the first of them, or as a list."""
    if isinstance(given, list | tuple):
        return tuple(given)
    return tuple(range(first, first + whole("seeds", given, at_least=1, at_most=MOST_SEEDS)))


def axes_of(file: StudyFile, asked: Mapping[str, Any]) -> tuple[tuple[Axis, ...], Value | None]:
    """Return the axes of a study, and its reference on the last one.

    Args:
        file: The study.
        asked: Name of an axis -> values of a budget, or their number.

    Raises:
        ConfigError: an axis without a name or without values, or values that are not on their axis.
    """
    axes: list[Axis] = []
    reference: Value | None = None
    for number, one in enumerate(file.axis, 1):
        name, is_last = one.field if one.criterion is None else one.criterion, number == len(file.axis)
        if name is None or (one.criterion is not None and one.field is not None):
            raise ConfigError("Expected either criterion or field of an axis, got both or none of them.")
        if one.criterion is not None:
            known_name("criterion", name, (*CRITERIA, QUIRK))
        values = _usual_values(file, name) if one.values is None else _plain(one.values)
        if not values:
            raise ConfigError(f"Expected the values of axis {name} to be one or more values, got none.")
        if one.reference is not None and not is_last:
            raise ConfigError(f"Expected a reference on the last axis only, got one on {name}.")
        if is_last:
            reference = _usual_reference(name, values) if one.reference is None else _plain(one.reference)
            if reference is not None and reference not in values:
                values = (reference, *values)
        axes.append(Axis(name=name, values=_chosen(name, values, reference, asked.get(name))))
    known_keys(asked, [axis.name for axis in axes], "axis", prefix="values.")
    return tuple(axes), reference


def _plain(value: Any) -> Any:
    """Return a value of the file with tuples in place of lists."""
    return tuple(map(_plain, value)) if isinstance(value, list | tuple) else value


def _usual_values(file: StudyFile, name: str) -> tuple[Value, ...]:
    if name == QUIRK:
        return (NOTHING, *QUIRK_NAMES)
    if name not in CRITERIA:
        raise ConfigError(f"Missing key 'values' of axis {name}; only criteria have values of their own.")
    overrides = {field: value for field, value in file.set.items() if field != OBJECT_DENSITY}
    return tuple(study_values(scenario(file.scenario, **overrides), name))


def _usual_reference(name: str, values: Sequence[Any]) -> Value | None:
    if name == SIZE:
        return min(values)
    return NOTHING if name == QUIRK else 0.0 if name in CRITERIA else None


def _chosen(name: str, values: tuple[Value, ...], reference: Value | None, asked: Any) -> tuple[Value, ...]:
    """The values that a budget runs: all, a list, or a number of values besides the reference."""
    if asked is None:
        return values
    if isinstance(asked, tuple):
        wanted: Sequence[Value] = _plain(asked)
        unknown = [value for value in wanted if value not in values]
        if unknown:
            raise ConfigError(f"Expected values.{name} to be some of {list(values)!r}, got {unknown[0]!r}.")
    else:
        whole(f"values.{name}", asked, at_least=1)
        wanted = spread([value for value in values if value != reference], asked)
    return tuple(value for value in values if value in wanted or value == reference)


def value_words(values: Iterable[Value]) -> dict[Value, str]:
    """Return the values of an axis in words: 2/7 as 0.285714, but with all digits if two values would look alike."""
    short = {value: word_of(value) for value in values}
    shown = Counter(short.values())
    return {value: word if shown[word] == 1 else str(value) for value, word in short.items()}


def word_of(value: Any) -> str:
    """Return a value in a word: true, 0.25, "3.2,12.8" for a list, "1,2+3,4" for one of lists, "none" for none."""
    if isinstance(value, tuple):
        between = "+" if any(isinstance(entry, tuple) for entry in value) else ","
        return between.join(map(word_of, value)) or NOTHING
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)
