"""Two studies of the same conditions held against each other: do their runs differ beyond chance?

A change of the code may change the last bits of every run and leave the science as it is. So runs are compared first
bit by bit, and where they differ, by tests of their means.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from scipy.special import stdtr, stdtrit  # pyright: ignore[reportMissingTypeStubs]  (scipy ships none)

from swarm_forage_env._internal.wording import aligned, counted, limits, number, percent, plain
from swarm_forage_env.runs.answer import Answer, Sheet

from ..checks import CurveError
from ..curves import FloatArray
from ..significance import ROUNDING, SIGNIFICANT, holm

if TYPE_CHECKING:
    from swarm_forage_env.studies.study import Place
    from swarm_forage_env.studies.study_table import StudyTable

ROWS_SHOWN = 20
"""Differences that are listed, and conditions that are not compared; `to_mapping` has all."""
COLUMNS = ("performance", "interference_fraction", "n_carrying", "cache_pickups")
"""Columns that are compared by default: what is achieved, the time lost, and what robots do. Each run counts with the
mean over its intervals (our choice: few, so that the correction for many tests stays small)."""
TEST = (
    "Means over the intervals of a run are compared. Studies of the same seeds are paired by seed, others by Welch's "
    "test. A line is all conditions of a policy under the same rules that can be tested, and identical ones, each in "
    "shares of its own mean, so that a small change everywhere is found, too. * = significant: p at most 0.05 after "
    "Holm's correction over all tests of conditions and lines together. Intervals are Student's, 95 %."
)
"""How studies are compared, as a text for readers."""
STATE_WORDS: "dict[State, str]" = {
    "identical": "identical to the last bit",
    "alike": "alike: other bits, no difference beyond chance",
    "different": "different",
    "open": "open: other bits, and too few runs to say more",
}
"""State of a condition -> what it says."""
_LEVEL = 0.975
"""Quantile of the upper bound of a 95 % interval."""

State: TypeAlias = Literal["identical", "alike", "different", "open"]
"""Of a condition: same seeds and every recorded number the same; no column differs significantly; one does; the numbers
differ and there are too few runs to say more."""


@dataclass(frozen=True, kw_only=True)
class Shift:
    """The mean of a column in the second study less that in the first."""

    column: str
    words: tuple[str, ...]
    """Rules, policy and the value on each axis; of a line rules and policy alone."""
    first: float
    """Mean of the first study; NaN for a line."""
    second: float
    difference: float
    """Mean difference; of a line the mean over its conditions, as a share of the mean of both studies."""
    lower: float
    """Bounds of its 95 % interval; NaN where there is none."""
    upper: float
    n_first: int
    """Runs."""
    n_second: int
    is_paired: bool
    p: float
    """Two-sided; NaN where there are too few runs."""
    variance: float
    """Of the difference."""
    freedom: float
    """Degrees of freedom of the variance."""
    p_holm: float = math.nan
    """After Holm's correction over all tests of the two studies."""

    @property
    def scale(self) -> float:
        """Mean of both studies; what a line is measured in shares of."""
        return 0.5 * (self.first + self.second)

    @property
    def is_significant(self) -> bool:
        """Whether p_holm is at most `SIGNIFICANT`."""
        return self.p_holm <= SIGNIFICANT

    def to_mapping(self) -> dict[str, Any]:
        """Return it as plain values; numbers that JSON does not have are None."""
        numbers = ("first", "second", "difference", "lower", "upper", "p", "p_holm")
        return {
            "column": self.column,
            "place": list(self.words),
            **{name: plain(getattr(self, name)) for name in numbers},
            "n_first": self.n_first,
            "n_second": self.n_second,
            "paired": self.is_paired,
            "significant": self.is_significant,
        }


@dataclass(frozen=True, kw_only=True)
class PlaceDiff:
    """A condition of both studies."""

    place: "Place"
    words: tuple[str, ...]
    """Rules, policy and the value on each axis, as they are shown."""
    n_identical: int
    """Runs of the same seed with the same numbers in all columns of both studies."""
    is_same: bool
    """Whether all runs on both sides are the same to the last bit."""
    shifts: tuple[Shift, ...]
    """One per column that was tested; none for an identical condition."""

    @property
    def state(self) -> State:
        """What it says."""
        if self.is_same:
            return "identical"
        if all(math.isnan(shift.p) for shift in self.shifts):
            return "open"
        return "different" if any(shift.is_significant for shift in self.shifts) else "alike"


