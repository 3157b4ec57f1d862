"""What robots of a kind may lack or have less of. Numbers and names only: they are compiled into functions."""

SENSORS = ("proximity", "light", "los_object", "los_cache", "neighbours", "messages")
"""Slices of the observation that a kind may lack, besides own sensors. Zero there means that nothing is seen or heard.
The floor is not among them: zero is an object there, and a robot that does not feel the nest never delivers."""
WINDOWS_CELLS = (1, 3, 5)
"""Sides of the line-of-sight window that a kind may have, in cells; the last is that of robots of one kind."""
