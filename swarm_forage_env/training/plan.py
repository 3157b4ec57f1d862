"""TrainingPlan: a training run as frozen data, read from TOML and written beside its results."""

import dataclasses
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from swarm_forage_env._internal.fields import (
    ConfigError,
    checked,
    known_keys,
    number,
    one_of,
    table,
    whole,
)
from swarm_forage_env._internal.files import parse_json, parse_toml, replacing
from swarm_forage_env._internal.wording import suggestion
from swarm_forage_env.contract.policy import layout_for
from swarm_forage_env.policies.interface import InterfaceConfig, interface_from_mapping, learner_layout
from swarm_forage_env.policies.network import ACTIVATIONS, TEMPERATURES
from swarm_forage_env.policies.pretrained import plan_file, plan_names
from swarm_forage_env.runs.plan import Plan
from swarm_forage_env.runs.spec import PolicySpec
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.overrides import scenario_of_same_size
from swarm_forage_env.training.defaults import DEFAULT_ARENAS, DEFAULT_HIDDEN, DEFAULT_STEPS
from swarm_forage_env.training.evaluation_plan import COUNTED, EvaluationPlan, EvaluationWorld, scenario_of, tuples
from swarm_forage_env.training.options import check_options
from swarm_forage_env.views.sampler import ScenarioSampler, columns_of
from swarm_forage_env.wrappers.base import WrapperConfig
from swarm_forage_env.wrappers.registry import wrappers_from_mapping
from swarm_forage_env.wrappers.world import World

ALGORITHMS = ("ppo", "a2c", "dqn", "sac")
"""Algorithms of stable-baselines3 that train; the first two on rollouts, the others from replay."""
SAMPLING = ("ppo", "a2c")
"""Those whose networks give probabilities of discrete actions."""
EXPORTABLE = ("ppo", "a2c", "dqn")
"""Those whose networks a file can hold."""
MOST_ARENAS, MOST_LAYERS, MOST_UNITS = 10_000, 20, 10_000
"""Sizes of a training that are far beyond sense and still fit into the memory of a machine; our choice."""
IN_RUNS = {"decision_ticks": 1, "frame_decisions": 0}
"""Fields of an interface that may be others in runs than in training, of the same network -> the least."""
_OF_THE_WHOLE = ("algorithm", "n_arenas", "hidden", "activation", "samples", "temperature", "in_runs")
"""Keys of a plan that none of its tables has."""
LEARNING = PolicySpec(label="policy", policy="policy")
"""The policy that is trained, in its evaluations."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Stage:
    """A part of the training with a scenario of its own: a step of a curriculum."""

    steps: int
    """Decisions of single robots."""
    scenario: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """Fields of the plan's scenario that differ, by name; the number of robots cannot."""
    options: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """Arguments of the algorithm that differ from here on (`learning_rate`, `gamma` ...)."""
    sampler: ScenarioSampler | None = None
    """Draws the worlds of this stage; None = as the plan says."""

    def __post_init__(self) -> None:
        whole("stage.steps", self.steps, at_least=1)
        table("stage.scenario", self.scenario)
        check_options("stage.options", self.options)

    def to_mapping(self) -> dict[str, Any]:
        """Return the stage as plain values; `sampler` only where there is one."""
        plain: dict[str, Any] = {"steps": self.steps, "scenario": dict(self.scenario), "options": dict(self.options)}
        return plain if self.sampler is None else {**plain, "sampler": dict(self.sampler.table)}

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> "Stage":
        """Build a stage from nested plain values; raises ConfigError where one cannot be."""
        values = dict(table("stages", mapping))
        known_keys(values, [item.name for item in dataclasses.fields(cls)], prefix="stages.")
        if "steps" not in values:
            raise ConfigError(f"Expected a stage with its steps, such as steps = 1_000_000, got {dict(mapping)}.")
        values["scenario"] = tuples(table("stages.scenario", values.get("scenario", {})))
        if "sampler" in values:
            values["sampler"] = ScenarioSampler(values["sampler"])
        return cls(**values)


