"""Scripts of measurements run: short, to see that they still fit the packages."""

import ast
import importlib
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from metrics.laws import ALL_LAWS

from metrics import verdict
from metrics.claims import CLAIMS, INTUITIONS
from metrics.scoring.study_numbers import FIGURE_MEASURES
from scripts import results_data
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.policy_spec import policy_specs
from swarm_forage_env.runs.run import LiveRun, build_env
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.studies.study import Axis
from swarm_forage_env.studies.study_file import load_study, set_names
from swarm_forage_env.studies.study_table import read_study
from swarm_forage_env.wrappers.world import World
from tests.reference import read_results
from tests.support.foraging import quick_world
from tests.support.foraging_table import foraging_table
from tests.support.made_tables import FOUR, made_study, made_table

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.compiled
def test_two_engines_are_compared(run):
    words = ("--policy", "dpo", "--robots", "30", "--seeds", "2", "--horizon", "20", "--all")
    lines = run("compare_engines", *words)[1].splitlines()
    assert len(lines) == 2 + 13 + 2
    assert all(line.startswith("| warehouse_small | dpo | 30 |") for line in lines[2:15])
    assert lines[15:] == [
        "1 of 1 cases have the same numbers in both engines.",
        "In 0 of the 0 rows that differ, the interval of the difference leaves out zero.",
    ]


def test_results_say_which_sets_and_conditions_they_are_of(run):
    """One condition of S1a lacks one of its two runs, another both, and those of the other rules do; S1c is whole."""
    pytest.importorskip("matplotlib", reason="needs the plots extra: matplotlib")
    spec = load_study("S1a", "smoke", rules=("described",))
    lost = {(spec.places[0], 1), (spec.places[1], 0), (spec.places[1], 1)}
    made_table(spec, lambda cell: 10.0 * cell.values[0], lost=lost).write("S1a.parquet")
    whole = load_study("S1c", "smoke")
    made_table(whole, lambda cell: 10.0, adversity=lambda cell: cell.values[0]).write("S1c.parquet")
    Path("page").mkdir()
    code, out, _ = run("write_results", "--out", "page", "S1a.parquet", "S1c.parquet")
    assert code == 0
    page = Path("page/results.md").read_text(encoding="utf-8")
    n_planned = sum(load_study(name, "smoke").n_runs for name in set_names())
    n_places = len(spec.places)
    assert page.splitlines()[2:5] == [
        f"**This page is based on {spec.n_runs - 3 + whole.n_runs} of {n_planned} runs of the paper's sets at budget "
        "`smoke`.** Sets with all runs: S1c. Sets not run: S1b, S1d, S1e, S1f, S1g, S1h, S2a, S2b, S2c, S2d. Sets of "
        "which runs are still to be made:",
        "",
        f"- S1a: {n_places - 2} of {2 * n_places} conditions whole, with 2 runs each; 1 begun, {n_places + 1} not run",
    ]
    pictures = {path.relative_to("page").as_posix() for path in Path("page").rglob("*.png")}
    assert pictures == set(re.findall(r"\]\((images/.+?)\)", page))
    assert f"{len(pictures)} pictures" in out
    assert pictures
    assert "swarm-forage study run S1c --budget smoke --seeds 2 --rules both" in page
    assert set(re.findall(r"^\| (\w+) \|", page, flags=re.MULTILINE)) >= {*CLAIMS, *INTUITIONS}
    names = {name: read_study(f"page/results/{name}.parquet").digest[:8] for name in ("S1a", "S1c")}
    verdicts = pl.read_csv("page/results/verdicts.csv", infer_schema=False)
    of_p2 = verdicts.filter((pl.col("claim") == "P2") & pl.col("sense").is_null())
    assert of_p2["measures"].to_list() == ["corrected", "sierra"], "it is of one set of rules"
    assert of_p2["runs"].to_list() == [f"S1a {names['S1a']}"] * 2
    measures = pl.read_csv("page/results/measures.csv")
    assert set(measures["runs"]) == {f"{name} {digest}" for name, digest in names.items()}
    assert "for S1b" in page, "what waits for runs"
    assert "| `S1a` | population_size 2, 8, 32, 128 | 0 to 2 of 192 | E1, E2, E3, C5, P2, X2, X3 |" in page
    assert "Judged [on fewer values than the paper's](#what-is-left-out): E1, E2, E3, C5, P2, R1" in page
    assert f"| S1c {names['S1c']} | {len(whole.places)} | 0 | 0 | - |" in page, "four intervals are too short"


