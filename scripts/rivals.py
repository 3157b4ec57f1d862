"""What scripts have in common that carry out a plan of a training with another library."""

import argparse
import dataclasses
from collections.abc import Callable
from pathlib import Path

import torch

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.training.evaluations import Evaluation
from swarm_forage_env.training.plan import TrainingPlan, read_plan


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
    except (ConfigError, OSError) as error:
        parser.error(str(error))


def told(evaluation: Evaluation) -> str:
    """Return a line about an evaluation."""
    speed = f"{evaluation.steps / max(evaluation.cpu_time_s, 0.1):,.0f} per s of a core"
    reached = f"{evaluation.performance:.2f} of the baselines, interference {evaluation.interference_fraction:.3f}"
    return f"{evaluation.steps:>11,} decisions, {speed}, {reached}"
