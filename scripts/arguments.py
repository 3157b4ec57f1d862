"""Arguments of the scripts of measurements."""

import argparse
from collections.abc import Callable


def whole(*, at_least: int) -> Callable[[str], int]:
    """Return an argparse type: whole numbers from `at_least` on."""

    def read(text: str) -> int:
        try:
            number = int(text)
        except ValueError:
            number = at_least - 1
        if number < at_least:
            raise argparse.ArgumentTypeError(f"expected a whole number >= {at_least}, got {text!r}")
        return number

    return read