def test_the_results_page_comes_of_the_runs_beside_it(run):
    """They lie there packed; without them the page is another one."""
    pytest.importorskip("matplotlib", reason="needs the plots extra: matplotlib")
    spec = replace(load_study("S1c", "smoke"), looks=(1, 2))
    lost = {(spec.places[0], 1)}
    given = made_table(spec, lambda cell: 10.0 + cell.values[0], lost=lost, adversity=lambda cell: cell.values[0])
    replace(given, frame=given.frame.with_columns(throttle=0.1, n_carrying=1.0), wall_time_s=5400.0).write(
        "S1c.parquet"
    )
    Path("page").mkdir()
    assert run("write_results", "--out", "page", "S1c.parquet")[0] == 0
    text = Path("page/results.md").read_text(encoding="utf-8")
    kept = read_study("page/results/S1c.parquet")
    assert set(kept.frame.columns) >= {"performance", "adversity", "throttle", "n_carrying"}, "whole runs"
    assert verdict(kept).csv() == verdict(read_study("S1c.parquet")).csv()
    assert "Sets run until claims are decided: S1c. Sets not run: S1a" in text
    assert f"| {spec.n_runs - 1} of {spec.n_runs} | 1 to 2 |" in text
    command = "study run S1c --budget smoke --seeds 2 --rules both --out results/studies --until-decided --hours 1\n"
    assert command in text
    assert "based on all" not in text
    assert run("write_results", "--out", "page", "--check")[:2] == (0, "as the runs have it\n")
    pictures = [path.name for path in Path("page").rglob("*.png")]
    assert run("write_results", "--out", "page")[0] == 0, "once more, from what is there"
    assert Path("page/results.md").read_text(encoding="utf-8") == text
    assert [path.name for path in Path("page").rglob("*.png")] == pictures
    Path("page/results.md").write_text(text.replace("supported", "contradicted", 1), encoding="utf-8")
    Path("page/results/undecided.csv").unlink()
    code, out, _ = run("write_results", "--out", "page", "--check")
    assert (code, out) == (1, "not those of the runs in page/results: results.md, results/undecided.csv\n")


def test_the_results_page_says_what_would_decide_the_rest(tmp_path, monkeypatch):
    """Two policies whose runs scatter, and one that has fewer runs than the others."""
    axis = Axis(name="noise", values=(0.0, 0.02, 0.04))
    spec = made_study("S1e", axis, reference=0.0, seeds=tuple(range(8)), looks=(4, 8, 16, 64))
    table = made_table(spec, lambda place: 50.0, lost={(spec.places[0], 7)})
    scatter = np.random.default_rng(3).uniform(0.5, 1.5, len(table.frame))
    table = replace(table, frame=table.frame.with_columns(performance=pl.col("performance") * pl.Series(scatter)))
    results = verdict(replace(table, wall_time_s=7200.0))
    found = results_data.undecided(results)
    open_ones = {(one.claim.name, one.rules) for one in results.judged if one.verdict.answer == "undecided"}
    assert {(one["claim"], one["rules"]) for one in found if not one["sense"]} == open_ones != set()
    assert {one["runs"] for one in found} <= {4, 8}
    assert {one["last_look"] for one in found} == {64}
    assert all(one["core_hours"] > 0.0 and "S1e " in one["needs_runs_of"] for one in found)
    monkeypatch.syspath_prepend(ROOT / "scripts")
    undecided_claims = importlib.import_module("results_undecided").undecided_claims
    text = undecided_claims(results)
    for one in found:
        look = f"{one['decided_after']} runs" if one["decided_after"] else "never by 64 runs like these"
        (line,) = [line for line in text.splitlines() if line.startswith(f"| {look} |")]
        assert one["claim"] in line
    results_data.write_numbers(results, tmp_path)
    assert len(pl.read_csv(tmp_path / "undecided.csv")) == len(found)
    unlooked = verdict(made_table(replace(spec, looks=()), lambda place: 50.0))
    assert "No forecast" in undecided_claims(unlooked)


