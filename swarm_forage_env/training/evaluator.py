"""Evaluate the networks of any learner as `swarm-forage train` does, and keep the best.

evaluator = Evaluator(plan, "results/mine/seed_0", {"by": "my_learner.py"})
...                                              # learn for some decisions
if evaluator.is_due(decisions):
    print(evaluator.evaluate(network, decisions))

The folder becomes that of a training: `swarm-forage train curves` draws it, beside others and the paper's controllers.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from swarm_forage_env.policies.network import Network, NetworkPolicy
from swarm_forage_env.runs.policy_spec import policy_spec
from swarm_forage_env.runs.run import Started
from swarm_forage_env.runs.versions import software_versions
from swarm_forage_env.training.evaluations import (
    EVALUATIONS_FILE,
    PLAN_FILE,
    POLICY_FILE,
    Evaluation,
    baselines_of,
    chosen,
    evaluated,
    write_evaluations,
)
from swarm_forage_env.training.plan import LEARNING, TrainingPlan


class Evaluator:
    """Runs networks in the worlds of a plan's evaluation, beside its baselines.

    Attributes:
        evaluations: All of them, oldest first.
    """

    def __init__(self, plan: TrainingPlan, folder: str | Path, made_by: Mapping[str, Any]) -> None:
        """Begin a training; `folder` gets its plan.

        Args:
            plan: Says the worlds, how often they are run, and which network counts as best.
            folder: Gets `plan.json`, `evaluations.csv` and `policy.npz`. It is made if it is not there. What another
                training left there is replaced.
            made_by: What the card of the network says besides plan, evaluation and versions, as plain values. Its
                `versions`, if any, are added to ours.
        """
        self.plan, self.evaluations = plan, list[Evaluation]()
        self._folder = Path(folder)
        self._made_by = {**made_by, "versions": {**software_versions(), **made_by.get("versions", {})}}
        self._folder.mkdir(parents=True, exist_ok=True)
        (self._folder / EVALUATIONS_FILE).unlink(missing_ok=True)
        plan.write(self._folder / PLAN_FILE)
        self._baselines = baselines_of(plan)
        self._started = Started.now()

    def is_due(self, steps: int) -> bool:
        """Return whether an evaluation is due after so many decisions of single robots.

        That is each time when `every_steps` of the plan are full, and at its end.
        """
        last, every = (self.evaluations[-1].steps if self.evaluations else 0), self.plan.evaluation.every_steps
        return steps // every > last // every or steps >= self.plan.total_steps > last

    def evaluate(self, network: Network, steps: int) -> Evaluation:
        """Run a network, and write its file if none did better.

        Args:
            network: It sees and acts as the plan says.
            steps: Decisions of single robots so far.

        Raises:
            ConfigError: a run failed.
        """
        spec = policy_spec(NetworkPolicy(network), label=LEARNING.label)
        evaluation = evaluated(self.plan, spec, self._baselines, steps=steps, spent_s=self._started.spent_s)
        self.evaluations.append(evaluation)
        if chosen(self.evaluations) is evaluation:  # the network first: no table without it
            card = {"plan": self.plan.to_mapping(), "evaluation": evaluation.to_mapping(), **self._made_by}
            replace(network, about=replace(network.about, card=card)).save(self._folder / POLICY_FILE)
        write_evaluations(self._folder / EVALUATIONS_FILE, self.evaluations)
        return evaluation
