"""From the environment to learning libraries: what a learner sees and does, arenas in batches, trained policies.

Reading order: `interface` (observations and actions of a learner), `arenas` (many arenas stepped as one batch),
`sb3` (stable-baselines3, the only package here that imports it), `network` (trained policies without torch).
"""