SETS = {
    "S1a": (Axis(name="population_size", values=(1, 2, 4)),),
    "S1b": (Axis(name="population_size", values=(1, 2, 4)),),
    "S1c": (Axis(name="throttle", values=(0.0, 0.1, 0.4)),),
    "S1e": (Axis(name="noise", values=(0.0, 0.01, 3.0 / 70.0)),),
    "S1g": (Axis(name="population_dynamics", values=(1.0, 2.0, 5.0)),),
    "S2a": (Axis(name="walk_probability", values=(0.0, 0.051)), Axis(name="population_size", values=(2, 4))),
    "S2d": (Axis(name="population_size", values=(2, 3)), Axis(name="population_dynamics", values=(1e-4, 9e-4))),
}


def varied_table(name):
    """Runs of a set in few conditions with curves by chance, one run of which is lost."""
    axes = SETS[name]
    reference = None if axes[-1].name == "population_size" else axes[-1].values[0]
    about = {"scenario": "search_and_rescue", "settings": {}} if name == "S2d" else {}
    about |= {"looks": (2, 4)} if name == "S1b" else {}
    spec = made_study(name, *axes, reference=reference, seeds=tuple(range(5)), **about)
    lost = {(spec.places[1], 2)}
    table = made_table(spec, lambda place: 10.0 + 3.0 * FOUR.index(place.policy), lost=lost)
    shape, rng = len(table.frame), np.random.default_rng(1)
    sizes = [spec.world(spec.places[cell]).n_robots for cell in table.frame["cell"]]
    varied = {
        "n_robots": pl.Series(sizes),
        "reading": pl.lit("described"),
        "policy": pl.Series([spec.places[cell].policy for cell in table.frame["cell"]]),
        **{
            f"axis_{axis.name}": pl.Series([float(spec.places[cell].values[at]) for cell in table.frame["cell"]])
            for at, axis in enumerate(axes)
        },
        "performance": pl.col("performance") * pl.Series(rng.uniform(0.5, 1.5, shape)),
        "interference_fraction": pl.col("interference_fraction") * pl.Series(rng.uniform(0.5, 1.5, shape)),
        "interference_ticks": pl.Series(rng.uniform(50.0, 100.0, shape)),
        "interference_ticks_near_caches": pl.Series(rng.uniform(0.0, 50.0, shape)),
        "n_caches": pl.Series(rng.uniform(0.0, 3.0, shape)),
        "n_active": pl.col("n_active") * pl.Series(rng.uniform(0.5, 1.0, shape)),
        "adversity": pl.col("adversity") * pl.Series(rng.uniform(0.5, 1.0, shape)),
    }
    return replace(table, frame=table.frame.with_columns(**varied))