@dataclass(frozen=True, kw_only=True, slots=True)
class TrainingPlan:
    """Everything that decides a training run, but for the machine and the installed versions.

    Raises:
        ConfigError: an unknown algorithm or baseline, a performance that arenas do not count, sizes below 1, a stage
            whose scenario cannot be or has another number of robots, or actions that the algorithm cannot choose.
    """

    world: World
    """What is to be mastered, rewards included, and what disturbs the swarm; evaluations take place in it. Stages may
    have shorter episodes. Beside a sampler it is its largest world, undisturbed, which stands for all where spaces are
    asked for; samplers and worlds to be judged in have their own wrappers."""
    algorithm: str = "ppo"
    interface: InterfaceConfig = field(default_factory=InterfaceConfig)
    n_arenas: int = DEFAULT_ARENAS
    hidden: tuple[int, ...] = DEFAULT_HIDDEN
    """Sizes of the hidden layers of actor and critic."""
    activation: str = "tanh"
    """What hidden layers do to their sums: "tanh", which a plan without it always meant, or "relu", which takes less
    time and is the recipe's."""
    options: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """Arguments of the algorithm's class; what is not here keeps the library's default."""
    stages: tuple[Stage, ...] = (Stage(steps=DEFAULT_STEPS),)
    evaluation: EvaluationPlan = field(default_factory=EvaluationPlan)
    seed: int = 0
    samples: bool = False
    """Whether the policy that comes of it draws its discrete actions by their probabilities, as it did while it learnt
    (PPO, A2C), or by the exponentials of their values over the temperature (DQN). Robots that always take the likeliest
    one may block each other for ever."""
    temperature: float = 1.0
    """How the policy that comes of it draws: by probabilities to the power of 1 / temperature, scaled to a sum
    of 1. Below 1, rare actions become rarer than they were while it learnt. With values (DQN) it must be said."""
    in_runs: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """Fields of the interface (`IN_RUNS`) that are others for the policy that comes of it than while it learns. A
    training at the pace of runs would take longer. Frames count decisions, so another pace changes their seconds."""
    sampler: ScenarioSampler | None = None
    """Draws the world of each episode; None = it is always `world`. Then `evaluation` has worlds."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "interface", self.interface.for_scenario(self.scenario))
        one_of("algorithm", self.algorithm, ALGORITHMS)
        one_of("performance of a scenario to train in", self.scenario.performance, COUNTED)
        unfit = {"dqn": "continuous", "sac": "discrete"}.get(self.algorithm)
        if self.interface.actions == unfit:
            raise ConfigError(f"Expected actions that {self.algorithm} can choose, got {unfit} ones.")
        checked("samples", self.samples, bool)
        if self.samples and self.interface.actions != "discrete":
            raise ConfigError(f"Expected samples only with discrete actions, got {self.interface.actions} ones.")
        number("temperature", self.temperature, at_least=TEMPERATURES[0], at_most=TEMPERATURES[1])
        if self.temperature != 1.0 and not self.samples:
            raise ConfigError(f"Expected temperature only with samples, got {self.temperature}; set samples = true.")
        if self.temperature == 1.0 and self.samples and self.algorithm not in SAMPLING:
            raise ConfigError(
                f"Expected a temperature for samples of {self.algorithm}, whose actions have values and no "
                "probabilities; write a plan with one that is small beside a reward, for example 0.005."
            )
        self._check_in_runs()
        whole("n_arenas", self.n_arenas, at_least=1, at_most=MOST_ARENAS)
        if not isinstance(self.hidden, tuple):  # pyright: ignore[reportUnnecessaryIsInstance] - files hold anything
            raise ConfigError(f"Expected hidden to be sizes of layers, for example [64, 64], got {self.hidden!r}.")
        if len(self.hidden) > MOST_LAYERS:
            raise ConfigError(f"Expected at most {MOST_LAYERS} hidden layers, got {len(self.hidden)}.")
        for size in self.hidden:
            whole("hidden", size, at_least=1, at_most=MOST_UNITS)
        one_of("activation", self.activation, ACTIVATIONS)
        if not self.stages:
            raise ConfigError("Expected at least one stage, got none.")
        whole("seed", self.seed, at_least=0)
        check_options("options", self.options)
        self._check_worlds()
        self.judging(LEARNING)  # refuses horizons that cannot be

    def _check_in_runs(self) -> None:
        known_keys(table("in_runs", self.in_runs), IN_RUNS, prefix="in_runs.")
        if self.in_runs and self.algorithm not in EXPORTABLE:
            raise ConfigError(
                f"Expected in_runs only with {', '.join(EXPORTABLE)}, got {self.algorithm}; leave it out."
            )
        for name, value in self.in_runs.items():
            whole(f"in_runs.{name}", value, at_least=IN_RUNS[name])
        if self.in_runs.get("frame_decisions") and not self.interface.frame_decisions:
            raise ConfigError(
                "Expected in_runs.frame_decisions only of robots that learn in frames, too; set "
                "frame_decisions in the interface."
            )
        _ = self.run_interface  # refuses frames beside extra columns

    def arenas_of(self, stage: Stage) -> dict[str, Any]:
        """Return the arguments of the vector environments of a stage, such as `SwarmVecEnv`."""
        sampler = stage.sampler or self.sampler
        worlds = {"sampler": sampler} if sampler else {"scenario": self.scenario, "wrappers": self.wrappers}
        return {**worlds, "n_arenas": self.n_arenas, "interface": self.interface}

    def _check_worlds(self) -> None:
        """Refuse worlds that are said twice, that cannot be, or that one policy cannot have in common."""
        if self.sampler is not None and (self.scenario != self.sampler.largest or self.wrappers):
            raise ConfigError(
                "Expected a plan with a sampler without scenario and wrappers, which it draws; in Python, give "
                "world=World(sampler.largest)."
            )
        is_sampled = self.is_sampled
        if is_sampled and not self.evaluation.worlds:
            raise ConfigError(
                "Expected evaluation.worlds beside a sampler: fixed worlds, in which policies can be compared."
            )
        if self.wrappers and (is_sampled or self.evaluation.worlds):
            raise ConfigError(
                "Expected a plan without wrappers beside samplers and evaluation.worlds, which have their own, got "
                f"{', '.join(config.name for config in self.wrappers)}; write them into each sampler and each world, "
                "with a sampler of one world where the scenario is fixed."
            )
        performances: dict[str, str] = {}
        for stage in self.stages:
            sampler = stage.sampler or self.sampler
            for config in (self.scenario,) if sampler is None else sampler.ends:
                one_of("performance of a scenario to train in", config.performance, COUNTED)
                if is_sampled and _common(config) != _common(self.scenario):
                    raise ConfigError(
                        f"Expected stages and worlds with the same caches and columns of observations as "
                        f"{self.scenario.name}, which are those of the policy; {config.name} has others."
                    )
                scenario_of_same_size(config, stage.scenario)
                known = performances.setdefault(config.name, config.performance)
                if known != config.performance:
                    raise ConfigError(
                        f"Expected worlds with the name {config.name} to have one performance, because progress is "
                        f"told by name, got {known} and {config.performance}; give one of them another name."
                    )
        for world in self.evaluation.worlds:
            self._check_evaluation_world(world)

    def _check_evaluation_world(self, world: EvaluationWorld) -> None:
        """Refuse a world in which the policy cannot be judged."""
        try:
            learner_layout(layout_for(world.scenario), self.interface)
        except ConfigError as error:
            raise ConfigError(f"Cannot judge the policy in the evaluation world {world.name}: {error}") from error
        if world.scenario.caches != self.scenario.caches:
            raise ConfigError(
                f"Expected the evaluation world {world.name} with the caches of the training, "
                f"{self.scenario.caches!r}, got {world.scenario.caches!r}; give both the same."
            )

    @property
    def is_sampled(self) -> bool:
        """Whether samplers draw worlds, in all stages or in some."""
        return any(stage.sampler or self.sampler for stage in self.stages)

    @property
    def scenario(self) -> ScenarioConfig:
        """The scenario of the world."""
        return self.world.scenario

    @property
    def wrappers(self) -> tuple[WrapperConfig, ...]:
        """What disturbs the swarm."""
        return self.world.wrappers

    @property
    def run_interface(self) -> InterfaceConfig:
        """What the policy that comes of it sees and does."""
        return dataclasses.replace(self.interface, **self.in_runs)

    @property
    def judging_worlds(self) -> tuple[World, ...]:
        """Worlds that the policy is judged in, with runs as long as evaluations have them."""
        return tuple(map(self.evaluation.timed, self.evaluation.worlds or (self.world,)))

    def judging(self, *policies: PolicySpec) -> Plan:
        """Return the runs of an evaluation of policies, in all worlds; raises ConfigError where one cannot be."""
        return Plan.product(policies, self.judging_worlds, self.evaluation.seeds)

    @property
    def total_steps(self) -> int:
        """Decisions of single robots in all stages."""
        return sum(stage.steps for stage in self.stages)

    def to_mapping(self) -> dict[str, Any]:
        """Return the plan as nested plain values."""
        plain = {name: getattr(self, name) for name in _keys()}
        nested: dict[str, Any] = {name: dataclasses.asdict(plain[name]) for name in ("scenario", "interface")}
        nested["evaluation"] = self.evaluation.to_mapping()
        nested["wrappers"] = {config.name: config.to_mapping() for config in self.wrappers}
        nested["stages"] = [item.to_mapping() for item in self.stages]
        if self.sampler is None:
            del plain["sampler"]
            return {**plain, **nested}
        del plain["scenario"], plain["wrappers"], nested["scenario"], nested["wrappers"]
        return {**plain, **nested, "sampler": dict(self.sampler.table)}

    def settings(self) -> dict[str, Any]:
        """Return all plain values of the plan by their names with dots, such as "interface.observation"."""
        return dict(_leaves(self.to_mapping()))

    def with_settings(self, settings: Mapping[str, Any]) -> "TrainingPlan":
        """Return the plan with plain values replaced, by names with dots as in `settings`.

        Example: `plan.with_settings({"n_arenas": 2, "options.learning_rate": 0.001})`.

        Raises:
            ConfigError: there is no such table or value, or the plan cannot have it.
        """
        mapping = self.to_mapping()
        for name, value in settings.items():
            *tables, last = name.split(".")
            place: Any = mapping
            for key in tables:
                place = place.get(key) if isinstance(place, dict) else None
            if not isinstance(place, dict):
                raise ConfigError(f"Expected a value of the plan, got {name}.{suggestion(name, self.settings())}")
            place[last] = value
        return TrainingPlan.from_mapping(mapping)

    def differences(self, earlier: "TrainingPlan") -> tuple[str, ...]:
        """Return what keeps this plan from going on with a training by an earlier one, field by field.

        More steps in the last stage of the earlier plan, and further stages, do not.
        """
        last = len(earlier.stages) - 1
        stages = list(earlier.stages)
        if last < len(self.stages):
            stages[last] = dataclasses.replace(stages[last], steps=max(stages[last].steps, self.stages[last].steps))
        begun = dataclasses.replace(self, stages=self.stages[: last + 1])
        before, now = (plan.settings() for plan in (dataclasses.replace(earlier, stages=tuple(stages)), begun))
        pairs = {name: (before.get(name, "nothing"), now.get(name, "nothing")) for name in {**before, **now}}
        return tuple(f"{name}: {was} before, {is_now} now" for name, (was, is_now) in pairs.items() if was != is_now)

    def longer(self, steps: int) -> "TrainingPlan":
        """Return the plan with a last stage that makes `steps` in all.

        Raises:
            ConfigError: fewer steps than it has.
        """
        if steps < self.total_steps:
            raise ConfigError(f"Expected in all at least the {self.total_steps:,} steps of the plan, got {steps:,}.")
        last = self.stages[-1]
        last = dataclasses.replace(last, steps=last.steps + steps - self.total_steps)
        return dataclasses.replace(self, stages=(*self.stages[:-1], last))

    def write(self, path: str | Path) -> None:
        """Write the plan as JSON."""
        text = json.dumps(self.to_mapping(), indent=2) + "\n"
        with replacing(Path(path)) as draft:
            draft.write_text(text, encoding="utf-8")

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> "TrainingPlan":
        """Build a plan from nested plain values.

        `scenario` is either complete, as `to_mapping` writes it, or a table with the `preset` it starts from and
        fields by name. `wrappers` is a table of tables by name. `sampler` stands instead of both.

        Raises:
            ConfigError: unknown keys, or values that a plan cannot have.
        """
        values = dict(table("the plan", mapping))
        known_keys(values, _keys())
        _check_places(values)
        if "sampler" in values:
            given = [name for name in ("scenario", "wrappers") if name in values]
            if given:
                raise ConfigError(f"Expected a plan with either sampler or {' and '.join(given)}, got both.")
            values["sampler"] = ScenarioSampler(values["sampler"])
            values["scenario"] = values["sampler"].largest
        else:
            values["scenario"] = scenario_of(values.get("scenario"))
        if "wrappers" in values:
            values["wrappers"] = wrappers_from_mapping(table("wrappers", values["wrappers"]))
        if "interface" in values:
            values["interface"] = interface_from_mapping(dict(table("interface", values["interface"])))
        if "evaluation" in values:
            values["evaluation"] = EvaluationPlan.from_mapping(values["evaluation"])
        if "stages" in values:
            if not isinstance(values["stages"], list):
                raise ConfigError(f"Expected stages to be a list of tables, [[stages]], got {values['stages']!r}.")
            values["stages"] = tuple(Stage.from_mapping(stage) for stage in values["stages"])
        world = World(values.pop("scenario"), values.pop("wrappers", ()))
        return cls(world=world, **tuples(values))


def _keys() -> list[str]:
    """Names in the file of a plan: its fields, with the parts of the world."""
    _, *others = dataclasses.fields(TrainingPlan)
    return ["scenario", "wrappers", *(item.name for item in others)]


def read_plan(path: str | Path) -> TrainingPlan:
    """Read a plan from a TOML file, or from the JSON file that a training run leaves.

    Raises:
        ConfigError: the file cannot be read or does not hold a plan; the message names it.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
        written = table("the plan", parse_json(text)) if path.suffix == ".json" else parse_toml(text)
        return TrainingPlan.from_mapping(written)
    except OSError as error:
        raise ConfigError(f"Cannot read the plan {path}: {error.strerror or error}.") from error
    except (ValueError, TypeError) as error:  # ConfigError, and what the two parsers raise
        raise ConfigError(f"Cannot use the plan {path}: {error}") from error


