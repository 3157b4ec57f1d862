"""The answer of a score: who is better at what, by how much, and whether that is certain, in every form.

found = score(["crw", "dpo"], "warehouse_small", budget="quick")
print(found)                # sentences, then a table
found.frame                 # one row per policy, measure, level and seed
found.summary               # means with intervals
found.differences           # pairs of policies, tested
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import polars as pl
import polars.selectors as cs

from swarm_forage_env._internal.wording import counted, limits, number, percent, plain
from swarm_forage_env.rendering.figures import SCREEN, FigureStyle
from swarm_forage_env.sheet import Answer, Sheet

from ..statistics import ROUNDING
from .frame import ROW, differences, label_of, summarized, words_of
from .measures import MEASURES, PICTURED
from .plots import draw_scores, interval_words

TEST = (
    "Differences: first policy minus second, runs paired by seed, mean with half of Student's 95 % interval; * = "
    "certain: two-sided paired t test, p at most 0.05 after Holm's correction over all levels and pairs of a measure."
)
"""How differences are tested, as a text for readers."""
SIGNS = {
    "%": "share of the performance compared with",
    "!": "runs are missing, or have no value or no share",
    "?": "misleads, see below",
}
"""Sign in a cell -> what it says."""
_NO_AMOUNT = 1e-12
"""Smaller amounts are rounding errors."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scores(Answer):
    """Scores of policies in one world, or of curves."""

    frame: pl.DataFrame
    """One row per policy, measure, level and seed; `metrics.scoring.frame.SCHEMA` says what the columns are."""
    policies: tuple[str, ...]
    world: str = ""
    """The world for people: the scenario, and what differs from its preset; empty for curves."""
    missing: Mapping[tuple[str, str], str] = field(default_factory=dict[tuple[str, str], str])
    """Policy and measure -> why it could not be computed."""
    failures: Mapping[str, Sequence[str]] = field(default_factory=dict[str, Sequence[str]])
    """Policy -> why runs failed, a line per reason."""
    settings: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """How the runs were made."""
    notes: tuple[str, ...] = ()
    """What else is to be known."""
    against: str | None = None
    """The policy that all others are compared with; None = all pairs are compared."""
    is_full: bool = False
    """Whether the text has all levels, numbers and differences."""

    @cached_property
    def summary(self) -> pl.DataFrame:
        """Means with intervals, one row per policy and level; see `summarized`."""
        return summarized(self.frame)

    @cached_property
    def differences(self) -> pl.DataFrame:
        """Differences of policies, one row per pair and level; see `frame.differences`."""
        against = self.against
        pairs = None if against is None else [(name, against) for name in self.policies if name != against]
        return differences(self.frame, pairs)

    def sentences(self) -> list[str]:
        """Return who is best at what, by how much, and whether that is certain; at the last level of each measure."""
        if len(self.policies) < 2 or self.differences.is_empty():
            return []
        found = [sentence for rows in self._strongest() if (sentence := self._sentence(rows))]
        certain = [words for words in found if words.endswith(".")]
        open_ones = [words for words in found if words not in certain]
        return [*certain, *([f"No certain difference: {', '.join(open_ones)}."] if open_ones else [])]

    def _strongest(self) -> Iterator[pl.DataFrame]:
        """Yield the rows of all policies at the last level of each measure that is shown."""
        shown = self.summary.filter(pl.col("runs") > 0, pl.col("variant") == "corrected", pl.col("form") == "marginal")
        if set(shown["measure"]) >= {*PICTURED} and not self.is_full:
            shown = shown.filter(pl.col("measure").is_in(PICTURED))
        for _, rows in shown.group_by("measure", "criterion", maintain_order=True):
            yield rows.filter(pl.col("at") == rows.sort("n_robots", "x")["at"][-1])

    def _sentence(self, rows: pl.DataFrame) -> str:
        """Return what is certain of the best policy and the next; else the measure alone, of fewer than two nothing."""
        first = rows.row(0, named=True)
        measure, words = MEASURES[first["measure"]], words_of(first["measure"])
        column = "relative" if measure.is_amount else "mean"
        ranked = rows.filter(pl.col(column).is_finite()).sort(column, descending=measure.higher_is_better)["policy"]
        if len(ranked) < 2:
            return ""
        best, other = ranked[0], ranked[1]
        if self.against in ranked and best != self.against:
            other = self.against
        at = self.differences.filter(
            *(pl.col(name) == first[name] for name in ROW),
            pl.col("first").is_in([best, other]),
            pl.col("second").is_in([best, other]),
            is_relative=measure.is_amount,
        )
        if at.is_empty():
            return ""
        of = at.row(0, named=True)
        if not of["better"]:
            return words
        gap = spread(abs(of["difference"]), of["upper"] - of["difference"], is_share=measure.is_amount)
        unit = f" {first['unit']}" if "{amount}" in measure.unit and not measure.is_amount else ""
        side = "ahead of" if measure.higher_is_better else "below"
        return f"{words} at {first['at']}: {best} is best, {gap}{unit} {side} {other} (certain)."

    def sheets(self) -> tuple[Sheet, ...]:
        """Return sentences, a table and notes; with `is_full`, all levels and differences."""
        tables = tuple(self._long()) if self.is_full else (self._short(),)
        return Sheet(title=self._title(), notes=self.sentences()), *tables, Sheet(notes=self._notes())

    def _title(self) -> str:
        told = self.settings
        places = [f"in {self.world}"] if self.world else []
        places += [f"from {told['curves']}"] if "curves" in told else []
        words = [" ".join([", ".join(self.policies), " and ".join(places)]).rstrip()]
        if told.get("performance", "collected") != "collected":
            words.append(f"performance {told['performance']}")
        words += [f"budget {told['budget']}"] if "budget" in told else []
        words += [counted(len(told["seeds"]), "seed")] if "seeds" in told else []
        words += [f"{told['horizon_s']:,g} s"] if told.get("horizon_s") else []
        return ", ".join(words)

    def _short(self) -> Sheet:
        """The strongest level of each measure, policies side by side."""
        rows: list[list[str]] = []
        for part in self._strongest():
            first = part.row(0, named=True)
            of = {row["policy"]: _cell(row) for row in part.iter_rows(named=True)}
            cells = [of.get(name, "-") for name in self.policies]
            rows.append([words_of(first["measure"]), first["at"], MEASURES[first["measure"]].better, *cells])
        notes = self._legend("".join(cell for row in rows for cell in row)) if rows else ()
        return Sheet.of(["measure", "at", "better", *self.policies], rows, notes=notes)

    def _legend(self, cells: str) -> list[str]:
        """What the signs in some cells are."""
        n_runs = self.summary["runs"].to_list()
        intervals = [interval_words(n_runs)] if "±" in cells or max(n_runs) == 1 else []
        signs = [f"{sign} = {words}" for sign, words in SIGNS.items() if sign in cells]
        return [*intervals, *(["; ".join(signs)] if signs else [])]

    def _long(self) -> Iterator[Sheet]:
        """All levels and differences, a measure after the other, and what their signs are."""
        by_measure = self.differences.partition_by(*ROW[:3], as_dict=True) if len(self.differences) else {}
        for key, part in self.summary.group_by(*ROW[:3], maintain_order=True):
            first = part.row(0, named=True)
            title = f"{words_of(label_of(*key))}, {first['unit']}, {MEASURES[first['measure']].better} is better"
            levels = [
                {
                    "at": row["at"],
                    "policy": row["policy"],
                    "value": number(row["mean"]) + _marks(row),
                    "95 % interval": limits(row["lower"], row["upper"]),
                    "noise floor": "" if row["floor"] is None else number(row["floor"]),
                    "relative": "" if math.isnan(row["relative"]) else percent(row["relative"]),
                    "runs": str(row["runs"]),
                }
                for row in part.iter_rows(named=True)
            ]
            frame = pl.DataFrame(levels)
            yield Sheet(title=title, frame=frame.select(name for name in frame.columns if {*frame[name]} - {"", "-"}))
            if key in by_measure:
                yield _pairs_of(by_measure[key])
        if len(self.summary):
            yield Sheet(notes=[*self._legend("".join(("±", *SIGNS))), *([TEST] if by_measure else [])])

    def _notes(self) -> list[str]:
        shown = self.summary if self.is_full else pl.concat([self.summary.clear(), *self._strongest()])
        remarks: dict[str, dict[str, None]] = {}  # remark -> places, each once
        for row in shown.filter(pl.col("remark") != "").iter_rows(named=True):
            place = f"{words_of(label_of(row['measure'], row['variant'], row['form']))}, {row['at']}"
            remarks.setdefault(row["remark"], {})[place] = None
        absent: dict[tuple[str, str], list[str]] = {}  # policies and reason -> measures
        for label, reason in dict.fromkeys((label, reason) for (_, label), reason in self.missing.items()):
            of = [policy for policy in self.policies if self.missing.get((policy, label)) == reason]
            words = "" if len(of) == len(self.policies) else f" of {', '.join(of)}"
            absent.setdefault((words, reason), []).append(words_of(label))
        return [
            *self.notes,
            *(f"{'; '.join(places)}: {remark}" for remark, places in remarks.items()),
            *(f"not computed{of}: {', '.join(labels)}: {reason}" for (of, reason), labels in absent.items()),
            *(f"failed: {line}" for lines in self.failures.values() for line in lines),
        ]

    def csv(self) -> str:
        """Return the means with intervals as CSV, see `summary`."""
        return self.summary.write_csv()

    def to_mapping(self) -> dict[str, Any]:
        """Return everything as plain values, ready for JSON; numbers that do not exist are None."""
        of_runs = self.frame.filter(pl.col("seed").is_not_null()).group_by("policy", *ROW, maintain_order=True)
        per_seed = {key: dict(zip(map(str, of["seed"]), map(plain, of["value"]), strict=True)) for key, of in of_runs}
        rows: list[dict[str, Any]] = []
        for row in _plain_rows(self.summary):
            of = MEASURES[row["measure"]]
            row |= {"symbol": of.symbol, "higher_is_better": of.higher_is_better, "neutral": of.neutral}
            rows.append({**row, "per_seed": per_seed.get(tuple(row[name] for name in ("policy", *ROW)), {})})
        missing: dict[str, dict[str, str]] = {}
        for (policy, label), reason in self.missing.items():
            missing.setdefault(policy, {})[label] = reason
        return {
            "policies": list(self.policies),
            "world": self.world,
            "settings": dict(self.settings),
            "sentences": self.sentences(),
            "scores": rows,
            "differences": _plain_rows(self.differences),
            "missing": missing,
            "failures": {policy: list(lines) for policy, lines in self.failures.items()},
        }

    @property
    def has_picture(self) -> bool:
        """Whether a score has runs."""
        return self.frame["seed"].count() > 0

    def draw(self, path: str | Path, *, style: FigureStyle = SCREEN) -> None:
        """Draw the scores, see `draw_scores`."""
        draw_scores(self.summary, path, title=self.world, style=style)


