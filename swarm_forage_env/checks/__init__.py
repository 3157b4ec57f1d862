"""Checks for environments and policies of your own: do they keep the rules that the package keeps itself?

    check_env(env)                    an environment, alone or in wrappers
    check_policy(policy)              what a policy returns, reads and remembers
    check_determinism(policy)         whole runs: equal seeds, equal records

Each returns None if all is well, and otherwise raises a `CheckError` about the first fault.
"""

from .environments import CheckError, check_env
from .policies import check_policy
from .runs import check_determinism

__all__ = ["CheckError", "check_determinism", "check_env", "check_policy"]
