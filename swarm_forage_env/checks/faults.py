"""What a check raises, and words for what it found."""

from typing import Any

import numpy as np


class CheckError(ValueError):
    """An environment or a policy that breaks a promise; the message says what was expected, what came, what to do."""


def summary(values: Any) -> str:
    """Return kind and range of values, for messages."""
    array = np.asarray(values)
    shown = f"{array.dtype} of shape {array.shape}"
    if array.size and array.dtype.kind in "fiub":
        shown += f" from {array.min():g} to {array.max():g}"
    return shown
