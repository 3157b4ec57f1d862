"""The command `export`, as a person uses it."""

from pathlib import Path


def test_an_export_says_how_large_the_arena_is(command):
    code, _, _ = command("export", "generalist", "--file", "net.h", "--set", "width_m=12", "--set", "nest_size_m=1,3")
    assert code == 0
    assert "Arena: X = 12 m, Y = 16 m." in Path("net.h").read_text()
    command("export", "generalist", "--file", "hall.h", "--scenario", "search_and_rescue", "--robots", "16")
    assert "Arena: X = 32 m, Y = 32 m." in Path("hall.h").read_text(), "the hall grows with the swarm"
