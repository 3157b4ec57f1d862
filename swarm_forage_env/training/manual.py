"""What a network takes and returns, in words: for whoever builds a robot or another simulator around it."""

from collections.abc import Iterator
from textwrap import wrap

from swarm_forage_env.contract.policy import COMMANDS, SwarmSpec
from swarm_forage_env.policies.interface import GRIPS, MOTIONS, InterfaceConfig, LearnerInterface
from swarm_forage_env.policies.kernels.frames import (
    APART,
    FIRST_FACTOR,
    N_UPRIGHT,
    OF_PERIOD,
    OF_ROBOT,
    SECOND_FACTOR,
    Frames,
)
from swarm_forage_env.policies.kernels.learner import GRIP_COMMANDS
from swarm_forage_env.policies.network import Network
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import WHEEL_SCALE_MPS

WIDTH = 110
"""Characters of a line of formulas or numbers."""
_FRAMES = """
Each robot sees the world in a frame f of its own, and in another one after {length:,} decisions, so that a swarm
spreads. In frame f the world is mirrored (x becomes -x) if f >= {upright}, and then turned counter-clockwise by f % 4
quarter turns. The frame of robot i in its decision n, both counted from 0, is, all in uint64_t,
"""


def manual_of(network: Network, scenario: ScenarioConfig) -> tuple[str, ...]:
    """Return the words about a network in a scenario, line by line.

    Raises:
        ConfigError: the scenario lacks what the network sees.
        NetworkError: the network does not fit its interface.
    """
    about, arena = network.about, scenario.arena
    interface = LearnerInterface(about.interface, SwarmSpec.of(scenario))
    network.check_fits(interface)
    n_inputs, n_outputs = interface.widths
    is_discrete = interface.translation.is_discrete
    frames = interface.translation.frames
    return (
        f"Inputs, {n_inputs} numbers:",
        *interface.layout.describe().splitlines(),
        f"Arena: X = {arena.width_m:g} m, Y = {arena.height_m:g} m. All inputs lie in [-1, 1].",
        "",
        f"Outputs, {n_outputs} numbers:",
        *(
            _numbered(about.samples, interface.translation.wheels.tolist(), n_outputs)
            if is_discrete
            else _commands(about.interface, n_outputs)
        ),
        "",
        *_use(about.interface, about.interface.decision_ticks * scenario.dt_s),
        *(_frame_lines(frames, is_discrete) if about.interface.frame_decisions else ()),
    )


def _numbered(samples: bool, wheels: list[list[float]], n_outputs: int) -> list[str]:
    lines = [
        f"{number:>9}  {motion}: wheels {left * WHEEL_SCALE_MPS:+.2f}, {right * WHEEL_SCALE_MPS:+.2f} m/s (left, right)"
        for number, (motion, (left, right)) in enumerate(zip(MOTIONS, wheels, strict=True))
    ]
    if n_outputs > len(MOTIONS):
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


def _commands(interface: InterfaceConfig, n_outputs: int) -> list[str]:
    names = [
        f"left wheel / {WHEEL_SCALE_MPS:g} m/s",
        f"right wheel / {WHEEL_SCALE_MPS:g} m/s",
        "gripper command",
    ]
    driven = 2 if interface.automatic_gripper else COMMANDS
    names = names[:driven] + [f"number {k} of the message" for k in range(n_outputs - driven)]
    return [*(f"{k:>9}  {name}" for k, name in enumerate(names)), "All outputs are cut to [-1, 1]."]


def _use(interface: InterfaceConfig, every_s: float) -> list[str]:
    lines = [f"Ask the network every {every_s:g} s, and keep its wheel speeds in between."]
    if interface.automatic_gripper:
        lines.append(
            "The gripper works by itself, in every tick: an empty robot grasps over an object or a cache, one with an "
            "object lets go in the nest."
        )
    return lines


def _frame_lines(frames: Frames, is_discrete: bool) -> Iterator[str]:
    """Return how a robot sees and acts in its frames, in formulas of C, from the columns that `take_frames` moves."""
    yield from _FRAMES.format(length=frames.length, upright=N_UPRIGHT).splitlines()
    yield f"    m = (i + 1) * {OF_ROBOT:#x}ull + (n + {APART} * i) / {frames.length} * {OF_PERIOD:#x}ull;"
    yield f"    m = (m ^ (m >> 30)) * {FIRST_FACTOR:#x}ull;"
    yield f"    m = (m ^ (m >> 27)) * {SECOND_FACTOR:#x}ull;"
    yield "    f = (m ^ (m >> 31)) >> 61;"
    yield "With s[c] for what the robot senses in the world as it is, set inputs[c] = s[c] for all c, then"
    for frame, (source, sign) in enumerate(zip(frames.source.tolist(), frames.sign.tolist(), strict=True)):
        moved = [c for c in range(len(source)) if (source[c], sign[c]) != (c, 1.0)]
        moves = " ".join(f"inputs[{c}]={'-' if sign[c] < 0.0 else ''}s[{source[c]}];" for c in moved)
        line = f"    f == {frame}: {moves or 'nothing more'}"
        yield from wrap(line, WIDTH, subsequent_indent=" " * 12, break_on_hyphens=False)
    wheels = "the two wheel speeds of the action" if is_discrete else "outputs[0] and outputs[1]"
    yield f"If f >= {N_UPRIGHT}, {wheels} change places before the robot drives: left is right in a mirror."
