"""The worlds behind the measures: ladders of swarm sizes and of adversity, at three budgets.

A rung of a ladder is a world with one criterion at one value. The criteria, the value that each of them varies, and its
reference world:

    population_size       number of robots; reference: one robot
    throttle              amplitude of the waveform by which robots lose speed; reference: value 0, ideal throttle
    handling_cost         amplitude of the waveform by which handling takes longer; reference: value 0, one tick
    noise                 standard deviation of sensor and actuator noise; reference: the undisturbed run
    population_dynamics   rates of malfunctions and repairs, or of deaths; reference: the undisturbed run
    none                  the undisturbed run itself
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, TypeVar, cast

from msgspec import Meta

from swarm_forage_env._internal.fields import Checked, ConfigError, Positive, Whole, known_name, whole
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.overrides import arena_at_density, robots_at_density
from swarm_forage_env.scenarios.presets import DENSITY, SEARCH_AND_RESCUE_OBJECTS, at_density, search_and_rescue
from swarm_forage_env.scenarios.presets import scenario as preset_scenario
from swarm_forage_env.wrappers.base import WrapperConfig
from swarm_forage_env.wrappers.handling import HandlingCostConfig, square_costs
from swarm_forage_env.wrappers.noise import noise_levels
from swarm_forage_env.wrappers.population import PopulationConfig, death_levels, malfunction_levels
from swarm_forage_env.wrappers.throttle import ThrottleConfig, sine_throttles, square_throttles
from swarm_forage_env.wrappers.world import SIZE, World, WorldLike, world_of

ADVERSITIES = ("throttle", "handling_cost", "noise", "population_dynamics")
CRITERIA = (SIZE, *ADVERSITIES)
STUDY_HORIZON_S = 10_000.0
"""Length of the study's runs, which its throttle waveforms have their periods for."""
SIZE_SWEEP_OBJECTS = {
    "warehouse_small": 512,
    "warehouse_medium": 2048,
    "warehouse_dual": 512,
    "warehouse_quad": 2048,
}
"""Objects while the swarm size varies: enough for the largest swarm (study configuration; dual and quad: our choice, as
in the warehouse of that size)."""
STUDY_LARGEST_SIZE = 2.56
"""Largest swarm of the size sweeps in units of the usual one: 128 of 50 and 512 of 200 (study configuration)."""
SIGMA_MAX, SIGMA_MAX_SEARCH_AND_RESCUE = 0.03, 0.10
"""Highest noise of the robustness studies (paper; dual, quad and classroom: our choice, as in the other warehouses, as
more stops most controllers wholly)."""
STUDY_SIZES_OF_MALFUNCTIONS = (50, 200)
MALFUNCTION_PER_TICK = 0.001
AWAY_SHARE = 0.9
"""Share of the swarm away in the equilibrium of an unlimited queue at the study's malfunction and repair rates."""

_T = TypeVar("_T")


@dataclass(frozen=True, kw_only=True, slots=True)
class Budget(Checked):
    """How much computing a score may cost."""

    called: ClassVar[str] = "budget"
    horizon_s: Positive
    """Length of a run. Waveforms are compressed to it, so that they pass as many cycles as in the study; population
    rates and noise stay as they are."""
    interval_s: Positive
    """Length of a recording interval."""
    n_seeds: Whole
    n_sizes: Annotated[int, Meta(ge=2)] | None
    """Swarm sizes from one robot up, the largest the scenario's own; None = the sweep of the study."""
    n_levels: Whole | None
    """Levels of each kind of adversity, evenly spread up to the study's strongest; None = all of the study."""


BUDGETS: dict[str, Budget] = {
    "quick": Budget(horizon_s=4_000.0, interval_s=100.0, n_seeds=4, n_sizes=3, n_levels=2),
    "standard": Budget(horizon_s=10_000.0, interval_s=200.0, n_seeds=16, n_sizes=5, n_levels=4),
    "paper": Budget(horizon_s=STUDY_HORIZON_S, interval_s=200.0, n_seeds=192, n_sizes=None, n_levels=None),
}
"""quick: about a minute per policy, shows large differences; standard: ten minutes to an hour per policy; paper: the
sizes, levels, length and number of runs of the study. Times for the warehouses on two cores."""


