"""Basic units: the floor cell, the walls, and the wheel speed of a command of 1."""

CELL_M = 0.2
"""Side of a floor cell and of an object."""
CELLS_PER_M = 5.0
"""Cell index = floor(coordinate * 5); dividing by 0.2 would truncate 0.6 m to cell 2."""
WALL_M = 0.2
"""How far the walls in the west, south and north reach into the arena: half of their 0.4 m; the other half stands
outside."""
EAST_WALL_M = 0.4
"""How far the wall in the east reaches into the arena: all of it."""
WHEEL_SCALE_MPS = 0.20
"""Wheel speed that an action or an observation of 1.0 stands for."""
