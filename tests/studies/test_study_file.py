"""Study files, and the paper's sets among them."""

from pathlib import Path

import pytest

from swarm_forage_env import load_policy
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies import pretrained
from swarm_forage_env.scenarios.quirks import QUIRK_NAMES
from swarm_forage_env.studies.ladders import BUDGETS
from swarm_forage_env.studies.study import Place, is_set_of_paper, left_out, load_study, set_names, study_of
from swarm_forage_env.studies.study_file import word_of

EXPERIMENTS = {"S1a": 8, "S1b": 10, "S1c": 7, "S1d": 7, "S1e": 8, "S1f": 8, "S1g": 8, "S1h": 8,
               "S2a": 32, "S2b": 24, "S2c": 24, "S2d": 24}  # fmt: skip
"""Set of the paper -> experiments per controller."""

FILE = """
name = "mine"
scenario = "warehouse_small"
policies = ["crw", { policy = "stochm", label = "without caches", caches = "none" }]
rules = ["described"]

[set]
n_objects = 50
nest_size_m = [3.2, 6.4]

[wrappers.population]
death_per_tick = 0.0001

[[axis]]
field = "walk_probability"
values = [0.0, 0.01]

[[axis]]
criterion = "noise"
values = [0.01, 0.02, 0.03, 0.04]

[budget.tiny]
seeds = 2
horizon_s = 400.0
values = { noise = 2, walk_probability = [0.01] }
"""


@pytest.fixture
def written(tmp_path):
    def write(text=FILE):
        file = tmp_path / "mine.toml"
        file.write_text(text)
        return file

    return write


