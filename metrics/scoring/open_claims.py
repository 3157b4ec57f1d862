"""Claims that runs leave open, and after how many runs they would be decided if further ones were like those there are.

The forecast asks the rule itself: it repeats the runs that are there and looks again. After few runs it is rough; it
only says where to make the next ones.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from ..claims import Claim, Panel, PanelName
from ..claims.checking import RELATIVE, Statement, joined, read_otherwise
from ..claims.looks import as_if
from ..claims.outcomes import DECIDED, Answer, Outcome

OPEN = "undecided"


@dataclass(frozen=True, kw_only=True)
class OpenClaim:
    """A claim that is not decided yet, under one of the rules."""

    claim: Claim
    is_relative: bool
    """Whether its measures are read relative to performance."""
    ways: tuple[tuple[Statement, ...], ...]
    """Statements that need more runs; each of the tuples would do."""
    n_runs: int | None
    """The look at which it would be decided; None if at none."""

    @property
    def words(self) -> str:
        """Its name, and how it is read."""
        return f"{self.claim.name} relative" if self.is_relative else self.claim.name


def both_forms(claims: Iterable[Claim]) -> list[tuple[Claim, bool]]:
    """Return the claims as they are, and relative to performance where they can be read so; True marks the latter."""
    return [
        (read, is_relative)
        for claim in claims
        for read, is_relative in ((claim, False), (read_otherwise(claim).get(RELATIVE), True))
        if read is not None
    ]


def policies_of(statement: Statement, panels: Mapping[PanelName, Panel]) -> tuple[str, ...]:
    """Return the policies that a statement speaks of; all that its panels have if it names none."""
    return statement.policies or tuple(dict.fromkeys(name for at in statement.panels for name in panels[at].scores))


def open_claim(claim: Claim, is_relative: bool, panels: Mapping[PanelName, Panel]) -> OpenClaim | Answer:
    """Return a claim with its forecast, or its answer if it has one; "no scores" if there is nothing to judge.

    Args:
        claim: Of the paper, or as `read_otherwise` returns it.
        is_relative: What that is.
        panels: Of studies that are looked at several times, under the same rules.
    """
    if not claim.panels or any(name not in panels for name in claim.panels):
        return "no scores"
    now = [statement.outcome(panels, "intervals") for statement in claim.statements]
    if (answer := joined(claim, now).answer) != OPEN:
        return answer
    is_open = [outcome.answer == OPEN for outcome in now]
    statements = [statement for statement, still in zip(claim.statements, is_open, strict=True) if still]
    for look in _later_looks(statements, panels):
        grown = {name: as_if(panels[name], look) for statement in statements for name in statement.panels}
        then = [
            statement.outcome(grown, "intervals") if still else outcome
            for statement, outcome, still in zip(claim.statements, now, is_open, strict=True)
        ]
        answer = joined(claim, then).answer
        if answer in DECIDED:
            of_open = [outcome for outcome, still in zip(then, is_open, strict=True) if still]
            ways = _ways(claim, statements, of_open, answer)
            return OpenClaim(claim=claim, is_relative=is_relative, ways=ways, n_runs=look)
    return OpenClaim(claim=claim, is_relative=is_relative, ways=(tuple(statements),), n_runs=None)


def _later_looks(statements: Sequence[Statement], panels: Mapping[PanelName, Panel]) -> list[int]:
    """Looks that one of the statements has not had."""
    reached = [
        panels[name].reached.get(policy, 0)
        for statement in statements
        for name in statement.panels
        for policy in policies_of(statement, panels)
    ]
    looks = panels[statements[0].panels[0]].looks
    return [look for look in looks if look > min(reached)]


def _ways(
    claim: Claim, statements: Sequence[Statement], then: Sequence[Outcome], answer: str
) -> tuple[tuple[Statement, ...], ...]:
    """Which statements decide the claim: one that fails suffices where all must hold."""
    holds = answer == "supported"
    deciding = [
        statement
        for statement, outcome in zip(statements, then, strict=True)
        if outcome.answer in DECIDED and (outcome.answer == "supported") == holds
    ]
    if claim.needs == "all" and not holds and deciding:
        return tuple((statement,) for statement in deciding)
    return (tuple(deciding or statements),)
