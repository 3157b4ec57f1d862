"""What a person gets wrong is one line that says what to do, exit code 2, and nothing is written."""

from pathlib import Path

import pytest

RUN, SCORE = "run crw", "score crw"


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (f"{RUN} --scenario warehouse_smal", "Did you mean 'warehouse_small'?"),
        ("run crw,crv", "Unknown policy 'crv'. Did you mean 'crw'?"),
        ("run crw,gone.npz", "gone.npz"),
        ("run ,", "Expected one or more names separated by commas"),
        (f"{RUN} --robot 3", "Unknown option: --robot. Did you mean --robots?"),
        (f"{RUN} --seeds 0", 'Invalid value "0" for --seeds. Must be >= 1'),
        (f"{RUN} --set n_objects=100000", "Expected at most"),
        (f"{RUN} --set n_robot=5", "Unknown scenario field 'n_robot'. Did you mean 'n_robots'?"),
        (f"{RUN} --set n_robots", "Expected --set key=value, got 'n_robots'"),
        (f"{RUN} --set n_robots=x", "Expected robots.n_robots to be a whole number >= 1, got 'x'"),
        (f"{RUN} --set n_robots=3 --robots 4", "Expected n_robots once"),
        (f"{RUN} --wrapper throtle:amplitude=1", "Unknown wrapper 'throtle'. Did you mean 'throttle'?"),
        (f"{RUN} --wrapper actuator_noise:sigma", "as key=value, got 'sigma'"),
        (f"{RUN} --scenario world.toml", "Cannot use world.toml: Expected n_robots under [set]"),
        (f"{RUN} --out file/inside", "Not a directory: file"),
        ("list colums", "Did you mean 'columns'?"),
        ("list columns extra", "Unused Tokens: ['extra']"),
        ("record --file x.avi", "to end in .gif or .mp4"),
        ("record --file x.png", "one picture is made by --at SECONDS"),
        ("info crv", "Did you mean 'crw'?"),
        ("rerun missing.parquet", "Cannot read missing.parquet: No such file or directory"),
        ("rerun file", "Cannot read file: it is no Parquet file or a damaged one"),
        ("rnu", 'Unknown command "rnu". Did you mean "run"?'),
        ("study rnu", 'Unknown command "rnu". Did you mean "run"?'),
        (f"{SCORE} --curves x.csv --budget quick", "Expected no --budget"),
        ("score --curves x.csv --robots 3", "Expected policies to run in a world beside --curves"),
        ("score --columns seed=0", "Expected a file with --curves for --columns"),
        ("score --curves curves.csv --columns seed:0", "Expected --columns OURS=THEIRS"),
        ("score --curves curves.csv --events", "the length of an interval"),
        ("score --curves gone.csv", "Cannot read gone.csv: No such file"),
        (f"{SCORE} --measures reactivty", "Did you mean 'reactivity'?"),
        (f"{SCORE} --variant papr", "Unknown variant 'papr'. Did you mean 'paper'?"),
        (f"{SCORE} --budget huge", "Unknown budget 'huge'"),
        (f"{SCORE} --performance n_carying", "Did you mean 'n_carrying'?"),
        (f"{SCORE} --set interval_s=2", "which the budget sets"),
        (f"{SCORE} --robots 1", "at least 2 robots"),
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