def test_the_paper_ran_129024_times():
    studies = {name: load_study(name, "paper", rules=["described"]) for name in set_names()}
    assert {name: len(spec.places) // 4 for name, spec in studies.items()} == EXPERIMENTS
    assert all([p.label for p in spec.policies] == ["crw", "dpo", "stochm", "stochx"] for spec in studies.values())
    assert sum(len(spec.plan.specs) for spec in studies.values()) == 168 * 4 * 192 == 129_024
    assert {spec.length.horizon_s for spec in studies.values()} == {BUDGETS["paper"].horizon_s}
    ticks = {run.scenario.horizon_ticks for spec in studies.values() for run in spec.specs_of(spec.places[0])}
    assert ticks == {50_000}


@pytest.mark.parametrize(
    ("name", "robots", "objects", "reference"),
    [
        ("S1a", {1, 2, 4, 8, 16, 32, 64, 128}, {512}, 1),
        ("S1b", {1, 2, 4, 8, 16, 32, 64, 128, 256, 512}, {2048}, 1),
        ("S1c", {50}, {200}, 0.0),
        ("S1f", {200}, {800}, 0.0),
        ("S1g", {50}, {200}, 1.0),
        ("S2a", {12, 51, 115, 204, 320, 460, 627, 819}, {22, 87, 196, 348, 544, 783, 1066, 1393}, 12),
        ("S2d", {12, 115, 320}, {22, 196, 544}, 0.0001),
    ],
)
def test_the_worlds_of_the_sets(name, robots, objects, reference):
    spec = load_study(name, "paper")
    worlds = [spec.world(place).scenario for place in spec.places]
    assert {world.robots.n_robots for world in worlds} == robots
    assert {world.objects.n_objects for world in worlds} == objects
    assert {world.physics for world in worlds} == {"compiled"}
    assert spec.reference == reference
    assert all(spec.reference_of(place) in spec.places for place in spec.places)


def test_the_reference_of_wandering_objects_wanders_as_much():
    spec = load_study("S2a", "paper")
    assert spec.reference_of(Place("program", "dpo", (0.026, 819))) == Place("program", "dpo", (0.026, 12))


@pytest.mark.parametrize("name", set_names())
def test_every_set_has_its_budgets_and_both_readings(name):
    with pytest.raises(ConfigError, match="Known: smoke, reduced, confirmatory, paper"):
        load_study(name, "another")
    smoke, reduced = (load_study(name, budget) for budget in ("smoke", "reduced"))
    assert smoke.rules == reduced.rules == ("described", "program")
    assert smoke.plan.robot_ticks < 50e6, "a minute or two of one core"
    paper = load_study(name, "paper")
    assert set(reduced.places) <= set(paper.places)
    assert min(load_study(name, "confirmatory").seeds) == 1000 > max(paper.seeds), "runs that nobody has seen"
    place = reduced.places[-1]
    of_place = reduced.specs_of(place)
    assert of_place == paper.specs_of(place)[: len(of_place)], "so that a reduced study can be continued"


def test_a_file_and_a_budget_make_a_study(written):
    spec = load_study(written(), "tiny")
    assert spec == load_study(written()), "the first budget is the default"
    assert [(axis.name, axis.values) for axis in spec.axes] == [
        ("walk_probability", (0.01,)), ("noise", (0.0, 0.02, 0.04))]  # fmt: skip
    assert (spec.reference, spec.seeds, spec.length.horizon_s, spec.length.interval_s) == (0.0, (0, 1), 400.0, 200.0)
    last = spec.specs_of(Place("described", "without caches", (0.01, 0.04)))[1]
    assert (last.policy, last.scenario.caches, last.seed) == ("stochm", "none", 1)
    assert last.scenario.objects.n_objects == 50
    assert [config.name for config in last.wrappers] == ["sensor_noise", "population", "actuator_noise"]
    assert (last.world.criterion, last.world.value) == ("noise", 0.04)


def test_seeds_and_readings_can_be_chosen(written):
    spec = load_study(written(), seeds=3, rules=["program"])
    assert (spec.seeds, spec.rules) == ((0, 1, 2), ("program",))
    assert load_study(written(FILE.replace("seeds = 2", "seeds = [7, 9]"))).seeds == (7, 9)


def test_the_budget_of_the_paper_is_always_there(written):
    spec = load_study(written(), "paper")
    assert (len(spec.seeds), spec.length.horizon_s) == (192, 10_000.0)
    assert spec.axes[-1].values == (0.0, 0.01, 0.02, 0.03, 0.04)


def test_an_axis_of_quirks_has_all_of_them_and_the_rules_as_reference():
    spec = load_study(Path(__file__).parents[2] / "docs/quirks.toml")
    (axis,) = spec.axes
    assert (axis.name, axis.values, spec.reference) == ("quirk", ("none", *QUIRK_NAMES), "none")
    place = Place("program", "stochx", ("scattered_sites",))
    assert spec.reference_of(place) == Place("program", "stochx", ("none",))


def test_rules_that_the_text_lacks_are_parameters_of_policies_in_a_study():
    spec = load_study(Path(__file__).parents[2] / "docs/silent.toml")
    given = {policy.label: policy.parameters for policy in spec.policies if policy.parameters}
    assert given["dpo_sees_obstacles_at_goals"] == {"approach_ignores_obstacles": False}
    assert all(load_policy(one.policy, one.parameters) for one in spec.policies)


def test_a_policy_file_lies_beside_the_study(written, tmp_path):

    source = next(Path(pretrained.__file__).parent.glob("*.npz"))
    (tmp_path / "own.npz").write_bytes(source.read_bytes())
    spec = load_study(written(FILE.replace('"crw"', '"own.npz"')))
    assert spec.policies[0].label == "own"
    assert spec.policies[0].policy == str(tmp_path / "own.npz")
    assert "digest" in spec.policies[0].parameters


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("policies", "polices", "unknown field `polices`"),
        ("death_per_tick", "deaths_per_tick", "Did you mean 'population.death_per_tick'"),
        ("criterion", "criterium", r"unknown field `criterium` in axis\[1\]"),
        ('criterion = "noise"', 'criterion = "noise"\nfield = "n_objects"', "either criterion or field"),
        ("values = [0.0, 0.01]", "", "Missing key 'values' of axis walk_probability"),
        ("values = [0.0, 0.01]", "values = [0.0]\nreference = 0.0", "reference on the last axis only"),
        ("seeds = 2", "seeds = 0", "seeds to be a whole number from 1 to 100,000"),
        ("noise = 2", "nose = 2", "Did you mean 'values.noise'"),
        ("noise = 2", "noise = [0.05]", "to be some of"),
        ("[set]", "[set", "mine.toml"),
        ("values = [0.01, 0.02, 0.03, 0.04]", "values = []", "values of axis noise to be one or more values"),
    ],
)  # fmt: skip
def test_what_a_file_may_not_say(written, old, new, message):
    assert old in FILE
    with pytest.raises(ConfigError, match=message) as refusal:
        load_study(written(FILE.replace(old, new, 1)))
    assert "mine.toml" in str(refusal.value)


