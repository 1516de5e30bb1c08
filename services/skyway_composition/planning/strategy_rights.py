"""Who may ask for which strategy: those that try everything can take for ever."""

from collections.abc import Set
from dataclasses import dataclass
from typing import Any, Self

from skyway.planner.compose import STRATEGIES
from skyway.runtime.errors import AccessDenied
from skyway.runtime.http.identity import Caller


@dataclass(frozen=True, slots=True)
class StrategyRights:
    """The strategies for everybody; operators and other services may ask for all."""

    open_to_all: Set[str]

    @classmethod
    def read(cls, names: str) -> Self:
        """The rights with these strategies for everybody, separated by commas."""
        return cls(frozenset(each.strip() for each in names.split(",")))

    def check(self, document: Any, caller: Caller) -> None:  # any JSON value
        """Go on only if the caller may ask for the strategy; unknown ones are refused later.

        Raises
        ------
        AccessDenied
            The strategy of the problem is for operators.
        """
        strategy = document.get("strategy") if isinstance(document, dict) else None
        if not isinstance(strategy, str) or strategy not in STRATEGIES:
            return
        if strategy not in self.open_to_all and caller.role in ("customer", "provider"):
            raise AccessDenied(f"the strategy {strategy} is for operators")
