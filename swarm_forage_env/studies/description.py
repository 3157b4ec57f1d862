"""What a study varies, and what the sets of the paper take, as tables."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from swarm_forage_env._internal.wording import counted
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.studies.study import StudySpec, value_words
from swarm_forage_env.studies.study_file import PAPER, left_out, left_out_words, load_study, set_names


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyDescription(Answer):
    """A study in words."""

    spec: StudySpec

    def sheets(self) -> Sequence[Sheet]:
        """Return one row per thing that is to be said."""
        spec = self.spec
        words = [value_words(axis.values) for axis in spec.axes]
        axes = [f"{axis.name}: {', '.join(of.values())}" for axis, of in zip(spec.axes, words, strict=True)]
        if spec.reference is not None:
            axes[-1] += f" (reference {words[-1][spec.reference]})"
        settings = ", ".join(f"{name} = {value}" for name, value in spec.settings.items())
        runs = f"{spec.n_runs:,} in {counted(len(spec.places), 'condition')}, {spec.robot_ticks:.3g} robot-ticks"
        rows = [
            ("study", f"{spec.name}: {spec.title}" if spec.title else spec.name),
            ("scenario", spec.scenario + (f", {settings}" if settings else "")),
            *(("wrapper", config.name) for config in spec.wrappers),
            ("policies", ", ".join(policy.label for policy in spec.policies)),
            *(("axis", axis) for axis in axes),
            ("rules", ", ".join(spec.rules)),
            ("budget", f"{spec.budget}: {counted(len(spec.seeds), 'seed')}, {spec.horizon_s:,g} s"),
            ("runs", runs),
            ("identity", spec.study_id),
        ]
        absent = left_out_words(spec)
        rows += [("left out", f"of the paper's values: {absent}")] if absent else []
        return (Sheet(rows=rows),)

    def to_mapping(self) -> dict[str, Any]:
        """Return the study, its numbers of conditions and runs, and what it leaves out of the paper's values."""
        spec = self.spec
        return {
            "study": spec.to_mapping(),
            "study_id": spec.study_id,
            "n_conditions": len(spec.places),
            "n_runs": spec.n_runs,
            "robot_ticks": spec.robot_ticks,
            "left_out": {axis: list(values) for axis, values in left_out(spec).items()},
        }


def describe(spec: StudySpec) -> StudyDescription:
    """Say what a study varies, and how many runs it makes."""
    return StudyDescription(spec=spec)


@dataclass(frozen=True, kw_only=True, eq=False)
class PaperSets(Answer):
    """The sets of the paper at one budget, under one of the rules."""

    budget: str
    specs: tuple[StudySpec, ...]

    def sheets(self) -> Sequence[Sheet]:
        """Return one row per set; of another budget than the paper's also what it leaves out."""
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
        return {"budget": self.budget, "sets": {spec.name: describe(spec).to_mapping() for spec in self.specs}}


def paper_sets(budget: str = PAPER) -> PaperSets:
    """List the experiment sets of the paper: what they take, and what a budget leaves out.

    Raises:
        ConfigError: they have no such budget.
    """
    return PaperSets(budget=budget, specs=tuple(load_study(name, budget, rules=("described",)) for name in set_names()))


def _numbers(specs: Sequence[StudySpec]) -> tuple[str, str, str]:
    """Experiments, runs and robot-ticks of studies together."""
    return (
        f"{sum(spec.n_experiments for spec in specs):,}",
        f"{sum(spec.n_runs for spec in specs):,}",
        f"{sum(spec.robot_ticks for spec in specs):.2e}",
    )