@dataclass(frozen=True, kw_only=True)
class Lacking:
    """A condition that is not compared, since not both studies have finished runs of it."""

    place: "Place"
    words: tuple[str, ...]
    """Rules, policy and the value on each axis, as they are shown."""
    why: str


@dataclass(frozen=True, kw_only=True)
class StudyDiff(Answer):
    """How two studies differ."""

    axes: tuple[str, ...]
    """Names of what both vary."""
    places: tuple[PlaceDiff, ...]
    """Conditions that both have, with runs in both."""
    lines: tuple[Shift, ...]
    """All conditions of a policy under the same rules together, per column; none where all of them are identical."""
    lacking: tuple[Lacking, ...]
    """Conditions that cannot be compared."""
    settings: tuple[str, ...]
    """What differs between the two studies apart from their runs, in words."""

    def count(self, state: State) -> int:
        """Return how many conditions are in a state."""
        return sum(place.state == state for place in self.places)

    @property
    def differs(self) -> bool:
        """Whether a condition or a line differs significantly, or a condition is open or not compared."""
        return (
            bool(self.lacking)
            or any(place.state in ("different", "open") for place in self.places)
            or any(line.is_significant for line in self.lines)
        )

    @property
    def shifts(self) -> tuple[Shift, ...]:
        """All tests, those of lines first."""
        return (*self.lines, *(shift for place in self.places for shift in place.shifts))

    def sheets(self) -> Sequence[Sheet]:
        """Return how many conditions differ, the tests that say so, and what was not compared."""
        counts = [(str(self.count(state)), words) for state, words in STATE_WORDS.items() if self.count(state)]
        notes = [f"  {row}" for row in aligned(counts)] if counts else []
        notes += [f"not the same: {text}" for text in self.settings]
        sheets = [Sheet(title=f"{counted(len(self.places), 'condition')} compared", notes=notes)]
        where = ("rules", "policy", *self.axes)
        of_places = [shift for place in self.places for shift in place.shifts if shift.is_significant]
        if of_places:
            header = (*where, "column", "A", "B", "B - A", "95 % interval", "runs", "p (Holm)")
            rows = [_row(shift) for shift in sorted(of_places, key=lambda shift: shift.p)]
            sheets.append(Sheet(header=header, rows=rows[:ROWS_SHOWN], notes=_more(len(rows))))
        if self.lines:
            title = "all conditions of a policy together, in shares of each condition's mean:"
            header = ("rules", "policy", "column", "B - A", "95 % interval", "p (Holm)")
            sheets.append(Sheet(title=title, header=header, rows=[_line_row(line) for line in self.lines]))
        if self.lacking:
            title = f"{counted(len(self.lacking), 'condition')} not compared:"
            rows = [(*one.words, one.why) for one in self.lacking]
            sheets.append(Sheet(title=title, header=(*where, "why"), rows=rows[:ROWS_SHOWN], notes=_more(len(rows))))
        return [*sheets, *([Sheet(title=TEST)] if self.shifts else [])]

    def to_mapping(self) -> dict[str, Any]:
        """Return everything as plain values, ready for JSON."""
        return {
            "differs": self.differs,
            "test": TEST,
            "settings": list(self.settings),
            "conditions": [
                {
                    "place": list(place.words),
                    "state": place.state,
                    "n_identical": place.n_identical,
                    "shifts": [shift.to_mapping() for shift in place.shifts],
                }
                for place in self.places
            ],
            "lines": [shift.to_mapping() for shift in self.lines],
            "lacking": [{"place": list(one.words), "why": one.why} for one in self.lacking],
        }


def _row(shift: Shift) -> tuple[str, ...]:
    runs = str(shift.n_first) if shift.n_first == shift.n_second else f"{shift.n_first}, {shift.n_second}"
    means = (number(value) for value in (shift.first, shift.second, shift.difference))
    return (*shift.words, shift.column, *means, limits(shift.lower, shift.upper), runs, f"{shift.p_holm:.2g}")


def _line_row(shift: Shift) -> tuple[str, ...]:
    mark = " *" if shift.is_significant else ""
    between = f"{percent(shift.lower)} to {percent(shift.upper)}"
    return (*shift.words, shift.column, percent(shift.difference), between, f"{shift.p_holm:.2g}{mark}")


def _more(n_rows: int) -> list[str]:
    return [f"and {n_rows - ROWS_SHOWN:,} more; --json has all"] if n_rows > ROWS_SHOWN else []


