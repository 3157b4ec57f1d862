"""Training as data, by recipes and plans; `sb3` carries it out with stable-baselines3."""