def budget(name: str) -> Budget:
    """Return a budget by name; raises ConfigError on an unknown one."""
    known_name("budget", name, BUDGETS)
    return BUDGETS[name]


def plan_worlds(
    base: WorldLike, criteria: Collection[str], budget: Budget, *, density: float | None = None
) -> tuple[World, ...]:
    """Return the worlds of `criteria` and their reference worlds, each once.

    Args:
        base: The world. All worlds get its wrappers, and the horizon and the recording interval of the budget.
        criteria: Some of `CRITERIA`.
        budget: How many sizes and levels, and how long a run is.
        density: Robots per m^2 for all swarm sizes, see `size_ladder`; None = all sizes in the scenario's arena.

    Raises:
        ConfigError: an unknown criterion, a swarm of one robot when sizes are varied, a size for which the arena has no
            room, or a wrapper of `base` that a criterion varies, too.
    """
    for name in criteria:
        known_name("criterion", name, CRITERIA)
    given = world_of(base)
    scenario = replace(given.scenario, horizon_s=budget.horizon_s, interval_s=budget.interval_s)
    always = given.wrappers
    worlds: list[World] = []
    if SIZE in criteria:
        worlds += [
            World(sized, always, criterion=SIZE, value=sized.robots.n_robots)
            for sized in size_ladder(scenario, budget.n_sizes, density)
        ]
    if "noise" in criteria or "population_dynamics" in criteria:
        worlds.append(World(scenario, always))
    for criterion in ADVERSITIES:
        if criterion in criteria:
            (_, ideal), *disturbed = _levels(scenario, criterion).items()
            worlds += [
                World(scenario, _joined(always, wrappers, criterion), criterion=criterion, value=value)
                for value, wrappers in ([(0.0, ideal)] if ideal else []) + list(spread(disturbed, budget.n_levels))
            ]
    return tuple(worlds)


def _joined(
    always: Sequence[WrapperConfig], varied: Sequence[WrapperConfig], criterion: str
) -> tuple[WrapperConfig, ...]:
    """Return the wrappers of all worlds, then those of a level; raises ConfigError if both have one of a kind."""
    taken = sorted({config.name for config in always} & {config.name for config in varied})
    if taken:
        raise ConfigError(
            f"Expected no wrapper {taken[0]} in a world where {criterion} is varied, which sets it, too; leave out "
            f"the wrapper, or what varies {criterion}; a score varies it only for some measures (--measures)."
        )
    return (*always, *varied)