def test_every_printed_measure_is_that_of_the_runs_by_other_code(tmp_path, capsys):
    tables = [varied_table(name) for name in SETS]
    results_data.ship(tables, tmp_path)
    results_data.write_numbers(verdict(*results_data.shipped(tmp_path)), tmp_path)
    n_rows = len(pl.read_csv(tmp_path / "measures.csv"))
    assert read_results.main(tmp_path) == 0, capsys.readouterr().out
    assert capsys.readouterr().out == f"{n_rows} of {n_rows} printed measures are those of the runs\n"
    names = set(pl.read_csv(tmp_path / "measures.csv")["measure"])
    assert names == set(FIGURE_MEASURES), "all that the page has"
    text = (tmp_path / "measures.csv").read_text(encoding="utf-8")
    first = text.splitlines()[1]
    *before, mean, lower, upper, sd = first.split(",")
    for changed in (
        ",".join([*before, str(1.001 * float(mean)), lower, upper, sd]),
        ",".join([*before, mean, str(float(lower) - 0.1), upper, sd]),
        ",".join([*before, mean, lower, upper, str(1.001 * float(sd))]),
        first.replace("S1a ", "S1a 0", 1),
    ):
        (tmp_path / "measures.csv").write_text(text.replace(first, changed), encoding="utf-8")
        assert read_results.main(tmp_path) == 1
        assert f"of {n_rows}" not in capsys.readouterr().out.splitlines()[0]


def test_shipped_runs_have_room():
    """A repository that everybody clones."""
    assert sum(file.stat().st_size for file in (ROOT / "docs/results").iterdir()) < 25e6


def test_the_other_code_is_short_and_imports_polars_and_numpy_alone():
    text = Path(read_results.__file__).read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 200
    tree = ast.parse(text)
    imported = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    imported |= {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert {name.split(".")[0] for name in imported} - set(sys.stdlib_module_names) == {"numpy", "polars"}


@pytest.mark.compiled
def test_stochx_is_held_beside_the_program(run):
    lines = run("stochx_beside_program", "--seeds", "2", "--horizon", "400")[1].splitlines()
    assert [line.split()[:3] for line in lines[2:7]] == [
        ["warehouse_small", "16", "230"],
        ["warehouse_small", "32", "230"],
        ["warehouse_small", "50", "177"],
        ["warehouse_small", "64", "230"],
        ["warehouse_medium", "200", "800"],
    ]
    of_robots = [float(number) for number in lines[12].split()[1:]]
    assert 49.0 < sum(of_robots) <= 50.1, "everybody has a task but in the first tick"


@pytest.mark.compiled
def test_the_floor_near_the_nest_empties(run):
    title, _, crw, dpo, _ = run("emptying_floor", "--seeds", "2", "--horizon", "4000")[1].splitlines()
    assert title == "warehouse_medium, 200 robots: the first 1,000 s, and from 3,000 s on"
    for line, policy in ((crw, "crw"), (dpo, "dpo")):
        first, later, _, _, begin_m, end_m = (float(word) for word in re.findall(r"(\S+) ±", line))
        assert line.startswith(policy)
        assert first > later
        assert begin_m < end_m


WORLDS = """
horizon_s = 400.0
n_runs = 2
[[worlds]]
name = "ten robots"
scenario = { preset = "warehouse_small", n_robots = 10, width_m = 12.0, physics = "compiled" }
[[worlds]]
name = "a wall"
scenario = { preset = "classroom", obstacles = [[3.0, 1.5, 3.2, 4.5]], physics = "compiled" }
"""


@pytest.mark.compiled
def test_policies_are_compared_in_the_worlds_of_a_file(run):
    Path("mine.toml").write_text(WORLDS)
    title, header, *rows = run("unseen_worlds", "--worlds", "mine.toml", "--policy", "dpo,oracle")[1].splitlines()
    assert title == "Performance as a share of the better of crw and dpo, 400 s, means of 2 runs"
    assert header.split() == ["world", "dpo", "oracle"]
    assert [row.split("  ")[0] for row in rows[:2]] == ["ten robots", "a wall"]
    assert re.split("  +", rows[3]) == ["better than crw and dpo", "0 of 2", "2 of 2"]
    for dpo, oracle in (row.split()[-2:] for row in rows[:2]):
        assert float(dpo) <= 1.0 < float(oracle)


@pytest.mark.parametrize(
    ("text", "words", "told"),
    [
        (None, (), "Cannot read the file of worlds mine.toml: No such file"),
        ("horizon_s = 400.0", (), r"Expected \[\[worlds\]\] in mine.toml, got none"),
        ("horizon = 400.0", (), "mine.toml: .*Did you mean"),
        (WORLDS, ("--draws", "2"), "without --draws and --horizon"),
    ],
)
def test_a_file_that_holds_no_worlds_is_refused_in_one_line(run, capsys, text, words, told):
    if text is not None:
        Path("mine.toml").write_text(text)
    ends_with, out, err = run("unseen_worlds", "--worlds", "mine.toml", *words)
    assert re.search(told, f"{ends_with}{err}")
    assert out == ""


@pytest.mark.usefixtures("run")  # finds the modules beside the scripts
@pytest.mark.compiled
def test_unseen_worlds_are_drawn_once_and_shares_are_of_the_best(monkeypatch, capsys):
    from scripts import unseen_worlds

    for kind in unseen_worlds.KINDS:
        more = unseen_worlds.worlds(kind, 5, 200.0)
        assert unseen_worlds.worlds(kind, 2, 200.0) == more[:2]
        assert len({world.scenario for world in more}) > 1
        build_env(more[0].scenario, more[0].wrappers).reset_batch(0)
    monkeypatch.setattr(unseen_worlds, "KINDS", unseen_worlds.KINDS[:3])  # runs in all of them take minutes
    monkeypatch.setattr(sys, "argv", ["", "--policy", "dpo,oracle", "--draws", "1", "--horizon", "400"])
    unseen_worlds.main()
    title, header, *kinds, keeping_up, better, median = capsys.readouterr().out.splitlines()
    assert title == "Performance as a share of the best scripted controller, 400 s, one run of each"
    assert header.split() == ["worlds", "dpo", "oracle"]
    assert (len(kinds), better.split()[4:]) == (3, ["0", "of", "3", "3", "of", "3"]), "DPO is one of the four"
    assert keeping_up.endswith("3 of 3")
    dpo, oracle = (float(word) for word in median.split()[1:])
    assert dpo <= 1.0 < oracle


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--horizon", "100"), "Expected a horizon of a whole number of intervals of 200 s, got 100 s; choose a"),
        (("--policy", "no_such_file.npz"), "no_such_file.npz: No such file or directory."),
    ],
)
def test_what_cannot_be_run_in_unseen_worlds_is_told_in_one_line(run, words, told):
    ends_with, out, _ = run("unseen_worlds", *words)
    assert told in ends_with
    assert "\n" not in ends_with
    assert out == ""


