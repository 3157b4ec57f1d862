"""From the words after `score` to a question."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from metrics.scoring import ScoreForms, ScoreQuestion, score_question
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.cli.option_groups import WorldOptions
from swarm_forage_env.cli.printer import refusing
from swarm_forage_env.cli.scenario_options import described_fields, described_world, split_names

_OF_THE_BUDGET = ("horizon_s", "interval_s")


def asked_scores(policies: Sequence[str], described: WorldOptions, **options: Any) -> ScoreQuestion:
    """Return the question that the words ask.

    Args:
        policies: Names and files.
        described: Options of the world.
        options: Further ones of `score_question`.

    Raises:
        ConfigError: whatever is wrong with the words.
        ImportError: the policy is a model, and stable-baselines3 is not installed.
    """
    for word in described.settings:
        if word.partition("=")[0] in _OF_THE_BUDGET:
            raise ConfigError(f"Expected no --set {word}, which the budget sets; --horizon changes the length of runs.")
    density = described_fields(described).fields.get("density")
    world, caches = described_world(replace(described, horizon=None))
    with refusing():
        return score_question(policies, world, horizon_s=described.horizon, caches=caches, density=density, **options)


def score_forms(variants: str, forms: str, *, band: bool = False) -> ScoreForms:
    """Return the variants and forms that the words name, separated by commas.

    Raises:
        ConfigError: an unknown word, or none.
    """
    words: dict[str, Any] = {"variants": split_names(variants), "forms": split_names(forms)}
    with refusing():
        return ScoreForms(**words, band=band)
