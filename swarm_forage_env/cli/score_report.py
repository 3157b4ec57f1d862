"""The commands `swarm-forage score` and `compare`: from words to a plan, and what they have to say."""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from metrics.comparison import Comparison, compare_tables
from metrics.plots import draw_scores
from metrics.score_table import ScoreTable, aligned, counted
from metrics.scoring import ScoringPlan, plan_scores, score_curves
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.cli.report import estimate
from swarm_forage_env.cli.scenario_options import ScenarioOptions, build_scenario, estimated_seconds, split_names
from swarm_forage_env.study.store import RunStore

_OF_THE_BUDGET = ("horizon_s", "interval_s")


@dataclass(frozen=True, kw_only=True, slots=True)
class ScoreOptions:
    """The options of both commands that are not about the world."""

    policies: str
    """Names and files, separated by commas."""
    measures: str | None = None
    budget: str = "standard"
    seeds: int | None = None
    horizon: float | None = None


def build_plan(
    world: ScenarioOptions, options: ScoreOptions, *, at_least: int = 1, at_most: int | None = None
) -> ScoringPlan:
    """Return what the words ask for.

    Args:
        world: Of which the horizon is left out.
        options: The rest.
        at_least: How many policies there must be.
        at_most: How many there may be, None = any number.

    Raises:
        ConfigError: whatever is wrong with the words.
        ImportError: a model, and stable-baselines3 is not installed.
    """
    for word in world.settings:
        if word.partition("=")[0] in _OF_THE_BUDGET:
            raise ConfigError(f"Expected no --set {word}, which the budget sets; --horizon changes the length of runs.")
    names = split_names(options.policies)
    if len(names) < at_least:
        raise ConfigError(f"Expected {at_least} or more policies to compare, separated by commas, got {names[0]!r}.")
    if at_most is not None and len(names) > at_most:
        raise ConfigError(f"Expected one policy to score, got {', '.join(names)}; compare scores more than one.")
    scenario, caches = build_scenario(world)
    try:
        return plan_scores(
            names,
            scenario,
            measures=None if options.measures is None else split_names(options.measures),
            budget=options.budget,
            seeds=options.seeds,
            horizon_s=options.horizon,
            caches=caches,
        )
    except ValueError as error:  # of a policy, a measure, a budget or a file
        raise ConfigError(str(error)) from error


def tables_of_file(path: Path, measures: str | None) -> tuple[ScoreTable, ...]:
    """Return the scores of a file of curves; raises ConfigError whatever is wrong with it."""
    try:
        return score_curves(path, measures=None if measures is None else split_names(measures))
    except ValueError as error:
        raise ConfigError(str(error)) from error


def plan_text(plan: ScoringPlan, store: RunStore, jobs: int) -> str:
    """Return the planned experiments as a table with an estimate."""
    todo = [spec for spec in plan.specs if spec.run_id not in store]
    left = Counter((spec.criterion, spec.criterion_value, spec.scenario.robots.n_robots) for spec in todo)
    rows: list[Sequence[str]] = [("varied", "value", "robots", "objects", "seconds", "runs", "to do")]
    for experiment in plan.experiments:
        world = experiment.scenario
        n_robots = world.robots.n_robots
        rows.append(
            (
                experiment.criterion,
                f"{experiment.value:g}",
                str(n_robots),
                str(world.objects.n_objects),
                f"{world.horizon_s:g}",
                str(len(plan.seeds) * len(plan.contestants)),
                str(left[experiment.criterion, experiment.value, n_robots]),
            )
        )
    seconds = estimated_seconds(todo, jobs)
    return "\n".join(
        [
            f"{', '.join(contestant.label for contestant in plan.contestants)} in {plan.scenario.name}, budget "
            f"{plan.budget_name}, {counted(len(plan.seeds), 'seed')}, records go to {store.folder}",
            *aligned(rows),
            f"{counted(len(plan.specs), 'run')}, {len(todo):,} to do" + estimate(seconds, jobs, any_left=bool(todo)),
        ]
    )


def plan_json(plan: ScoringPlan, store: RunStore, jobs: int) -> str:
    """Return the planned runs as a JSON document."""
    todo = [spec for spec in plan.specs if spec.run_id not in store]
    runs = [{"run_id": spec.run_id, "stored": spec.run_id in store, "spec": spec.to_mapping()} for spec in plan.specs]
    document = {
        "policies": [contestant.label for contestant in plan.contestants],
        "measures": list(plan.measures),
        "out": str(store.folder),
        "estimated_wall_s": estimated_seconds(todo, jobs),
        "runs": runs,
    }
    return json.dumps(document, indent=1)


def json_text(tables: Sequence[ScoreTable], comparison: Comparison | None, picture: Path | None) -> str:
    """Return everything as a JSON document; numbers that do not exist are null."""
    document = {"tables": [table.to_mapping() for table in tables]} if comparison is None else comparison.to_mapping()
    return json.dumps({**document, "picture": None if picture is None else str(picture)}, indent=1)


def compared(tables: Sequence[ScoreTable]) -> Comparison | None:
    """Return the comparison of two or more tables."""
    return compare_tables(tables) if len(tables) > 1 else None


def draw(tables: Sequence[ScoreTable], path: Path) -> Path | None:
    """Draw the tables; None where there is nothing to draw.

    Raises:
        ImportError: matplotlib is not installed.
    """
    if not any(score.per_seed for table in tables for score in table.scores):
        return None
    path.parent.mkdir(parents=True, exist_ok=True)
    draw_scores(tables, path)
    return path
