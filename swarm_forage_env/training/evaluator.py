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

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.files import check_folder
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.policies.network import Network, NetworkPolicy
from swarm_forage_env.runs.run import Started
from swarm_forage_env.runs.spec import policy_spec
from swarm_forage_env.runs.versions import software_versions
from swarm_forage_env.training.evaluations import (
    EVALUATIONS_FILE,
    PLAN_FILE,
    POLICY_FILE,
    Baselines,
    Evaluation,
    as_kept,
    baselines_of,
    check_unused,
    chosen,
    evaluated,
    lacks_evaluation,
    write_evaluations,
)
from swarm_forage_env.training.plan import LEARNING, TrainingPlan


class Evaluator:
    """Runs networks in the worlds of a plan's evaluation, beside its baselines.

    Attributes:
        plan: Of the training.
        baselines: What networks are compared with in each world.
        evaluations: All of them, oldest first.
    """

    def __init__(
        self,
        plan: TrainingPlan,
        folder: str | Path,
        made_by: Mapping[str, Any],
        *,
        baselines: Baselines | None = None,
    ) -> None:
        """Begin a training: run its baselines, and write its plan.

        Args:
            plan: Says the worlds, when they are run, and which network counts as best.
            folder: Gets `plan.json`, `evaluations.csv` and `policy.npz`. It is made if it is not there.
            made_by: What the card of the network says besides plan, evaluation and versions, as plain values. Its
                `versions`, if any, are added to ours.
            baselines: Those of another training with the same evaluation, which saves their runs.

        Raises:
            ConfigError: the folder holds a training, or cannot be made or written to; or a run of a baseline failed.
        """
        self.plan, self.evaluations = plan, list[Evaluation]()
        self._folder = Path(folder)
        self._started = Started.now()
        self._made_by = {**made_by, "versions": {**software_versions(), **made_by.get("versions", {})}}
        check_unused(self._folder, "choose another folder, or remove it")
        try:
            check_folder(self._folder)
        except OSError as error:
            reason = error.strerror or error
            raise ConfigError(f"Expected a folder to write to, got {folder}: {reason}; choose another.") from error
        self.baselines = baselines_of(plan) if baselines is None else baselines
        self._folder.mkdir(parents=True, exist_ok=True)
        plan.write(self._folder / PLAN_FILE)

    def is_due(self, steps: int) -> bool:
        """Return whether an evaluation is due after so many decisions of single robots.

        That is when `every_steps` of the plan have passed since the last one, and at the end of each stage.
        """
        return lacks_evaluation(self.plan, self.evaluations, steps)

    def evaluate(self, network: Network, steps: int) -> Evaluation:
        """Run a network as the policy that comes of the plan, and write its file if none did better.

        Args:
            network: It sees and acts as the plan's interface says, by which it learns.
            steps: Decisions of single robots so far, more than at the last evaluation. They need not be due.

        Raises:
            ConfigError: the network sees or acts in another way, there are no more decisions than at the last
                evaluation, or a run failed.
            NetworkError: the network has another number of inputs or outputs than its interface.
        """
        plan, about = self.plan, network.about
        found = about.interface.for_scenario(plan.scenario), about.samples
        if found != (plan.interface, plan.samples):
            raise ConfigError(
                f"Expected a network with the plan's interface and samples, {plan.interface} and {plan.samples}, got "
                f"{found[0]} and {found[1]}; make it with NetworkAbout(interface=plan.interface, samples=plan.samples)."
            )
        # Layers that do not fit are refused here, not in the middle of runs.
        NetworkPolicy(network).reset(SwarmSpec.of(plan.scenario), np.random.default_rng())
        network = as_kept(network, plan)
        last = self.evaluations[-1].steps if self.evaluations else -1
        if steps <= last:
            raise ConfigError(f"Expected more decisions than at the last evaluation, {last}, got {steps}.")
        spec = policy_spec(NetworkPolicy(network), label=LEARNING.label)
        evaluation = evaluated(plan, spec, self.baselines, steps=steps, spent_s=self._started.spent_s)
        self.evaluations.append(evaluation)
        if chosen(self.evaluations) is evaluation:  # the network first: no table without it
            card = {**self._made_by, "plan": plan.to_mapping(), "evaluation": evaluation.to_mapping()}
            replace(network, about=replace(network.about, card=card)).save(self._folder / POLICY_FILE)
        write_evaluations(self._folder / EVALUATIONS_FILE, self.evaluations)
        return evaluation
