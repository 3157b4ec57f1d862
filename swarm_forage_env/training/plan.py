"""TrainingPlan: a training as frozen data, read from TOML and written beside its results."""

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate
from pathlib import Path
from typing import Annotated, Any, Literal, cast

from msgspec import Meta

from swarm_forage_env._internal.fields import Checked, ConfigError, Count, Number, Whole, known_keys, read, table
from swarm_forage_env._internal.files import json_text, parse_json, parse_toml, replacing
from swarm_forage_env._internal.wording import suggestion
from swarm_forage_env.contract.policy import layout_for
from swarm_forage_env.policies.interface import InterfaceConfig, any_swarm, chosen_interface, learner_layout
from swarm_forage_env.policies.network import TEMPERATURES, Network
from swarm_forage_env.policies.pretrained import plan_file, plan_names
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.overrides import scenario_of_same_size
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.training.evaluation import EXPORTABLE, Evaluation, EvaluationPlan, EvaluationWorld, reached_by
from swarm_forage_env.views.sampler import ScenarioSampler, columns_of
from swarm_forage_env.wrappers.base import WrapperConfig
from swarm_forage_env.wrappers.registry import wrappers_from_mapping
from swarm_forage_env.wrappers.world import World

DEFAULT_STEPS = 3_400_000
"""Decisions of single robots in all stages; our choice."""
SAMPLING = ("ppo", "a2c")
"""Algorithms whose networks give probabilities of discrete actions."""
IN_RUNS = ("decision_ticks", "frame_decisions")
"""Fields of an interface that may be others in runs than in training, of the same network."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Stage(Checked):
    """A part of the training with a scenario of its own: a step of a curriculum."""

    called = "stage"
    steps: Whole
    """Decisions of single robots."""
    scenario: Mapping[str, Any] = field(default_factory=dict)
    """Fields of the plan's scenario that differ, by name; the number of robots cannot."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """Arguments of the algorithm that differ from here on (`learning_rate`, `gamma` ...)."""
    sampler: ScenarioSampler | None = None
    """Draws the worlds of this stage; None = as the plan says."""

    def check(self) -> None:
        """Take lists, the only sequences of files, as the tuples of scenarios."""
        object.__setattr__(self, "scenario", {name: _tuples(value) for name, value in self.scenario.items()})


