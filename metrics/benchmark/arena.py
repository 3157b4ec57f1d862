"""An arena for programs: what one candidate of a search is worth, in about two seconds, and why.

    feedback = evaluate("my_module.py:MyPolicy")
    feedback.score, feedback.error
    print(feedback)                              # the same in words

Candidates run in the worlds to train in, shorter and with other seeds than entries. Their faults are feedback, too.
"""

import multiprocessing
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.python_files import classes_of
from swarm_forage_env.runs.plan import Plan, run_plan
from swarm_forage_env.runs.record import Record
from swarm_forage_env.runs.spec import policy_specs

from ..controllers import PAPER_POLICIES
from ..scoring.limits import share_of_limit
from .protocol import load_protocol
from .standing import best_of

TIME = {"search": "n_searching", "carry": "n_homing", "handle": "n_handling"}
"""What robots do with their time -> the column that counts them."""


@dataclass(frozen=True, kw_only=True)
class InWorld:
    """What a program did in a world; means over its runs."""

    world: str
    performance: float
    """Per 1,000 s."""
    ratio: float
    """To the best scripted controller in whole runs, which begin as short ones do: with empty robots near the nest."""
    of_limit: float | None
    """Share of `metrics.scoring.limits.limit_of`; None where no limit is known."""
    later: float
    """Performance of the second half over that of the first; a swarm that jams or has lost its sources is below 1."""
    time: dict[str, float]
    """Shares of robot time: those of `TIME`, and `avoid`, which is interference."""

    def __str__(self) -> str:
        limit = "" if self.of_limit is None else f", {self.of_limit:.0%} of the limit"
        time = ", ".join(f"{what} {share:.0%}" for what, share in self.time.items())
        return (
            f"{self.world}: {self.performance:.1f} per 1,000 s, {self.ratio:.2f} of the best scripted{limit}.\n"
            f"  Robots {time} of their time. The second half brought {self.later:.2f} of the first."
        )


@dataclass(frozen=True, kw_only=True)
class Feedback:
    """What a program is worth, and why."""

    score: float
    """Mean of its ratios; 0 for a program with an error."""
    worlds: tuple[InWorld, ...] = ()
    error: str = ""
    """What is wrong, with line, robot and tick where these are known."""

    def __str__(self) -> str:
        if self.error:
            return f"score 0: {self.error}"
        return "\n".join([f"score {self.score:.3f}; 1 is as good as the best scripted", *map(str, self.worlds)])


def evaluate(
    program: Any, *, horizon_s: float = 800.0, seeds: Sequence[int] = (1,), limit_s: float | None = None
) -> Feedback:
    """Run a program in the worlds to train in. It can do all that Python can: give no stranger's to your machine.

    Args:
        program: The text of a Python file, whose last class runs; or a policy as all runs take it, `FILE.py:Class`.
        horizon_s: Length of a run. The default costs about two seconds of a processor, its compiling included.
        seeds: Of the runs in each world; those of the benchmark are from 9,000 to 10,000.
        limit_s: Seconds after which a program is stopped; it then has a process of its own.
    """
    if limit_s is None:
        return _evaluated(program, horizon_s, seeds)
    ours, theirs = multiprocessing.Pipe(duplex=False)
    process = multiprocessing.Process(target=_send, args=(theirs, program, horizon_s, seeds), daemon=True)
    process.start()
    theirs.close()
    try:
        return ours.recv() if ours.poll(limit_s) else Feedback(score=0.0, error=f"not ready after {limit_s:g} s")
    except EOFError:
        return Feedback(score=0.0, error="its process ended before it had an answer")
    finally:
        process.kill()


def _send(pipe: Any, *arguments: Any) -> None:
    pipe.send(_evaluated(*arguments))


def _evaluated(program: Any, horizon_s: float, seeds: Sequence[int]) -> Feedback:
    if not (isinstance(program, str) and "\n" in program):
        return _run(program, horizon_s, seeds)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "program.py"
        file.write_text(program, encoding="utf-8")
        try:
            name = classes_of(file)[-1]
        except (ConfigError, IndexError) as error:
            told = f"expected Python with a class, got: {error}"
            return Feedback(score=0.0, error=told.replace(str(file), file.name))
        found = _run(f"{file}:{name}", horizon_s, seeds)
        return replace(found, error=found.error.replace(str(file), file.name))


def _run(program: Any, horizon_s: float, seeds: Sequence[int]) -> Feedback:
    protocol = load_protocol()
    halves = {"horizon_s": horizon_s, "interval_s": horizon_s / 2.0}
    short = [replace(world, scenario=replace(world.scenario, **halves)) for world in protocol.training]
    try:
        table = run_plan(Plan.product(policy_specs([program]), short, seeds), jobs=1)
    except (ValueError, TypeError) as error:
        return Feedback(score=0.0, error=str(error))
    for failure in table.failures.values():
        return Feedback(score=0.0, error=f"{failure.spec.scenario.name}: {failure.error}")
    best = best_of(PAPER_POLICIES, protocol.training, protocol)
    found = tuple(map(_in_world, map(table.of, table.plan.conditions), best.tolist()))
    return Feedback(score=float(np.mean([each.ratio for each in found])), worlds=found)


def _in_world(records: Sequence[Record], best: float) -> InWorld:
    world = records[0].spec.world
    performance = float(np.mean([record.per_1000_s("performance") for record in records]))
    first, second = np.sum([record["performance"] for record in records], axis=0)
    at_work = sum(record["n_active"].sum() for record in records)
    shares = {what: sum(record[column].sum() for record in records) / at_work for what, column in TIME.items()}
    avoiding = float(np.mean([record["interference_fraction"].mean() for record in records]))
    return InWorld(
        world=world.name.removeprefix("training: "),
        performance=performance,
        ratio=performance / best,
        of_limit=share_of_limit(world, performance * records[0].horizon_s / 1000.0),
        later=float(second / first) if first else 0.0,
        time={**{what: float(share) for what, share in shares.items()}, "avoid": avoiding},
    )
