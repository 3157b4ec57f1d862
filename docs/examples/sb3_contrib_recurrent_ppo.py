r"""RecurrentPPO of sb3-contrib, whose robots learn what to remember: pip install sb3-contrib.

    python docs/examples/sb3_contrib_recurrent_ppo.py docs/benchmark/plans/ippo.toml 3 results/seed_3 \
        interface.frame_decisions=200 interface.site_memory=false options.batch_size=8192

trains by a plan and seed 3: in its worlds and stages, with its interface, hidden layers and options; a value of it may
be another one. The folder gets evaluations and the best model, which runs from its zip file with a memory per robot.
"""

import sys
from functools import partial
from pathlib import Path

import numpy as np
import torch
from sb3_contrib import RecurrentPPO
from sb3_contrib.common.recurrent.buffers import RecurrentRolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback

from swarm_forage_env.cli.worlds import parse_setting
from swarm_forage_env.policies.model_files import ModelPolicy
from swarm_forage_env.training.evaluation import Evaluator, best_of
from swarm_forage_env.training.plan import read_plan
from swarm_forage_env.training.sb3 import ActiveRolloutBuffer, SwarmVecEnv
from swarm_forage_env.training.sb3.export import ACTIVATION_CLASSES, note_interface
from swarm_forage_env.training.sb3.training import training_seed

CELLS = 64
ROWS = ("observations", "actions", "values", "log_probs", "advantages", "returns", "episode_starts")
MEMORIES = ("hidden_states_pi", "cell_states_pi", "hidden_states_vf", "cell_states_vf")


class RolloutsOfRobots(RecurrentRolloutBuffer, ActiveRolloutBuffer):
    """Minibatches of rows from all arenas; steps of robots not at work teach nothing, but fill them."""

    def compute_returns_and_advantage(self, *args, **kwargs):
        super().compute_returns_and_advantage(*args, **kwargs)
        order = np.random.permutation(self.n_envs)  # noqa: NPY002 - the generator that the library seeds
        for name in ROWS:
            setattr(self, name, getattr(self, name)[:, order])
        for name in MEMORIES:
            setattr(self, name, getattr(self, name)[:, :, order])

    def _get_samples(self, *args, **kwargs):
        samples = super()._get_samples(*args, **kwargs)
        return samples._replace(mask=self.at_work(samples.observations).float())


class Watch(BaseCallback):
    """Evaluates the model where the plan says so, and keeps the best one."""

    def __init__(self, evaluator, folder):
        super().__init__()
        self.evaluator, self.folder = evaluator, folder

    def _on_step(self):
        return True

    def _on_rollout_start(self):
        self.look()

    def _on_training_end(self):
        self.look()

    def look(self):
        """Evaluate the model between two rollouts or at the end of a stage, if that is due."""
        steps, latest = self.model.num_timesteps, self.folder / "latest.zip"
        if not self.evaluator.is_due(steps):
            return
        self.model.save(latest)
        evaluation = self.evaluator.evaluate(None, steps, policy=partial(ModelPolicy, latest))
        print(f"{steps:,}: {evaluation.reached:.3f} of the baselines", flush=True)
        if best_of(self.evaluator.evaluations) is evaluation:
            latest.replace(self.folder / "policy.zip")


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    plan_file, seed, folder, *settings = sys.argv[1:]
    plan = read_plan(plan_file).with_settings(dict(map(parse_setting, [*settings, f"seed={seed}"])))
    torch.set_num_threads(1)
    if plan.algorithm != "ppo" or plan.starts > 1 or plan.in_runs or plan.temperature != 1.0:
        sys.exit(f"Expected a plan of ppo with one start, without in_runs and temperature, got {plan_file}.")
    Path(folder).mkdir(parents=True, exist_ok=True)
    watch, before = Watch(Evaluator(plan, folder, {"by": "RecurrentPPO of sb3-contrib"}), Path(folder)), None
    for stage, end in plan.parts():
        env = SwarmVecEnv(**plan.arenas_of(stage))
        env.set_options({"scenario": dict(stage.scenario)})
        network = {
            "lstm_hidden_size": CELLS,
            "net_arch": list(plan.hidden),
            "activation_fn": ACTIVATION_CLASSES[plan.activation],
        }
        done = before.num_timesteps if before else 0
        options = {**plan.options, **stage.options, "seed": training_seed(plan.seed, done)}
        model = RecurrentPPO("MlpLstmPolicy", env, policy_kwargs=network, device="cpu", **options)
        model.rollout_buffer.__class__ = RolloutsOfRobots  # the algorithm takes no class for it
        model.rollout_buffer._active_column = env.rollout_buffer_kwargs["active_column"]
        note_interface(model, env.interface.config, samples=plan.samples)
        if before:
            model.set_parameters(before.get_parameters())
            model.num_timesteps = done
        model.learn(end - done, callback=watch, reset_num_timesteps=False)
        before = model
