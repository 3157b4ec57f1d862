"""A search for good settings of a training by Optuna: pip install optuna==5.0.0.

It is so small that it learns nothing: leave out SMALL and the evaluation, and take more trials.
"""

from pathlib import Path

import optuna

from swarm_forage_env.training.evaluation import Evaluation
from swarm_forage_env.training.recipe import recipe
from swarm_forage_env.training.sb3.training import train

SMALL = {"n_robots": 4, "n_objects": 20, "n_arenas": 2, "steps": 256, "physics": "compiled"}  # a training takes seconds


def objective(trial: optuna.Trial) -> float:
    plan = recipe(
        "warehouse_small",
        options={
            "learning_rate": trial.suggest_float("learning_rate", 1e-4, 3e-3, log=True),
            "ent_coef": trial.suggest_float("ent_coef", 1e-4, 1e-1, log=True),
            "n_steps": 16,
            "batch_size": 64,
        },
        evaluation={"every_steps": 128, "horizon_s": 200.0},
        **SMALL,
    )
    best = 0.0

    def report(news):
        nonlocal best
        if isinstance(news, Evaluation):  # not the status in between
            best = max(best, news.reached)
            trial.report(news.reached, news.steps)
            if trial.should_prune():
                raise optuna.TrialPruned

    train(plan, Path(f"results/optuna/{trial.number}"), report=report)
    return best


study = optuna.create_study(direction="maximize", sampler=optuna.samplers.TPESampler(seed=1))
study.optimize(objective, n_trials=2)
print("best of", len(study.trials), "trainings:", study.best_params)
