"""Looks at the databases: each service checks its own and writes down its facts."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypeVar

from skyway.cli.data_folder import DataFolder
from skyway.cli.system.children import PACKAGES
from skyway.contracts.service_facts import DeliveryFacts, DroneFacts, HintFacts, ProviderFacts
from skyway.errors import SkywayError
from skyway.json_model import WireModel
from skyway.runtime.errors import ExitCode
from skyway.runtime.verification.rule import BrokenRule

#: Seconds for one service; millions of rows take minutes, not hours.
_WITHIN_S: Final = 600.0

_RESTORE: Final = (
    "The database is damaged, or of another version of Skyway. Stop the service, copy its database "
    "files away, check the disk, and restore the newest backup (docs/reference/operations.md)."
)

FactsT = TypeVar("FactsT", bound=WireModel)


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
