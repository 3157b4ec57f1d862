"""What a person gets wrong is one line that says what to do, exit code 2, and nothing is written."""

import subprocess
import sys
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import pytest

from swarm_forage_env.cli.app import COMMANDS, made
from swarm_forage_env.env import ForageEnv

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
        ("score --curves curves.csv --budget quick", "Expected no budget"),
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
    Path("curves.csv").write_text("n_robots,seed,interval,performance\n1,0,0,2\n")
    Path("world.toml").write_text("n_robots = 3")
    code, out, err = command(*words.split())
    assert (code, out) == (1 if "inside" in words else 2, "")
    assert err.startswith("swarm-forage: ")
    assert err.count("\n") == 1
    assert complaint in err
    assert sorted(path.name for path in Path.cwd().iterdir()) == ["curves.csv", "file", "world.toml"]


def test_what_nobody_foresaw_is_raised(command, monkeypatch):
    monkeypatch.setattr("swarm_forage_env.inspect.descriptions.overview", None)  # our code calls it
    with pytest.raises(TypeError, match="not callable"):
        command("list")


@pytest.mark.parametrize(
    ("error", "code", "told"),
    [
        (OSError(28, "No space left on device", "here"), 1, "No space left on device: here"),
        (KeyboardInterrupt("Interrupted: 3 runs are kept."), 130, "Interrupted: 3 runs are kept."),
        (KeyboardInterrupt(), 130, "Interrupted. Unfinished work is not kept; run the same command to start again."),
    ],
)
def test_what_happens_to_a_user_is_one_line(command, monkeypatch, error, code, told):
    def overview(_):
        raise error

    monkeypatch.setattr("swarm_forage_env.inspect.descriptions.overview", overview)
    assert command("list") == (code, "", f"swarm-forage: {told}\n")


MAIN = f"{sys.executable} -c 'from swarm_forage_env.cli import main; main()'"
DRAWS_AT_LAST = MAIN.replace("-c '", '-c \'import atexit; atexit.register(__import__, "matplotlib"); ')


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "out", "err"),
    [
        (f"{MAIN} info warehouse_small | head -1", "warehouse_small: ", ""),
        (f"{MAIN} info warehouse_small >&-", "", "swarm-forage: Expected a standard output to write to, got a closed"),
        (f"{MAIN} info nobody 2>&-", "", ""),
        (f"echo 'raise ImportError(42)' > polars.py; {MAIN} list", "", "swarm-forage: Cannot import polars: 42"),
        (f"MPLBACKEND=nonsense {DRAWS_AT_LAST} --version", "swarm-forage ", ""),
        (f"mkdir gone; cd gone; rmdir ../gone; {MAIN} info a.toml", "", "swarm-forage: The working folder is gone; "),
    ],
)
def test_where_a_command_reads_and_writes_may_be_gone(tmp_path, words, out, err):
    """Whoever reads the output may stop, too."""
    ended = subprocess.run(words, shell=True, capture_output=True, text=True, timeout=120, check=False, cwd=tmp_path)
    assert ended.stdout.startswith(out)
    assert ended.stderr.startswith(err)
    assert (ended.stdout.count("\n"), ended.stderr.count("\n")) == (bool(out), bool(err))


needs_training = pytest.mark.skipif(
    find_spec("stable_baselines3") is None or find_spec("torch") is None, reason="needs the train extra"
)


@pytest.mark.parametrize(
    "words",
    [
        ("run", "random", "--robots", "3", "--horizon", "4", "--set", "interval_s=2", "--jobs", "1"),
        ("score", "random", "--budget", "quick", "--jobs", "1"),
        ("score", "random,crw", "--budget", "quick", "--jobs", "1"),
        ("study", "run", "S1a", "--budget", "smoke", "--jobs", "1"),
        ("record", "random", "--robots", "3"),
        ("replay", "random", "--robots", "3"),
        pytest.param(("train", "--robots", "3", "--steps", "1", "--set", "n_arenas=1"), marks=needs_training),
    ],
    ids=lambda words: words[0],
)
def test_a_full_disk_is_told_before_anything_is_run(command, full_disk, monkeypatch, words):
    monkeypatch.setattr(ForageEnv, "reset_batch", lambda *_, **__: pytest.fail("a run was started"))
    code, out, err = command(*words)
    assert (code, out) == (1, "")
    assert err.splitlines()[-1].startswith("swarm-forage: File too large: results")
    assert "Traceback" not in err


ALL = {name: line for group in COMMANDS.values() for name, (_, line) in group.items()}
BELOW = {"study": ("list", "run", "status", "plot", "verdict"), "train": ("curves",), "benchmark": ("show", "verify")}
HEAVY = ("numba", "polars", "matplotlib", "swarm_forage_env.world", "swarm_forage_env.runs", "metrics")


def imported(*words: str) -> set[str]:
    """Which heavy modules a command imports."""
    program = f"""
import atexit, sys
from swarm_forage_env.cli import main
atexit.register(lambda: print(*(name for name in {HEAVY} if name in sys.modules), file=sys.stderr))
main()
"""
    ended = subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True, check=True)
    return set(ended.stderr.split())


def test_version_and_help(command):
    assert command("--version") == (0, f"swarm-forage {version('swarm-forage-env')}\n", "")
    assert command() == command("--help") == command("-h")
    code, out, err = command("--help")
    assert (code, err) == (0, "")
    for name, line in ALL.items():
        assert f"{name} " in out
        assert line in out


def test_every_command_tells_of_itself_and_of_each_option():
    for words in [*ALL, *(f"{first} {second}" for first, those in BELOW.items() for second in those)]:
        _, apps, _ = made(words.split()).parse_commands(words.split())
        assert apps[-1].help, words
        if apps[-1].default_command is not None:
            arguments = apps[-1].assemble_argument_collection(parse_docstring=True)
            assert all(argument.parameter.help for argument in arguments if not argument.children), words


def test_only_what_is_asked_for_is_imported():
    assert imported("--help") == imported("study", "-h") == imported("run", "--help") == set()