def named_plan(name: str) -> TrainingPlan:
    """Return the plan of a file, or of a shipped policy by its name.

    Raises:
        ConfigError: there is none, or it cannot be used.
    """
    shipped = plan_file(name)
    if shipped is None and not Path(name).suffix and not Path(name).exists():
        raise ConfigError(
            f"Expected --plan as a file, or as a shipped policy ({', '.join(plan_names())}), got {name!r}, which is "
            f"neither.{suggestion(name, plan_names())}"
        )
    return read_plan(name if shipped is None else shipped)


def _common(config: ScenarioConfig) -> tuple[Any, ...]:
    """Return what all worlds of a policy have in common."""
    return config.caches, columns_of(config)


def _leaves(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the plain values of nested tables and lists of tables, by their names with dots."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _leaves(item, f"{name}.{key}" if name else str(key))
    elif isinstance(value, list):
        for k, item in enumerate(value):
            yield from _leaves(item, f"{name}[{k}]")
    else:
        yield name, value


def _check_places(value: Any, where: str = "") -> None:
    """Refuse a key of the plan itself in one of its tables: in TOML, a line below a [table] is part of it."""
    if isinstance(value, Mapping):
        astray = next((key for key in value if where and key in _OF_THE_WHOLE), None)
        if astray is not None:
            raise ConfigError(f"Expected {astray!r} above the first [table] of the plan, got it in {where!r}.")
        for key, item in value.items():
            if key != "wrappers":  # those of others may call their fields as they like
                _check_places(item, f"{where}.{key}" if where else str(key))
    elif isinstance(value, list):
        for item in value:
            _check_places(item, where)
