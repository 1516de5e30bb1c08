"""A rule across two services, and what breaks it by two looks at their databases.

What one service has stored, the other must have stored too, and a running system must break no such
rule. So there are two looks, a pause apart, and each rule says which service counts by the first
look: what was settled there must be in the other service by the second look. What is still on its
way explains a difference: a report in an outbox, a booking that is not answered.
"""

from collections import ChainMap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Literal, Protocol, TypeVar

from skyway_verifier.facts import Facts
from skyway_verifier.rule import BrokenRule

FactT = TypeVar("FactT")

Service = Literal["gateway", "composition", "registry"]


class HasFacts(Protocol):
    """A look at a database."""

    @property
    def facts(self) -> Facts | None:
        """The facts in the database; None if they could not be read."""
        ...


#: The looks at databases, by service, or by `cell_name`.
Looks = Mapping[str, HasFacts]


def cell_name(number: int) -> str:
    """The name of the database of a cell, which has a part of composition's facts."""
    return f"composition of cell {number}"


def service_of(name: str) -> str:
    """The service of the database of this name."""
    return name.partition(" ")[0]


# Without slots, because a generic class with slots cannot be made with its type.
@dataclass(frozen=True)
class CrossRule(Generic[FactT]):
    """A sentence about the facts of one key in two services; the `second` is read later.

    The finder names what breaks the rule, by a fact of the first service and the fact of the same
    key in the second one, None if there is none.
    """

    name: str
    finder: Callable[[FactT, FactT | None], Iterable[str]]
    advice: str
    first: Service
    second: Service
    facts: Callable[[Facts], Mapping[Any, FactT]]  # Any: keys are texts, or tuples of texts

    def broken(self, look: Looks, later: Looks) -> Iterator[BrokenRule]:
        """What breaks the rule by a look at the first service, and a later one at the second."""
        one, other = _facts_of(self.first, look), _facts_of(self.second, later)
        if one is None or other is None:
            return
        known = ChainMap(*(dict(self.facts(each)) for each in other))
        facts = [fact for each in one for fact in self.facts(each).items()]
        found = {subject for key, fact in facts for subject in self.finder(fact, known.get(key))}
        yield from (BrokenRule(self.name, subject, self.advice) for subject in sorted(found))


def _facts_of(service: Service, looks: Looks) -> Sequence[Facts] | None:
    """The facts of all databases of a service; None if one is missing."""
    facts = [each.facts for name, each in looks.items() if service_of(name) == service]
    return None if None in facts or not facts else [each for each in facts if each is not None]


#: A rule about facts of any kind.
AnyCrossRule = CrossRule[Any]


def broken_across(rules: Sequence[AnyCrossRule], look: Looks, later: Looks) -> list[BrokenRule]:
    """What breaks the rules by two looks; with the same look twice, what may break them."""
    return [each for rule in rules for each in rule.broken(look, later)]


def still_broken(rules: Sequence[AnyCrossRule], look: Looks, later: Looks) -> list[BrokenRule]:
    """What may break the rules by each look alone, and does so by both looks.

    What changed only between the looks is no fault: each service was read at another moment. Nor is
    what a service has deleted since because of its age.
    """
    suspected = frozenset(broken_across(rules, look, look))
    suspected &= frozenset(broken_across(rules, later, later))
    return [each for each in broken_across(rules, look, later) if each in suspected]