def diff(first: "StudyTable", second: "StudyTable", columns: Sequence[str] = COLUMNS) -> StudyDiff:
    """Say which conditions of two studies differ beyond chance.

    Conditions are those of the same rules, policy and values. Only finished runs count.

    Args:
        first: From `swarm_forage_env.read_study`.
        second: The other, with the same axes, horizon and intervals.
        columns: Recorded columns whose means are tested; the comparison of bits takes all.

    Raises:
        CurveError: studies that have no condition with runs in common, other axes or times, or a column that neither
            has.
    """
    _check_alike(first, second)
    unknown = [name for name in columns if name not in first.frame.columns or name not in second.frame.columns]
    if unknown:
        raise CurveError(
            f"Expected columns that both studies have, got {unknown[0]!r}; see 'swarm-forage list columns'."
        )
    places: list[PlaceDiff] = []
    lacking: list[Lacking] = []
    for place, words in first.spec.place_words(second.spec).items():
        why = _why_not(place, first, second)
        if why:
            lacking.append(Lacking(place=place, words=words, why=why))
            continue
        n_identical, is_same = _identical(place, first, second)
        tests = [] if is_same else [_tested(place, words, column, first, second) for column in columns]
        shifts = tuple(test for test in tests if test is not None)
        places.append(PlaceDiff(place=place, words=words, n_identical=n_identical, is_same=is_same, shifts=shifts))
    if not places:
        raise CurveError("Expected two studies with finished runs of the same conditions, got none that both have.")
    lines = _lines(places, columns)
    every = [*lines, *(shift for one in places for shift in one.shifts)]
    p_values = iter(holm(np.array([shift.p for shift in every])).tolist())

    def corrected(shifts: tuple[Shift, ...]) -> tuple[Shift, ...]:
        return tuple(replace(shift, p_holm=next(p_values)) for shift in shifts)

    return StudyDiff(
        axes=tuple(axis.name for axis in first.spec.axes),
        lines=corrected(lines),  # before the places, as in `every`
        places=tuple(replace(one, shifts=corrected(one.shifts)) for one in places),
        lacking=tuple(lacking),
        settings=_settings(first, second),
    )


def _check_alike(first: "StudyTable", second: "StudyTable") -> None:
    for what in ("axes", "horizon_s", "interval_s"):
        words = [
            ", ".join(axis.name for axis in table.spec.axes) if what == "axes" else f"{getattr(table.spec, what):g}"
            for table in (first, second)
        ]
        if words[0] != words[1]:
            raise CurveError(f"Expected two studies of the same {what}, got {words[0]} and {words[1]}.")


def _why_not(place: "Place", first: "StudyTable", second: "StudyTable") -> str:
    tables = {"first": first, "second": second}
    for name, table in tables.items():
        if place not in table.spec.places:
            return f"the {name} study does not have it"
    without = [name for name, table in tables.items() if not table.curves(place, "performance")[0]]
    if len(without) == 2:
        return "neither study has a finished run of it"
    return f"the {without[0]} study has no finished run of it" if without else ""


def _identical(place: "Place", first: "StudyTable", second: "StudyTable") -> tuple[int, bool]:
    """Runs of the same seed with the same numbers, and whether that is all of them on both sides."""
    names = [name for name, kind in first.frame.schema.items() if kind.is_numeric() and name in second.frame.columns]
    (seeds, mine), (others, theirs) = (table.curves(place, *names) for table in (first, second))
    shared = [seed for seed in seeds if seed in others]
    same = [
        all(
            np.array_equal(mine[name][seeds.index(seed)], theirs[name][others.index(seed)])
            for name in mine
            if name in theirs and name != "cell"
        )
        for seed in shared
    ]
    return sum(same), seeds == others and all(same) and mine.keys() == theirs.keys()


def _tested(
    place: "Place", words: tuple[str, ...], column: str, first: "StudyTable", second: "StudyTable"
) -> Shift | None:
    """The test of one column; None where runs of this condition do not have it."""
    (seeds, mine), (others, theirs) = (table.curves(place, column) for table in (first, second))
    if column not in mine or column not in theirs:
        return None
    a, b = (np.atleast_1d(curves[column].mean(axis=-1)) for curves in (mine, theirs))
    is_paired = seeds == others
    difference = float((b - a).mean()) if is_paired else float(b.mean() - a.mean())
    variance, freedom = _variance_of_difference(a, b, is_paired=is_paired)
    p, half = _test(difference, variance, freedom, scale=float(np.abs([*a, *b]).max()), n_runs=len({*seeds, *others}))
    return Shift(
        column=column,
        words=words,
        first=float(a.mean()),
        second=float(b.mean()),
        difference=difference,
        lower=difference - half,
        upper=difference + half,
        n_first=a.size,
        n_second=b.size,
        is_paired=is_paired,
        p=p,
        variance=variance,
        freedom=freedom,
    )


