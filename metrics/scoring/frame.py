"""Scores: runs of policies as one tidy frame, a row per policy, measure, level and seed.

    frame, missing = scores(studies)
    summarized(frame)                  # means with intervals: one row per policy and level
    differences(frame)                 # pairs of policies: paired t tests with Holm's correction

Tables, figures, verdicts and files are made of these three.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import polars as pl

from swarm_forage_env.wrappers.world import SIZE

from ..curves import FloatArray, Form, Variant
from ..distance import noise_floor
from ..statistics import SIGNIFICANT, Summary, aggregate, holm, paired_p
from .measures import (
    MEASURES,
    Compared,
    Uncomputable,
    checked_request,
    conditions_apart,
    levels,
    remark_on,
    unit_of,
)
from .run_curves import RunCurves, StudyCurves

SCHEMA: dict[str, Any] = {
    "policy": pl.String,
    "measure": pl.String,
    "variant": pl.String,
    "form": pl.String,
    "at": pl.String,
    "criterion": pl.String,
    "x": pl.Float64,
    "n_robots": pl.Int64,
    "seed": pl.Int64,
    "value": pl.Float64,
    "relative": pl.Float64,
    "floor": pl.Float64,
    "excess": pl.Float64,
    "total": pl.Float64,
    "distance": pl.Float64,
    "lost": pl.Int64,
    "misleads": pl.Boolean,
    "unit": pl.String,
    "remark": pl.String,
}
"""Columns of the frame. `seed` is null where no run tells the value: availability, and levels whose runs all failed.

