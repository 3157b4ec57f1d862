"""Array aliases and the axis letters used in every docstring.

Axes: N robots, M objects, K cache slots, D observation columns, T recording intervals.
Units are SI (metres, seconds, radians) unless a docstring says otherwise; a *tick* is one control
step of `dt_s`, a *cell* is one square of the floor grid (`scenarios.floor.CELL_M` wide).
"""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int32]
CodeArray: TypeAlias = NDArray[np.int8]
BitArray: TypeAlias = NDArray[np.uint32]
BoolArray: TypeAlias = NDArray[np.bool_]
ObsArray: TypeAlias = NDArray[np.float32]
"""Observations, (N, D) float32 in [-1, 1]."""
ActionArray: TypeAlias = NDArray[np.float32]
"""Actions, (N, A) float32 in [-1, 1]: left wheel, right wheel, gripper, and the numbers of a message; A = 3 without."""
Row: TypeAlias = Any
"""One row of an array inside a compiled function, such as the observation of one robot, (D,) float32."""