@pytest.mark.usefixtures("run")  # finds the modules beside the scripts
@pytest.mark.compiled
def test_a_policy_is_compared_with_the_best_in_every_size():
    from scripts import every_size

    (oracle,) = policy_specs(["oracle"])
    worlds = [World(scenario("warehouse_small", n_robots=size, horizon_s=600.0)) for size in (4, 6)]
    two, more = every_size.rows_of(oracle, worlds, range(2), 1)
    assert (two[:2], more[:2]) == (("warehouse_small", "4"), ("warehouse_small", "6"))
    assert all(" ± " in told for told in two[3:5])
    ((*_, performance, of_oracle, ratio, _),) = every_size.rows_of(oracle, worlds[:1], range(1), 1)
    assert not any("±" in told or "nan" in told for told in (performance, of_oracle))
    assert float(ratio) == pytest.approx(float(of_oracle) / float(performance), rel=0.1)
    assert float(ratio) > 1.0, "the oracle sees everything"


@pytest.mark.parametrize(
    ("script", "words", "told"),
    [
        ("every_size", ("--policy", "dpo"), "another policy than crw, dpo, stochm, stochx, which are the yardstick"),
        ("every_size", ("--policy", "dop"), "Did you mean 'dpo'"),
        ("every_size", ("--horizon", "-1"), "horizon_s"),
        ("turned_worlds", ("--policy", "dpo"), "Expected a network, that is the name of a shipped one"),
        ("turned_worlds", ("--policy", "no_such_file.npz"), "no_such_file.npz"),
        ("turned_worlds", ("--horizon", "-1"), "horizon_s"),
    ],
)
def test_what_cannot_be_measured_is_told_in_one_line(run, script, words, told):
    ends_with, out, _ = run(script, *words)
    assert told in ends_with
    assert "\n" not in ends_with
    assert out == ""


