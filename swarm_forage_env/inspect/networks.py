"""What a network file says: its layers, what it sees and does, what it was trained in, and the rest of its card."""

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from swarm_forage_env.policies.network import Network, NetworkAbout

_PLAN = "plan"
"""The part of a card that holds the plan of the training."""
_BETWEEN = {"uniform": " to ", "log_uniform": " to ", "choice": " or "}
"""Kinds of distributions of plans, and the word between their numbers."""


def network_lines(file: Path, network: Network) -> Iterator[str]:
    """Yield the lines about a network file.

    Args:
        file: Where it lies.
        network: What it holds. Its card is for readers: it may hold anything, and what is no plan is shown as it is.
    """
    about = network.about
    sizes = [len(network.weights[0]), *(weight.shape[1] for weight in network.weights)]
    yield f"{file}: a network of {' x '.join(map(str, sizes))} units ({about.activation})"
    yield ""
    for name, value in dataclasses.asdict(about.interface).items():
        yield f"  {name:<20}{'none' if value in (None, ()) else in_words(value)}"
    yield f"  {'samples':<20}{about.samples} ({_choice(about)})"
    yield f"  {'caches':<20}{about.caches} (the caches it is made for)"
    for part, values in about.card.items():
        yield ""
        if part == _PLAN and isinstance(values, Mapping):  # whole, it takes pages
            yield "  [trained in]"
            yield from (f"    {name:<24}{told}" for name, told in _training(values))
            continue
        yield f"  [{part}]"
        for name, value in values.items() if isinstance(values, Mapping) else (("", values),):
            yield from _entry(name, value)


def in_words(value: Any) -> str:
    """Return a value as readers like it: sizes as "4 x 6", fields after their names, distributions in words."""
    if isinstance(value, Mapping):
        if len(value) == 1 and (kind := next(iter(value))) in _BETWEEN and isinstance(value[kind], list):
            return _BETWEEN[kind].join(map(in_words, value[kind]))
        return ", ".join(f"{name} {in_words(inner)}" for name, inner in value.items())
    if isinstance(value, tuple | list):
        is_size = all(isinstance(part, int | float) for part in value)
        return " x ".join(f"{part:g}" for part in value) if is_size else ", ".join(map(in_words, value))
    return str(value)


def _choice(about: NetworkAbout) -> str:
    if about.interface.actions != "discrete":
        return "takes the mean"
    return "draws actions by their probabilities" if about.samples else "greedy: takes the likeliest action"


def _entry(name: str, value: Any) -> Iterator[str]:
    """Yield an entry of a card, in which a list of tables takes a line for each of them."""
    rows = value if isinstance(value, list) and all(isinstance(row, Mapping) for row in value) else [value]
    for k, row in enumerate(rows):
        told = f"{row:.6g}" if isinstance(row, float) else in_words(_rounded(row))
        yield f"    {'' if k else name:<24}{told}" if name else f"    {told}"


def _rounded(value: Any) -> Any:
    if not isinstance(value, Mapping):
        return value
    return {name: f"{inner:.6g}" if isinstance(inner, float) else inner for name, inner in value.items()}


def _training(plan: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield in which worlds a plan trains, and for how long, as names and what they are."""
    if "sampler" in plan:
        sampler = _table(plan["sampler"])
        for world in map(_table, _rows(sampler.get("worlds"))):
            fields = dict(_table(world.get("scenario")))
            yield _name(fields.pop("preset", None)), in_words(fields)
        yield "all of them", in_words(_table(sampler.get("scenario"))) or "as they are"
        disturbances = sampler.get("wrappers")
    else:
        scenario = _table(plan.get("scenario"))
        yield _name(scenario), f"n_robots {_table(scenario.get('robots')).get('n_robots', 'unknown')}"
        disturbances = plan.get("wrappers")
    yield "wrappers", ", ".join(_table(disturbances)) or "none"
    if plan.get("temperature", 1.0) != 1.0:
        yield "temperature", f"{in_words(plan['temperature'])}, in the weights of the last layer"
    learnt, in_runs = _table(plan.get("interface")), _table(plan.get("in_runs"))
    if others := {name: learnt.get(name, "unknown") for name, value in in_runs.items() if learnt.get(name) != value}:
        yield "learnt with", in_words(others)
    for k, stage in enumerate(map(_table, _rows(plan.get("stages"))), start=1):
        own = "in worlds of its own" if "sampler" in stage else in_words(_table(stage.get("scenario")))
        yield f"stage {k}", f"{stage.get('steps', 'unknown')} decisions{', ' if own else ''}{own}"


def _table(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _rows(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def _name(preset: Any) -> str:
    """Return the name of a preset or of a whole scenario."""
    return str(preset.get("name", "unknown") if isinstance(preset, Mapping) else preset)
