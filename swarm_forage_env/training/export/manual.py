"""What a network takes and returns, in words: for whoever builds a robot or another simulator around it."""

import re
from dataclasses import dataclass

import numpy as np

from swarm_forage_env.contract.policy import COMMANDS, SwarmSpec
from swarm_forage_env.policies.interface import GRIPS, MOTIONS, InterfaceConfig
from swarm_forage_env.policies.kernels.learner import GRIP_COMMANDS, MOTION_WHEELS
from swarm_forage_env.policies.network import Network, NetworkPolicy
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.robots import WHEEL_SCALE_MPS


@dataclass(frozen=True, kw_only=True, slots=True)
class Manual:
    """Words about a network, each a line or several."""

    name: str
    """Of the policy."""
    n_inputs: int
    n_outputs: int
    is_discrete: bool
    """Whether outputs are logits of numbered actions; else they are commands in [-1, 1]."""
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    use: tuple[str, ...]
    """When to ask it, and what to do with the answer."""

    @property
    def identifier(self) -> str:
        """The name with letters, digits and _ only, as C wants it."""
        found = re.sub(r"\W", "_", self.name, flags=re.ASCII)
        return found if found[:1].isalpha() else f"policy_{found}"

    @property
    def lines(self) -> tuple[str, ...]:
        """All of it, one line after the other."""
        n_inputs, n_outputs = f"Inputs, {self.n_inputs} numbers:", f"Outputs, {self.n_outputs} numbers:"
        return (n_inputs, *self.inputs, "", n_outputs, *self.outputs, "", *self.use)


def manual_of(network: Network, scenario: ScenarioConfig, name: str) -> Manual:
    """Return the words about a network in a scenario.

    Raises:
        ConfigError: the scenario lacks what the network sees.
        NetworkError: the network does not fit its interface.
    """
    policy = NetworkPolicy(network)
    policy.reset(SwarmSpec.of(scenario), np.random.default_rng(0))  # refuses what does not fit
    about, interface, arena = network.about, policy.interface, scenario.arena
    is_discrete = interface.translation.is_discrete
    every_s = about.interface.decision_ticks * scenario.dt_s
    return Manual(
        name=name,
        n_inputs=interface.layout.size,
        n_outputs=len(network.biases[-1]),
        is_discrete=is_discrete,
        inputs=(
            *(f"{line}" for line in interface.layout.describe().splitlines()),
            f"Arena: X = {arena.width_m:g} m, Y = {arena.height_m:g} m. All inputs lie in [-1, 1].",
        ),
        outputs=tuple(_numbered(about.samples, network) if is_discrete else _commands(network)),
        use=tuple(_use(about.interface, every_s)),
    )


def _numbered(samples: bool, network: Network) -> list[str]:
    lines = [
        f"{number:>9}  {motion}: wheels {left * WHEEL_SCALE_MPS:+.2f}, {right * WHEEL_SCALE_MPS:+.2f} m/s (left, right)"
        for number, (motion, (left, right)) in enumerate(MOTION_WHEELS.items())
    ]
    if len(network.biases[-1]) > len(MOTIONS):
        lines += [
            f"{len(MOTIONS) + k:>9}  {grip}: wheels stand, gripper command {GRIP_COMMANDS[grip]:+.3f}"
            for k, grip in enumerate(GRIPS)
        ]
    chosen = (
        "Draw the action k with probability exp(output k) / sum of exp(outputs), as the policy does in runs."
        if samples
        else "Choose the action with the largest output, as the policy does in runs."
    )
    return [*lines, f"These are logits. {chosen}"]


def _commands(network: Network) -> list[str]:
    names = [
        f"left wheel / {WHEEL_SCALE_MPS:g} m/s",
        f"right wheel / {WHEEL_SCALE_MPS:g} m/s",
        "gripper command",
    ]
    n_outputs = len(network.biases[-1])
    driven = 2 if network.about.interface.automatic_gripper else COMMANDS
    names = names[:driven] + [f"number {k} of the message" for k in range(n_outputs - driven)]
    return [*(f"{k:>9}  {name}" for k, name in enumerate(names)), "All outputs are cut to [-1, 1]."]


def _use(interface: InterfaceConfig, every_s: float) -> list[str]:
    lines = [f"Ask the network every {every_s:g} s, and keep its wheel speeds in between."]
    if interface.automatic_gripper:
        lines.append(
            "The gripper works by itself, in every tick: an empty robot grasps over an object or a cache, one with an "
            "object lets go in the nest."
        )
    if interface.frame_decisions:
        lines.append(
            "In the simulator each robot sees the world turned by quarter turns or mirrored, in one of eight ways, and "
            f"in another one after {interface.frame_decisions:,} decisions, so that a swarm spreads. Turn positions, "
            "headings and, where the world is mirrored, left and right of inputs and wheels in the same way."
        )
    return lines
