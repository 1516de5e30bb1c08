"""Packages that were cancelled at the pickup, and that the drone has taken all the same."""

from collections.abc import Sequence
from dataclasses import replace

from skyway.contracts.flight_step import PackageOnBoard
from skyway.delivery.request import Package
from skyway_composition.missions.hands import store
from skyway_composition.missions.hands.stop_packages import bring_back
from skyway_composition.missions.record import MissionRecord
from skyway_composition.missions.watch import Watch


async def bring_astray_back(
    watch: Watch, record: MissionRecord, packages: Sequence[PackageOnBoard]
) -> MissionRecord:
    """The record that knows these packages again, and brings them back.

    Word of the cancellation came while the drone loaded. What it has on board must be in its plan:
    else it would deliver by the old one what the customer was told stays.
    """
    pickup = record.request.pickup
    known_again = tuple(
        Package(package_id=each.package_id, mass_kg=each.mass_kg, destination=pickup)
        for each in packages
    )
    request = record.request.model_copy(
        update={"packages": (*record.request.packages, *known_again)}
    )
    record = replace(record, request=request)
    await store.save_request(watch.tx, record)
    package_ids = [each.package_id for each in packages]
    detail = f"cancelled, but on board already: {', '.join(package_ids)}"
    return await bring_back(watch, record, package_ids, code="CANCELLED", detail=detail)
