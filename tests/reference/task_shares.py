"""Shares of active robots per task, one robot at a time."""

from collections import Counter


def task_shares(tasks, active, n_codes):
    """Share of active robots in each of `n_codes` tasks; zeros while no robot is active."""
    working = [int(task) for task, at_work in zip(tasks, active, strict=True) if at_work]
    counts = Counter(working)
    return [counts[code] / len(working) if working else 0.0 for code in range(n_codes)]
