"""A question: which runs it needs, and how their table answers it. Everything that is asked of policies is one.

    question = score_question(["crw"], "warehouse_small", budget="quick")
    found = ask(question, out="results")          # makes the runs, or reads those that are there
    print(found)

A new question is a dataclass with `plan` and `answer`, and a function that writes the plan. Its answer is best an
`swarm_forage_env.sheet.Answer`, which has all forms.
"""

from abc import ABC, abstractmethod
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from swarm_forage_env.runs.plan import Plan, Table, run_plan

Found = TypeVar("Found")


@dataclass(frozen=True, kw_only=True, eq=False)
class Question(ABC, Generic[Found]):
    """Runs, and what they answer."""

    plan: Plan

    def make_runs(
        self,
        *,
        out: str | Path | None = None,
        executor: Executor | None = None,
        jobs: int | None = None,
        progress: bool = False,
    ) -> Table:
        """Make the runs that the answer needs; arguments and errors as in `swarm_forage_env.runs.plan.run_plan`."""
        return run_plan(self.plan, out=out, executor=executor, jobs=jobs, progress=progress)

    @abstractmethod
    def answer(self, table: Table) -> Found:
        """Return the answer that the runs give; it says which failed."""


def ask(
    question: Question[Found],
    *,
    out: str | Path | None = None,
    jobs: int | None = None,
    executor: Executor | None = None,
    progress: bool = True,
) -> Found:
    """Make the runs of a question and return its answer.

    Args:
        question: What is asked.
        out: Folder for run records. Runs that it already holds are not repeated, so you can repeat an interrupted call.
        jobs: Processes; default one per core.
        executor: Runs the work instead, for example Dask's `client.get_executor()`.
        progress: Show progress and an estimate on stderr.

    Raises:
        KeyboardInterrupt: Ctrl-C; finished runs are in `out`.
    """
    return question.answer(question.make_runs(out=out, jobs=jobs, executor=executor, progress=progress))
