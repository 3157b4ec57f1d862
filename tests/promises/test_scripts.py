"""Scripts of measurements run: short, to see that they still fit the packages."""

import re
import runpy
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from metrics.claims import CLAIMS, INTUITIONS
from metrics.laws import ALL_LAWS
from swarm_forage_env.policies.network import Network
from swarm_forage_env.policies.pretrained import network_file
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.runs.store import RunStore
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.studies.study_file import load_study, set_names
from tests.support.foraging_table import foraging_table
from tests.support.made_tables import made_table

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Run a script in an empty folder, in this process: a new one would import for seconds; returns code and texts."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(ROOT / "scripts")

    def call(script, *words):
        monkeypatch.setattr(sys, "argv", [f"{script}.py", *words])
        code = 0
        try:
            runpy.run_path(str(ROOT / f"scripts/{script}.py"), run_name="__main__")
        except SystemExit as end:
            code = end.code
        shown = capsys.readouterr()
        return code, shown.out, shown.err

    return call


@pytest.mark.compiled
def test_conflicts_over_one_object_are_counted(run):
    code, out, _ = run("contact_conflicts", "--scenario", "warehouse_small", "--seeds", "1", "--seconds", "20")
    assert code == 0
    assert "unresolved" in out


@pytest.mark.compiled
def test_what_a_batch_of_runs_could_save_is_estimated(run):
    code, out, _ = run("batch_gain", "--seeds", "2", "--ticks", "5")
    assert code == 0
    header, _, *rows = [line.split("|") for line in out.splitlines()]
    assert [(len(row), row[2].strip()) for row in rows] == [(len(header), size) for size in ("8", "50", "8", "50")]


@pytest.mark.compiled
def test_two_engines_are_compared(run):
    words = ("--policy", "dpo", "--robots", "30", "--seeds", "2", "--horizon", "20", "--all")
    lines = run("compare_engines", *words)[1].splitlines()
    assert len(lines) == 2 + 9 + 2
    assert all(line.startswith("| warehouse_small | dpo | 30 |") for line in lines[2:11])
    assert lines[11:] == [
        "1 of 1 cases have the same numbers in both engines.",
        "In 0 of the 0 rows with other numbers the interval of the difference leaves out zero.",
    ]


def test_two_versions_are_drawn_beside_each_other(run):
    pytest.importorskip("matplotlib", reason="needs the plots extra: matplotlib")
    store = RunStore("runs/warehouse_small")
    for robots in (2, 4):
        world = scenario("warehouse_small", n_robots=robots, horizon_s=4.0, interval_s=4.0)
        store.write(run_one(plan_run(world, "crw")))
    code, out, _ = run("compare_versions", "runs", "runs", "picture.png")
    assert code == 0
    assert "| 4 | 0.0 → 0.0 |" in out
    assert Path("picture.png").read_bytes().startswith(b"\x89PNG")


def test_results_say_which_sets_and_cells_they_are_of(run):
    """One cell of S1a lacks one of its two runs, another both, and those of the other reading do; S1c is whole."""
    pytest.importorskip("matplotlib", reason="needs the plots extra: matplotlib")
    spec = load_study("S1a", "smoke", readings=("described",))
    lost = {(spec.cells[0], 1), (spec.cells[1], 0), (spec.cells[1], 1)}
    made_table(spec, lambda cell: 10.0 * cell.values[0], lost=lost).write("S1a.parquet")
    whole = load_study("S1c", "smoke")
    made_table(whole, lambda cell: 10.0, adversity=lambda cell: cell.values[0]).write("S1c.parquet")
    Path("page").mkdir()
    code, out, _ = run("write_results", "--out", "page", "S1a.parquet", "S1c.parquet")
    assert code == 0
    page = Path("page/results.md").read_text(encoding="utf-8")
    n_planned = sum(load_study(name, "smoke").n_runs for name in set_names())
    n_cells = len(spec.cells)
    assert page.splitlines()[2:5] == [
        f"**This page is of {spec.n_runs - 3 + whole.n_runs} of {n_planned} runs of the paper's sets at budget "
        "`smoke`.** Sets with all runs: S1c. Sets not run: S1b, S1d, S1e, S1f, S1g, S1h, S2a, S2b, S2c, S2d. Sets of "
        "which runs are still to be made:",
        "",
        f"- S1a: {n_cells - 2} of {2 * n_cells} cells whole, with 2 runs each; 1 begun, {n_cells + 1} not run",
    ]
    pictures = {path.relative_to("page").as_posix() for path in Path("page").rglob("*.png")}
    assert pictures == set(re.findall(r"\]\((images/.+?)\)", page))
    assert f"{len(pictures)} pictures" in out
    assert pictures
    assert "swarm-forage study run S1c --budget smoke --seeds 2 --reading both" in page
    details = Path("page/results_in_detail.md").read_text(encoding="utf-8")
    headings = re.findall(r"^### (\w+)$", details, flags=re.MULTILINE)
    assert headings == [*CLAIMS, *INTUITIONS]
    assert re.findall(r"\(results_in_detail\.md#(\w+)\)", page) == [name.lower() for name in CLAIMS]
    (of_p2,) = re.findall(r"### P2\n\n(.+?)\n\n###", details, flags=re.DOTALL)
    forms = [line.split(" | ")[:2] for line in of_p2.splitlines() if line.startswith(("| described", "| program"))]
    assert forms == [["| described", "corrected"], ["| described", "sierra"]], "it is of one reading"
    assert "Waits for runs of S1b" in details
    assert "| `S1a` | population_size 2, 8, 32, 128 | 2 of 192 | E1, E2, E3, P2, X2, X3 |" in page
    assert "Judged [on fewer values than the paper's](#what-is-left-out): E1, E2, E3, P2, R1" in page
    assert f"| `S1c` | {len(whole.cells)} | 0 | 0 | - |" in page, "four intervals are too short for breakdowns"


