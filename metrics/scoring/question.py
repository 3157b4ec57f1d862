"""A question: which runs it needs, and how their table answers it.

question = score_question(["crw"], "warehouse_small", budget="quick")
question.plan.specs                                                  # the runs, before any is made
print(question.answer(run_plan(question.plan, out="results")))       # makes them, or reads those that are there
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from swarm_forage_env.runs.plan import Plan, Table

Found = TypeVar("Found")


@dataclass(frozen=True, kw_only=True, eq=False)
class Question(Generic[Found]):
    """Runs, and what they answer."""

    plan: Plan
    answer: Callable[[Table], Found]
    """From the table of the runs to the answer, which says which runs failed."""
