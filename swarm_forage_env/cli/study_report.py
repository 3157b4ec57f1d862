"""What the commands of studies print."""

import json
from collections.abc import Sequence

from rich.table import Table

from swarm_forage_env._internal.wording import aligned, counted
from swarm_forage_env.cli.terminal import notes
from swarm_forage_env.runs.cost import calibrate, kind_of
from swarm_forage_env.runs.progress import duration
from swarm_forage_env.runs.runner import Outcomes
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import DONE, FAILED, MISSING, STATES
from swarm_forage_env.studies.study import StudySpec, value_words
from swarm_forage_env.studies.study_file import PAPER, left_out_words, load_study, set_names
from swarm_forage_env.studies.study_folder import StudyFolder, shard
from swarm_forage_env.studies.study_table import StudyTable

FAILURES_SHOWN = 10
"""Failed runs that are named; the packed file and `--json` have all."""


def table_of_sets(budget: str = PAPER) -> Table:
    """Return the sets of the paper with what they take at a budget, under one of the rules.

    Of another budget than the paper's it also has how many runs each condition has, how long they are, and which of the
    paper's values are left out.
    """
    table = Table(
        title=f"experiment sets of the paper{'' if budget == PAPER else f', budget {budget}'}",
        caption=f"of four controllers at budget {budget}, under each of the two rules",
    )
    table.add_column("set")
    table.add_column("about" if budget == PAPER else "left out")
    for name in () if budget == PAPER else ("runs each", "length, s"):
        table.add_column(name, justify="right")
    for name in ("experiments", "runs", "robot-ticks"):
        table.add_column(name, justify="right")
    totals = [0, 0, 0]
    for name in set_names():
        spec = load_study(name, budget, rules=("described",))
        numbers = [spec.n_experiments, spec.n_runs, spec.robot_ticks]
        totals = [total + number for total, number in zip(totals, numbers, strict=True)]
        words = (spec.title,)
        if budget != PAPER:
            words = (left_out_words(spec), str(len(spec.seeds)), f"{spec.horizon_s:,g}")
        table.add_row(spec.name, *words, *_numbers(numbers))
    table.add_section()
    table.add_row("all", *[""] * (1 if budget == PAPER else 3), *_numbers(totals))
    return table


def described(spec: StudySpec) -> str:
    """Return a study in words."""
    words = [value_words(axis.values) for axis in spec.axes]
    axes = [f"{axis.name}: {', '.join(of.values())}" for axis, of in zip(spec.axes, words, strict=True)]
    if spec.reference is not None:
        axes[-1] += f" (reference {words[-1][spec.reference]})"
    settings = ", ".join(f"{name} = {value}" for name, value in spec.settings.items())
    rows = [
        ("study", f"{spec.name}: {spec.title}" if spec.title else spec.name),
        ("scenario", spec.scenario + (f", {settings}" if settings else "")),
        *(("wrapper", config.name) for config in spec.wrappers),
        ("policies", ", ".join(policy.label for policy in spec.policies)),
        *(("axis", axis) for axis in axes),
        ("rules", ", ".join(spec.rules)),
        ("budget", f"{spec.budget}: {counted(len(spec.seeds), 'seed')}, {spec.horizon_s:,g} s"),
        ("runs", f"{spec.n_runs:,} in {counted(len(spec.places), 'condition')}, {spec.robot_ticks:.3g} robot-ticks"),
        ("identity", spec.study_id),
    ]
    absent = left_out_words(spec)
    rows += [("left out", f"of the paper's values: {absent}")] if absent else []
    return "\n".join(f"{name:<10}{words}" for name, words in rows)


