"""PPO of RLlib on `ParallelPettingZooEnv`: pip install "ray[rllib]==2.60.0" torch==2.13.0.

A robot that dies ends its own episode; the arena goes on.
"""

from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
from ray.tune import register_env

from swarm_forage_env.policies.network import Network, NetworkAbout
from swarm_forage_env.training.evaluation import Evaluator
from swarm_forage_env.training.plan import TrainingPlan
from swarm_forage_env.views.pettingzoo import ParallelLearnerEnv

N_DECISIONS = 500_000  # of single robots

plan = TrainingPlan.from_mapping(
    {
        "scenario": {"preset": "classroom", "horizon_s": 400.0, "first_pickup": 1.0, "nest_progress": 0.05},
        "wrappers": {"population": {"death_per_tick": 0.0002}},  # a death every 1,000 s on average
        "interface": {"observation": "compact", "actions": "discrete", "automatic_gripper": True, "decision_ticks": 5},
        "samples": True,  # runs draw actions by their probabilities, as training does
        "stages": [{"steps": N_DECISIONS}],
        "evaluation": {"every_steps": N_DECISIONS // 10, "n_runs": 8},
    }
)


def make(config):
    """One arena in which robots die."""
    env = ParallelLearnerEnv(plan.scenario, wrappers=plan.wrappers, interface=plan.interface)
    return ParallelPettingZooEnv(env)


register_env("swarm_forage", make)
config = (
    PPOConfig()
    .environment("swarm_forage")
    .env_runners(num_env_runners=0)
    .multi_agent(policies={"robot"}, policy_mapping_fn=lambda agent_id, episode, **kwargs: "robot")
    .rl_module(model_config=DefaultModelConfig(fcnet_hiddens=[64, 64], fcnet_activation="tanh"))
    .training(
        train_batch_size_per_learner=800, minibatch_size=400, num_epochs=4, lambda_=0.95, entropy_coeff=0.01, lr=1e-3
    )
)
algorithm = config.build_algo()
evaluator = Evaluator(plan, "results/rllib", {"by": "docs/examples/rllib_ppo.py"})

decisions = 0
while decisions < N_DECISIONS:
    result = algorithm.train()
    decisions = int(result["env_runners"]["num_module_steps_sampled_lifetime"]["robot"])
    if evaluator.is_due(decisions):
        state = algorithm.get_module("robot").state_dict()
        network = Network.from_state_dict(
            state, NetworkAbout(interface=plan.interface, activation="tanh", samples=plan.samples)
        )
        print(decisions, evaluator.evaluate(network, decisions).reached)
algorithm.stop()
