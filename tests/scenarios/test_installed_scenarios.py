"""Scenarios that other packages offer by entry points."""

from importlib.metadata import EntryPoint

import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.inspect.descriptions import describe, overview
from swarm_forage_env.scenarios import presets
from swarm_forage_env.scenarios.presets import SCENARIO_ENTRY_POINTS, SCENARIO_NAMES, scenario, scenario_names
from swarm_forage_env.wrappers.world import World

HERE = "tests.scenarios.test_installed_scenarios"
CELLAR = scenario("warehouse_small", n_robots=7, name="cellar")


def attic(**overrides):
    """Attic with one window."""
    return scenario("classroom", **{"name": "attic", "n_objects": 12, **overrides})


OFFERED = {
    "attic": f"{HERE}:attic",
    "cellar": f"{HERE}:CELLAR",
    "other": f"{HERE}:attic",
    "gone": "a_package_that_is_missing:hall",
}


@pytest.fixture(autouse=True)
def installed(monkeypatch):
    """Offer them as installed packages do."""
    points = {name: EntryPoint(name, value, SCENARIO_ENTRY_POINTS) for name, value in OFFERED.items()}
    monkeypatch.setattr(presets, "_installed", lambda: points)


def test_they_are_known_by_name_and_take_overrides():
    assert scenario_names() == (*SCENARIO_NAMES, *sorted(OFFERED))
    assert scenario("attic", n_robots=3).robots.n_robots == 3
    assert scenario("cellar") == CELLAR
    assert scenario("cellar", n_objects=5).objects.n_objects == 5


def test_worlds_are_named_by_what_differs_from_them():
    assert World(scenario("attic")).file_name == "attic"
    assert World(scenario("attic", n_objects=5)).title() == "attic with 5 objects"


def test_a_broken_one_is_told_of_where_it_is_asked_for():
    with pytest.raises(ConfigError, match="Cannot load the scenario 'gone' from a_package_that_is_missing:hall"):
        scenario("gone")
    with pytest.raises(ConfigError, match="'other' to build a ScenarioConfig of that name, got attic"):
        scenario("other")
    with pytest.raises(ConfigError, match="Did you mean 'attic'"):
        scenario("atic")


def test_list_and_info_show_them_and_say_which_are_broken():
    lines = overview("scenarios").text().splitlines()
    rows = {line.split()[0]: line for line in lines}
    assert "Attic with one window." in rows["attic"]
    assert "7" in rows["cellar"].split()
    assert "broken: ConfigError: Cannot load the scenario 'gone'" in rows["gone"]
    assert "broken: " in rows["other"]
    assert "warehouse_small" in rows
    assert describe("attic").text().startswith("attic: Attic with one window.")


def test_a_broken_policy_leaves_the_others_listed(monkeypatch):
    from swarm_forage_env.policies import registry

    points = registry._installed
    broken = EntryPoint("gone", "a_package_that_is_missing:Policy", registry.POLICY_ENTRY_POINTS)
    monkeypatch.setattr(registry, "_installed", lambda group: (*points(group), broken))
    rows = {line.split()[0]: line for line in overview("policies").text().splitlines()}
    assert "broken: ModuleNotFoundError" in rows["gone"]
    assert "crw" in rows


def test_info_shows_the_world_of_a_file(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('scenario = "attic"\n[set]\nn_objects = 9\n[throttle]\nwaveform = "constant"\namplitude = 0.2\n')
    first = describe(str(file)).text().splitlines()[0]
    assert first == "attic: mine (attic) with 9 objects, throttle: robots lose 20 % of their speed"