@pytest.mark.compiled
def test_networks_are_run_in_turned_worlds(run):
    words = ("--policy", "ppo_warehouse_small", "--seeds", "1", "--horizon", "600")
    title, header, *rows = run("turned_worlds", *words)[1].splitlines()
    assert title == "Performance per 1,000 s, means of 1 run of 600 s"
    assert header.split() == ["network", "and", "world", "as", "drawn", "quarter", "half", "mirrored"]
    assert [row.split(",")[1].strip() for row in rows] == ["warehouse_small", "warehouse_medium", "search_and_rescue"]
    as_drawn, _, half, _ = map(float, rows[0].split()[-4:])
    assert as_drawn > 20.0 > half, "a specialist that knows the compass by heart"


def test_laws_are_written_beside_the_runs_of_a_study(run):
    pytest.importorskip("matplotlib", reason="needs the plots extra: matplotlib")
    foraging_table().write("laws.parquet")
    code, out, err = run("laws_beside_data", "laws.parquet", "--out", "page")
    assert (code, out) == (0, "written page/laws.md and page/images/laws.png\n"), err
    page = Path("page/laws.md").read_text(encoding="utf-8")
    assert "Swarms of 1 to 8 CRW robots, 512 objects, 4,000 s, 2 runs each. The model uses only the runs of one" in page
    assert re.findall(r"^\| (\d+) \|", page, re.MULTILINE) == ["1", "2", "4", "8"]
    assert re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE) == [*ALL_LAWS, *ALL_LAWS], "what they say, and the fits"
    assert Path("page/images/laws.png").read_bytes().startswith(b"\x89PNG")


def test_the_study_of_the_page_on_laws_is_one_that_the_model_holds_for():
    spec = load_study(ROOT / "docs/laws.toml")
    assert [world.caches for world in (spec.specs_of(place)[0].scenario for place in spec.places)] == ["none"] * 8


def test_sketches_of_theory_are_those_of_the_docs(run):
    pytest.importorskip("matplotlib", reason="needs the plots extra: matplotlib")
    names = ("self_organisation.png", "flexibility.png", "task_graph.png")
    assert run("draw_pictures", *names, "--out", ".")[0] == 0
    for name in names:
        assert Path(name).read_bytes().startswith(b"\x89PNG")
        assert (ROOT / "docs/images" / name).is_file()


RANGE, NO_RANGE = "name=low:high[:log][@start]", "expected name=low:high[:log][@start], log from above 0, got"


@pytest.mark.parametrize(
    ("script", "words", "fault"),
    [
        ("compare_engines", "--robots 4,many", "argument --robots: expected a whole number >= 1, got 'many'"),
        ("compare_engines", "--policy crv", "Unknown policy 'crv'. Did you mean 'crw'?"),
        ("bench", "nothing", "expected some of crw-50, crw-200, "),
        ("bench", "crw --peers venvs", "expected some of vmas-discovery, "),
        ("evolve_controller", "dpo rate=3:1", f"argument {RANGE}: {NO_RANGE} 'rate=3:1'"),
        ("evolve_controller", "dpo rate=1:3@x", f"argument {RANGE}: {NO_RANGE} 'rate=1:3@x'"),
        ("evolve_controller", "dpo rate=0:1:log", f"argument {RANGE}: {NO_RANGE} 'rate=0:1:log'"),
        ("evolve_controller", "dpo object_priority=0:1", "expected two numbers or more: CMA-ES learns how they go"),
        ("evolve_controller", "dpo object_priority=0:1 weight=0:1", "expected numbers of dpo, got 'weight'"),
        ("evolve_network", "--plan plan.toml --out o", "Cannot read"),
        ("bench", "--against .", "expected a revision or a checkout of this project, got /"),
    ],
)
def test_bad_arguments_end_in_a_message(script, words, fault, run):
    code, out, err = run(script, *words.split())
    assert code == 2, err
    assert f"{script}.py: error: {fault}" in " ".join(err.split())
    assert out == ""