def spread(levels: Sequence[_T], count: int | None) -> tuple[_T, ...]:
    """Return `count` of `levels`, evenly spread and ending with the last one; None = all."""
    if count is None or count >= len(levels):
        return tuple(levels)
    return tuple(levels[(index + 1) * len(levels) // count - 1] for index in range(count))


def size_ladder(
    scenario: ScenarioConfig, count: int | None, density: float | None = None
) -> tuple[ScenarioConfig, ...]:
    """Return the scenario with one robot, with more robots, up to its own swarm size (or the largest of the study).

    In search and rescue, and where a density is given, the arena grows with the swarm; the one-robot run is in the
    smallest arena.

    Args:
        scenario: Scenario with the usual number of robots.
        count: Number of sizes; None = powers of two up to 2.56 times the usual size (which gives the study's 128 and
            512), or all eight arenas of search and rescue.
        density: Robots per m^2 of all sizes but one robot; the arenas have the proportions of the scenario. Sizes for
            which the arena would be too small are left out. Search and rescue keeps to its arenas; its default is the
            density of the scenario.

    Raises:
        ConfigError: the scenario has one robot only, or there is no room for the largest swarm.
    """
    n_robots = scenario.robots.n_robots
    if n_robots < 2:
        raise ConfigError("Expected a scenario of at least 2 robots where swarm sizes are compared, got 1.")
    if scenario.name == "search_and_rescue":
        return _growing_arenas(scenario, count, density)
    if count is None:
        sizes = {2**power for power in range(64) if 2**power <= STUDY_LARGEST_SIZE * n_robots}
    else:
        # Halves of halves, so that neighbours differ by the same factor: 1, 25, 50 or 1, 6, 12, 25, 50.
        sizes = {1, *(max(2, n_robots >> halvings) for halvings in range(count - 1))}
    rungs = sorted(sizes)
    if density is not None:
        rungs = [1, *(size for size in rungs if size > 1 and _has_room(scenario, density, size))]
        if len(rungs) == 1:
            raise ConfigError(
                f"Expected a swarm whose arena at a density of {density:g} is larger than twice robots.start_margin_m "
                f"= {scenario.robots.start_margin_m} m, got {max(sizes)} robots; ask for more robots or a lower "
                "density."
            )
    return tuple(swarms_of_sizes(scenario, rungs, density).values())


def _has_room(scenario: ScenarioConfig, density: float, n_robots: int) -> bool:
    """Whether the arena of so many robots at a density is larger than its margins."""
    arena = arena_at_density(scenario, density, n_robots)
    return min(arena["width_m"], arena["height_m"]) > 2.0 * scenario.robots.start_margin_m


def swarms_of_sizes(
    scenario: ScenarioConfig, sizes: Sequence[int], density: float | None = None
) -> dict[int, ScenarioConfig]:
    """Return the scenario with each of some swarm sizes, by size, under the rules of `size_ladder`.

    Args:
        scenario: The scenario.
        sizes: Numbers of robots, each once.
        density: Robots per m^2 for all sizes but one robot; None = the arena of the scenario, in search and rescue the
            smallest of its arenas that holds the swarm at 5 %.

    Raises:
        ConfigError: the arena does not have room for a size, or there is no arena for it.
    """
    for size in sizes:
        whole("population_size", size, at_least=1)
    if density is None and scenario.name != "search_and_rescue":
        # A warehouse with its usual number of objects gets more, so that large swarms have enough.
        usual = preset_scenario(scenario.name).objects.n_objects if scenario.name in SIZE_SWEEP_OBJECTS else None
        if scenario.objects.n_objects == usual:
            scenario = replace(scenario, objects=replace(scenario.objects, n_objects=SIZE_SWEEP_OBJECTS[scenario.name]))
        return {size: replace(scenario, robots=replace(scenario.robots, n_robots=size)) for size in sizes}
    # One robot is in the smallest arena of the others, because at the density alone it would have next to none.
    smallest = min((size for size in sizes if size > 1), default=1)
    worlds = {size: at_density(scenario, density or DENSITY, n_robots=max(size, smallest)) for size in sizes}
    return {size: replace(world, robots=replace(world.robots, n_robots=size)) for size, world in worlds.items()}


def study_values(scenario: ScenarioConfig, criterion: str) -> tuple[float, ...]:
    """Return the values that the study gives a criterion in a scenario, the smallest first, without the value 0.

    Raises:
        ConfigError: an unknown criterion, or a swarm of one robot when sizes are varied.
    """
    known_name("criterion", criterion, CRITERIA)
    if criterion == SIZE:
        return tuple(sized.robots.n_robots for sized in size_ladder(scenario, None))
    return tuple(_levels(scenario, criterion))[1:]


def wrappers_at(scenario: ScenarioConfig, criterion: str, value: float) -> tuple[WrapperConfig, ...]:
    """Return the wrappers that make a value of a criterion, which may be a value that the study does not use.

    Args:
        scenario: The scenario; its horizon, to which waveforms are compressed, and its number of robots matter.
        criterion: One of `CRITERIA` but the swarm size.
        value: 0 is the ideal throttle or handling cost; for the other criteria it means no disturbance.

    Raises:
        ConfigError: an unknown criterion, or a value that its wrapper refuses.
    """
    known_name("criterion of adversity", criterion, ADVERSITIES)
    levels = _levels(scenario, criterion)
    if value in levels:
        return levels[value]
    _, (level, wrappers), *_ = levels.items()
    return tuple(_moved(config, level, value) for config in wrappers)


def _growing_arenas(scenario: ScenarioConfig, count: int | None, density: float | None) -> tuple[ScenarioConfig, ...]:
    """Search and rescue at constant density, one robot in the smallest arena first."""
    base_side = scenario.arena.width_m
    if density is None:
        density = scenario.robots.n_robots / (base_side * base_side)
        if scenario.robots.n_robots == robots_at_density(base_side * base_side, DENSITY):
            density = DENSITY  # that of the preset, without truncation to whole robots
    smallest = min(SEARCH_AND_RESCUE_OBJECTS)
    sides = [float(side) for side in SEARCH_AND_RESCUE_OBJECTS if count is None or side < base_side]
    sides = sides if count is None else [*spread(sides, min(count - 2, len(sides))), base_side]
    if count == 2:
        sides = [base_side]
    ladder = [_in_arena(scenario, float(smallest), 1)]
    for side in sides:
        sized = scenario if side == base_side else _in_arena(scenario, side, robots_at_density(side * side, density))
        if sized.robots.n_robots > ladder[-1].robots.n_robots:
            ladder.append(sized)
    return tuple(ladder)


def _in_arena(scenario: ScenarioConfig, side_m: float, n_robots: int) -> ScenarioConfig:
    """Return `scenario` in the search and rescue arena of that side, everything else as it is."""
    preset = search_and_rescue(side_m=side_m)
    return replace(
        scenario,
        arena=preset.arena,
        robots=replace(scenario.robots, n_robots=n_robots),
        objects=replace(scenario.objects, n_objects=preset.objects.n_objects),
    )


def _levels(scenario: ScenarioConfig, criterion: str) -> dict[float, tuple[WrapperConfig, ...]]:
    """Return the wrappers of the reference, value 0, and of each level of the study, in their order."""
    is_rescue = scenario.name == "search_and_rescue"
    if criterion == "throttle":
        return _waved(sine_throttles() if is_rescue else square_throttles(), scenario)
    if criterion == "handling_cost":
        return _waved(square_costs(), scenario)
    if criterion == "noise":
        sigmas = noise_levels(SIGMA_MAX_SEARCH_AND_RESCUE if is_rescue else SIGMA_MAX)[1:]
        return {0.0: (), **{cast("float", both[1].sigma): both for both in sigmas}}
    if is_rescue:
        return {0.0: (), **{config.death_per_tick: (config,) for config in death_levels()}}
    configs = enumerate(_malfunctions(scenario.robots.n_robots), 1)
    return {0.0: (), **{float(factor): (config,) for factor, config in configs}}


def _waved(
    configs: Sequence[ThrottleConfig] | Sequence[HandlingCostConfig], scenario: ScenarioConfig
) -> dict[float, tuple[WrapperConfig, ...]]:
    """Waveforms compressed to the length of a run; the first is the ideal one."""
    levels: dict[float, tuple[WrapperConfig, ...]] = {}
    for config in configs:
        wave = config.waveform
        if wave.period_s is not None:
            wave = replace(wave, period_s=wave.period_s * (scenario.horizon_s / STUDY_HORIZON_S))
        levels[wave.amplitude if levels else 0.0] = (replace(config, waveform=wave),)
    return levels


def _moved(config: Any, level: float, value: float) -> WrapperConfig:
    """Return the wrapper of a level for another value: amplitude and offset move together, rates are multiples."""
    if hasattr(config, "waveform"):
        wave = config.waveform
        return replace(config, waveform=replace(wave, amplitude=value, offset=wave.offset - level + value))
    if hasattr(config, "sigma"):
        return replace(config, sigma=value)
    rates = ("death_per_tick", "malfunction_per_tick", "repair_per_tick")
    return replace(config, **{name: getattr(config, name) * (value / level) for name in rates})


def repairs_per_tick(malfunction_per_tick: float, n_robots: int) -> float:
    """Return the repair rate at which an unlimited queue holds `AWAY_SHARE` of the swarm, in equilibrium.

    rho / (1 - rho) = AWAY_SHARE * N with rho = malfunctions / repairs. A swarm cannot lose more robots than it has, so
    fewer robots are away in its own equilibrium.
    """
    return malfunction_per_tick * (1.0 + 1.0 / (AWAY_SHARE * n_robots))


def _malfunctions(n_robots: int) -> tuple[PopulationConfig, ...]:
    """Rates of the study; for other swarm sizes, rates that keep the same share of the swarm away (our choice)."""
    if n_robots in STUDY_SIZES_OF_MALFUNCTIONS:
        return malfunction_levels(n_robots)
    repair = repairs_per_tick(MALFUNCTION_PER_TICK, n_robots)
    return tuple(
        PopulationConfig(malfunction_per_tick=factor * MALFUNCTION_PER_TICK, repair_per_tick=factor * repair)
        for factor in range(1, 9)
    )
