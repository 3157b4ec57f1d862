"""Where numba has its settings from: the environment, and no file that lies in the current folder.

Where PyYAML is installed, numba reads `.numba_config.yaml` of the current folder when it is imported and whenever it
compiles. Such a file may have come with somebody's results, and it can name the folder of compiled functions, which are
pickles, modules to import, and files to write. So whoever imports numba imports this module first.
"""

import logging
import multiprocessing
import os
import sys
import warnings
from collections.abc import Generator
from contextlib import contextmanager, nullcontext
from typing import Any

_FILE = ".numba_config.yaml"


@contextmanager
def _without_yaml() -> Generator[None]:
    """Let no import find PyYAML: without it numba reads no file, and warns."""
    modules: Any = sys.modules
    before = modules.get("yaml")
    modules["yaml"] = None  # Python's sign for what cannot be imported
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        del modules["yaml"]
        if before is not None:
            modules["yaml"] = before


def _read_environment_only() -> None:
    """Import numba without its file, undo what it has read from one before, and let it never look for one again."""
    lies_there = os.path.lexists(_FILE)
    with _without_yaml() if lies_there else nullcontext():
        from numba.core import config as settings
    config: Any = settings
    is_worker = multiprocessing.current_process().name != "MainProcess"
    if lies_there and config._config_fname != os.devnull and not is_worker:
        told = f"{_FILE} in the current folder is not read: numba has its settings from the environment alone."
        logging.getLogger(__name__.partition(".")[0]).warning(told)
    config._config_fname = os.devnull  # which is no file to numba
    config.reload_config()


_read_environment_only()