def test_kernels_that_only_kernels_call_are_seen_as_reached(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(ROOT / "scripts")
    import check_bounds

    names = ("floor._shine-111.py311-called.nbi", "floor.shine-130.py311.nbi", "floor.shine-130.py311-called.nbi")
    for name in (*names, "floor.draw-3.py311-called.1.nbc"):
        (tmp_path / name).touch()
    assert check_bounds.compiled(tmp_path) == {"floor._shine", "floor.shine"}
    assert {"tick.run", *check_bounds.ELSEWHERE} <= check_bounds.kernels()


@pytest.fixture
def bench(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "scripts")
    return importlib.import_module("bench")


@pytest.mark.compiled
@pytest.mark.parametrize(
    "case", ["crw-50", "seeds-50", "adverse-200", "network-50", "numpy-200", "dict-200", "vec-8x50"]
)
def test_what_is_measured_is_still_there(case, bench):
    assert bench.CASES[case].measure("compiled", 0.01) > 0.0


@pytest.mark.compiled
@pytest.mark.parametrize("policy", ["crw", "stochm", "stochx"])
def test_phases_one_by_one_are_the_tick(policy, monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "scripts")
    caches = getattr(load_policy(policy), "caches", "none")
    world = quick_world("warehouse_medium", caches=caches, walk_probability=0.0)
    phased = importlib.import_module("bench_phases").PhasedRun(policy, world, seed=3)
    run = LiveRun(build_env(world, reads=phased.policy.reads), load_policy(policy), 3, by_ticks=True)
    for tick in range(1, 601):
        phased.tick()
        run.advance(to_tick=tick)
        np.testing.assert_array_equal(phased.arena.obs, run.forage_env.arena.obs, err_msg=f"tick {tick}")
    counters = run.forage_env.arena.events.counters
    np.testing.assert_array_equal(phased.arena.events.counters, counters)
    assert counters[Counter.FREE_PICKUPS] > 0
    assert phased.watch.spent_ns.keys() <= set(importlib.import_module("bench_phases").ROWS)


def test_a_table_has_values_targets_and_ratios_of_rounds(bench):
    cases, by_cases = (
        ["crw-50", "seeds-50", "crw-200"],
        {"crw-50": [[200.0, 100.0, 104.0]], "seeds-50": [[300.0, 200.0, 104.0]]},
    )
    rows = bench.rows_of_cases(cases, by_cases, against=False)
    assert [(row[0], row[2], row[5]) for row in rows[1:]] == [
        ("crw-50", "104", ""),
        ("seeds-50", "200", "1.50 (1.00 to 2.00) x crw-50"),
        ("crw-200", "-", ""),
    ]
    by_versions = {"crw-50": [[100.0, 100.0], [50.0, 1637.0]]}
    assert bench.rows_of_cases(["crw-50"], by_versions, against=True)[1][-2:] == ["844", "8.44 (0.50 to 16.4)"]
    peer = bench.rows_of_peers(["rware"], {"rware": [[2.0], [4.0]]})[1]
    assert peer == ["RWARE, 38 x 22 squares", "2.0.0", "4.00", "vec-50", "2.00", "2.00"]
    assert {of_peer.ours for of_peer in bench.PEERS.values()} <= {*bench.CASES}
    assert {case.beside for case in bench.CASES.values()} <= {"", *bench.CASES}
    assert bench.markdown([["a", "b"], ["long", "c"]]).splitlines()[0] == "| a    | b |"


def test_a_case_that_cannot_be_measured_gives_its_reason(bench):
    with (
        bench.Subject(sys.executable, bench.CASES_FILE, ROOT) as subject,
        pytest.raises(bench.BenchError, match="nobody: KeyError: 'nobody'"),
    ):
        subject.measure("nobody", "compiled", 0.1)
