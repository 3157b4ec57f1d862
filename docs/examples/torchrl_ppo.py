"""PPO of TorchRL on `PettingZooWrapper`: pip install torchrl==0.14.1 torch==2.13.0.

Robots die. Dead ones are rows whose mask is false; steps of robots that are not at work teach nothing.
"""

import torch
from tensordict.nn import TensorDictModule
from torchrl.collectors import Collector
from torchrl.envs.libs.pettingzoo import PettingZooWrapper
from torchrl.modules import MaskedCategorical, MultiAgentMLP, ProbabilisticActor
from torchrl.objectives import ClipPPOLoss, ValueEstimators

from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.network import Network, NetworkAbout
from swarm_forage_env.views.pettingzoo import ParallelLearnerEnv

N_DECISIONS = 500_000  # of single robots

interface = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5)
deaths = ["population:death_per_tick=0.001"]
fields = {"n_robots": 6, "max_cycles": 500, "nest_progress": 0.05}
swarm = ParallelLearnerEnv("warehouse_small", interface=interface, wrappers=deaths, **fields)
env = PettingZooWrapper(
    swarm,
    group_map={"robots": swarm.possible_agents},
    use_mask=True,  # robots die
    done_on_any=False,  # the run goes on without them
    categorical_actions=True,
)


def network(n_outputs):
    """One network for all robots; each robot sees its own row."""
    return MultiAgentMLP(
        n_agent_inputs=swarm.interface.layout.size,
        n_agent_outputs=n_outputs,
        n_agents=6,
        centralized=False,
        share_params=True,
        depth=2,
        num_cells=64,
        activation_class=torch.nn.Tanh,
    )


actor = ProbabilisticActor(
    TensorDictModule(network(swarm.interface.action_space.n), [("robots", "observation")], [("robots", "logits")]),
    in_keys={"logits": ("robots", "logits"), "mask": ("robots", "action_mask")},
    out_keys=[("robots", "action")],
    distribution_class=MaskedCategorical,
    return_log_prob=True,
    log_prob_key=("robots", "action_log_prob"),
)
critic = TensorDictModule(network(1), [("robots", "observation")], [("robots", "state_value")])
ppo = ClipPPOLoss(actor, critic)
ppo.set_keys(
    action=("robots", "action"),
    sample_log_prob=("robots", "action_log_prob"),
    value=("robots", "state_value"),
    reward=("robots", "reward"),
    done=("robots", "done"),
    terminated=("robots", "terminated"),
)
ppo.make_value_estimator(ValueEstimators.GAE, gamma=0.99, lmbda=0.95)
optimizer = torch.optim.Adam(ppo.parameters(), lr=3e-4)

for rollout in Collector(env, actor, frames_per_batch=200, total_frames=N_DECISIONS // 6):
    with torch.no_grad():
        ppo.value_estimator(rollout)
    away = rollout["robots", "info", "active"][..., None] < 0.5  # not at work: nothing to learn from
    rollout["advantage"].masked_fill_(away, 0.0)
    rollout["value_target"] = torch.where(away, rollout["robots", "state_value"], rollout["value_target"])
    parts = ppo(rollout)
    loss = parts["loss_objective"] + parts["loss_critic"] + parts["loss_entropy"]
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
about = NetworkAbout(interface=interface, activation="tanh", samples=True)
Network.from_state_dict(actor.state_dict(), about).save("policy.npz")