def _variance_of_difference(a: FloatArray, b: FloatArray, *, is_paired: bool) -> tuple[float, float]:
    """Variance of the mean difference and its degrees of freedom (Welch 1947); NaN for fewer than two runs."""
    if min(a.size, b.size) < 2:
        return math.nan, math.nan
    if is_paired:
        return float((b - a).var(ddof=1)) / a.size, a.size - 1.0
    return _sum_of_variances([(float(x.var(ddof=1)) / x.size, x.size - 1.0) for x in (a, b)])


def _sum_of_variances(parts: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Variance of a sum, and its degrees of freedom after Welch and Satterthwaite."""
    variance = sum(part for part, _ in parts)
    if not variance > 0.0:
        return variance, min(freedom for _, freedom in parts)
    return variance, variance**2 / sum(part**2 / freedom for part, freedom in parts if part > 0.0)


def _test(difference: float, variance: float, freedom: float, *, scale: float, n_runs: int) -> tuple[float, float]:
    """Two-sided p value that a mean difference is zero, and half of its interval.

    Without any scatter Student's t does not exist; the value is then 1 for no difference, else that of the sign test,
    2^(1 - runs).
    """
    if math.isnan(variance):
        return math.nan, math.nan
    error = math.sqrt(variance)
    if error <= ROUNDING * scale:
        return (1.0 if abs(difference) <= ROUNDING * scale else 2.0 ** (1 - n_runs)), 0.0
    return 2.0 * float(stdtr(freedom, -abs(difference) / error)), float(stdtrit(freedom, _LEVEL)) * error


def _lines(places: Sequence[PlaceDiff], columns: Sequence[str]) -> tuple[Shift, ...]:
    """One test per policy, rules and column over all conditions that can be tested; identical ones count with 0."""
    groups: dict[tuple[str, str], list[PlaceDiff]] = {}
    for one in places:
        groups.setdefault((one.place.rules, one.place.policy), []).append(one)
    lines = [
        line
        for words, together in groups.items()
        for column in columns
        if (line := _line(words, column, together)) is not None
    ]
    return tuple(lines)


def _line(words: tuple[str, str], column: str, together: Sequence[PlaceDiff]) -> Shift | None:
    """The mean difference over conditions, in shares of each condition's mean; None where none can be tested.

    Conditions that nobody can test, those of one run or of mean 0, say nothing and are left out.
    """
    found = [shift for one in together for shift in one.shifts if shift.column == column]
    usable = [shift for shift in found if shift.variance >= 0.0 and shift.scale > 0.0]
    n_places = len(usable) + sum(one.is_same for one in together)
    if not usable or n_places < 2:
        return None
    difference = sum(shift.difference / shift.scale for shift in usable) / n_places
    variance, freedom = _sum_of_variances(
        [(shift.variance / (shift.scale * n_places) ** 2, shift.freedom) for shift in usable]
    )
    n_first, n_second = (sum(getattr(shift, name) for shift in usable) for name in ("n_first", "n_second"))
    p, half = _test(difference, variance, freedom, scale=1.0, n_runs=max(n_first, n_second))
    return Shift(
        column=column,
        words=words,
        first=math.nan,
        second=math.nan,
        difference=difference,
        lower=difference - half,
        upper=difference + half,
        n_first=n_first,
        n_second=n_second,
        is_paired=all(shift.is_paired for shift in usable),
        p=p,
        variance=variance,
        freedom=freedom,
    )


def _settings(first: "StudyTable", second: "StudyTable") -> tuple[str, ...]:
    """What differs between two studies besides seeds, budget and title, whose runs show it."""
    mine, other = first.spec.to_mapping(), second.spec.to_mapping()
    told = ("title", "budget", "seeds", "readings", "policies", "axes")
    words = [_two(key, mine[key], other[key]) for key in mine if key not in told and mine[key] != other[key]]
    if first.versions != second.versions:
        names = sorted({name for made in (*first.versions, *second.versions) for name in made})
        differing = [
            name
            for name in names
            if len({frozenset(made.get(name) for made in t.versions) for t in (first, second)}) > 1
        ]
        words.append(f"versions: {', '.join(differing)}")
    return tuple(words)


def _two(key: str, mine: Any, other: Any) -> str:
    if key != "settings":
        return f"{key}: {mine} and {other}"
    names = [name for name in {**mine, **other} if mine.get(name) != other.get(name)]
    return "settings: " + ", ".join(f"{name} {mine.get(name)} and {other.get(name)}" for name in names)
