"""Numbers of the training recipe that the help of the command line tells, too; nothing is imported here.

All are our choice: values that were seen to learn.
"""

DEFAULT_STEPS = 3_400_000
"""Decisions of single robots in all stages."""
DEFAULT_HIDDEN = (64, 64)
"""Sizes of the hidden layers."""
DEFAULT_ACTIVATION = "relu"
"""What hidden layers do to their sums in the recipe; tanh takes more time. A plan that says nothing means tanh."""
DEFAULT_ARENAS = 8
"""Arenas side by side, at most."""
DEFAULT_ROBOTS = 400
"""Robots in all arenas, at most, but for one whole swarm: where more of them share the decisions, there are fewer
rollouts, and so few seconds of each arena that no jam is ever seen."""
DEFAULT_REWARDS = {"first_pickup": 1.0, "nest_progress": 0.05, "interference": -0.002}
"""Rewards where deliveries count: deliveries alone are too rare to learn from. The whole way home is worth about one
delivery. Each tick in the way of others costs a little."""
EPISODE_S = 4000.0
"""Length of an episode, s, at most. Jams build up slowly: with 1,000 s and no price for being in the way, two
trainings of two ended in them."""
JAMMING_S = 1000.0
"""Shortest time in which the recipe lets an episode end, s; in less, jams hardly begin."""
DECISION_TICKS = 5
"""Ticks per decision, one second."""
FRAME_DECISIONS = 200
"""Decisions for which each robot sees the world in a frame of its own, so that the swarm spreads: 200 s at the pace of
`DECISION_TICKS`."""
EVALUATE_EVERY = 1_000_000
"""Decisions of single robots between two evaluations, at least."""
EVALUATION_SHARE = 0.5
"""Most that evaluations may add to the simulated time of all robots; large swarms are evaluated less often for it."""
