"""The runs that score a policy: the sweeps of the paper at full budget, fewer levels at smaller budgets."""

from dataclasses import replace

import pytest

from metrics import PopulationRates, queue_statistics
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario
from swarm_forage_env.studies.ladders import (
    BUDGETS,
    CRITERIA,
    Budget,
    budget,
    plan_worlds,
    repairs_per_tick,
    size_ladder,
    spread,
)
from swarm_forage_env.wrappers.noise import SensorNoiseConfig
from swarm_forage_env.wrappers.throttle import ThrottleConfig
from swarm_forage_env.wrappers.waveform import Waveform
from swarm_forage_env.wrappers.world import UNDISTURBED, World

PAPER = BUDGETS["paper"]


def planned(name, criterion, allowed=PAPER, **overrides):
    return plan_worlds(scenario(name, **overrides), [criterion], allowed)


def of(criterion, worlds):
    return [world for world in worlds if world.criterion == criterion]


def test_the_paper_budget_is_the_study():
    assert (PAPER.horizon_s, PAPER.interval_s, PAPER.n_seeds) == (10_000.0, 200.0, 192)
    small, medium = (
        [world.scenario.robots.n_robots for world in planned(name, "population_size")]
        for name in ("warehouse_small", "warehouse_medium")
    )
    assert small == [1, 2, 4, 8, 16, 32, 64, 128]
    assert medium == [1, 2, 4, 8, 16, 32, 64, 128, 256, 512]


def test_search_and_rescue_grows_at_constant_density_from_one_robot_in_the_smallest_arena():
    worlds = [world.scenario for world in planned("search_and_rescue", "population_size")]
    assert [(w.robots.n_robots, w.arena.width_m, w.objects.n_objects) for w in worlds] == [
        (1, 16.0, 80),
        (12, 16.0, 80),
        (51, 32.0, 272),
        (115, 48.0, 368),
        (204, 64.0, 448),
        (320, 80.0, 544),
        (460, 96.0, 1248),
        (627, 112.0, 1408),
        (819, 128.0, 1568),
    ]


@pytest.mark.parametrize(("name", "n_objects"), [("warehouse_small", 512), ("warehouse_medium", 2048)])
def test_sizes_are_swept_with_more_objects_than_everything_else(name, n_objects):
    worlds = plan_worlds(scenario(name), CRITERIA, BUDGETS["quick"])
    assert {world.scenario.objects.n_objects for world in of("population_size", worlds)} == {n_objects}
    others = [world for world in worlds if world.criterion != "population_size"]
    assert {world.scenario.objects.n_objects for world in others} == {scenario(name).objects.n_objects}


def test_a_chosen_number_of_objects_is_kept_for_all_sizes():
    ladder = size_ladder(scenario("warehouse_small", n_objects=77), 3)
    assert {world.objects.n_objects for world in ladder} == {77}


@pytest.mark.parametrize(
    ("name", "amplitudes", "kind", "carriers"),
    [
        ("warehouse_small", [0.15, 0.2, 0.25, 0.3, 0.35, 0.4], "square", True),
        ("search_and_rescue", [0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45], "sine", False),
    ],
)
def test_throttles_are_those_of_the_scenario_and_their_reference_is_the_ideal_throttle(
    name, amplitudes, kind, carriers
):
    reference, *levels = planned(name, "throttle")
    (ideal,) = reference.wrappers
    assert (reference.value, ideal.waveform.kind, ideal.waveform.amplitude) == (0.0, "constant", 0.10)
    assert [level.value for level in levels] == amplitudes
    for level in levels:
        (config,) = level.wrappers
        assert (config.waveform.kind, config.carriers) == (kind, carriers)
        assert config.waveform.amplitude == config.waveform.offset == level.value


def test_throttles_pass_as_many_cycles_in_a_short_run():
    for allowed in BUDGETS.values():
        *_, strongest = planned("warehouse_small", "throttle", allowed)
        (config,) = strongest.wrappers
        assert isinstance(config, ThrottleConfig)
        assert allowed.horizon_s / config.waveform.period_s == 2.0


def test_handling_costs_begin_with_one_tick_and_double():
    reference, *levels = planned("warehouse_medium", "handling_cost", BUDGETS["quick"])
    (ideal,) = reference.wrappers
    assert (reference.value, ideal.waveform) == (0.0, Waveform(kind="constant", amplitude=1.0))
    assert [level.value for level in levels] == [100.0, 800.0]
    (strongest,) = levels[-1].wrappers
    # Two cycles in 4,000 s, from 801 - 800 = 1 to 801 + 800 = 1,601 ticks.
    assert strongest.waveform == Waveform(kind="square", amplitude=800.0, offset=801.0, period_s=2_000.0)
    full = planned("warehouse_medium", "handling_cost")
    assert [level.value for level in full] == [0.0, 25.0, 50.0, 100.0, 200.0, 400.0, 800.0]


