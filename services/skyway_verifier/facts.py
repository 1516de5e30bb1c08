"""Facts that several services store about the same things; the rules of `across` compare them.

A fact says what its service has stored, and what is still on its way from there to another service.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Self


@dataclass(frozen=True, slots=True)
class PackageFacts:
    """Who had a package of a delivery: drones, and its recipient with the mission if it has one."""

    drones: frozenset[str] = frozenset()
    recipient: tuple[str, str | None] | None = None

    @classmethod
    def of(cls, links: Iterable[tuple[str, str, str | None]]) -> Self:
        """The facts by its chain: each custodian's kind and id, and the mission that passed it."""
        chain = [*links]
        recipients = [(custodian, by) for kind, custodian, by in chain if kind == "RECIPIENT"]
        drones = frozenset(custodian for kind, custodian, _ in chain if kind == "DRONE")
        return cls(drones, recipients[0] if recipients else None)


@dataclass(frozen=True, slots=True)
class MissionFacts:
    """A mission of a delivery.

    `report_seq` is the last report that was sent or applied, and `waiting_reports` says how many of
    the last ones are on their way. The first of these was sent `tries` times without success.
    """

    mission_id: str
    attempt: int
    trip: int
    provider_id: str
    drone_id: str
    state: str
    price: tuple[int, str]
    report_seq: int
    waiting_reports: int = 0
    tries: int = 0

    @property
    def fixed(self) -> tuple[object, ...]:
        """What never changes."""
        return self.attempt, self.trip

    @property
    def reported(self) -> tuple[object, ...]:
        """What changes with a report: who flies it, its state, and its price."""
        return self.provider_id, self.drone_id, self.state, self.price


@dataclass(frozen=True, slots=True)
class DeliveryFacts:
    """A delivery, by gateway or composition.

    `is_over`: nothing will be booked any more. `is_queued`: a booking may be under way.
    `is_leaving`: it is being deleted, at composition first. `waiting_messages` about it are on the
    way to composition.
    """

    delivery_id: str
    is_over: bool
    is_queued: bool = False
    is_leaving: bool = False
    waiting_messages: int = 0
    missions: tuple[MissionFacts, ...] = ()
    packages: Mapping[str, PackageFacts] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class HintFacts:
    """A mission that makes its drone busy, by composition or the registry.

    `report_seq` and `waiting_reports` are those of reports to the registry.
    """

    mission_id: str
    drone_id: str
    state: str
    is_live: bool
    report_seq: int
    waiting_reports: int = 0


@dataclass(frozen=True, slots=True)
class CopyFacts:
    """A value that two services store: a version or moment that only grows, and its text.

    The key is a kind and an id, such as `network texas`.
    """

    key: str
    number: int = 0
    text: str | None = None


@dataclass(frozen=True, slots=True)
class Facts:
    """All facts of one database at one moment, by the keys by which they are compared.

    `drones` are registered or fly a live mission, each with its provider; `providers` are
    registered or have a key.
    """

    deliveries: Mapping[str, DeliveryFacts] = field(default_factory=dict)
    hints: Mapping[str, HintFacts] = field(default_factory=dict)
    drones: Mapping[tuple[str, str], str] = field(default_factory=dict)
    providers: Mapping[str, str] = field(default_factory=dict)
    copies: Mapping[str, CopyFacts] = field(default_factory=dict)


def stations_hash(places: Iterable[tuple[str, float, float]]) -> str | None:
    """The hash of stations with their longitudes and latitudes; None without stations."""
    text = json.dumps(sorted(places))
    return None if text == "[]" else hashlib.sha256(text.encode()).hexdigest()
