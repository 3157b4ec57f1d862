"""The protocol of the benchmark: what its file says is what is run, and entries hold for it alone."""

import contextlib
import itertools
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from metrics.benchmark import BenchmarkError, Training, load_protocol
from swarm_forage_env import plan_run, scenario
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies import pretrained
from tests.support.entries import TINY

PLAN = Path(pretrained.__file__).with_name("generalist.toml")


@pytest.fixture(scope="module")
def protocol():
    return load_protocol()


def test_it_has_three_worlds_or_more_of_eight_kinds(protocol):
    assert len(protocol.scored) == 27
    kinds = [world.group for world in protocol.scored]
    assert len({*kinds}) == 8
    assert min(kinds.count(kind) for kind in kinds) >= 3


def test_held_out_worlds_differ_from_those_to_train_in(protocol):
    given = [world for world in protocol.worlds if not world.group]
    assert len(given) == 3
    assert not any(world.counts for world in given)
    known = [world.world.scenario for world in given]
    assert [world.name for world in protocol.scored if world.world.scenario in known] == []


def test_a_source_of_boxes_lies_on_all_their_cells(protocol):
    """The small warehouse turned by half: 16 x 56 cells, as many as the source of the preset has."""
    turned = next(each.world.scenario for each in protocol.worlds if each.name.endswith("mirrored, source in the west"))
    ((x_low, y_low, x_high, y_high),) = scenario("warehouse_small").source_cells
    nx, ny = turned.arena.n_cells
    wanted = {(nx - 1 - x, ny - 1 - y) for x in range(x_low, x_high) for y in range(y_low, y_high)}
    assert {box[:2] for box in turned.source_cells} == wanted
    assert turned.arena.nest_box_m == pytest.approx((27.2, 1.6, 30.4, 14.4))


@pytest.mark.parametrize("policy", ["crw", "stochm", "stochx"])
def test_controllers_with_and_without_caches_fit_into_every_calm_world(protocol, policy):
    for world in protocol.scored:
        if not world.is_disturbed:
            ForageEnv(plan_run(world.world, policy).scenario).reset(seed=protocol.seeds[0])


@pytest.mark.parametrize(
    ("fields", "n_policies", "message"),
    [
        ({}, 5, None),
        ({"track": "40M", "decisions": 40_000_000}, 5, None),
        ({"worlds": "other", "track": "open", "decisions": 10**12}, 1, None),
        ({"decisions": 10_000_001}, 5, "at most 10,000,000 decisions .* for the track 10M, got 10,000,001"),
        ({"decisions": None}, 5, r"\(--decisions\) for the track 10M, got none"),
        ({"worlds": "other"}, 5, "trained-in given.* got 'other'; or choose --track open"),
        ({}, 4, "Expected 5 trainings, a file each, for the track 10M, got 4"),
        ({"track": "20M"}, 5, "--track to be one of 10M, 40M, open, got '20M'"),
    ],
)
def test_a_training_fits_its_track_or_is_refused(protocol, fields, n_policies, message):
    training = replace(Training(worlds="given", track="10M", decisions=10_000_000), **fields)
    with contextlib.nullcontext() if message is None else pytest.raises(BenchmarkError, match=message):
        training.check_track(protocol, n_policies)


def test_no_world_has_an_arena_in_which_the_shipped_generalist_was_trained_or_evaluated(protocol):
    plan = tomllib.loads(PLAN.read_text())
    parts = (plan["sampler"], *(stage["sampler"] for stage in plan["stages"] if "sampler" in stage), plan["evaluation"])
    drawn = [world["scenario"] for part in parts for world in part["worlds"]]
    arenas = {
        scenario(fields["preset"], **variant | {"n_robots": n_robots}).arena
        for fields in drawn
        for variant in variants(fields)
        for n_robots in bounds(fields["n_robots"])
    }
    assert len(arenas) > 20
    assert not [world.name for world in protocol.scored if world.world.scenario.arena in arenas]


def bounds(value):
    return value["uniform"] if isinstance(value, dict) else [value]


def variants(fields):
    """Fields of a sampled world as a scenario takes them, once for each choice; those within bounds are left out."""
    choices = {
        name: value["choice"] if isinstance(value, dict) else [value]
        for name, value in fields.items()
        if name != "preset" and not (isinstance(value, dict) and "uniform" in value)
    }
    for picked in itertools.product(*choices.values()):
        yield dict(zip(choices, picked, strict=True))


def test_a_swarm_of_one_does_not_count():
    assert {world.name: world.counts for world in load_protocol(TINY).worlds} == {
        "training: here": False,
        "room, source below": True,
        "room, 1 robot": False,
        "room, 2 robots": True,
        "room, 4 robots": True,
        "room, slow": True,
        "room, noisy wheels": True,
    }


def test_quick_is_shorter_and_another_identity():
    full, quick = load_protocol(TINY), load_protocol(TINY, quick=True)
    assert [world.name for world in quick.worlds] == [world.name for world in full.worlds]
    assert quick.seeds == (1,)
    assert quick.worlds[0].world.scenario.horizon_s == 100.0
    assert quick.identity != full.identity
