"""The recipe by which `swarm-forage train` makes its plans: defaults that were seen to learn, for Python, too.

Deliveries are too rare to learn from them alone. Where they count, the recipe also rewards first pick-ups and the way
home, makes it cost a little to be in the way of others, and begins in a smaller arena. The last third of a training
learns more slowly. All numbers are our choice.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from swarm_forage_env._internal.fields import ConfigError, read, table, whole
from swarm_forage_env.policies.interface import GivenInterface, InterfaceConfig, chosen_interface
from swarm_forage_env.runs.plan import Plan
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELLS_PER_M
from swarm_forage_env.scenarios.obstacles import stretched
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.scenarios.presets import chosen_scenario
from swarm_forage_env.training.evaluation import EVALUATE_EVERY, LEARNING, EvaluationPlan, EvaluationWorld
from swarm_forage_env.training.plan import DEFAULT_STEPS, SAMPLING, Stage, TrainingPlan
from swarm_forage_env.views.plans import DEFAULT_SCENARIO
from swarm_forage_env.views.sampler import ScenarioSampler
from swarm_forage_env.wrappers.base import WrapperConfig
from swarm_forage_env.wrappers.registry import wrapper_configs
from swarm_forage_env.wrappers.world import World, WorldLike, described

MOST_ARENAS = 8
"""Arenas side by side, at most."""
MOST_ROBOTS = 400
"""Robots in all arenas, at most, but for one whole swarm: where more of them share the decisions, there are fewer
rollouts, and so few seconds of each arena that no jam is ever seen."""
REWARDS = {"first_pickup": 1.0, "nest_progress": 0.05, "interference": -0.002}
"""Rewards where deliveries count: the whole way home is worth about one delivery. Each tick in the way of others costs
a little."""
EPISODE_S = 4000.0
"""Length of an episode, s, at most. Jams build up slowly: with 1,000 s and no price for being in the way, two
trainings of two ended in them."""
JAMMING_S = 1000.0
"""Shortest time in which the recipe lets an episode end, s; in less, jams hardly begin."""
EVALUATION_SHARE = 0.5
"""Most that evaluations may add to the simulated time of all robots; large swarms are evaluated less often for it."""
INTERFACE = {"observation": "compact", "automatic_gripper": True, "decision_ticks": 5, "site_memory": True}
"""How robots see and act: a decision is a second."""
FRAME_DECISIONS = 200
"""Decisions for which each robot sees the world in a frame of its own, so that the swarm spreads."""
OPTIONS: dict[str, dict[str, Any]] = {
    "ppo": {
        "n_steps": 128,
        "batch_size": 3200,
        "n_epochs": 3,
        "gamma": 0.99,
        "gae_lambda": 0.98,
        "learning_rate": 0.001,
        "ent_coef": 0.003,
    },
    "a2c": {"n_steps": 32, "gamma": 0.99},
    "dqn": {"buffer_size": 1_000_000, "learning_starts": 50_000, "batch_size": 1024, "train_freq": 4},
    "sac": {"buffer_size": 1_000_000, "learning_starts": 50_000, "batch_size": 1024},
}
"""Arguments that suit hundreds of robots at once; the rest is the library's."""
LATE_OPTIONS: dict[str, dict[str, Any]] = {"ppo": {"learning_rate": 0.0003, "gamma": 0.995}}
"""Arguments of an algorithm in the last third of a training: smaller steps, further ahead."""
SMALL_START = 0.4
"""Share of its size that an arena has in a small start."""
MEASURED: dict[str, dict[str, Any]] = {
    # Objects lie anywhere, so that a smaller arena is no shorter way, only a fuller one.
    "warehouse_medium": {"small_start": False, "options": {"ppo": {"ent_coef": 0.01}}},
    # It counts first pick-ups, but a robot that does not come home cannot find the next object: deliveries pay, too.
    "search_and_rescue": {
        "rewards": {"delivery": 1.0, "nest_progress": 0.05, "interference": -0.002},
        "options": {"ppo": {"ent_coef": 0.01}},
    },
}
"""Preset -> what was measured to teach it better than the general recipe."""


