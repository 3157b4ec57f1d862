"""Curves from a CSV or Parquet file."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..checks import CurveError
from .columns import HANDLING, NOISE, POPULATION, THROTTLE
from .curves_table import study_curves
from .performance import PerformanceLike, with_performance
from .studies import StudyCurves, shared_seeds

if TYPE_CHECKING:
    import polars as pl


def read_curves(path: str | Path, performance: PerformanceLike | None = None) -> tuple[StudyCurves, ...]:
    """Read curves from a CSV or Parquet file with the columns of `CURVE_COLUMNS`; one study per policy in it.

    Args:
        path: The file.
        performance: What is read as performance; default the column of that name. See `with_performance`.

    Raises:
        CurveError: whatever is wrong with the file, in one line: as `study_curves`, a file that cannot be read, no
            reference run for what is varied, no runs that can be paired.
    """
    file = Path(path)
    frame = _read_frame(file)
    if performance is None:
        studies = study_curves(frame, where=str(file), controller=file.stem)
    else:
        frame, told = with_performance(frame, performance, str(file))
        studies = tuple(replace(study, **told) for study in study_curves(frame, where=str(file), controller=file.stem))
    for study in studies:
        _check_comparable(study)
    return studies


def _check_comparable(study: StudyCurves) -> None:
    """Check that there is a reference for everything that is varied, and that runs can be paired."""
    for criterion in (THROTTLE, HANDLING, NOISE, POPULATION):
        study.levels(criterion)
    if not shared_seeds(study.experiments):
        raise CurveError(
            f"Expected runs with numbers in common over all experiments of {study.controller} in {study.where}, "
            "got none; number the runs of each experiment alike (column seed)."
        )


def _read_frame(file: Path) -> "pl.DataFrame":
    import polars as pl

    readers = {".csv": pl.read_csv, ".parquet": pl.read_parquet}
    reader = readers.get(file.suffix.lower())
    if reader is None:
        raise CurveError(f"Expected curves as a .csv or .parquet file, got {file}.")
    try:
        content = file.read_bytes()
    except OSError as error:
        raise CurveError(f"Cannot read {file}: {error.strerror or error}.") from error
    if not content.strip():
        raise CurveError(f"Expected curves in {file}, but the file is empty.")
    try:
        return reader(content)
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, UnicodeDecodeError) as error:
        reason = str(error).splitlines()[0]
        raise CurveError(f"Cannot read {file} as {file.suffix.lower()[1:].upper()}: {reason}.") from error
