"""A question: which runs it needs, and how their table answers it.

question = score_question(["crw"], "warehouse_small", budget="quick")
question.plan.specs                    # the runs, before any is made
print(question.ask(out="results"))     # makes the runs, or reads those that are there
"""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from swarm_forage_env.runs.plan import Plan, Table, run_plan

Found = TypeVar("Found")


@dataclass(frozen=True, kw_only=True, eq=False)
class Question(Generic[Found]):
    """Runs, and what they answer."""

    plan: Plan
    answer: Callable[[Table], Found]
    """From the table of the runs to the answer, which says which runs failed."""

    def ask(
        self,
        *,
        out: str | Path | None = None,
        jobs: int | None = None,
        executor: Executor | None = None,
        progress: bool = True,
    ) -> Found:
        """Make the runs and return the answer; arguments and errors as in `swarm_forage_env.runs.plan.run_plan`."""
        return self.answer(run_plan(self.plan, out=out, jobs=jobs, executor=executor, progress=progress))
