"""What `ablate` prints: Markdown tables of what each quirk moves, or JSON."""

import json
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from metrics.scoring.texts import plain
from metrics.statistics import Summary, aggregate
from swarm_forage_env.study.ablation import BASES, AblationResult, Cell, Effect

_SWITCHED = {"described": "switched on in the description", "program": "switched off in the authors' program"}
_NOTHING = "="


def ablation_pages(result: AblationResult) -> str:
    """Return all tables as Markdown: the two readings side by side, then what each quirk moves."""
    effects = result.effects()
    parts = [_readings(result)]
    if effects:
        parts.append(
            "`=` the first run is the same, bit for bit. `*` the 95 % interval of the difference, seed by seed, leaves "
            "out 0. Quirks that change nothing in a world are left out of its tables."
        )
    for scenario in dict.fromkeys(cell.scenario for cell in result.records):
        for base in BASES:
            own = [effect for effect in effects if effect.cell.scenario == scenario and effect.cell.base == base]
            moving = [effect for effect in own if not effect.is_same]
            if own and not moving:
                parts.append(f"**{scenario}: each quirk {_SWITCHED[base]}**\n\nNone changes anything.")
            if moving:
                parts += _tables(result, scenario, base, own, {effect.cell.quirk for effect in moving})
    return "\n\n".join(parts)


def ablation_json(result: AblationResult) -> str:
    """Return every effect as a JSON document."""
    return json.dumps({"effects": [_plain(effect) for effect in result.effects()]}, indent=1)


def _plain(effect: Effect) -> dict[str, Any]:
    summaries = {
        "performance": _share(effect),
        "interference": _interference(effect),
        "task_shares": _task_shift(effect),
    }
    numbers = {
        name: None if found is None else {part: plain(getattr(found, part)) for part in ("mean", "lower", "upper")}
        for name, found in summaries.items()
    }
    return {**effect.cell._asdict(), "is_same": effect.is_same, "n_runs": len(effect.performance), **numbers}


def _readings(result: AblationResult) -> str:
    """Return a table of performance and interference under both readings."""
    header = "| world | robots | policy | described: performance | program | described: interference | program |"
    lines = [header, "|---|--:|---|--:|--:|--:|--:|"]
    for cell, records in result.records.items():
        twin = result.records.get(cell._replace(base="program"))
        if cell.quirk or cell.base != "described" or twin is None:
            continue
        rates = [f"{np.mean([record.rate_per_1000_s('performance') for record in own]):.1f}" for own in (records, twin)]
        lost = [f"{np.mean([record.interference_fraction.mean() for record in own]):.3f}" for own in (records, twin)]
        lines.append("| " + " | ".join([cell.scenario, str(cell.n_robots), cell.policy, *rates, *lost]) + " |")
    return "**Both readings.** Performance per 1,000 s, share of robot time in interference\n\n" + "\n".join(lines)


def _tables(result: AblationResult, scenario: str, base: str, effects: Sequence[Effect], moving: set[str]) -> list[str]:
    sizes = sorted({effect.cell.n_robots for effect in effects})
    policies = tuple(dict.fromkeys(effect.cell.policy for effect in effects))
    by_cell = {effect.cell: effect for effect in effects}
    quirks = [quirk for quirk in dict.fromkeys(effect.cell.quirk for effect in effects) if quirk in moving]

    def table(title: str, text: Callable[[Effect], str], *, with_order: bool = False) -> str:
        columns = [(size, policy) for size in sizes for policy in policies]
        head = ["quirk", *(f"{policy} {size}" for size, policy in columns)]
        head += [f"order at {size}" for size in sizes] if with_order else []
        rows = [head, ["---", *("--:" for _ in columns), *("---" for _ in sizes if with_order)]]
        for quirk in quirks:
            cells = [Cell(scenario, size, policy, base, quirk) for size, policy in columns]
            row = [f"`{quirk}`", *(text(by_cell[cell]) if cell in by_cell else "-" for cell in cells)]
            row += [_order(result, Cell(scenario, size, "", base, quirk)) for size in sizes] if with_order else []
            rows.append(row)
        shown = "\n".join("| " + " | ".join(row) + " |" for row in rows)
        return f"**{scenario}, each quirk {_SWITCHED[base]}: {title}**\n\n{shown}"

    orders = [" > ".join(result.order(Cell(scenario, size, "", base, ""))) for size in sizes]
    before = "; ".join(f"at {size} robots {order}" for size, order in zip(sizes, orders, strict=True))
    tables = [
        table(f"performance, % of the reading's. Order without it: {before}", _performance_text, with_order=True),
        table("interference, points of % of robot time", _interference_text),
    ]
    if any(effect.task_shares is not None for effect in effects):
        tables.append(table("largest change of a task's share, points of %", _task_text))
    return tables


def _order(result: AblationResult, cell: Cell) -> str:
    order, before = result.order(cell), result.order(cell._replace(quirk=""))
    return "as before" if order == before else " > ".join(order)


def _share(effect: Effect) -> Summary:
    return aggregate(effect.performance)


def _interference(effect: Effect) -> Summary:
    return aggregate(effect.interference)


def _task_shift(effect: Effect) -> Summary | None:
    """The task whose mean share moved most; None without tasks."""
    if effect.task_shares is None:
        return None
    most = int(np.argmax(np.abs(effect.task_shares.mean(axis=0))))
    return aggregate(effect.task_shares[:, most])


def _text(summary: Summary | None, *, is_same: bool) -> str:
    if summary is None:
        return "-"
    if is_same:
        return _NOTHING
    if math.isnan(summary.mean):
        return "-"
    leaves_out_0 = summary.lower > 0.0 or summary.upper < 0.0
    return f"{100.0 * summary.mean:+.1f}" + ("*" if leaves_out_0 else "")


def _performance_text(effect: Effect) -> str:
    return _text(_share(effect), is_same=effect.is_same)


def _interference_text(effect: Effect) -> str:
    return _text(_interference(effect), is_same=effect.is_same)


def _task_text(effect: Effect) -> str:
    return _text(_task_shift(effect), is_same=effect.is_same)
