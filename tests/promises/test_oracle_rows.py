"""scripts/oracle_rows.py: who wins rows of measures, and who achieves more."""

from dataclasses import replace

import pytest

from metrics.benchmark.entry import read_entry
from metrics.benchmark.protocol import load_protocol
from metrics.benchmark.standing import scripted_entries


@pytest.mark.usefixtures("run")  # finds the modules beside the scripts
def test_rows_of_both_are_counted_and_who_achieves_more():
    from scripts import oracle_rows

    protocol = load_protocol()
    best = next(entry for entry in scripted_entries(protocol) if entry.name == "dpo")
    generalist = read_entry(oracle_rows.GENERALIST, protocol)
    sheet = oracle_rows.compared(generalist, replace(best, name="oracle"), protocol)
    assert [row[0] for row in sheet.rows] == ["generalist", "oracle"]
    of_dpo = dict(zip(sheet.header, sheet.rows[1], strict=True))
    assert (of_dpo["reactivity"], of_dpo["noise robustness"]) == ("2 of 4", "1 of 3"), "as docs/benchmark.md has them"
    assert sheet.notes == ["oracle achieves more than generalist in 0 of 26 held-out worlds."]
