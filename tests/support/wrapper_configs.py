"""Wrapper configurations of tests: one for the inner and one for the outer end of a stack."""

from dataclasses import dataclass
from typing import ClassVar

from swarm_forage_env.wrappers.base import SwarmWrapper, WrapperConfig


@dataclass(frozen=True, kw_only=True, slots=True)
class OuterConfig(WrapperConfig):
    name: ClassVar[str] = "test_outer"
    stack_position: ClassVar[int] = 1
    groups: tuple[str, ...] = ("proximity",)

    def wrap(self, env):
        return type("Outer", (SwarmWrapper,), {"stack_position": 1})(env)

    def in_words(self, dt_s):
        return f"test outer: groups {'+'.join(self.groups)}"


@dataclass(frozen=True, kw_only=True, slots=True)
class InnerConfig(WrapperConfig):
    name: ClassVar[str] = "test_inner"
    stack_position: ClassVar[int] = 4
    sigma: float = 0.1

    def wrap(self, env):
        return type("Inner", (SwarmWrapper,), {"stack_position": 4})(env)

    def in_words(self, dt_s):
        return f"test inner: sigma {self.sigma}"
