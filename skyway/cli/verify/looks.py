"""Looks at the databases, and the rules across two services.

At each look a service checks its own database and writes down its facts. What one service has
stored, the other must have stored too: a running system must break no such rule. So there are two
looks, a pause apart, and each rule says which service counts by the first look: what was settled
there must be in the other service by the second look. What is still on its way explains a
difference: a report in an outbox, a booking that is not answered.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Generic, Literal, TypeVar

from skyway.cli.data_folder import DataFolder
from skyway.cli.system.children import PACKAGES
from skyway.contracts.service_facts import DeliveryFacts, DroneFacts, HintFacts, ProviderFacts
from skyway.errors import SkywayError
from skyway.json_model import WireModel
from skyway.runtime.errors import ExitCode
from skyway.runtime.verification.fact_files import side_by_side
from skyway.runtime.verification.rule import BrokenRule

#: Seconds for one service; millions of rows take minutes, not hours.
_WITHIN_S: Final = 600.0

_RESTORE: Final = (
    "The database is damaged, or of another version of Skyway. Stop the service, copy its database "
    "files away, check the disk, and restore the newest backup (docs/reference/operations.md)."
)

FactsT = TypeVar("FactsT", bound=WireModel)


ComparedT = TypeVar("ComparedT", DeliveryFacts, HintFacts, DroneFacts, ProviderFacts)

Service = Literal["gateway", "composition", "registry"]


@dataclass(frozen=True, slots=True)
class ServiceLook:
    """What one service said of its database at one moment."""

    service: str
    broken: tuple[BrokenRule, ...]
    folder: Path

    @property
    def has_facts(self) -> bool:
        """Whether the service could write down its facts."""
        return self.folder.exists()

    def deliveries(self) -> Iterator[DeliveryFacts]:
        """The facts about deliveries, by id."""
        return self._facts("deliveries", DeliveryFacts)

    def hints(self) -> Iterator[HintFacts]:
        """The facts about missions that make drones busy, by mission."""
        return self._facts("hints", HintFacts)

    def drones(self) -> Iterator[DroneFacts]:
        """The facts about drones, by id."""
        return self._facts("drones", DroneFacts)

    def providers(self) -> Iterator[ProviderFacts]:
        """The facts about providers, by id."""
        return self._facts("providers", ProviderFacts)

    def _facts(self, kind: str, model: type[FactsT]) -> Iterator[FactsT]:
        with (self.folder / f"{kind}.jsonl").open() as lines:
            for line in lines:
                yield model.read(line)


#: What each service said, by its name.
Looks = Mapping[str, ServiceLook]


def look(folder: DataFolder, urls: Mapping[str, str], facts: Path) -> Looks:
    """Have the services check their databases side by side, and write facts below a folder.

    Raises
    ------
    SkywayError
        A service could not check its database.
    """
    with ThreadPoolExecutor() as threads:
        looks = threads.map(lambda service: _look(service, folder, urls, facts / service), urls)
    return {each.service: each for each in looks}


def _look(service: str, folder: DataFolder, urls: Mapping[str, str], facts: Path) -> ServiceLook:
    checked = subprocess.run(
        [sys.executable, "-m", PACKAGES[service], "verify", "--facts", str(facts)],
        env={
            **os.environ,
            "SKYWAY_DATABASE_URL": urls[service],
            "SKYWAY_SECRETS_DIR": str(folder.secrets),
        },
        capture_output=True,
        text=True,
        timeout=_WITHIN_S,
        check=False,
    )
    if checked.returncode == ExitCode.BAD_DATABASE:
        broken = BrokenRule("the database can be opened", checked.stderr.strip(), _RESTORE)
        return ServiceLook(service, (broken,), facts)
    found = tuple(BrokenRule(**json.loads(line)) for line in checked.stdout.splitlines())
    if checked.returncode not in (0, 1) or bool(found) != bool(checked.returncode):
        raise SkywayError(f"{service} could not be checked:\n{checked.stderr}")
    return ServiceLook(service, found, facts)


# Without slots, because a generic class with slots cannot be made with its type.
@dataclass(frozen=True)
class CrossRule(Generic[ComparedT]):
    """A sentence about the facts of one key in two services; the `second` is read later."""

    name: str
    first: Service
    second: Service
    facts: Callable[[ServiceLook], Iterator[ComparedT]]
    #: The subjects that break the rule; None where a service has no such fact.
    finder: Callable[[ComparedT | None, ComparedT | None], Iterable[str]]
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
    """What may break the rules by each look alone, and does so by both looks.

    What changed only between the looks is no fault: each service was read at another moment. Nor is
    what a service has deleted since because of its age.
    """
    suspected = frozenset(broken_across(rules, look, look))
    suspected &= frozenset(broken_across(rules, later, later))
    return [each for each in broken_across(rules, look, later) if each in suspected]
