"""IPPO of BenchMARL in a task of its own: pip install benchmarl==1.5.2 torchrl==0.11.1 torch==2.13.0.

BenchMARL wants a fixed set of agents, so deaths are absorbing: dead robots are rows of zeros.
"""

from benchmarl.algorithms import IppoConfig
from benchmarl.environments.pettingzoo.common import PettingZooClass
from benchmarl.experiment import Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig
from torchrl.envs.libs.pettingzoo import PettingZooWrapper

from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.network import Network, NetworkAbout
from swarm_forage_env.views.pettingzoo import ParallelLearnerEnv

N_DECISIONS = 500_000  # of single robots
INTERFACE = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5)
DEATHS = ["population:death_per_tick=0.0002,deaths=absorbing"]  # one every 1,000 s on average
FIELDS = {"horizon_s": 400.0, "first_pickup": 1.0, "nest_progress": 0.05}


class ClassroomTask(PettingZooClass):
    """The classroom as a BenchMARL task."""

    def get_env_fun(self, num_envs, continuous_actions, seed, device):
        def make():
            env = ParallelLearnerEnv("classroom", wrappers=DEATHS, interface=INTERFACE, **FIELDS)
            return PettingZooWrapper(
                env,
                group_map={"robots": env.possible_agents},
                return_state=self.has_state(),
                categorical_actions=True,
                device=device,
                seed=seed,
            )

        return make

    def supports_continuous_actions(self):
        return False

    def supports_discrete_actions(self):
        return True

    def has_state(self):
        return False


settings = ExperimentConfig.get_from_yaml()
settings.max_n_frames = N_DECISIONS // 10  # a frame is a decision of all ten robots
settings.on_policy_collected_frames_per_batch = 400
settings.on_policy_n_envs_per_worker = 4
settings.on_policy_n_minibatch_iters = 8
settings.on_policy_minibatch_size = 100
settings.lr = 1e-3
settings.evaluation = False
settings.loggers = []
settings.create_json = False
settings.save_folder = "."
algorithm = IppoConfig.get_from_yaml()
algorithm.entropy_coef = 0.01
model = MlpConfig.get_from_yaml()
model.num_cells = [64, 64]

experiment = Experiment(
    task=ClassroomTask(name="CLASSROOM", config={"max_cycles": 400}),
    algorithm_config=algorithm,
    model_config=model,
    seed=0,
    config=settings,
)
experiment.run()
about = NetworkAbout(interface=INTERFACE, activation="tanh", samples=True)
Network.from_state_dict(experiment.policy.state_dict(), about).save("policy.npz")
