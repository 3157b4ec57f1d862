"""Numbers of the training recipe that the help of the command line tells, too; nothing is imported here.

All are our choice: values that were seen to learn.
"""

DEFAULT_STEPS = 5_000_000
"""Decisions of single robots in all stages."""
DEFAULT_HIDDEN = (64, 64)
"""Sizes of the hidden layers."""
DEFAULT_ACTIVATION = "tanh"
"""What hidden layers do to their sums."""
DEFAULT_ARENAS = 8
"""Arenas side by side, at most."""
DEFAULT_ROBOTS = 400
"""Robots in all arenas, at most, but for one whole swarm: where more of them share the decisions, there are fewer
rollouts, and so few seconds of each arena that no jam is ever seen."""
DEFAULT_REWARDS = {"first_pickup": 1.0, "nest_progress": 0.05}
"""Rewards where deliveries count: deliveries alone are too rare to learn from. The whole way home is worth about one
delivery."""
EPISODE_S = 1000.0
"""Length of an episode, s: a start puts robots all over the arena, which teaches more than a long run."""
DECISION_TICKS = 5
"""Ticks per decision, one second."""
EVALUATE_EVERY = 1_000_000
"""Decisions of single robots between two evaluations, at least."""
EVALUATION_SHARE = 0.5
"""Most that evaluations may add to the simulated time of all robots; large swarms are evaluated less often for it."""
