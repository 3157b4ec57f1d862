"""The protocol of the benchmark: what its file says is what is run, and a version never changes."""

import pytest

from metrics.benchmark import BenchmarkError, load_protocol
from swarm_forage_env import plan_run, scenario
from swarm_forage_env.env import ForageEnv
from tests.support.entries import TINY
from tests.support.foraging import NEAR

IDENTITY_OF_VERSION_1 = "8c641b8515a43882"
"""A change of worlds, seeds or lengths is another version: entries of this one must stay comparable."""


@pytest.fixture(scope="module")
def protocol():
    return load_protocol()


def test_version_1_never_changes(protocol):
    assert (protocol.version, protocol.identity) == (1, IDENTITY_OF_VERSION_1)


def test_held_out_worlds_differ_from_those_to_train_in(protocol):
    given = [world for world in protocol.worlds if not world.is_held_out]
    assert len(given) == 3
    assert not any(world.counts for world in given)
    same = [
        world.name
        for world in protocol.scored
        if not world.is_disturbed and any(world.world.scenario == known.world.scenario for known in given)
    ]
    assert same == []


@pytest.mark.parametrize("policy", ["stochm", "stochx"])
def test_controllers_with_caches_fit_into_every_world(protocol, policy):
    """Those are the worlds that can refuse a controller: caches need room."""
    calm = {world.group: world.world for world in protocol.worlds if not world.is_disturbed}
    assert len(calm) > 5
    for world in calm.values():
        ForageEnv(plan_run(world, policy).scenario)


def test_the_protocol_has_what_it_promises(protocol):
    """Sizes from 8 to 512, every kind of placement, all disturbances."""
    sizes = [world.world.n_robots for world in protocol.scored]
    assert (min(sizes), max(sizes)) == (8, 512)
    placements = {world.world.scenario.objects.placement for world in protocol.scored}
    assert placements == {scenario(name).objects.placement for name in NEAR}
    disturbances = {config.name for world in protocol.scored for config in world.world.wrappers}
    assert disturbances == {"throttle", "handling_cost", "sensor_noise", "actuator_noise", "population"}
    rates = [config for world in protocol.scored for config in world.world.wrappers if config.name == "population"]
    assert any(config.repair_per_tick > 0.0 for config in rates)
    assert any(config.death_per_tick > 0.0 for config in rates)
    assert {world.world.scenario.physics for world in protocol.worlds} == {"compiled"}


def test_a_swarm_of_one_and_ideal_throttles_are_references_only():
    protocol = load_protocol(TINY)
    names = {world.name: world.counts for world in protocol.worlds}
    assert names == {
        "training: here": False,
        "room, 1 robot": False,
        "room, 2 robots": True,
        "room, 4 robots": True,
        "room, throttle 0": False,
        "room, throttle 0.4": True,
        "room, noise 0.01": True,
        "room, failures 4": True,
        "room, noisy wheels": True,
    }


def test_one_run_serves_as_a_size_and_as_the_undisturbed_swarm():
    (group,) = load_protocol(TINY).groups
    roles = [(world, role.criterion) for world, role in group.roles]
    assert ("room, 4 robots", "population_size") in roles
    assert ("room, 4 robots", "none") in roles


def test_quick_is_shorter_and_another_identity():
    full, quick = load_protocol(TINY), load_protocol(TINY, quick=True)
    assert [world.name for world in quick.worlds] == [world.name for world in full.worlds]
    assert (quick.horizon_s, quick.seeds) == (100.0, (1,))
    assert quick.worlds[0].world.scenario.horizon_s == 100.0
    assert quick.identity != full.identity


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("seeds = [1, 2]", "sheds = [1, 2]", "sheds"),
        ("seeds = [1, 2]", "", "missing key 'seeds'"),
        ('name = "room"', 'name = "room"\nlevel = {}', "group.level"),
        ('"noisy wheels" = { actuator_noise', '"noisy wheels" = { wheel_noise', "wheel_noise"),
        ('"noisy wheels"', '"2 robots"', "2 robots"),
        ("version = 1", "version =", "line"),
    ],
)
def test_a_file_that_describes_no_protocol_is_refused(old, new, message, tmp_path):
    file = tmp_path / "protocol.toml"
    file.write_text(TINY.read_text().replace(old, new))
    with pytest.raises(BenchmarkError, match=message) as refused:
        load_protocol(file)
    assert str(file) in str(refused.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(BenchmarkError, match=r"Cannot read the protocol .*none\.toml"):
        load_protocol(tmp_path / "none.toml")
