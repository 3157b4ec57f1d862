"""Scripts of measurements run: short, to see that they still fit the packages."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def run(*words: str, cwd: Path) -> str:
    done = subprocess.run([sys.executable, *words], cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.compiled
def test_conflicts_over_one_object_are_counted(tmp_path):
    words = ("--scenario", "warehouse_small", "--seeds", "1", "--seconds", "20")
    assert "unresolved" in run(str(ROOT / "scripts/contact_conflicts.py"), *words, cwd=tmp_path)


@pytest.mark.compiled
def test_two_engines_are_compared(tmp_path):
    words = ("--policy", "dpo", "--robots", "30", "--seeds", "2", "--horizon", "20")
    lines = run(str(ROOT / "scripts/compare_engines.py"), *words, cwd=tmp_path).splitlines()
    assert len(lines) == 2 + 9
    assert all(line.startswith("| warehouse_small | dpo | 30 |") for line in lines[2:])


@pytest.mark.compiled
def test_two_versions_are_drawn_beside_each_other(tmp_path):
    pytest.importorskip("matplotlib", reason="needs the plots extra: matplotlib")
    for robots in ("2", "4"):
        run(
            "-m", "swarm_forage_env.cli", "run", "--policy", "crw", "--robots", robots, "--horizon", "4",
            "--set", "interval_s=4", "--jobs", "1", "--out", "runs/warehouse_small", cwd=tmp_path,
        )  # fmt: skip
    printed = run(str(ROOT / "scripts/compare_versions.py"), "runs", "runs", "picture.png", cwd=tmp_path)
    assert "| 4 | 0.0 → 0.0 |" in printed
    assert (tmp_path / "picture.png").read_bytes().startswith(b"\x89PNG")


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
def test_bad_arguments_end_in_a_message(script, words, fault, tmp_path):
    (tmp_path / "taken").touch()
    program = [sys.executable, str(ROOT / f"scripts/{script}.py"), *words.split()]
    done = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    assert f"{script}.py: error: {fault}" in " ".join(done.stderr.split())
    assert done.stdout == ""