@pytest.mark.parametrize(("name", "highest"), [("warehouse_small", 0.03), ("search_and_rescue", 0.10)])
def test_noise_rises_in_equal_steps_from_the_undisturbed_run(name, highest):
    reference, *levels = planned(name, "noise")
    assert (reference.criterion, reference.wrappers) == (UNDISTURBED, ())
    assert [level.value for level in levels] == pytest.approx([highest * step / 7 for step in range(1, 8)])


@pytest.mark.parametrize(("name", "repair"), [("warehouse_small", 0.001022222), ("warehouse_medium", 0.001005556)])
def test_warehouses_have_malfunctions_and_repairs(name, repair):
    reference, *levels = planned(name, "population_dynamics")
    assert reference.population is None
    assert [level.value for level in levels] == list(range(1, 9))
    rates = [level.population for level in levels]
    assert [config.malfunction_per_tick for config in rates] == pytest.approx([0.001 * k for k in range(1, 9)])
    assert [config.repair_per_tick for config in rates] == pytest.approx([repair * k for k in range(1, 9)])


def test_other_swarm_sizes_have_as_large_a_share_away():
    """At 50 and 200 robots the rule gives the rates of the study, to the digits that it prints."""
    for n_robots, repair in ((49, 0.001022676), (51, 0.001021786), (199, 0.001005583)):
        _, lowest, *_ = planned("warehouse_small", "population_dynamics", n_robots=n_robots)
        rho = lowest.population.malfunction_per_tick / lowest.population.repair_per_tick
        assert rho / (1.0 - rho) == pytest.approx(0.9 * n_robots)
        assert lowest.population.repair_per_tick == pytest.approx(repair, abs=1e-9)


def test_a_queue_without_limit_has_more_robots_away_than_a_swarm():
    # 50 robots: 0.001 (1 + 1 / 45). In an unlimited queue 45 are away; a swarm has 29.7 of 50 at work, 118.3 of 200.
    assert repairs_per_tick(0.001, 50) == pytest.approx(0.001 * 46.0 / 45.0)
    for n_robots, at_work in ((50, 29.7), (200, 118.3)):
        rates = PopulationRates(lambda_bd=0.002, mu_bd=repairs_per_tick(0.002, n_robots))
        equilibrium = queue_statistics(rates, n_robots)
        assert equilibrium.length == pytest.approx(0.9 * n_robots)
        assert n_robots - equilibrium.truncated_length == pytest.approx(at_work, abs=0.05)


def test_search_and_rescue_has_deaths():
    _, *levels = planned("search_and_rescue", "population_dynamics")
    assert [level.value for level in levels] == pytest.approx([0.0001 * k for k in range(1, 16, 2)])
    assert [level.population.death_per_tick for level in levels] == [level.value for level in levels]


def test_the_undisturbed_run_is_planned_once():
    worlds = plan_worlds(scenario("warehouse_small"), CRITERIA, BUDGETS["quick"])
    assert len(of(UNDISTURBED, worlds)) == 1
    assert len(worlds) == 14  # itself, 3 sizes, 3 throttles, 3 handling costs, 2 noises, 2 populations
    assert len({(world.criterion, world.value) for world in worlds}) == 14


@pytest.mark.parametrize("name", SCENARIO_NAMES)
@pytest.mark.parametrize("budget_name", BUDGETS)
def test_smaller_budgets_are_parts_of_the_study(name, budget_name):
    for criterion in CRITERIA[1:]:
        full, part = planned(name, criterion), planned(name, criterion, BUDGETS[budget_name])
        assert {world.value for world in part} <= {world.value for world in full}
        assert part[-1].value == full[-1].value
    ladder = size_ladder(scenario(name), BUDGETS[budget_name].n_sizes)
    sizes = [world.robots.n_robots for world in ladder]
    assert sizes[0] == 1
    assert sizes == sorted(set(sizes))


@pytest.mark.parametrize(
    ("name", "n_robots", "count", "sizes"),
    [
        ("warehouse_small", 50, 3, [1, 25, 50]),
        ("warehouse_small", 50, 5, [1, 6, 12, 25, 50]),
        ("warehouse_small", 3, 5, [1, 2, 3]),
        ("warehouse_small", 50, 2, [1, 50]),
        ("search_and_rescue", 115, 3, [1, 51, 115]),
        ("search_and_rescue", 115, 2, [1, 115]),
        ("search_and_rescue", 100, 3, [1, 44, 100]),
        ("search_and_rescue", 12, 4, [1, 12]),
    ],
)
def test_sizes_end_with_the_swarm_of_the_scenario(name, n_robots, count, sizes):
    ladder = size_ladder(scenario(name, n_robots=n_robots), count)
    assert [world.robots.n_robots for world in ladder] == sizes
    assert replace(ladder[-1], objects=scenario(name).objects) == scenario(name, n_robots=n_robots, n_objects=200) or (
        name == "search_and_rescue" and ladder[-1] == scenario(name, n_robots=n_robots)
    )