def test_unknown_studies_and_budgets_are_refused(written):
    with pytest.raises(ConfigError, match="Did you mean 'S1h'"):
        load_study("S1i")
    with pytest.raises(ConfigError, match=r"Did you mean 'tiny'\? Known: tiny, paper"):
        load_study(written(), "tini")


def test_a_set_of_the_paper_is_known_by_more_than_its_name():
    some = load_study("S1a", "reduced", seeds=2, rules=("program",))
    assert is_set_of_paper(some)
    assert is_set_of_paper(some.with_run(seeds=(5, 9)))
    assert not is_set_of_paper(study_of(some.text.replace("[set]", "[set]\nn_objects = 20")))
    assert not is_set_of_paper(study_of(some.text.replace('"S1a"', '"mine"')))


def test_an_axis_of_lists(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(
        'name = "mine"\nscenario = "warehouse_small"\npolicies = ["random"]\nrules = ["described"]\n'
        '[[axis]]\nfield = "further_nests"\nvalues = [[], [[14.0, 1.0, 18.0, 4.0]], [[14.0, 9.0, 18.0, 12.0]]]\n'
        "reference = []\n"
        "[budget.few]\nseeds = 1\nvalues = { further_nests = [[[14.0, 1.0, 18.0, 4.0]]] }\n"
    )
    spec = load_study(file)
    assert spec.axes[0].values == ((), ((14.0, 1.0, 18.0, 4.0),))
    assert (spec.reference, word_of(spec.places[1].values[-1])) == ((), "14,1,18,4")
    assert [spec.world(place).scenario.arena.further_nests for place in spec.places] == [(), ((14.0, 1.0, 18.0, 4.0),)]


def test_what_a_budget_leaves_out_of_the_paper_is_told():
    reduced = load_study("S2a", "reduced")
    assert left_out(reduced) == {"walk_probability": ("0.026",), "population_size": ("460", "627", "819")}
    assert left_out(load_study("S2a", "paper")) == {}
    assert left_out(study_of(reduced.text.replace('"S2a"', '"mine"'))) == {}, (
        "nobody knows what a study of one's own might have"
    )


def test_more_conditions_than_anybody_runs_are_refused_before_any_is_made(tmp_path):
    text = 'name = "much"\nscenario = "warehouse_small"\npolicies = ["crw"]\nrules = ["described"]\n'
    for name, first in (("n_objects", 10), ("pickup_ticks", 1), ("n_robots", 1)):
        text += f'[[axis]]\nfield = "{name}"\nvalues = {list(range(first, first + 50))}\n'
    (tmp_path / "much.toml").write_text(text)
    with pytest.raises(ConfigError, match=r"at most 100,000 conditions of study much, got 125,000; leave out"):
        load_study(tmp_path / "much.toml")


def test_a_budget_is_a_part_of_a_file_name(tmp_path):
    (tmp_path / "a.toml").write_text(
        'name = "a"\nscenario = "warehouse_small"\npolicies = ["crw"]\n[budget."../b"]\nseeds = 1\n'
    )
    with pytest.raises(ConfigError, match="budget to be at most 60 characters that can be a part of a file name"):
        load_study(tmp_path / "a.toml")
