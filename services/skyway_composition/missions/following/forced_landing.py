"""A drone that has landed away from every station: its mission is over, somebody must fetch it."""

from datetime import datetime

from skyway.geo import Position
from skyway_composition.missions.custody.chain import on_board
from skyway_composition.missions.custody.store import held_packages
from skyway_composition.missions.ending import abort_in_the_open
from skyway_composition.missions.mission_alarm import raise_alarm
from skyway_composition.missions.record import MissionRecord
from skyway_composition.missions.watch import Watch


async def take_forced_landing(
    watch: Watch,
    record: MissionRecord,
    *,
    at: datetime,
    position: Position,
    soc: float,
    code: str,
    detail: str,
) -> None:
    """End the mission where its drone came down; what is on board stays with the drone."""
    held = record.own(await held_packages(watch.tx.connection, record.mission.delivery_id))
    packages = sorted(on_board(held))
    place = f"{position.latitude_deg:.5f}, {position.longitude_deg:.5f}"
    load = f"with {', '.join(packages)} on board" if packages else "with nothing on board"
    await raise_alarm(
        watch,
        record,
        level="CRITICAL",
        code="FORCED_LANDING",
        detail=f"down away from every station at {place}, {load}: {detail}",
        data={
            "fault": code,
            "longitude_deg": position.longitude_deg,
            "latitude_deg": position.latitude_deg,
            "soc": soc,
            "package_ids": packages,
        },
    )
    await abort_in_the_open(
        watch,
        record,
        at=at,
        code=code,
        detail=f"the drone had to land at {place}, away from every station: {detail}",
        position=position,
    )
