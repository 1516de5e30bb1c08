"""A rule that a database must keep, and what a person can do when it is broken."""

from collections.abc import Awaitable, Callable, Iterable
from dataclasses import asdict, dataclass
from typing import Any

from sqlalchemy import Select

from skyway.runtime.verification.survey import Survey

#: A query whose first column names what breaks a rule. Any: columns have every type.
Subjects = Select[*tuple[Any, ...]]

#: Finds what breaks a rule, by a query or by a function of the survey.
Finder = Subjects | Callable[[Survey], Awaitable[Iterable[str]]]


@dataclass(frozen=True, slots=True)
class Rule:
    """A sentence that must hold, a finder of the subjects that break it, and advice.

    A rule holds in every state of a running system, unless it `settles`: such a rule is broken only
    when the same subject breaks it twice, a pause apart.
    """

    name: str
    finder: Finder
    advice: str
    settles: bool = False


@dataclass(frozen=True, slots=True, order=True)
class BrokenRule:
    """A rule that a subject breaks, and what a person can do about it."""

    rule: str
    subject: str
    advice: str

    def as_json(self) -> dict[str, str]:
        """The members of its JSON line."""
        return asdict(self)
