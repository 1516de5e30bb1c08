"""Who holds each package: a chain from the pickup station to the recipient.

A chain only grows; its links are never changed.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from skyway.ids import PackageId, StationId

CustodianKind = Literal["STATION", "DRONE", "RECIPIENT"]


@dataclass(frozen=True, slots=True)
class Custodian:
    """Who holds a package: a station or a drone by its id, or the recipient at a station."""

    kind: CustodianKind
    custodian_id: str


@dataclass(frozen=True, slots=True)
class Held:
    """The newest link of a package's chain."""

    package_id: PackageId
    seq: int
    custodian: Custodian


def may_pass(held: Held | None, to: Custodian) -> bool:
    """Whether a package may pass to this custodian.

    A recipient never passes a package on, and a package cannot pass to its present custodian.
    """
    return held is None or (held.custodian.kind != "RECIPIENT" and held.custodian != to)


def on_board(held: Mapping[PackageId, Held]) -> frozenset[PackageId]:
    """The packages that a drone holds."""
    return _held_by(held, "DRONE")


def delivered(held: Mapping[PackageId, Held]) -> frozenset[PackageId]:
    """The packages that their recipients have."""
    return _held_by(held, "RECIPIENT")


def returned(held: Mapping[PackageId, Held], pickup: StationId) -> frozenset[PackageId]:
    """The packages that were on board and are back at the pickup station."""
    station = Custodian("STATION", pickup)
    return frozenset(
        each.package_id for each in held.values() if each.custodian == station and each.seq > 1
    )


def left_behind(held: Mapping[PackageId, Held], pickup: StationId) -> frozenset[PackageId]:
    """The packages that a drone has left at a station other than the pickup."""
    return frozenset(
        each.package_id
        for each in held.values()
        if each.custodian.kind == "STATION" and each.custodian.custodian_id != pickup
    )


def _held_by(held: Mapping[PackageId, Held], kind: CustodianKind) -> frozenset[PackageId]:
    return frozenset(each.package_id for each in held.values() if each.custodian.kind == kind)


def has_never_left(held: Held | None) -> bool:
    """Whether a package has never left the pickup station."""
    return held is None or (held.custodian.kind == "STATION" and held.seq == 1)