def _plain_rows(frame: pl.DataFrame) -> list[dict[str, Any]]:
    """Return rows without NaN and infinities, which JSON does not have."""
    return frame.with_columns(pl.when(cs.float().is_finite()).then(cs.float())).to_dicts()


def _marks(row: Mapping[str, Any]) -> str:
    is_partial = row["lost"] or row["undefined"] or row["idle"]
    return (" !" if is_partial else "") + (" ?" if row["misleads"] else "")


def _cell(row: Mapping[str, Any]) -> str:
    """Return a value with half of its interval, as a share where there are shares."""
    is_share = MEASURES[row["measure"]].is_amount
    mean, upper = (row[name] for name in (("relative", "relative_upper") if is_share else ("mean", "upper")))
    return spread(mean, upper - mean, is_share=is_share) + _marks(row)


def _pairs_of(rows: pl.DataFrame) -> Sheet:
    """The differences of a measure, a row per level and pair, values beside shares."""
    cells: dict[tuple[str, str], dict[str, str]] = {}
    for row in rows.iter_rows(named=True):
        pair = f"{row['first']} - {row['second']}"
        gap = spread(row["difference"], row["upper"] - row["difference"], is_share=row["is_relative"])
        told = cells.setdefault((row["at"], pair), {"at": row["at"], "difference": pair})
        told["relative" if row["is_relative"] else "value"] = gap + (" *" if row["better"] else "")
    return Sheet(frame=pl.DataFrame([*cells.values()], infer_schema_length=None))


def spread(mean: float, half: float, *, is_share: bool = False) -> str:
    """Return a mean with half of its interval, to two digits of the latter."""
    factor, unit = (100.0, " %") if is_share else (1.0, "")
    mean, half = factor * mean, factor * half
    if not (math.isfinite(mean) and math.isfinite(half)):
        return number(mean) + (unit if math.isfinite(mean) else "")
    if half <= max(ROUNDING * abs(mean), _NO_AMOUNT):
        return f"{number(0.0 if abs(mean) <= _NO_AMOUNT else mean)} ± 0{unit}"
    decimals = max(0, 1 - math.floor(math.log10(half)))
    mean = round(mean, decimals) + 0.0  # no "-0"
    return f"{mean:.{decimals}f} ± {half:.{decimals}f}{unit}"
