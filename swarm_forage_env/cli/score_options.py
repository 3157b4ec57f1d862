"""From the words after `score` to a question."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from metrics.scoring import ScoreForms, ScoreQuestion, score_curves, score_question
from metrics.scoring.table import ScoreTable
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.cli.option_groups import WorldOptions
from swarm_forage_env.cli.scenario_options import described_fields, described_world, split_names

_OF_THE_BUDGET = ("horizon_s", "interval_s")


@dataclass(frozen=True, kw_only=True, slots=True)
class ScoreOptions:
    """The options that are not about the world."""

    policies: tuple[str, ...]
    """Names and files."""
    measures: str | None = None
    variants: str = "corrected"
    forms: str = "marginal"
    budget: str = "standard"
    seeds: int | None = None
    disturbance: str = "throttle"


def build_question(described: WorldOptions, options: ScoreOptions) -> ScoreQuestion:
    """Return the question that the options describe.

    Args:
        described: Options of the world.
        options: The other options.

    Raises:
        ConfigError: whatever is wrong with the words.
        ImportError: the policy is a model, and stable-baselines3 is not installed.
    """
    for word in described.settings:
        if word.partition("=")[0] in _OF_THE_BUDGET:
            raise ConfigError(f"Expected no --set {word}, which the budget sets; --horizon changes the length of runs.")
    fields = described_fields(described).fields
    world, caches = described_world(replace(described, horizon=None))
    forms = score_forms(options.variants, options.forms)
    try:
        return score_question(
            options.policies,
            world,
            measures=None if options.measures is None else split_names(options.measures),
            budget=options.budget,
            seeds=options.seeds,
            horizon_s=described.horizon,
            caches=caches,
            density=fields.get("density"),
            disturbance=options.disturbance,
            forms=forms,
        )
    except ValueError as error:  # of a policy, a measure, a budget or a file
        raise ConfigError(str(error)) from error


def score_forms(variants: str, forms: str) -> ScoreForms:
    """Return the variants and forms that the words name, separated by commas.

    Raises:
        ConfigError: an unknown word, or none.
    """
    words: dict[str, Any] = {"variants": tuple(split_names(variants)), "forms": tuple(split_names(forms))}
    try:
        return ScoreForms(**words)
    except ValueError as error:
        raise ConfigError(str(error)) from error


def tables_of_file(
    path: Path, measures: str | None, performance: str | None, forms: ScoreForms
) -> tuple[ScoreTable, ...]:
    """Return the scores of a file of curves; raises ConfigError whatever is wrong with it."""
    wanted = None if measures is None else split_names(measures)
    try:
        return score_curves(path, measures=wanted, performance=performance, forms=forms)
    except ValueError as error:
        raise ConfigError(str(error)) from error
