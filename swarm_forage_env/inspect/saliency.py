"""What a trained network looks at: how much its actions change when one slice of its observations is exchanged.

Our choice is exchange by slice, not a gradient. A gradient asks what an endless small change does, but most columns of
an observation jump: an object is in view or not, a robot carries or does not. Zeros in place of a slice would be
observations that no robot ever makes, and networks answer those by chance. So a robot gets the slice of another robot,
or of itself at another moment: values that occur, but do not belong to the rest of its observation. The measure is
"permutation importance" (L. Breiman, Random forests, Machine Learning 45, 2001, section 10), with the change of
actions in place of the loss of accuracy.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env._internal.fields import ConfigError, number
from swarm_forage_env._internal.wording import counted, plain, suggestion
from swarm_forage_env.contract.layout import ObservationLayout
from swarm_forage_env.contract.types import ActionArray, BoolArray, FloatArray, ObsArray
from swarm_forage_env.policies.network import Network, NetworkPolicy
from swarm_forage_env.policies.pretrained import network_file, network_names
from swarm_forage_env.rendering.figures import SCREEN, FigureStyle
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.runs.run import LiveRun, build_env
from swarm_forage_env.runs.spec import RunSpec

MOST_ROWS = 20_000
"""Observations that are kept of a run (our choice: shares of so many are exact to a percent)."""
EXCHANGES = 8
"""How often each observation gets the slice of another."""

Group: TypeAlias = Literal["all", "empty", "carrying"]
"""Which robots a number is about."""
GROUPS: tuple[Group, ...] = get_args(Group)
_FRAMES = "position, heading and directions are those that each robot sees in its own frame"
"""What table and figure say beside the numbers of a network whose robots have frames of their own."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Saliency(Answer):
    """What a network looked at in a run, by slice of its observations (S of them) and by group of robots."""

    slices: tuple[str, ...]
    """(S,) names."""
    n_columns: tuple[int, ...]
    """(S,) sizes."""
    meanings: tuple[str, ...]
    """(S,) what the columns hold."""
    n_rows: dict[Group, int]
    """How many observations there are of each group."""
    changed: dict[Group, FloatArray]
    """Group -> (S,) discrete actions: share of decisions that come out different; continuous ones: mean change of the
    commands, which lie in [-1, 1]. NaN where the group has no observation."""
    moved: dict[Group, FloatArray] | None
    """Group -> (S,) mean total variation distance between the probabilities of actions before and after, in [0, 1]; as
    if outputs were logits, which they are in ppo and a2c, and in a dqn that draws. None for continuous actions."""
    title: str = ""
    """What it is about: policy and run."""
    in_frames: bool = False
    """Whether robots have frames of their own, in which the network sees position, heading and all directions."""

    @property
    def ranked(self) -> tuple[int, ...]:
        """Rows of slices, that with the largest change over all robots first."""
        return tuple(np.argsort(-self.changed["all"], kind="stable").tolist())

    @property
    def _words(self) -> str:
        return "share of decisions that change" if self.moved is not None else "mean change of the commands"

    def sheets(self) -> tuple[Sheet, ...]:
        """Return one row per slice, in the order of `ranked`."""
        counts = [f"{group} ({self.n_rows[group]:,} seen)" for group in GROUPS]
        moved = [] if self.moved is None else ["probability moved"]
        return (
            Sheet(
                title=self.title,
                header=("slice", "columns", *counts, *moved, "what it holds"),
                rows=[self._row(row) for row in self.ranked],
                notes=(f"{self._words} when a slice comes from another observation", *([_FRAMES] * self.in_frames)),
            ),
        )

    def _row(self, row: int) -> tuple[str, ...]:
        numbers = [self.changed[group][row] for group in GROUPS]
        numbers += [] if self.moved is None else [self.moved["all"][row]]
        told = ("" if math.isnan(number) else f"{number:.3f}" for number in numbers)
        return (self.slices[row], str(self.n_columns[row]), *told, self.meanings[row])

    def to_mapping(self) -> dict[str, Any]:
        """Return all numbers as plain values, by slice."""
        return {
            "what": self.title,
            "seen": dict(self.n_rows),
            "in_frames": self.in_frames,
            "slices": {
                self.slices[row]: {
                    "columns": self.n_columns[row],
                    "changed": {group: plain(float(self.changed[group][row])) for group in GROUPS},
                    "moved": None
                    if self.moved is None
                    else {group: plain(float(self.moved[group][row])) for group in GROUPS},
                }
                for row in self.ranked
            },
        }

    def draw(self, path: str | Path, *, style: FigureStyle = SCREEN) -> None:
        """Draw a group of bars per slice; see `rendering.plots.draw_saliency`."""
        from swarm_forage_env.rendering.plots import draw_saliency

        exchanged = f"{self._words} when the slice comes from another observation"
        ends = (
            "(0: it is not looked at, 1: every decision changes)"
            if self.moved is not None
            else "(0: it is not looked at; commands lie in [-1, 1], so at most 2)"
        )
        bars = {group: self.changed[group] for group in GROUPS[1:] if self.n_rows[group]}
        label = "\n".join((exchanged, ends, *([_FRAMES] * self.in_frames)))
        draw_saliency(path, self.slices, bars, title=self.title, xlabel=label, style=style)


def open_network_of(policy: str) -> Network:
    """Return the network of a policy.

    Args:
        policy: Name of a shipped policy, or path of a network file.

    Raises:
        ConfigError: the policy is no network in a file.
        NetworkError: the file holds none, or one with a memory.
        OSError: the file cannot be read.
    """
    file = network_file(policy) or Path(policy)
    if file.suffix.lower() != ".npz":
        known = network_names()
        raise ConfigError(
            f"Expected a network, that is the name of a shipped one ({', '.join(known)}) or an .npz file, got "
            f"{policy!r}.{suggestion(policy, known)} Training leaves policy.npz beside a model; other policies have no "
            "network to look into."
        )
    network = Network.load(file)
    network.require_no_memory()
    return network


