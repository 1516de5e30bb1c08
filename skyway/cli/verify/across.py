"""Rules across two services: what one has stored, the other must have stored too.

A running system must break none of them. So there are two looks, a pause apart, and each rule says
which service counts by the first look: what was settled there must be in the other service by the
second look. What is still on its way explains a difference: a report in an outbox, a booking that
is not answered.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

from skyway.cli.verify.looks import Looks, ServiceLook
from skyway.contracts.service_facts import DeliveryFacts, DroneFacts, HintFacts, ProviderFacts
from skyway.runtime.verification.fact_files import side_by_side
from skyway.runtime.verification.rule import BrokenRule

FactsT = TypeVar("FactsT", DeliveryFacts, HintFacts, DroneFacts, ProviderFacts)
Service = Literal["gateway", "composition", "registry"]


# Without slots, because a generic class with slots cannot be made with its type.
@dataclass(frozen=True)
class CrossRule(Generic[FactsT]):
    """A sentence about the facts of one key in two services; the `second` is read later."""

    name: str
    first: Service
    second: Service
    facts: Callable[[ServiceLook], Iterator[FactsT]]
    #: The subjects that break the rule; None where a service has no such fact.
    finder: Callable[[FactsT | None, FactsT | None], Iterable[str]]
    advice: str

    def broken(self, first: ServiceLook, second: ServiceLook) -> Iterator[BrokenRule]:
        """What breaks the rule in a look at the first service and a later one at the second."""
        if not (first.has_facts and second.has_facts):
            return
        for one, other in side_by_side(self.facts(first), self.facts(second)):
            for subject in self.finder(one, other):
                yield BrokenRule(self.name, subject, self.advice)


#: A rule about facts of any kind.
AnyCrossRule = (
    CrossRule[DeliveryFacts]
    | CrossRule[HintFacts]
    | CrossRule[DroneFacts]
    | CrossRule[ProviderFacts]
)


def broken_across(rules: Sequence[AnyCrossRule], look: Looks, later: Looks) -> list[BrokenRule]:
    """What breaks the rules by two looks; with the same look twice, what may break them."""
    return [each for rule in rules for each in rule.broken(look[rule.first], later[rule.second])]


def still_broken(rules: Sequence[AnyCrossRule], look: Looks, later: Looks) -> list[BrokenRule]:
    """What may break the rules by the first look, and does so by both looks.

    What changed only between the looks is no fault: each service was read at another moment.
    """
    suspected = frozenset(broken_across(rules, look, look))
    return [each for each in broken_across(rules, look, later) if each in suspected]
