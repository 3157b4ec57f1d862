"""What is told while a policy is trained, line by line: progress, and evaluations as a table."""

from swarm_forage_env._internal.wording import counted
from swarm_forage_env.runs.progress import duration
from swarm_forage_env.training.curves import place_of
from swarm_forage_env.training.evaluation_worlds import ALL_WORLDS
from swarm_forage_env.training.plan import TrainingPlan
from swarm_forage_env.training.status import Evaluation, TrainingStatus


def heading(plan: TrainingPlan) -> str:
    """Return what stands above the evaluations: their runs, and the names of the columns."""
    horizons = {world.scenario.horizon_s for world in plan.judging_worlds}
    runs = f"Evaluated in {counted(plan.evaluation.n_runs, 'run' if len(horizons) == 1 else 'whole run')}"
    if len(horizons) == 1:
        runs += f" of {horizons.pop():,.0f} s"
    if plan.evaluation.worlds:
        return (
            f"{runs} in each of {place_of(plan)}; what counts is the {plan.evaluation.chosen_by} ratio:\n"
            f"{'decisions':>10}  {'world':<20} {'per 1,000 s':>11} {'baseline':>13} {'ratio':>6} {'interference':>12}"
        )
    baseline = plan.evaluation.baseline
    return f"{runs}:\n{'decisions':>12} {'per 1,000 s':>12} {baseline:>8} {'interference':>13}"


def evaluation_lines(news: Evaluation) -> list[str]:
    """Return the lines of an evaluation below `heading`."""
    interference = news.interference_fraction
    if not news.worlds:
        return [f"{news.steps:>12,} {news.performance:>12.1f} {news.baseline:>8.1f} {interference:>13.3f}"]
    lines = [
        f"{'':>10}  {world.world:<20} {world.performance:>11.1f} {f'{world.baseline_policy} {world.baseline:.1f}':>13} "
        f"{world.ratio:>6.2f} {world.interference_fraction:>12.3f}"
        for world in news.worlds
    ]
    return [
        *lines,
        f"{news.steps:>10,}  {ALL_WORLDS:<20} {'':>11} {'':>13} {news.performance:>6.2f} {interference:>12.3f}",
    ]


def progress_line(plan: TrainingPlan, now: TrainingStatus, before: TrainingStatus | None) -> str:
    """Say how far a training is, and how long it takes at the pace since the line before."""
    steps, seconds = (0, 0.0) if before is None else (before.steps, before.wall_time_s)
    left_s = (plan.total_steps - now.steps) * (now.wall_time_s - seconds) / max(1, now.steps - steps)
    return (
        f"{now.steps:,} of {plan.total_steps:,} decisions, mean return {now.episode_return:.2f}, "
        f"about {duration(max(0.0, left_s))} left"
    )