def test_sizes_at_constant_density_grow_with_the_arena():
    ladder = size_ladder(scenario("warehouse_small", n_robots=200, density=0.05), 4, 0.05)
    seen = [(w.robots.n_robots, w.arena.width_m, w.arena.height_m, w.objects.n_objects) for w in ladder]
    # 50 robots need 1,000 m^2 = 2 a^2 with a = 22.36 m, 100 need a = 31.62 m, 200 need a = 44.72 m.
    assert seen == [(1, 44.8, 22.4, 392), (50, 44.8, 22.4, 392), (100, 63.6, 31.8, 790), (200, 89.6, 44.8, 1568)]
    assert ladder[-1] == scenario("warehouse_small", n_robots=200, density=0.05)


def test_sizes_that_need_too_small_an_arena_are_left_out():
    # Margins take 5.6 m of both sides. Two robots would have 9.2 x 4.6 m, four have 12.8 x 6.4 m.
    ladder = size_ladder(scenario("warehouse_small", n_robots=8), None, 0.05)
    assert [(w.robots.n_robots, w.arena.width_m) for w in ladder] == [(1, 12.8), (4, 12.8), (8, 18.0), (16, 25.6)]
    with pytest.raises(ConfigError, match=r"density of 0\.05 is larger than twice .* got 2 robots"):
        size_ladder(scenario("warehouse_small", n_robots=2), 2, 0.05)


def test_search_and_rescue_keeps_to_its_arenas_at_another_density():
    ladder = size_ladder(scenario("search_and_rescue", n_robots=230, density=0.1), 3, 0.1)
    assert [(w.robots.n_robots, w.arena.width_m) for w in ladder] == [(1, 16.0), (102, 32.0), (230, 48.0)]


def test_a_plan_keeps_the_density_in_sizes_only():
    base = scenario("warehouse_small", n_robots=200, density=0.05)
    quick = BUDGETS["quick"]
    worlds = plan_worlds(base, ["population_size", "throttle"], quick, density=0.05)
    sizes = [world.scenario.arena.width_m for world in of("population_size", worlds)]
    assert sizes == [63.6, 63.6, 89.6]
    assert {world.scenario.arena.width_m for world in of("throttle", worlds)} == {89.6}


def test_levels_are_spread_evenly_and_end_with_the_strongest():
    assert spread([1, 2, 3, 4, 5, 6], 2) == (3, 6)
    assert spread([1, 2, 3, 4, 5, 6, 7], 3) == (2, 4, 7)
    assert spread([1, 2, 3], 1) == (3,)
    assert spread([1, 2], 5) == spread([1, 2], None) == (1, 2)


def test_worlds_are_named_by_what_is_varied():
    assert [world.name for world in planned("warehouse_small", "throttle", BUDGETS["quick"])] == [
        f"warehouse_small, 50 robots, throttle {value}" for value in ("0", "0.25", "0.4")
    ]
    sizes = planned("warehouse_small", "population_size", BUDGETS["quick"])
    assert [world.name for world in sizes] == [f"warehouse_small, {n}" for n in ("1 robot", "25 robots", "50 robots")]


def test_wrappers_of_the_world_are_in_all_worlds():
    always, criteria = SensorNoiseConfig(sigma=0.01), ["population_size", "throttle", "population_dynamics"]
    base = World(scenario("warehouse_small"), (always,))
    worlds, bare = (plan_worlds(given, criteria, BUDGETS["quick"]) for given in (base, base.scenario))
    for world, without in zip(worlds, bare, strict=True):
        assert set(world.wrappers) == {always, *without.wrappers}
        assert (world.scenario, world.criterion, world.value) == (without.scenario, without.criterion, without.value)


def test_a_wrapper_that_a_criterion_varies_is_refused_in_the_world():
    base = World(scenario("warehouse_small"), (SensorNoiseConfig(sigma=0.01),))
    with pytest.raises(ConfigError, match="no wrapper sensor_noise in a world where noise is varied"):
        plan_worlds(base, ["noise"], BUDGETS["quick"])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: budget("quik"), "Unknown budget 'quik'. Did you mean 'quick'"),
        (lambda: planned("warehouse_small", "noize"), "Unknown criterion 'noize'. Did you mean 'noise'"),
        (lambda: planned("warehouse_small", "population_size", n_robots=1), "at least 2 robots"),
        (lambda: Budget(horizon_s=1.0, interval_s=1.0, n_seeds=0, n_sizes=2, n_levels=1), "n_seeds .* >= 1, got 0"),
        (lambda: Budget(horizon_s=1.0, interval_s=1.0, n_seeds=None, n_sizes=2, n_levels=1), "n_seeds .* got None"),
        (lambda: Budget(horizon_s=1.0, interval_s=1.0, n_seeds=1, n_sizes=1, n_levels=1), "n_sizes .* >= 2, got 1"),
        (lambda: Budget(horizon_s=1.0, interval_s=1.0, n_seeds=1, n_sizes=2, n_levels=0.5), "n_levels .* got 0.5"),
    ],
)
def test_nonsense_is_refused(call, message):
    with pytest.raises(ConfigError, match=message):
        call()
