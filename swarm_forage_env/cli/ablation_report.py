"""What `ablate` prints: Markdown tables of both readings and of what each quirk moves, or JSON."""

import json
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from metrics.significance import holm, pooled_p
from metrics.statistics import aggregate
from swarm_forage_env._internal.wording import plain
from swarm_forage_env.cli.report import performance_number, span
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.scenarios.performance import Performance
from swarm_forage_env.scenarios.quirks import READINGS
from swarm_forage_env.studies.ablation import TASK_COLUMNS, AblationResult, Effect, Switch

CLOSE = 0.05
"""Policies whose means differ by a smaller share count as equal in an order (our choice)."""
ALPHA = 0.05
_SWITCHED = {"DESCRIBED": "switched on in the description", "AUTHORS_PROGRAM": "switched off in the authors' program"}
_NOTES = (
    "`=`: the first run is the same, bit for bit, and no other was made. `*`: significant at 5 % by Student's t, with "
    "the scatter pooled over the quirks of a column and Holm's correction over the table. `~`: means closer than 5 %. "
    "Quirks that change no first run in a world are left out of its tables."
)


def ablation_pages(result: AblationResult, performance: Performance) -> str:
    """Return all tables as Markdown: the two readings side by side, then what each quirk moves."""
    effects = result.effects()
    parts = [_readings(result, performance), *([_NOTES] if effects else [])]
    for scenario in dict.fromkeys(switch.scenario for switch in result.records):
        for reading in READINGS:
            own = [e for e in effects if (e.switch.scenario, e.switch.reading) == (scenario, reading)]
            moving = [effect for effect in own if not effect.is_same]
            if own and not moving:
                parts.append(f"**{scenario}: each quirk {_SWITCHED[reading]}**\n\nNone changes a first run.")
            if moving:
                parts += _tables(result, own, {effect.switch.quirk for effect in moving})
    return "\n\n".join(parts)


def ablation_json(result: AblationResult, performance: Performance) -> str:
    """Return readings, effects and failures as a JSON document."""
    readings = [
        {**switch._asdict(), "n_runs": len(records), **dict(zip(("performance", "interference"), numbers, strict=True))}
        for switch, records in result.records.items()
        if not switch.quirk
        for numbers in [_numbers(records, performance)]
    ]
    failures = [{"run": failure.spec.describe(), "error": failure.error} for failure in result.failures]
    document = {
        "performance": f"{performance.title} {span(performance)}",
        "readings": readings,
        "effects": [_plain(effect) for effect in result.effects()],
        "failures": failures,
    }
    return json.dumps(document, indent=1)


def _plain(effect: Effect) -> dict[str, Any]:
    """An effect as plain values; a quirk that changed nothing in its first run has no intervals."""
    tasks = effect.task_shares
    rows: dict[str, FloatArray] = {"performance": effect.performance, "interference": effect.interference}
    if tasks is not None:
        rows |= {name: tasks[:, column] for column, name in enumerate(TASK_COLUMNS)}
    numbers = {
        name: {part: plain(getattr(summary, part)) for part in ("mean", "lower", "upper")}
        for name, values in rows.items()
        for summary in [aggregate(values)]
    }
    return {**effect.switch._asdict(), "is_same": effect.is_same, "n_runs": len(effect.performance), **numbers}


def _numbers(records: Sequence[Any], performance: Performance) -> tuple[float, float]:
    done = float(np.mean([performance_number(record, performance) for record in records]))
    return done, float(np.mean([record.interference_fraction.mean() for record in records]))


def _readings(result: AblationResult, performance: Performance) -> str:
    """Return a table of performance and interference under both readings."""
    lines = [
        "| world | robots | policy | described: performance | program | described: interference | program |",
        "|---|--:|---|--:|--:|--:|--:|",
    ]
    for switch, records in result.records.items():
        twin = result.records.get(switch._replace(reading="AUTHORS_PROGRAM"))
        if switch.quirk or switch.reading != "DESCRIBED" or twin is None:
            continue
        (done, lost), (done_there, lost_there) = (_numbers(own, performance) for own in (records, twin))
        numbers = f"{done:.1f} | {done_there:.1f} | {lost:.3f} | {lost_there:.3f}"
        lines.append(f"| {switch.scenario} | {switch.n_robots} | {switch.policy} | {numbers} |")
    title = (
        f"**Both readings.** {performance.title.capitalize()} {span(performance)}, share of robot time in interference"
    )
    return title + "\n\n" + "\n".join(lines)