`relative` is the value as a share of the performance that it is compared with, `total`; null for measures without
shares. `floor` is the noise floor of a distance, null where the map depends on the seed, because two undisturbed runs
then differ in it, too. `excess` is what a disturbed run adds to the distance of the undisturbed run of this seed to
that of the next; where the map depends on the seed, it is the disturbed run of the next seed, so that both are of two
maps. `distance` is that of the conditions from the ideal ones. `lost` counts missing runs.
"""
ROW = ("measure", "variant", "form", "at", "criterion", "x", "n_robots")
"""Columns that tell the levels of a policy apart."""


def scores(
    studies: Sequence[StudyCurves],
    measures: Sequence[str] | None = None,
    *,
    variants: Sequence[Variant] = ("corrected",),
    forms: Sequence[Form] = ("marginal",),
) -> tuple[pl.DataFrame, dict[tuple[str, str], str]]:
    """Score the runs of policies.

    Args:
        studies: Runs, one study per policy.
        measures: Names in `MEASURES`; default all.
        variants: Variants as in docs/metrics.md; a measure that has none of them is scored in the corrected one.
        forms: With what swarm sizes are compared.

    Returns:
        A frame with the columns of `SCHEMA`, and for each policy and measure (`label_of`) without scores the reason.

    Raises:
        CurveError: an unknown measure, variant or form, or curves that a measure refuses.
    """
    names = checked_request(measures, variants, forms)
    parts: list[pl.DataFrame] = []
    missing: dict[tuple[str, str], str] = {}
    for study in studies:
        for name in names:
            measure = MEASURES[name]
            wanted: list[Variant] = [each if each in measure.variants else "corrected" for each in variants]
            compared: Sequence[Form] = forms if measure.compares else ("marginal",)
            for variant in dict.fromkeys(wanted):
                for form in dict.fromkeys(compared):
                    try:
                        parts += [_rows(name, study, form, level) for level in levels(name, study, variant, form)]
                    except Uncomputable as reason:
                        missing[study.controller, label_of(name, variant, form)] = str(reason)
    return pl.concat([pl.DataFrame(schema=SCHEMA), *parts]), missing


def _rows(name: str, study: StudyCurves, form: Form, compared: Compared) -> pl.DataFrame:
    """Return the rows of one level."""
    measure, base, runs = MEASURES[name], compared.base, compared.runs
    told: dict[str, Any] = {
        "policy": study.controller,
        "measure": name,
        "variant": compared.variant,
        "form": form,
        "at": compared.at,
        "criterion": runs.criterion,
        "x": float(compared.x),
        "n_robots": runs.n_robots,
        "misleads": compared.misleads,
        "unit": unit_of(name, study, compared.variant),
        "remark": remark_on(name, study, compared),
    }
    if name == "availability":
        return _frame({**told, "value": measure.of(compared)})
    if measure.is_distance:
        told["floor"] = (
            float(noise_floor(base.performance).mean()) if len(base.seeds) > 1 and not base.maps_differ else None
        )
        told["distance"] = conditions_apart(compared)
    paired = compared.paired()
    seeds = paired.runs.seeds
    sides = (each for each in (compared.one, base, runs) if each is not None)
    told["lost"] = max(each.n_lost + len(each.seeds) for each in sides) - len(seeds)
    if not seeds:
        return _frame(told)
    values = measure.of(paired)
    columns: dict[str, Any] = {"seed": seeds, "value": values}
    if measure.is_amount:
        total = (paired.runs if measure.varies == SIZE else paired.base).performance.sum(axis=-1)
        columns |= {"total": total, "relative": _share(values, total)}
    if measure.is_distance and len(seeds) > 1:
        beside_next = measure.of(paired._replace(runs=_next(paired.runs, runs.criterion)))
        floors = measure.of(paired._replace(runs=_next(paired.base, runs.criterion)))
        columns["excess"] = (beside_next if runs.maps_differ else values) - floors
    return _frame({**told, **columns})


def _frame(columns: Mapping[str, Any]) -> pl.DataFrame:
    """Return rows with all columns; single values are the same in each row."""
    given: dict[str, Any] = {name: value for name, value in columns.items() if isinstance(value, np.ndarray | tuple)}
    frame = pl.DataFrame(given or {"seed": [None]})
    return frame.select(
        (pl.col(name) if name in frame.columns else pl.lit(columns.get(name))).cast(kind).alias(name)
        for name, kind in SCHEMA.items()
    )


def _share(values: FloatArray, total: FloatArray) -> FloatArray:
    """Return values over the performance that they are compared with; NaN where that is zero."""
    return np.divide(values, total, out=np.full(values.shape, math.nan), where=total > 0.0)


def _next(runs: RunCurves, criterion: str) -> RunCurves:
    """Return the runs with each in the place of the one before, and the first in that of the last."""
    curves = {name: np.roll(curve, -1, axis=0) for name, curve in runs.curves.items()}
    return replace(runs, criterion=criterion, curves=curves)


def summarized(frame: pl.DataFrame) -> pl.DataFrame:
    """Return one row per policy and level: what all its seeds have in common, means and intervals.

    Columns besides those of a level: mean, lower, upper, sd, runs, undefined of the values (Student's 95 % interval
    over seeds); relative, relative_lower, relative_upper, idle of the shares; floor, relative_floor, distance, lost,
    misleads, unit, remark. `undefined` and `idle` count runs without a value, and without a share.
    """
    rows: list[dict[str, Any]] = []
    for _, part in frame.group_by("policy", *ROW, maintain_order=True):
        first, total = part.row(0, named=True), part["total"].mean()
        of, shares = (_summary(part[name]) for name in ("value", "relative"))
        rows.append(
            {name: first[name] for name in ("policy", *ROW)}
            | {"mean": of.mean, "lower": of.lower, "upper": of.upper, "sd": of.std}
            | {"runs": 0 if first["seed"] is None else of.n_used, "undefined": of.n_nan}
            | {"relative": shares.mean, "relative_lower": shares.lower, "relative_upper": shares.upper}
            | {
                "idle": shares.n_nan,
                "relative_floor": first["floor"] / total if first["floor"] is not None and total else None,
            }
            | {name: first[name] for name in ("floor", "distance", "lost", "misleads", "unit", "remark")}
        )
    return pl.DataFrame(rows, infer_schema_length=None)


def _summary(values: pl.Series) -> Summary:
    """Return mean and interval of values, without nulls; NaN is a run in which there is none."""
    known = values.drop_nulls().to_numpy()
    return aggregate(known) if known.size else Summary()


def differences(frame: pl.DataFrame, pairs: Sequence[tuple[str, str]] | None = None) -> pl.DataFrame:
    """Return one row per pair of policies and level: first minus second, runs paired by seed.

    Columns besides those of a level: first, second, is_relative (whether shares are compared), difference, lower,
    upper, pairs, p (two-sided paired t test), p_holm (after Holm's correction over all levels and pairs of a measure,
    shares and values apart), better (the better policy if p_holm is at most `SIGNIFICANT`, else empty).

    Args:
        frame: Scores.
        pairs: Policies to compare; default all pairs.
    """
    names = frame["policy"].unique(maintain_order=True).to_list()
    rows: list[dict[str, Any]] = []
    for first, second in combinations(names, 2) if pairs is None else pairs:
        mine, theirs = (frame.filter(pl.col("policy") == name) for name in (first, second))
        joined = mine.join(theirs, on=[*ROW, "seed"], suffix="_other", maintain_order="left")
        for key, part in joined.group_by(*ROW, maintain_order=True):
            for column in ("value", "relative"):
                both = part.select(column, f"{column}_other").drop_nulls()
                if len(both):
                    of = _difference(*(both[name].to_numpy() for name in both.columns))
                    about = {"first": first, "second": second, "is_relative": column == "relative"}
                    rows.append({**dict(zip(ROW, key, strict=True)), **about, **of})
    if not rows:
        return pl.DataFrame()
    corrected = (
        pl.col("p")
        .map_batches(lambda p: pl.Series(holm(p.to_numpy())), return_dtype=pl.Float64)
        .over("measure", "variant", "form", "is_relative")
    )
    found = pl.DataFrame(rows, infer_schema_length=None).with_columns(p_holm=corrected)
    higher = pl.col("measure").replace_strict({name: each.higher_is_better for name, each in MEASURES.items()})
    winner = pl.when((pl.col("difference") > 0.0) == higher).then("first").otherwise("second")
    is_certain = pl.col("p_holm").fill_nan(1.0) <= SIGNIFICANT
    return found.with_columns(better=pl.when(is_certain).then(winner).otherwise(pl.lit("")))


def _difference(mine: FloatArray, theirs: FloatArray) -> dict[str, Any]:
    with np.errstate(invalid="ignore"):
        gaps = mine - theirs
    gaps = gaps[~(np.isnan(mine) | np.isnan(theirs))]
    is_known = gaps.size > 0 and bool(np.isfinite(gaps).all())
    of = aggregate(gaps) if is_known else Summary(n_used=gaps.size)
    return {"difference": of.mean, "lower": of.lower, "upper": of.upper, "pairs": of.n_used, "p": paired_p(gaps)}


def label_of(measure: str, variant: Variant, form: Form) -> str:
    """Return the name of a measure with what differs from the usual form: "spatial_emergence, interactive, paper"."""
    words = (measure, "interactive" if form == "interactive" else "", "" if variant == "corrected" else variant)
    return ", ".join(word for word in words if word)


def words_of(label: str) -> str:
    """Return a name of `label_of` in words for people: "spatial emergence, against lone robots"."""
    measure, comma, rest = label.partition(",")
    words = "time lost" if measure == "t_lost_fraction" else measure.replace("_", " ")
    return words + comma + rest.replace("interactive", "against lone robots")
