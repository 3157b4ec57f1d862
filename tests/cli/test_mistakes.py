"""What a person gets wrong is one line that says what to do, exit code 2, and nothing is written."""

from pathlib import Path

import pytest

RUN, SCORE = "run crw", "score crw"


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (f"{RUN} --scenario warehouse_smal", "Did you mean 'warehouse_small'?"),
        ("run ,", "Expected one or more names separated by commas"),
        (f"{RUN} --robot 3", "Unknown option: --robot. Did you mean --robots?"),
        (f"{RUN} --set n_objects=100000", "Expected at most"),
        (f"{RUN} --set n_robot=5", "Unknown scenario field 'n_robot'. Did you mean 'n_robots'?"),
        (f"{RUN} --set n_robots=x", "Expected robots.n_robots to be a whole number >= 1, got 'x'"),
        (f"{RUN} --wrapper throtle:amplitude=1", "Unknown wrapper 'throtle'. Did you mean 'throttle'?"),
        (f"{RUN} --scenario world.toml", "Cannot use world.toml: Expected n_robots under [set]"),
        (f"{RUN} --out file/inside", "Not a directory: file"),
        ("list colums", "Did you mean 'columns'?"),
        ("record --file x.avi", "to end in .gif or .mp4"),
        ("rerun file", "Cannot read file: it is no Parquet file or a damaged one"),
        ("rnu", 'Unknown command "rnu". Did you mean "run"?'),
        ("study run mine.tom", "Expected a study file that exists, or one of S1a"),
        ("study run S1a --shard 3/2", "the shard to be a whole number from 1 to 2"),
        ("study verdict .", "without study.toml"),
        ("train --set hiden=3", "Unknown field of the scenario or the training 'hiden'. Did you mean 'hidden'?"),
        ("study rnu", 'Unknown command "rnu". Did you mean "run"?'),
        (f"{SCORE} --curves x.csv --budget quick", "Expected no --budget"),
        ("score --curves x.csv --robots 3", "Expected policies to run in a world beside --curves"),
        ("score --curves curves.csv --columns seed:0", "Expected --columns OURS=THEIRS"),
        ("score --curves curves.csv --events", "the length of an interval"),
        (f"{SCORE} --measures reactivty", "Did you mean 'reactivity'?"),
        (f"{SCORE} --budget huge", "Unknown budget 'huge'"),
        (f"{SCORE} --set interval_s=2", "which the budget sets"),
    ],
)
def test_a_mistake_is_one_line(command, words, complaint):
    Path("file").write_text("no record")
    Path("curves.csv").write_text("n_robots,performance\n1,2\n")
    Path("world.toml").write_text("n_robots = 3")
    code, out, err = command(*words.split())
    assert (code, out) == (1 if "inside" in words else 2, "")
    assert err.startswith("swarm-forage: ")
    assert err.count("\n") == 1
    assert complaint in err
    assert sorted(path.name for path in Path.cwd().iterdir()) == ["curves.csv", "file", "world.toml"]
