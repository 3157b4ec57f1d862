"""A stored run again: a record is compared with what comes out, and a failure raises its error again."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.runs.record import RunRecord
from swarm_forage_env.runs.run import run_one, run_policy
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import read_failure


@dataclass(frozen=True, kw_only=True, eq=False)
class Rerun(Answer):
    """What came out when a stored run was made again."""

    record: RunRecord
    file: Path
    """Of the record, or the failure."""
    is_same: bool | None
    """Whether the results are those in the file, bit for bit; None where the run had failed."""

    def sheets(self) -> tuple[Sheet, ...]:
        """Return a text: the run, and whether it is the same."""
        same = {True: f"bit for bit the same as {self.file}", False: f"the results differ from those in {self.file}"}
        return (Sheet(notes=[self.record.describe(), *([] if self.is_same is None else [same[self.is_same]])]),)

    def to_mapping(self) -> dict[str, Any]:
        """Return what the run is, and whether it is the same."""
        return {**self.record.keys(), "file": str(self.file), "is_same": self.is_same}


def rerun(file: str | Path) -> Rerun:
    """Make a stored run again, in this process.

    Args:
        file: A record (.parquet) or a failure (.json).

    Raises:
        RecordError: no such file, or another content.
        ConfigError: the policy of a record is not installed here, or its file has gone or changed.
        Exception: whatever a run that had failed raises again.
    """
    path = Path(file)
    if path.suffix == ".json":
        return Rerun(record=run_one(read_failure(path).spec), file=path, is_same=None)
    stored = RunRecord.read(path)
    spec = RunSpec.from_json(stored.spec)
    try:
        policy = load_policy(spec.policy, spec.parameters)
    except ValueError as error:
        raise ConfigError(f"Cannot run {path} again: {error}") from error
    again = run_policy(policy, spec)
    return Rerun(record=again, file=path, is_same=again.same_results(stored))
