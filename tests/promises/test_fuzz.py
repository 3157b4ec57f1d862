"""Campaigns of random cases: faults with their numbers, figures at the end, also after Ctrl-C, and in the page."""

import os
import signal
import time
from collections import Counter

import pytest

from scripts import fuzz

PAGE = "before\n\n<!-- table by scripts/fuzz -->\nNone yet.\n<!-- end of table -->\n\nafter\n"


@pytest.fixture
def page(tmp_path, monkeypatch):
    monkeypatch.setattr(fuzz, "PAGE", tmp_path / "promises.md")
    fuzz.PAGE.write_text(PAGE)
    return fuzz.PAGE


def of_worlds(monkeypatch, case):
    monkeypatch.setitem(fuzz.KINDS, "worlds", case)


def test_a_fault_is_shown_with_the_words_that_repeat_it(monkeypatch, capsys):
    of_worlds(monkeypatch, lambda number, folder: (Counter(ticks=1000), "a wall leaks" if number == 7 else ""))
    assert fuzz.main(["worlds", "--first", "5", "--count", "4"]) == 1
    assert capsys.readouterr().out.splitlines() == [
        "--- scripts/fuzz worlds --first 7 --count 1",
        "a wall leaks",
        "4 worlds, 1 faults; 4,000 ticks",
    ]


def test_figures_come_after_ctrl_c_even_if_the_case_takes_it_for_its_own(monkeypatch, capsys):
    def case(number, folder):
        if number == 2:
            try:
                os.kill(os.getpid(), signal.SIGINT)
            except KeyboardInterrupt:
                return Counter(codes=1), "ended by Ctrl-C"
        return Counter(codes=1), ""

    of_worlds(monkeypatch, case)
    before = signal.getsignal(signal.SIGINT)
    assert fuzz.main(["worlds"]) == 0
    assert capsys.readouterr().out.splitlines() == ["Stopped by Ctrl-C.", "2 worlds, 0 faults; 2 codes"]
    assert signal.getsignal(signal.SIGINT) == before


def test_figures_come_into_the_page_and_those_of_other_kinds_stay(page, monkeypatch):
    monkeypatch.setitem(fuzz.KINDS, "kills", lambda number, folder: (Counter(kills=2), ""))
    of_worlds(monkeypatch, lambda number, folder: (Counter(ticks=10), "wrong"))
    fuzz.main(["kills", "--count", "3", "--note"])
    fuzz.main(["worlds", "--count", "1", "--note"])
    fuzz.main(["worlds", "--count", "2", "--first", "4", "--note"])
    lines = page.read_text().splitlines()
    assert lines[:3] == PAGE.splitlines()[:3]
    assert lines[-3:] == PAGE.splitlines()[-3:]
    assert lines[5].startswith("| worlds | 2 | 2 | 20 ticks | 2")
    assert lines[5].endswith("| `scripts/fuzz worlds --first 4 --count 2` |")
    assert lines[6].startswith("| kills | 3 | 0 | 6 kills | 2")
    assert len(lines) == 10


def test_figures_of_a_campaign_that_goes_on_are_added(page, monkeypatch):
    of_worlds(monkeypatch, lambda number, folder: (Counter({"robot-ticks": 1000, "of a kind": 1}), ""))
    for words in ("--first 5 --count 2", "--first 7 --count 3", "--first 10 --count 1"):
        fuzz.main(["worlds", *words.split(), "--note"])
    row = page.read_text().splitlines()[5]
    assert row.startswith("| worlds | 6 | 0 | 6 of a kind, 6,000 robot-ticks | 2")
    assert row.endswith("| `scripts/fuzz worlds --first 5 --count 6` |")
    campaign = fuzz.Campaign("worlds", 11, n_cases=1, n_faults=1)
    assert (
        fuzz._joined(campaign, ["6", "0", "6,000 robot-ticks", "", "`scripts/fuzz worlds --first 5 --count 6 --x`"])
        is campaign
    )
    assert (
        fuzz._joined(campaign, ["6", "0", "6,000 robot-ticks", "", "`scripts/fuzz worlds --first 5 --count 5`"])
        is campaign
    )


def end_of_a_process(kind, first, folder, sender):
    """Cases of which every second one ends the process, but for the last, which says nothing."""
    (folder / fuzz.ERRORS).write_text("out of memory")
    sender.send((Counter(fine=1), ""))
    if first < 4:
        os._exit(5)
    time.sleep(60)


def test_cases_go_on_behind_one_that_ends_the_process_or_hangs(monkeypatch, capsys):
    monkeypatch.setattr(fuzz, "_make_cases", end_of_a_process)
    monkeypatch.setattr(fuzz, "MOST_SILENT_S", 8.0)
    assert fuzz.main(["files", "--first", "2", "--count", "4"]) == 1
    assert capsys.readouterr().out.splitlines() == [
        "--- scripts/fuzz files --first 3 --count 1",
        "ended the process, with exit code 5",
        "out of memory",
        "--- scripts/fuzz files --first 5 --count 1",
        "told nothing for 8 s",
        "4 files, 2 faults; 2 fine",
    ]


def test_a_page_without_the_marks_is_told(page):
    page.write_text("nothing")
    with pytest.raises(ValueError, match="marks of a table by scripts/fuzz"):
        fuzz.note(fuzz.Campaign("worlds", 0))


def test_every_kind_of_case_runs(capsys):
    assert fuzz.main(["commands", "--count", "1"]) == 0
    assert fuzz.main(["files", "--count", "3"]) == 0
    assert fuzz.main(["worlds", "--count", "1"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("1 commands, 0 faults; 1 ended with exit code ")
    assert lines[1].startswith("3 files, 0 faults; ")
    assert "ticks" in lines[2]
