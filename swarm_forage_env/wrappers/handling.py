"""HandlingCost: picking up and dropping take longer, by a waveform of time."""

from dataclasses import dataclass
from typing import ClassVar

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.config import MAX_HANDLING_TICKS
from swarm_forage_env.wrappers.base import SwarmWrapper, WrapperConfig
from swarm_forage_env.wrappers.waveform import Waveform

IDEAL_COST = 1.0
"""Constant cost, in ticks, that comparisons take as ideal conditions: nothing extra."""
COST_AMPLITUDES = (25.0, 50.0, 100.0, 200.0, 400.0, 800.0)
"""Levels of `square_costs`, in ticks."""


class HandlingCost(SwarmWrapper):
    """Lets pick-ups and drops take more ticks: those that start in tick t take the integer part of V(t).

    V is the waveform, and the first tick is 1. With V = 5.7, a robot that starts to pick up in tick 10 carries the
    object after tick 15. Nothing takes less time than in the scenario (`pickup_ticks`, `drop_ticks`, usually one tick).
    The paper's second kind of temporal disturbance: a penalty for handling objects.

    Records what handling took: `handling_cost`, the mean ticks of a pick-up and a drop that start in the last tick of
    an interval, and `handling_cost_mean`, its mean over the interval.
    """

    stack_position: ClassVar[int] = 5

    def __init__(self, env: ForageEnv | SwarmWrapper, config: "HandlingCostConfig") -> None:
        """Wrap `env`."""
        super().__init__(env, config)
        scenario = self.unwrapped.scenario
        self._pickup, self._drop = scenario.objects.pickup_ticks, scenario.objects.drop_ticks
        self.reconfigure(config)

    def reconfigure(self, config: "HandlingCostConfig") -> None:
        """Go on under another configuration from the next tick on."""
        self.made_from = config
        self._signal = config.waveform.signal(self.unwrapped.scenario.dt_s)

    def on_reset(self, seed: int) -> None:
        """Start the waveform."""
        self._applied = self._sum = 0.0
        self._ticks = 0

    def before_step(self) -> None:
        """Set what handling costs in the coming tick."""
        cost = int(self._signal(self.unwrapped.tick + 1))
        pickup, drop = max(self._pickup, cost), max(self._drop, cost)
        self.unwrapped.set_handling_ticks(pickup=pickup, drop=drop)
        # An object costs one pick-up and one drop, so their mean is what a policy can react to.
        self._applied = 0.5 * (pickup + drop)
        self._sum += self._applied
        self._ticks += 1

    def interval_columns(self) -> dict[str, float]:
        """Return what handling took at the last tick, and its mean over the ticks since the last call."""
        mean = self._sum / self._ticks
        self._sum, self._ticks = 0.0, 0
        return {"handling_cost": self._applied, "handling_cost_mean": mean}


@dataclass(frozen=True, kw_only=True, slots=True)
class HandlingCostConfig(WrapperConfig):
    """A `HandlingCost` as data.

    Raises:
        ConfigError: a waveform that exceeds `MAX_HANDLING_TICKS`.
    """

    name: ClassVar[str] = "handling_cost"
    wrapper: ClassVar[type[SwarmWrapper]] = HandlingCost
    waveform_field: ClassVar[str] = "waveform"

    waveform: Waveform
    """Ticks that a pick-up or a drop takes; values below those of the scenario change nothing."""
    example: ClassVar[str] = "waveform=constant,amplitude=50"

    def check(self) -> None:
        """Refuse what takes longer than any handling may."""
        if self.waveform.ends[1] > MAX_HANDLING_TICKS:
            raise ConfigError(
                f"Expected a handling cost of at most {MAX_HANDLING_TICKS:,} ticks, got a waveform that reaches "
                f"{self.waveform.ends[1]:g}; lower its amplitude or its offset."
            )

    def in_words(self, dt_s: float) -> str:
        """Return how long handling takes; see `WrapperConfig.in_words`."""
        # One tick is what handling takes without the wrapper.
        return f"handling cost: a pick-up or a drop takes {self.waveform.in_words(' s', factor=dt_s, floor=1.0)}"


def square_costs() -> tuple[HandlingCostConfig, ...]:
    """Handling costs to compare policies under: a square wave, two cycles in a run of 10,000 s; the first is the ideal.

    At amplitude A, a pick-up and a drop take 1 + 2 A ticks each in one half of a cycle and one tick in the other (our
    choice, as the throttles of scenario 1; the paper shows no levels). A = 25, 50, ..., 800: up to 10 s ... 320 s.
    """
    ideal = Waveform(kind="constant", amplitude=IDEAL_COST)
    waves = [
        Waveform(kind="square", amplitude=level, offset=IDEAL_COST + level, period_s=5_000.0)
        for level in COST_AMPLITUDES
    ]
    return tuple(HandlingCostConfig(waveform=waveform) for waveform in (ideal, *waves))
