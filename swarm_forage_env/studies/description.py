"""What a study varies, how many of its runs are done, and how many runs the sets of the paper need."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from swarm_forage_env._internal.wording import counted
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.runs.runner import Outcomes
from swarm_forage_env.runs.store import DONE, FAILED, MISSING, STATES, failure_file
from swarm_forage_env.studies.study import StudySpec
from swarm_forage_env.studies.study_file import PAPER, left_out, left_out_words, load_study, set_names
from swarm_forage_env.studies.study_folder import StudyFolder
from swarm_forage_env.studies.study_table import LOSS_COLUMNS, StudyTable


@dataclass(frozen=True, kw_only=True, eq=False)
class PaperSets(Answer):
    """The sets of the paper at one budget, under one of the rules."""

    budget: str
    specs: tuple[StudySpec, ...]

    def sheets(self) -> Sequence[Sheet]:
        """Return one row per set; for budgets other than the paper's, also what they leave out."""
        is_paper = self.budget == PAPER
        more = () if is_paper else ("runs each", "length, s")
        rows = []
        for spec in self.specs:
            words = (spec.title,)
            if not is_paper:
                words = (left_out_words(spec), str(len(spec.seeds)), f"{spec.horizon_s:,g}")
            rows.append((spec.name, *words, *_numbers([spec])))
        rows.append(("all", *[""] * (1 + len(more)), *_numbers(self.specs)))
        return (
            Sheet(
                title=f"experiment sets of the paper{'' if is_paper else f', budget {self.budget}'}",
                header=("set", "about" if is_paper else "left out", *more, "experiments", "runs", "robot-ticks"),
                rows=rows,
                notes=(f"of four controllers at budget {self.budget}, under each of the two rules",),
            ),
        )

    def to_mapping(self) -> dict[str, Any]:
        """Return the sets by name."""
        return {"budget": self.budget, "sets": {spec.name: _about(spec) for spec in self.specs}}


def paper_sets(budget: str = PAPER) -> PaperSets:
    """List the experiment sets of the paper: how many runs they make, and what a budget leaves out.

    Raises:
        ConfigError: the sets do not have this budget.
    """
    return PaperSets(budget=budget, specs=tuple(load_study(name, budget, rules=("described",)) for name in set_names()))


def _about(spec: StudySpec) -> dict[str, Any]:
    return {
        "study": spec.to_mapping(),
        "study_id": spec.study_id,
        "n_conditions": len(spec.places),
        "n_runs": spec.n_runs,
        "robot_ticks": spec.robot_ticks,
        "left_out": {axis: list(values) for axis, values in left_out(spec).items()},
    }


def _numbers(specs: Sequence[StudySpec]) -> tuple[str, str, str]:
    """Experiments, runs and robot-ticks of studies together."""
    return (
        f"{sum(spec.n_experiments for spec in specs):,}",
        f"{sum(spec.n_runs for spec in specs):,}",
        f"{sum(spec.robot_ticks for spec in specs):.2e}",
    )


FAILURES_SHOWN = 10
"""Number of failed runs in a printed list; the packed file and `to_mapping` have all of them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyStatus(Answer):
    """Which runs of a study are done, failed and missing."""

    table: StudyTable

    @property
    def is_complete(self) -> bool:
        """Whether every run is done."""
        return all(state.is_complete for state in self.table.place_states())

    @property
    def headline(self) -> str:
        """The study, and how many runs are in which state."""
        spec = self.table.spec
        totals = [sum(state.n_runs[name] for state in self.table.place_states()) for name in STATES]
        return f"{spec.name}, budget {spec.budget}: {_counts(totals)}"

    def sheets(self) -> Sequence[Sheet]:
        """Return how many runs are in which state, the conditions that are not complete, and failed runs."""
        spec, versions, states = self.table.spec, self.table.versions, self.table.place_states()
        left = [state for state in states if not state.is_complete]
        lines = [f"{len(states) - len(left):,} of {counted(len(states), 'condition')} complete"]
        if spec.looks:
            lines.append(f"Runs are made until claims are decided, looks after {', '.join(map(str, spec.looks))}.")
        if len(versions) > 1:
            lines.append(f"The runs were made by {len(versions)} versions or commits of the packages.")
        sheets = [Sheet(title=self.headline, notes=lines)]
        if left:
            shown = spec.place_words()
            rows = [(*shown[state.place], *(str(state.n_runs[name]) for name in STATES)) for state in left]
            sheets.append(Sheet(header=("rules", "policy", *(axis.name for axis in spec.axes), *STATES), rows=rows))
        failures = self._failures()
        for row in failures[:FAILURES_SHOWN]:
            title = f"failed: {row['policy']}, seed {row['seed']}: {row['error']}"
            sheets.append(Sheet(title=title, notes=[f"  again: {row['rerun']}"]))
        if more := _more(len(failures)):
            sheets[-1] = Sheet(title=sheets[-1].title, notes=[*sheets[-1].notes, *more])
        return sheets

    def to_mapping(self) -> dict[str, Any]:
        """Return the states of all conditions, and all failed runs."""
        return {
            "study": self.table.spec.to_mapping(),
            "versions": list(self.table.versions),
            "conditions": self.table.places().to_dicts(),
            "failures": self._failures(),
        }

    def _failures(self) -> list[dict[str, Any]]:
        lost = self.table.frame.filter(self.table.frame["state"] == FAILED)
        return lost.select("rules", "policy", "seed", *LOSS_COLUMNS[1:]).to_dicts()


def status(table: StudyTable) -> StudyStatus:
    """Return which runs of a study are done, failed and missing, from the table that `read_study` returns."""
    return StudyStatus(table=table)


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyOutcome(Answer):
    """How the runs of one call ended."""

    outcomes: Outcomes
    folder: StudyFolder

    def sheets(self) -> Sequence[Sheet]:
        """Return how many runs are done, and how to make each failed run again."""
        files = [str(file) for file in self._failed()]
        lines = [f"  again, alone: swarm-forage rerun {file}" for file in files[:FAILURES_SHOWN]]
        numbers = self._numbers()
        whole = self.folder.study().n_runs
        lines += _more(len(files))
        lines += [f"The study in this folder has {whole:,} runs in all."] if whole > sum(numbers) else []
        return (Sheet(title=f"{_counts(numbers)}, in {self.folder.folder}", notes=lines),)

    def to_mapping(self) -> dict[str, Any]:
        """Return how many runs are in which state, and the files of the failed ones."""
        counts = dict(zip(STATES, self._numbers(), strict=True))
        return {"folder": str(self.folder.folder), "n_runs": counts, "failed": [str(file) for file in self._failed()]}

    def _failed(self) -> list[Any]:
        return [failure_file(self.folder.runs, run_id) for run_id in self.outcomes.failures]

    def _numbers(self) -> tuple[int, int, int]:
        """How many runs are in each of `STATES`: a call that ends leaves none out."""
        return self.outcomes.n_done, len(self.outcomes.failures), 0


def _more(n_failed: int) -> list[str]:
    return [f"  and {n_failed - FAILURES_SHOWN} more"] if n_failed > FAILURES_SHOWN else []


def _counts(numbers: Sequence[int]) -> str:
    done, failed, missing = numbers
    words = [f"{done:,} of {counted(sum(numbers), 'run')} {DONE}"]
    words += [f"{number:,} {state}" for state, number in ((FAILED, failed), (MISSING, missing)) if number]
    return ", ".join(words)