def recipe(
    scenario: WorldLike | None = None,
    *,
    sampler: ScenarioSampler | None = None,
    algorithm: str = "ppo",
    steps: int = DEFAULT_STEPS,
    n_arenas: int | None = None,
    interface: GivenInterface = None,
    wrappers: Iterable[WrapperConfig | str] = (),
    hidden: tuple[int, ...] = (64, 64),
    activation: str = "relu",
    options: Mapping[str, Any] | None = None,
    small_start: bool | None = None,
    evaluation: EvaluationPlan | Mapping[str, Any] | None = None,
    seed: int = 0,
    samples: bool | None = None,
    **overrides: Any,
) -> TrainingPlan:
    """Return the plan of a training in a scenario, or in many.

    Args:
        scenario: Name of a preset (default warehouse_small), which gets the recipe's length of episodes (`EPISODE_S`,
            or that of its runs or of a third of the training if these are shorter), where deliveries count its rewards
            (`REWARDS`), and what `MEASURED` says; the file of a world likewise, with what it says instead; or a
            complete configuration or `World`, which is taken as it is.
        sampler: Draws the world of each episode, instead of `scenario`, `wrappers`, `small_start` and `overrides`; its
            worlds are taken as they are, with their rewards and horizons. Evaluations take place in the largest world
            of each name that it draws, unless `evaluation` has worlds.
        algorithm: See `TrainingPlan.algorithm`.
        steps: Decisions of single robots in all stages, 1 or more. There is a single stage where a third of them is
            less than a rollout (of ppo and a2c), unless `small_start` is asked for.
        n_arenas: Arenas side by side; default `MOST_ARENAS`, fewer of swarms that make more than `MOST_ROBOTS` in all.
        interface: What a learner sees and does: an `InterfaceConfig`, or fields by name that differ from `INTERFACE`,
            `FRAME_DECISIONS` (none where robots send messages) and discrete actions (continuous for sac).
        wrappers: What disturbs the swarm, in training and in evaluations: configurations, or words as on the command
            line ("population:death_per_tick=0.01").
        hidden: Sizes of the hidden layers.
        activation: What hidden layers do to their sums.
        options: Arguments of the algorithm that differ from `OPTIONS` and, to the end, from `LATE_OPTIONS`.
        small_start: Spend the first third of the steps in a smaller arena; default where deliveries count, unless
            `MEASURED` says otherwise or there are few `steps`.
        evaluation: How the policy is judged meanwhile: an `EvaluationPlan`, or fields by name that differ from the
            recipe's (whole runs, as often as `EVALUATE_EVERY` and `EVALUATION_SHARE` allow).
        seed: Seed of everything.
        samples: Whether the policy draws its actions; default where it has probabilities.
        **overrides: Fields of the scenario by name; they go before the recipe's (`nest_progress=0.1`). `horizon_s` is
            the length of the episodes; evaluations last as long as the scenario.

    Raises:
        ConfigError: an unknown name or field, values that are refused by what they are for (see `TrainingPlan`), or
            a smaller arena that cannot be.
    """
    whole("steps", steps, at_least=1)
    if sampler is not None:
        refused = {"scenario": scenario, "wrappers": tuple(wrappers), "small_start": small_start, **overrides}
        given = [name for name, value in refused.items() if value not in (None, ())]
        if given:
            raise ConfigError(f"Expected either a sampler or {', '.join(given)}, which it decides; got both.")
        scenario, small_start = sampler.largest, False
    scenario, overrides, disturbing = _told(scenario or DEFAULT_SCENARIO, overrides, wrapper_configs(wrappers))
    measured = MEASURED.get(scenario, {}) if isinstance(scenario, str) else {}
    config = _rewarding(scenario, overrides, measured.get("rewards", {}))
    chosen = chosen_interface(interface, _interface(algorithm, config))
    if n_arenas is None:  # a sampler needs many, so that every batch holds all kinds of worlds
        n_arenas = MOST_ARENAS if sampler else min(MOST_ARENAS, max(1, MOST_ROBOTS // config.robots.n_robots))
    n_rows = n_arenas * config.robots.n_robots
    episodes = {"horizon_s": overrides["horizon_s"]} if "horizon_s" in overrides else {}
    if not episodes and isinstance(scenario, str):
        episodes = {"horizon_s": _episode_s(config, steps // 3 / n_rows * chosen.decision_ticks * config.dt_s)}
    with_overrides(config, **episodes)  # refuses an impossible length
    given_options = dict(options or {})
    all_options = _options(algorithm, n_rows, measured.get("options", {}).get(algorithm, {}) | given_options)
    shortest = 1 if small_start else n_rows * (all_options.get("n_steps", 1) if algorithm in SAMPLING else 1)
    if small_start is None:
        small_start = config.performance == "collected" and bool(measured.get("small_start", True))
    late = {name: value for name, value in LATE_OPTIONS.get(algorithm, {}).items() if name not in given_options}
    return TrainingPlan(
        world=World(config, disturbing),
        algorithm=algorithm,  # type: ignore[arg-type] - words are checked there
        interface=chosen,
        n_arenas=n_arenas,
        hidden=hidden,
        activation=activation,  # type: ignore[arg-type] - likewise
        options=all_options,
        stages=_stages(config, steps, episodes, late=late, small_start=small_start, shortest=shortest),
        evaluation=_evaluation(evaluation, config, chosen.decision_ticks, sampler),
        seed=seed,
        samples=algorithm in SAMPLING and chosen.actions == "discrete" if samples is None else samples,
        sampler=sampler,
    )


def _told(
    given: WorldLike, fields: dict[str, Any], wrappers: tuple[WrapperConfig, ...]
) -> tuple[str | ScenarioConfig, dict[str, Any], tuple[WrapperConfig, ...]]:
    """Return a preset or a configuration, and fields and wrappers, with those that a world or its file has."""
    if isinstance(given, World):
        return given.scenario, fields, (*given.wrappers, *wrappers)
    if isinstance(given, ScenarioConfig):
        return given, fields, wrappers
    told = described(given).changed(fields, wrappers)
    return told.preset, told.fields, told.wrappers


def _rewarding(
    scenario: str | ScenarioConfig, overrides: Mapping[str, Any], measured: Mapping[str, float]
) -> ScenarioConfig:
    """Return the scenario with fields by name; a preset has the recipe's rewards and the measured ones beside them."""
    fields = {name: value for name, value in overrides.items() if name != "horizon_s"}
    config = chosen_scenario(scenario, fields)
    if isinstance(scenario, ScenarioConfig) or "reward" in fields:
        return config
    general = REWARDS if config.performance == "collected" else {}
    return chosen_scenario(scenario, {**general, **measured, **fields})


def _interface(algorithm: str, config: ScenarioConfig) -> InterfaceConfig:
    return InterfaceConfig(
        **INTERFACE,
        actions="continuous" if algorithm == "sac" else "discrete",
        frame_decisions=0 if config.robots.message_size else FRAME_DECISIONS,  # no frame turns what is said
    )


def _evaluation(
    given: EvaluationPlan | Mapping[str, Any] | None,
    config: ScenarioConfig,
    decision_ticks: int,
    sampler: ScenarioSampler | None,
) -> EvaluationPlan:
    """Return the plan of evaluations, which take at most `EVALUATION_SHARE` of the time of the training."""
    if isinstance(given, EvaluationPlan):
        return given
    fields = {**table("evaluation", given or {})}
    if sampler is not None and "worlds" not in fields:  # the largest of each name, undisturbed
        largest = {world.name: world for world in sorted(sampler.ends, key=lambda world: world.robots.n_robots)}
        fields["worlds"] = tuple(EvaluationWorld(world) for world in largest.values())
    plan = read(EvaluationPlan, fields, "evaluation")
    if "every_steps" in fields:
        return plan
    worlds = plan.worlds_of(World(config))
    decisions = Plan.product([LEARNING], worlds, plan.seeds).robot_ticks / decision_ticks
    return replace(plan, every_steps=max(EVALUATE_EVERY, round(decisions / EVALUATION_SHARE)))


def _options(algorithm: str, n_rows: int, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return arguments of an algorithm; batches of ppo share a rollout without a rest where they can."""
    chosen = {**OPTIONS.get(algorithm, {}), **given}
    n_steps = chosen.get("n_steps")
    if algorithm == "ppo" and "batch_size" not in given and isinstance(n_steps, int):
        n_samples, most = n_steps * n_rows, chosen["batch_size"]
        fitting = (size for size in range(most, most // 2, -1) if n_samples % size == 0)
        chosen["batch_size"] = n_samples if 1 < n_samples <= most else next(fitting, most)
    return chosen


def _episode_s(config: ScenarioConfig, third_s: float) -> float:
    """Return how long episodes last, so that one ends in each third of a training; not where thirds show no jam."""
    ending_s = third_s // config.interval_s * config.interval_s
    return min(EPISODE_S, config.horizon_s, ending_s if ending_s >= JAMMING_S else EPISODE_S)


def _stages(
    config: ScenarioConfig,
    steps: int,
    episodes: Mapping[str, Any],
    *,
    late: Mapping[str, Any],
    small_start: bool,
    shortest: int,
) -> tuple[Stage, ...]:
    """Return a third of the steps in a smaller arena if asked for, and a third with the `late` options if any.

    Where a third is below the `shortest` stage, all steps are in the middle.
    """
    third = steps // 3
    if third < shortest:
        return (Stage(steps=steps, scenario=episodes),)
    first = (Stage(steps=third, scenario={**small_arena(config), **episodes}),) if small_start else ()
    middle = Stage(steps=steps - third * (small_start + bool(late)), scenario=episodes)
    last = (Stage(steps=third, scenario=episodes, options=late),) if late else ()
    return (*first, middle, *last)


def small_arena(config: ScenarioConfig) -> dict[str, Any]:
    """Return fields that shrink the arena to SMALL_START of its size with nest and obstacles in proportion.

    Only along x for a single and a dual source, which lie beside the nest: the other axis is no way home.

    Raises:
        ConfigError: there cannot be such an arena.
    """
    arena = config.arena
    is_beside = config.objects.placement in ("single_source", "dual_source")
    shares = (SMALL_START, 1.0 if is_beside else SMALL_START)
    width_m, height_m = (
        round(extent * share * CELLS_PER_M) / CELLS_PER_M
        for extent, share in zip((arena.width_m, arena.height_m), shares, strict=True)
    )
    (centre_x, centre_y), (size_x, size_y) = arena.nest_centre_m, arena.nest_size_m
    small = {
        "width_m": width_m,
        "height_m": height_m,
        "nest_centre_m": (centre_x * shares[0], centre_y * shares[1]),
        "nest_size_m": (size_x * shares[0], size_y * shares[1]),
        **{
            name: stretched(boxes, shares, (width_m, height_m))
            for name in ("further_nests", "obstacles")
            if (boxes := getattr(arena, name))
        },
    }
    try:
        if config.objects.object_positions_m:
            raise ConfigError("Expected no object_positions_m, which it may not hold.")
        with_overrides(config, **small)
    except ConfigError as error:
        raise ConfigError(
            f"Cannot begin in a smaller arena (small_start) of {width_m} x {height_m} m: {error} "
            "Or train in the whole arena from the beginning: small_start=False (--set small_start=false)."
        ) from error
    return small
