"""What scripts have in common that carry out a plan of a training with another library."""

import argparse
import dataclasses
from collections.abc import Callable, Iterable
from pathlib import Path

import torch

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.network import NetworkError
from swarm_forage_env.training.evaluations import Evaluation
from swarm_forage_env.training.plan import TrainingPlan, read_plan


def check_plan(plan: TrainingPlan, algorithm: str, known: Iterable[str]) -> None:
    """Refuse a plan that a script cannot carry out: of another algorithm or network, or with what it does not know.

    Raises:
        ConfigError: see above.
    """
    options = {name for stage in (plan, *plan.stages) for name in stage.options}
    wanted = (algorithm, "discrete", "tanh", 0)
    found = (plan.algorithm, plan.interface.actions, plan.activation, plan.lstm)
    if found != wanted:
        words = "a plan of {} with {} actions, {} and an LSTM of {} cells"
        raise ConfigError(f"Expected {words.format(*wanted)}, got {words.format(*found)}.")
    if not options <= set(known):
        raise ConfigError(f"Expected options among {', '.join(known)}, got {', '.join(sorted(options))}.")


def begin(description: str | None, out: str, carry_out: Callable[[TrainingPlan, Path], None]) -> None:
    """Read the words of the command, and carry their plan out into the folder that they name."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plan", type=Path, required=True, help="plan of a training, as TOML")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path(out), help="folder of the training")
    args = parser.parse_args()
    torch.manual_seed(args.seed)
    torch.set_num_threads(1)
    try:
        carry_out(dataclasses.replace(read_plan(args.plan), seed=args.seed), args.out)
    except (ConfigError, NetworkError, OSError) as error:
        parser.error(str(error))


def told(evaluation: Evaluation) -> str:
    """Return a line about an evaluation."""
    speed = f"{evaluation.steps / max(evaluation.cpu_time_s, 0.1):,.0f} per s of a core"
    reached = f"{evaluation.performance:.2f} of the baselines, interference {evaluation.interference_fraction:.3f}"
    return f"{evaluation.steps:>11,} decisions, {speed}, {reached}"
