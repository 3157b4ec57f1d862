"""One word means one thing in all commands: which options they have."""

import inspect
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import pytest
import typer

from swarm_forage_env.cli.app import loaded
from swarm_forage_env.cli.commands import COMMANDS
from swarm_forage_env.cli.options import spread

ONE_RUN = ("record", "replay")
"""Commands that look into one run, or into one of each policy."""


ALL = {one.words: loaded(one) for group in COMMANDS.values() for one in group if one.place}
WITH_SCENARIO = [words for words, command in ALL.items() if any("--scenario" in one.opts for one in command.params)]


def options_of(words):
    return {option for param in ALL[words].params for option in param.opts}


MAKE_RUNS = [words for words in WITH_SCENARIO if "--dry-run" in options_of(words) and words != "dataset"]
"""Commands that make many runs and answer a question about them."""


def test_commands_that_have_a_scenario_are_those_that_we_mean():
    assert {"run", "score", "compare"} <= {*MAKE_RUNS}
    assert {*ONE_RUN, "train", "dataset"} <= {*WITH_SCENARIO}


@pytest.mark.parametrize("words", WITH_SCENARIO)
def test_whatever_has_a_scenario_takes_all_that_describes_a_world(words):
    wanted = {"--scenario", "--wrapper", "--set", "--objects", "--side", "--caches", "--horizon", "--performance"}
    assert wanted <= options_of(words)


@pytest.mark.parametrize("words", WITH_SCENARIO)
def test_whatever_has_a_scenario_takes_a_file_of_it(command, words):
    Path("world.toml").write_text('scenario = "warehouse_smal"\n')
    needed = [word for param in ALL[words].params if param.required for word in (param.opts[0], "4")]
    policies = () if words == "train" else ("ppo_warehouse_small",)
    code, out, err = command(*words.split(), *policies, "--scenario", "world.toml", *needed)
    assert (code, out) == (2, "")
    assert "Unknown scenario 'warehouse_smal'. Did you mean 'warehouse_small'?" in err


@pytest.mark.parametrize("words", MAKE_RUNS)
def test_whatever_makes_runs_says_where_how_many_and_in_what_form(words):
    assert {"--jobs", "--seeds", "--out", "--json", "--dry-run", "--policy"} <= options_of(words)


@pytest.mark.parametrize("words", ["list", "info", "rerun", "benchmark show"])
def test_what_is_printed_is_there_as_json_too(words):
    assert "--json" in options_of(words)


def test_spread_gives_a_command_objects_of_its_option_classes():
    @dataclass(frozen=True, kw_only=True)
    class Look:
        size: Annotated[int, typer.Option("--size")] = 3
        names: Annotated[tuple[str, ...], typer.Option("--name")] = ()

    def show(look: Look, file: str = "x") -> None:
        seen.append((look, file))

    seen: list[object] = []
    one = spread(show)
    assert list(inspect.signature(one).parameters) == ["size", "names", "file"]
    one(size=4, names=["a", "b"], file="y")
    one(size=3, names=None, file="x")
    assert seen == [(Look(size=4, names=("a", "b")), "y"), (Look(), "x")]


def test_an_option_takes_a_value_in_all_commands_or_in_none():
    found: dict[str, set[bool]] = {}
    for command in ALL.values():
        for option in command.params:
            for word in option.opts:
                found.setdefault(word, set()).add(bool(getattr(option, "is_flag", False)))
    assert [word for word, flags in found.items() if len(flags) > 1] == []


def test_a_folder_is_no_file(command):
    code, _, err = command("run", "crw", "--out", "film.gif")
    assert code == 2
    assert "Expected --out as a folder, got film.gif; --file and --picture take files." in err