def saliency(
    network: Network, spec: RunSpec, *, seconds: float | None = None, progress: Callable[[int, int], None] | None = None
) -> Saliency:
    """Let a network steer a run and measure what it looks at.

    Args:
        network: The network; `spec.policy` is only its name.
        spec: The run.
        seconds: Simulated time to take observations from; default the whole run.
        progress: Called with (ticks done, ticks in all).

    Raises:
        ConfigError: `seconds` is longer than the run, or no robot was at work at any decision.
    """
    scenario = spec.scenario
    number("seconds", scenario.horizon_s if seconds is None else seconds, above=0.0, at_most=scenario.horizon_s)
    end = scenario.horizon_ticks if seconds is None else max(1, round(seconds / scenario.dt_s))
    interface = network.about.interface
    n_decisions = -(-end // interface.decision_ticks)
    every = max(1, -(-n_decisions * scenario.robots.n_robots // MOST_ROWS))
    policy = _Watched(network, every)
    run = LiveRun(build_env(scenario, spec.wrappers, reads=policy.reads), policy, spec.seed)
    step = max(1, end // 100)
    while run.forage_env.tick < end and not run.over:
        run.advance(to_tick=min(run.forage_env.tick + step, end))
        if progress is not None:
            progress(run.forage_env.tick, end)
    seen = np.concatenate(policy.rows)
    rows = seen[seen[:, policy.interface.active_column] > 0.5]
    if not len(rows):
        raise ConfigError("Expected robots at work, got a run in which no robot decided anything; choose another seed.")
    found = saliency_of_rows(network, policy.interface.layout, rows, np.random.default_rng(spec.seed))
    about = spec.world.title(counted(scenario.robots.n_robots, "robot"), f"seed {spec.seed}", digests=False)
    return replace(found, title=f"{Path(spec.policy).stem} in {about}")


def saliency_of_rows(network: Network, layout: ObservationLayout, rows: ObsArray, rng: np.random.Generator) -> Saliency:
    """Measure what a network looks at, in given observations.

    Args:
        network: The network.
        layout: Columns of what it sees.
        rows: (K, d) observations as the network sees them, at least one; with `frame_decisions` each is in the frame of
            its robot.
        rng: Chooses whose slice an observation gets.
    """
    is_discrete = network.about.interface.actions == "discrete"
    before = network.outputs(rows)
    carrying = rows[:, layout["carrying"]][:, 0] > 0.5
    members: dict[Group, BoolArray] = dict(
        zip(GROUPS, (np.ones(len(rows), np.bool_), ~carrying, carrying), strict=True)
    )
    changed: dict[Group, list[float]] = {group: [] for group in GROUPS}
    moved: dict[Group, list[float]] = {group: [] for group in GROUPS}
    donors = [rng.permutation(len(rows)) for _ in range(EXCHANGES)]  # the same for all slices, so that they compare
    for part in layout:
        change, distance = np.zeros(len(rows)), np.zeros(len(rows))
        for donor in donors:
            exchanged = rows.copy()
            exchanged[:, part.start : part.stop] = rows[donor, part.start : part.stop]
            after = network.outputs(exchanged)
            change += _changes(before, after, is_discrete=is_discrete) / EXCHANGES
            if is_discrete:
                distance += 0.5 * np.abs(_probabilities(after) - _probabilities(before)).sum(axis=1) / EXCHANGES
        for group, rows_of_group in members.items():
            changed[group].append(_mean(change[rows_of_group]))
            moved[group].append(_mean(distance[rows_of_group]))
    return Saliency(
        slices=layout.names,
        n_columns=tuple(part.size for part in layout),
        meanings=tuple(part.meaning for part in layout),
        n_rows={group: int(rows_of_group.sum()) for group, rows_of_group in members.items()},
        changed={group: np.array(values) for group, values in changed.items()},
        moved={group: np.array(values) for group, values in moved.items()} if is_discrete else None,
        in_frames=network.about.interface.frame_decisions > 0,
    )


class _Watched(NetworkPolicy):
    """Keeps what robots saw at every so-many-th decision."""

    def __init__(self, network: Network, every: int) -> None:
        super().__init__(network)
        self._ticks = every * network.about.interface.decision_ticks
        self.rows: list[ObsArray] = []

    def act(self, obs: ObsArray, active: BoolArray) -> ActionArray:
        actions = super().act(obs, active)
        if (self.n_ticks - 1) % self._ticks == 0:
            self.rows.append(self.seen.copy())
        return actions


def _changes(before: np.ndarray, after: np.ndarray, *, is_discrete: bool) -> NDArray[np.float64]:
    """Return (K,): whether the most probable action is another one, or how far continuous commands move on average."""
    if is_discrete:
        return (before.argmax(axis=1) != after.argmax(axis=1)).astype(np.float64)
    return np.abs(np.clip(after, -1.0, 1.0) - np.clip(before, -1.0, 1.0)).mean(axis=1, dtype=np.float64)


def _probabilities(logits: np.ndarray) -> NDArray[np.float64]:
    powers = np.exp(np.subtract(logits, logits.max(axis=1, keepdims=True), dtype=np.float64))
    return powers / powers.sum(axis=1, keepdims=True)


def _mean(values: NDArray[np.float64]) -> float:
    return float(values.mean()) if len(values) else float("nan")
