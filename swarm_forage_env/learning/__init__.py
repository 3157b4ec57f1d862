"""From the environment to learning libraries: what a learner sees and does, arenas in batches, trained policies.

Reading order: `interface` (observations and actions of a learner), `worlds` (one world as a learner meets it), `arenas`
(many of them stepped as one batch; `processes` spreads them), `parallel` (under PettingZoo), `plan` (a training as
data), `sb3` (stable-baselines3, the only package here that imports it), `network` (trained policies without torch).
"""