@dataclass(frozen=True, kw_only=True, slots=True)
class TrainingPlan(Checked):
    """Everything that decides a training run, but for the machine and the installed versions.

    Raises:
        ConfigError: a value that cannot be, a stage whose scenario cannot be or has another number of robots, or
            actions that the algorithm cannot choose.
    """

    world: World
    """What is to be mastered, rewards included, and what disturbs the swarm. Stages may have shorter episodes. Beside a
    sampler it is its largest world, undisturbed, which stands for all where spaces are asked for."""
    algorithm: Literal["ppo", "a2c", "dqn", "sac"] = "ppo"
    """Of stable-baselines3; the first two learn on rollouts, the others from replay."""
    interface: InterfaceConfig = field(default_factory=InterfaceConfig)
    n_arenas: Annotated[int, Meta(ge=1, le=10_000)] = 8
    hidden: Annotated[tuple[Annotated[int, Meta(ge=1, le=10_000)], ...], Meta(max_length=20)] = (64, 64)
    """Sizes of the hidden layers of actor and critic."""
    activation: Literal["tanh", "relu"] = "tanh"
    """What hidden layers do to their sums; relu takes less time, and is the recipe's."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """Arguments of the algorithm's class; what is not here keeps the library's default."""
    stages: Annotated[tuple[Stage, ...], Meta(min_length=1)] = (Stage(steps=DEFAULT_STEPS),)
    starts: Whole = 1
    """How often the first stage is trained anew, one after the other; the best by its last evaluation goes on."""
    enough: Number | None = None
    """A start whose last evaluation reaches this is the last one; None = all starts are made."""
    evaluation: EvaluationPlan = field(default_factory=EvaluationPlan)
    seed: Count = 0
    samples: bool = False
    """Whether the policy that comes of it draws its discrete actions by their probabilities, as it did while it learnt
    (PPO, A2C), or by the exponentials of their values over the temperature (DQN). Robots that always take the likeliest
    one may block each other for ever."""
    temperature: Annotated[float, Meta(ge=TEMPERATURES[0], le=TEMPERATURES[1])] = 1.0
    """How the policy that comes of it draws: by probabilities to the power of 1 / temperature, scaled to a sum
    of 1. Below 1, rare actions become rarer than they were while it learnt. With values (DQN) it must be said."""
    in_runs: Mapping[str, Any] = field(default_factory=dict)
    """Fields of the interface (`IN_RUNS`) that are others for the policy that comes of it than while it learns. A
    training at the pace of runs would take longer. Frames count decisions, so another pace changes their seconds."""
    sampler: ScenarioSampler | None = None
    """Draws the world of each episode; None = it is always `world`. Then `evaluation` has worlds."""

    def check(self) -> None:
        """Refuse what does not fit together."""
        object.__setattr__(self, "interface", self.interface.for_scenario(self.scenario))
        unfit = {"dqn": "continuous", "sac": "discrete"}.get(self.algorithm)
        if self.interface.actions == unfit:
            raise ConfigError(f"Expected actions that {self.algorithm} can choose, got {unfit} ones.")
        if self.samples and self.interface.actions != "discrete":
            raise ConfigError(f"Expected samples only with discrete actions, got {self.interface.actions} ones.")
        if self.temperature != 1.0 and not self.samples:
            raise ConfigError(f"Expected temperature only with samples, got {self.temperature}; set samples = true.")
        if self.temperature == 1.0 and self.samples and self.algorithm not in SAMPLING:
            raise ConfigError(
                f"Expected a temperature for samples of {self.algorithm}, whose actions have values and no "
                "probabilities; write a plan with one that is small beside a reward, for example 0.005."
            )
        if self.starts > 1 and len(self.stages) == 1:
            raise ConfigError(f"Expected a second stage for the best of {self.starts} starts, got one stage.")
        self._check_in_runs()
        self._check_worlds()

    def _check_in_runs(self) -> None:
        known_keys(self.in_runs, IN_RUNS, prefix="in_runs.")
        _ = self.run_interface  # refuses other values, and frames beside extra columns
        if self.in_runs and self.algorithm not in EXPORTABLE:
            raise ConfigError(
                f"Expected in_runs only with {', '.join(EXPORTABLE)}, got {self.algorithm}; leave it out."
            )
        if self.in_runs.get("frame_decisions") and not self.interface.frame_decisions:
            raise ConfigError(
                "Expected in_runs.frame_decisions only for a policy that learns with frames, got 0 of them in "
                "interface.frame_decisions; leave one of both out, or give both."
            )

    def _check_worlds(self) -> None:
        """Refuse worlds that cannot be, or that one policy cannot have in common."""
        if self.is_sampled and not self.evaluation.worlds:
            raise ConfigError(
                "Expected evaluation.worlds beside a sampler: fixed worlds, in which policies can be compared."
            )
        if self.wrappers and (self.is_sampled or self.evaluation.worlds):
            raise ConfigError(
                "Expected a plan without wrappers beside samplers and evaluation.worlds, which have their own, got "
                f"{', '.join(config.name for config in self.wrappers)}; write them into each sampler and each world, "
                "with a sampler of one world where the scenario is fixed."
            )
        for stage in self.stages:
            sampler = stage.sampler or self.sampler
            for config in (self.scenario,) if sampler is None else sampler.ends:
                if (config.caches, columns_of(config)) != (self.scenario.caches, columns_of(self.scenario)):
                    raise ConfigError(
                        f"Expected stages and worlds with the same caches and columns of observations as "
                        f"{self.scenario.name}, which are those of the policy; {config.name} has others."
                    )
                scenario_of_same_size(config, stage.scenario)
        for world in self.judging_worlds:
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
        return replace(self.interface, **self.in_runs)

    @property
    def judging_worlds(self) -> tuple[EvaluationWorld, ...]:
        """Worlds that the policy is judged in, with runs as long as evaluations have them."""
        return self.evaluation.worlds_of(self.world)

    @property
    def total_steps(self) -> int:
        """Decisions of single robots in all stages, with all starts."""
        return self.parts()[-1][1]

    def parts(self, evaluations: Sequence[Evaluation] = ()) -> list[tuple[Stage, int]]:
        """Return the stages as they are trained one after the other, and the decisions up to the end of each.

        The first is there as often as it is begun, as far as the evaluations up to now tell.
        """
        first, starts = self.stages[0], 1
        enough = math.inf if self.enough is None else self.enough
        while starts < self.starts and not reached_by(evaluations, starts * first.steps) >= enough:
            starts += 1
        stages = (first,) * starts + self.stages[1:]
        return list(zip(stages, accumulate(stage.steps for stage in stages), strict=True))

    def arenas_of(self, stage: Stage) -> dict[str, Any]:
        """Return the arguments of the vector environments of a stage, such as `SwarmVecEnv`."""
        sampler = stage.sampler or self.sampler
        worlds = {"sampler": sampler} if sampler else {"scenario": self.scenario, "wrappers": self.wrappers}
        return {**worlds, "n_arenas": self.n_arenas, "interface": self.interface}

    def as_kept(self, network: Network) -> Network:
        """Return a network that learns by the plan as the policy that comes of it, at its temperature and pace.

        Raises:
            ConfigError: it sees or acts in another way than the plan says, or draws actions where the plan does not.
        """
        about = network.about
        found = about.interface.for_scenario(self.scenario), about.samples
        if found != (self.interface, self.samples):
            raise ConfigError(
                f"Expected a network with the plan's interface and samples, {self.interface} and {self.samples}, got "
                f"{found[0]} and {found[1]}; make its NetworkAbout with plan.interface and plan.samples."
            )
        network.check_fits(any_swarm(self.interface))
        sharpened = network.at_temperature(self.temperature)
        return replace(sharpened, about=replace(about, interface=self.run_interface))

    def to_mapping(self) -> dict[str, Any]:
        """Return the plan as nested plain values."""
        plain = _plain(self)
        world = plain.pop("world")
        return plain if self.sampler else {"scenario": world["scenario"], "wrappers": world["wrappers"], **plain}

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
        n_begun = len(earlier.stages)
        stages = [*earlier.stages]
        if n_begun <= len(self.stages):
            stages[-1] = replace(stages[-1], steps=max(stages[-1].steps, self.stages[n_begun - 1].steps))
        before = replace(earlier, stages=tuple(stages)).settings()
        now = replace(self, stages=self.stages[:n_begun]).settings()
        pairs = {name: (before.get(name, "nothing"), now.get(name, "nothing")) for name in {**before, **now}}
        return tuple(f"{name}: {was} before, {is_now} now" for name, (was, is_now) in pairs.items() if was != is_now)

    def longer(self, steps: int) -> "TrainingPlan":
        """Return the plan with a last stage that makes `steps` in all; raises ConfigError for fewer than it has."""
        if steps < self.total_steps:
            raise ConfigError(f"Expected in all at least the {self.total_steps:,} steps of the plan, got {steps:,}.")
        *others, last = self.stages
        return replace(self, stages=(*others, replace(last, steps=last.steps + steps - self.total_steps)))

    def write(self, path: str | Path) -> None:
        """Write the plan as JSON."""
        with replacing(Path(path)) as draft:
            draft.write_text(json_text("the plan", self.to_mapping(), indent=2) + "\n", encoding="utf-8")

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> "TrainingPlan":
        """Build a plan from nested plain values.

        `scenario` is either complete, as `to_mapping` writes it, or a table with the `preset` it starts from and
        fields by name. `wrappers` is a table of tables by name. `sampler` stands instead of both.

        Raises:
            ConfigError: unknown keys, or values that a plan cannot have.
        """
        values = dict(table("the plan", mapping))
        _, *others = dataclasses.fields(cls)
        known_keys(values, ["scenario", "wrappers", *(item.name for item in others)])
        if "sampler" in values:
            given = [name for name in ("scenario", "wrappers") if name in values]
            if given:
                raise ConfigError(f"Expected a plan with either sampler or {' and '.join(given)}, got both.")
            values["sampler"] = ScenarioSampler(values["sampler"])
            values["world"] = World(values["sampler"].largest)
        else:
            values["world"] = _world(values, World)
        if "interface" in values:
            values["interface"] = chosen_interface(table("interface", values["interface"]))
        if "evaluation" in values:
            evaluation = {**table("evaluation", values["evaluation"])}
            worlds = _tables("evaluation.worlds", evaluation.get("worlds", []))
            evaluation["worlds"] = [_world(world, EvaluationWorld) for world in worlds]
            values["evaluation"] = read(EvaluationPlan, evaluation, "evaluation")
        if "stages" in values:
            values["stages"] = [
                {**stage, "sampler": ScenarioSampler(stage["sampler"])} if "sampler" in stage else stage
                for stage in _tables("stages", values["stages"])
            ]
        return read(cls, values)


def _tables(where: str, given: Any) -> list[dict[str, Any]]:
    """Return the tables of a list, as [[where]] of TOML."""
    if not isinstance(given, list | tuple):
        raise ConfigError(f"Expected {where} to be a list of tables, [[{where}]], got {given!r}.")
    tables = cast("Sequence[Any]", given)
    return [dict(table(f"{where}[{k}]", one)) for k, one in enumerate(tables)]


def _world(values: dict[str, Any], kind: Any) -> Any:
    """Return the world of a table, out of which its scenario and its wrappers are taken."""
    fields = dict(table("scenario", values.pop("scenario", None)))
    wrappers = wrappers_from_mapping(table("wrappers", values.pop("wrappers", {})))
    preset = fields.pop("preset", None)
    if preset is None:
        config = read(ScenarioConfig, fields, "scenario")
    else:
        config = scenario(preset, **_tuples(fields))
    if kind is World:
        return kind(config, wrappers)
    known_keys(values, ("name", "baseline"), prefix="evaluation.worlds.")
    return kind(config, wrappers, **values)


def _tuples(value: Any) -> Any:
    """Return lists, the only sequences of TOML and JSON, as tuples, in tables, too."""
    if isinstance(value, Mapping):
        return {name: _tuples(item) for name, item in value.items()}
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def read_plan(path: str | Path) -> TrainingPlan:
    """Read a plan from a TOML file, or from the JSON file that a training run leaves.

    Raises:
        ConfigError: the file cannot be read or does not hold a plan; the message names it.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
        return TrainingPlan.from_mapping(parse_json(text) if path.suffix == ".json" else parse_toml(text))
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


def _plain(value: Any) -> Any:
    """Return plans, stages, worlds and samplers as plain values; without a sampler where there is none."""
    if isinstance(value, ScenarioSampler):
        return dict(value.table)
    if isinstance(value, ScenarioConfig | InterfaceConfig):
        return dataclasses.asdict(value)
    if isinstance(value, World):
        wrappers = {config.name: config.to_mapping() for config in value.wrappers}
        named = {"name": value.name, "baseline": value.baseline} if isinstance(value, EvaluationWorld) else {}
        return {"scenario": dataclasses.asdict(value.scenario), "wrappers": wrappers, **named}
    if dataclasses.is_dataclass(value):
        plain = {item.name: _plain(getattr(value, item.name)) for item in dataclasses.fields(value)}
        return {name: item for name, item in plain.items() if item is not None or name != "sampler"}
    if isinstance(value, Mapping):
        return dict(value)
    is_listed = isinstance(value, tuple) and value and dataclasses.is_dataclass(value[0])
    return list(map(_plain, value)) if is_listed else value


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