def plan_report(spec: StudySpec, folder: StudyFolder, part: tuple[int, int], workers: int) -> str:
    """Return what is left to run and how long it takes, measured here for a moment."""
    planned = {run.run_id: run for run in shard(spec.plan.specs, *part)}
    states = folder.store.look_up(planned.values(), keep=False).states
    todo = {run_id: run for run_id, run in planned.items() if states[run_id] != DONE}
    aside = notes()
    costs = calibrate(todo.values(), tell=aside.print)
    labels = {run.run_id: place.policy for place in spec.places for run in spec.specs_of(place)}
    by_policy: dict[str, list[RunSpec]] = {}
    for run_id, run in todo.items():
        by_policy.setdefault(labels[run_id], []).append(run)
    by_policy["all"] = [*todo.values()]
    rows = [("policy", "runs", "robot-ticks", "core-hours")]
    for label, runs in by_policy.items():
        seconds = [costs[kind_of(run)].seconds(run) for run in runs]
        robot_ticks = sum(run.robot_ticks for run in runs)
        rows.append((label, f"{len(runs):,}", f"{robot_ticks:.3g}", _hours(sum(seconds))))
    seconds = [costs[kind_of(run)].seconds(run) for run in todo.values()]
    busy = min(workers, max(1, len(todo)))
    wall = duration(max(sum(seconds) / busy, *seconds, 0.0))
    shares = f", shard {part[0]} of {part[1]}" if part[1] > 1 else ""
    return "\n".join(
        [
            f"{spec.name}, budget {spec.budget}{shares}: {len(todo):,} of {len(planned):,} runs to do",
            *aligned(rows),
            f"about {wall} on {counted(busy, 'core')} as fast as this one is now, and some seconds to start",
        ]
    )


def _hours(seconds: float) -> str:
    """Hours with two digits behind the point; nobody plans with fewer than 36 s."""
    hours = seconds / 3600.0
    return f"{hours:,.2f}" if hours >= 0.01 or seconds == 0.0 else "<0.01"


def state_report(state: Outcomes, folder: StudyFolder) -> str:
    """Return what came of the runs; failed ones with the command that makes each again."""
    lines = [f"{_counts([state.count(name) for name in STATES])}, in {folder.folder}"]
    failed = [run_id for run_id, found in state.states.items() if found == FAILED]
    files = [folder.store.failure_path(run_id) for run_id in failed[:FAILURES_SHOWN]]
    return "\n".join([*lines, *(f"  again, alone: swarm-forage rerun {file}" for file in files), *_more(failed)])


def status_report(table: StudyTable) -> str:
    """Return how far a study is: all conditions that are not complete, and failed runs."""
    states = table.place_states()
    open_places = [state for state in states if not state.is_complete]
    spec = table.spec
    lines = [
        f"{spec.name}, budget {spec.budget}: {_counts([sum(s.n_runs[name] for s in states) for name in STATES])}",
        f"{len(states) - len(open_places):,} of {counted(len(states), 'condition')} complete",
    ]
    if len(table.versions) > 1:
        lines.append(f"The runs were made by {len(table.versions)} versions or commits of the packages.")
    if open_places:
        header = ("rules", "policy", *(axis.name for axis in spec.axes), *STATES)
        places = spec.place_words()
        rows = [(*places[state.place], *(str(state.n_runs[name]) for name in STATES)) for state in open_places]
        lines += ["", *aligned([header, *rows])]
    failures = table.frame.filter(table.frame["state"] == FAILED)
    for row in failures.head(FAILURES_SHOWN).iter_rows(named=True):
        lines += ["", f"failed: {row['policy']}, seed {row['seed']}: {row['error']}", f"  again: {row['rerun']}"]
    return "\n".join([*lines, *_more(failures["run_id"].to_list())])


def status_json(table: StudyTable) -> str:
    """Return the states of all conditions, and all failed runs, as a JSON document."""
    lost = table.frame.filter(table.frame["state"] == FAILED)
    failures = (
        lost.rename({"reading": "rules"})
        .select("run_id", "rules", "policy", "seed", "error", "traceback", "rerun")
        .to_dicts()
    )
    document = {
        "study": table.spec.to_mapping(),
        "versions": list(table.versions),
        "conditions": table.places().to_dicts(),
        "failures": failures,
    }
    return json.dumps(document, indent=1)


def _more(run_ids: Sequence[str]) -> list[str]:
    n_more = len(run_ids) - FAILURES_SHOWN
    return [f"  and {n_more} more"] if n_more > 0 else []


def _counts(numbers: Sequence[int]) -> str:
    done, failed, missing = numbers
    words = [f"{done:,} of {counted(sum(numbers), 'run')} {DONE}"]
    words += [f"{number:,} {state}" for state, number in ((FAILED, failed), (MISSING, missing)) if number]
    return ", ".join(words)


def _numbers(numbers: Sequence[int]) -> tuple[str, str, str]:
    experiments, runs, robot_ticks = numbers
    return f"{experiments:,}", f"{runs:,}", f"{robot_ticks:.2e}"