def test_laws_are_written_beside_the_runs_of_a_study(run):
    pytest.importorskip("matplotlib", reason="needs the plots extra: matplotlib")
    foraging_table().write("laws.parquet")
    code, out, err = run("laws_beside_data", "laws.parquet", "--out", "page")
    assert (code, out) == (0, "written page/laws.md and page/images/laws.png\n"), err
    page = Path("page/laws.md").read_text(encoding="utf-8")
    assert "Swarms of 1 to 8 CRW robots, 512 objects, 4,000 s, 2 runs each. The model knows the runs of one and" in page
    assert re.findall(r"^\| (\d+) \|", page, re.MULTILINE) == ["1", "2", "4", "8"]
    assert re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE) == [*ALL_LAWS, *ALL_LAWS], "what they say, and the fits"
    assert Path("page/images/laws.png").read_bytes().startswith(b"\x89PNG")


def test_the_study_of_the_page_on_laws_is_one_that_the_model_holds_for():
    spec = load_study(ROOT / "scripts/laws.toml")
    assert [world.caches for world in (spec.specs_of(cell)[0].scenario for cell in spec.cells)] == ["none"] * 8


def test_sketches_of_theory_are_those_of_the_docs(run):
    pytest.importorskip("matplotlib", reason="needs the plots extra: matplotlib")
    assert run("draw_theory", ".")[0] == 0
    for name in ("self_organisation.png", "flexibility.png", "task_graph.png"):
        assert Path(name).read_bytes().startswith(b"\x89PNG")
        assert (ROOT / "docs/images" / name).is_file()


@pytest.mark.parametrize(
    ("script", "words", "fault"),
    [
        ("noise_by_group", "--seeds 0", "argument --seeds: expected a whole number >= 1, got '0'"),
        ("noise_by_group", "--horizon 300", "Expected a horizon of a whole number of intervals of 200 s, got 300 s"),
        ("noise_by_group", "--sigmas -1", "Expected sensor_noise.sigma to be a finite number >= 0, got -1.0"),
        (
            "noise_by_group",
            "--scenario warehouse_small --sigmas 0.1 --out taken/noise",
            "[Errno 20] Not a directory: 'taken/noise'",
        ),
        ("contact_conflicts", "--seconds 0.3", "Expected horizon_s to be a whole number of ticks of 0.2 s, got 0.3"),
        ("compare_engines", "--robots 4,many", "argument --robots: expected a whole number >= 1, got 'many'"),
        ("compare_engines", "--policy crv", "Unknown policy 'crv'. Did you mean 'crw'?"),
        ("bench", "--only nothing", "expected --only to be part of the name of a case, got 'nothing'"),
    ],
)
def test_bad_arguments_end_in_a_message(script, words, fault, run):
    Path("taken").touch()
    code, out, err = run(script, *words.split())
    assert code == 2, err
    assert f"{script}.py: error: {fault}" in " ".join(err.split())
    assert out == ""


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--only", "vmas"), "expected some of vmas-discovery, "),
        (("--rounds", "0"), "expected a number above 0, got 0"),
        ((), "required: --venvs"),
    ],
)
def test_other_packages_are_refused_with_what_was_expected(words, said, run):
    code, _, err = run("bench_peers", *words)
    assert code == 2
    assert said in err


def test_kernels_that_only_kernels_call_are_seen_as_reached(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(ROOT / "scripts")
    import check_bounds

    names = ("floor._shine-111.py311-called.nbi", "floor.shine-130.py311.nbi", "floor.shine-130.py311-called.nbi")
    for name in (*names, "floor.draw-3.py311-called.1.nbc"):
        (tmp_path / name).touch()
    assert check_bounds.compiled(tmp_path) == {"floor._shine", "floor.shine"}
    assert {"tick.run", *check_bounds.ELSEWHERE} <= check_bounds.kernels()


def test_a_package_beside_ours_has_a_row(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "scripts")
    import bench_peers

    rates = {bench_peers.CHIPMUNK: 200_000.0, bench_peers.COMPILED: 400_000.0}
    printed = bench_peers.row("rware", 1, 8, [{"rware": 4000.0, **rates}, {"rware": 100.0, **rates}])
    cells = printed.split(" | ")
    assert cells[0] == f"| {bench_peers.PEERS['rware'].label}"
    assert cells[1:7] == ["50", "1", "8", "2.05", "200", "400"]
    assert cells[7:] == ["1,025 (50.00 to 2,000)", "2,050 (100 to 4,000) |"]


def test_a_package_that_cannot_be_timed_gives_its_reason(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "scripts")
    import bench_peers

    worker = bench_peers.Worker(sys.executable)
    try:
        with pytest.raises(bench_peers.PeerError, match="not run: KeyError: 'nobody'"):
            worker.rate("nobody", 50, 1, 0.1)
    finally:
        worker.close()


def test_the_likeliest_action_of_a_network_that_draws_is_told_by_the_same_weights(run, tmp_path):
    assert run("likeliest", "generalist", "likeliest.npz")[0] == 0
    shipped, likeliest = Network.load(network_file("generalist")), Network.load(tmp_path / "likeliest.npz")
    assert (shipped.about.samples, likeliest.about.samples) == (True, False)
    assert replace(likeliest.about, samples=True) == shipped.about
    layers = zip(likeliest.weights + likeliest.biases, shipped.weights + shipped.biases, strict=True)
    assert all(np.array_equal(*pair) for pair in layers)
