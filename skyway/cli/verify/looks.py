"""Looks at the databases, and the rules across two services.

At each look a service checks its own database and writes down its facts. What one service has
stored, the other must have stored too: a running system must break no such rule. So there are two
looks, a pause apart, and each rule says which service counts by the first look: what was settled
there must be in the other service by the second look. What is still on its way explains a
difference: a report in an outbox, a booking that is not answered.
"""

import heapq
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Generic, Literal, TypeVar

from skyway.cli.data_folder import DataFolder
from skyway.cli.system.children import PACKAGES
from skyway.cli.system.supervisor import ProcessEnded
from skyway.contracts.service_facts import (
    CopyFacts,
    DeliveryFacts,
    DroneFacts,
    HintFacts,
    ProviderFacts,
)
from skyway.runtime.errors import ExitCode
from skyway.runtime.verification.fact_files import side_by_side
from skyway.runtime.verification.rule import BrokenRule

#: Seconds for one service; millions of rows take minutes, not hours.
_WITHIN_S: Final = 600.0

_RESTORE: Final = (
    "The database is damaged, or of another version of Skyway. Stop the service, copy its database "
    "files away, check the disk, and restore the newest backup (docs/reference/operations.md)."
)

FactsT = TypeVar("FactsT", DeliveryFacts, HintFacts, DroneFacts, ProviderFacts, CopyFacts)
Service = Literal["gateway", "composition", "registry"]


@dataclass(frozen=True, slots=True)
class ServiceLook:
    """What one service said of its database at one moment.

    `cells` are the folders of the facts of the service's other databases.
    """

    service: str
    broken: tuple[BrokenRule, ...]
    folder: Path
    cells: tuple[Path, ...] = ()

    @property
    def has_facts(self) -> bool:
        """Whether the service could write down its facts, those of all its databases."""
        return all(each.exists() for each in (self.folder, *self.cells))

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

    def copies(self) -> Iterator[CopyFacts]:
        """The values that other services store, too, by kind and id."""
        return self._facts("copies", CopyFacts)

    def _facts(self, kind: str, model: type[FactsT]) -> Iterator[FactsT]:
        with ExitStack() as opened:
            files = [
                opened.enter_context((each / f"{kind}.jsonl").open())
                for each in (self.folder, *self.cells)
            ]
            facts = ((model.read(line) for line in lines) for lines in files)
            yield from heapq.merge(*facts, key=lambda fact: fact.key)


#: What each service said, by its name.
Looks = Mapping[str, ServiceLook]

#: The service that may have several databases: its own, and the databases of cells.
_OF_CELLS: Final = "composition"


def cell_name(number: int) -> str:
    """The name of a cell's database, beside the names of services; numbered from 1."""
    return f"{_OF_CELLS} of cell {number}"


def with_cells(looks: Looks) -> Looks:
    """The looks in which composition has the facts of all cells, as one service."""
    cells = tuple(each.folder for name, each in looks.items() if name.startswith(f"{_OF_CELLS} "))
    return {**looks, _OF_CELLS: replace(looks[_OF_CELLS], cells=cells)}


def look(folder: DataFolder, urls: Mapping[str, str], facts: Path) -> Looks:
    """Have the services check their databases side by side, and write facts below a folder.

    Names of cells are those of `cell_name`.

    Raises
    ------
    ProcessEnded
        A service could not check its database.
    """
    with ThreadPoolExecutor() as threads:
        looks = threads.map(lambda service: _look(service, folder, urls, facts / service), urls)
    return with_cells({each.service: each for each in looks})


def _look(service: str, folder: DataFolder, urls: Mapping[str, str], facts: Path) -> ServiceLook:
    clock = {"SKYWAY_CLOCK_FILE": str(folder.clock_file)} if folder.clock_file.exists() else {}
    checked = subprocess.run(
        [
            sys.executable,
            "-m",
            PACKAGES[service.partition(" ")[0]],
            "verify",
            "--facts",
            str(facts),
        ],
        env={
            **os.environ,
            **clock,
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
        detail = f"{service} could not be checked:\n{checked.stderr}"
        raise ProcessEnded(detail, exit_code=checked.returncode)
    return ServiceLook(service, found, facts)


# Without slots, because a generic class with slots cannot be made with its type.
@dataclass(frozen=True)
class CrossRule(Generic[FactsT]):
    """A sentence about the facts of one key in two services; the `second` is read later."""

    name: str
    #: The subjects that break the rule; None where a service has no such fact.
    finder: Callable[[FactsT | None, FactsT | None], Iterable[str]]
    advice: str
    first: Service
    second: Service
    facts: Callable[[ServiceLook], Iterator[FactsT]]

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
    | CrossRule[CopyFacts]
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