def _tables(result: AblationResult, effects: Sequence[Effect], moving: set[str]) -> list[str]:
    """Tables of one world and reading: performance with orders, interference, tasks."""
    some = effects[0].switch
    sizes = sorted({effect.switch.n_robots for effect in effects})
    order = [f"order at {size}: {_order(result, some._replace(n_robots=size, quirk=''))}" for size in sizes]
    head = f"{some.scenario}, each quirk {_SWITCHED[some.reading]}"
    orders = {
        f"order at {size}": {
            quirk: _changed_order(result, some._replace(n_robots=size, quirk=quirk)) for quirk in moving
        }
        for size in sizes
    }
    own = [effect for effect in effects if effect.switch.quirk in moving]
    tables = [
        f"**{head}: performance, % of the reading's** ({'; '.join(order)})\n\n"
        + _table(own, _starred(own, "performance"), orders),
        f"**{head}: interference, points of % of robot time**\n\n" + _table(own, _starred(own, "interference"), {}),
    ]
    if any(effect.task_shares is not None for effect in own):
        tables.append(f"**{head}: task whose share moved most, points of %**\n\n" + _table(own, _task_text, {}))
    return tables


def _table(effects: Sequence[Effect], text: Callable[[Effect], str], more: dict[str, dict[str, str]]) -> str:
    """One row per quirk, one column per size and policy, and further columns by quirk."""
    policies = list(dict.fromkeys(e.switch.policy for e in effects))
    columns = [(size, policy) for size in sorted({e.switch.n_robots for e in effects}) for policy in policies]
    rows = [["quirk", *(f"{policy} {size}" for size, policy in columns), *more]]
    rows.append(["---", *("--:" for _ in columns), *("---" for _ in more)])
    texts = {(e.switch.quirk, e.switch.n_robots, e.switch.policy): text(e) for e in effects}
    for quirk in dict.fromkeys(e.switch.quirk for e in effects):
        cells = [texts.get((quirk, *column), "-") for column in columns]
        rows.append([f"`{quirk}`", *cells, *(column[quirk] for column in more.values())])
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def _order(result: AblationResult, switch: Switch) -> str:
    """Policies, best first; those with close means are joined by "~"."""
    means = result.means(switch)
    joints = [" ~ " if worse >= (1.0 - CLOSE) * better else " > " for better, worse in pairwise(means.values())]
    return "".join(name + joint for name, joint in zip(means, [*joints, ""], strict=True))


def _changed_order(result: AblationResult, switch: Switch) -> str:
    order, before = _order(result, switch), _order(result, switch._replace(quirk=""))
    return "as before" if order == before else order


def _starred(effects: Sequence[Effect], quantity: str) -> Callable[[Effect], str]:
    """Return what writes the mean of a quantity, with a star where it is significant."""
    columns: dict[tuple[int, str], list[Effect]] = {}
    for effect in effects:
        if not effect.is_same:
            columns.setdefault((effect.switch.n_robots, effect.switch.policy), []).append(effect)
    cells = [effect.switch for column in columns.values() for effect in column]
    p_values = [pooled_p(np.array([getattr(effect, quantity) for effect in column])) for column in columns.values()]
    adjusted = dict(zip(cells, holm(np.concatenate(p_values)) if p_values else (), strict=True))

    def text(effect: Effect) -> str:
        mean = float(getattr(effect, quantity).mean())
        if effect.is_same or np.isnan(mean):
            return "=" if effect.is_same else "-"
        return f"{100.0 * mean:+.1f}" + ("*" if adjusted[effect.switch] <= ALPHA else "")

    return text


def _task_text(effect: Effect) -> str:
    """The task whose mean share moved most, and by how much."""
    if effect.task_shares is None or effect.is_same:
        return "-" if effect.task_shares is None else "="
    shifts = effect.task_shares.mean(axis=0)
    most = int(np.argmax(np.abs(shifts)))
    return f"{TASK_COLUMNS[most].removeprefix('task_share_').replace('_', ' ')} {100.0 * shifts[most]:+.1f}"
