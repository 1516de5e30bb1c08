"""What must hold in composition when all missions of a busy world have ended."""

from collections.abc import Collection, Sequence

from skyway_composition.missions.mission.custody_store import delivered, held_packages
from skyway_composition.tables import pad_reservations
from sqlalchemy import select

from skyway.contracts.mission_reports import MissionReport
from skyway.ids import DeliveryId
from skyway.runtime.sql.database import Database


async def check_ended(
    db: Database,
    reports: Sequence[MissionReport],
    *,
    deliveries: Collection[str],
    handed_over: Collection[tuple[str, str]],
) -> None:
    """Check that nothing is reserved, and that packages and reports have come to their ends."""
    async with db.read() as connection:
        assert (await connection.execute(select(pad_reservations))).all() == []
        received = {
            (delivery_id, package_id)
            for delivery_id in deliveries
            for package_id in delivered(await held_packages(connection, DeliveryId(delivery_id)))
        }
    assert received <= set(handed_over)
    by_mission = {each.mission_id: list[MissionReport]() for each in reports}
    for report in reports:
        by_mission[report.mission_id].append(report)
    for story in by_mission.values():
        assert [each.seq for each in story] == list(range(1, len(story) + 1))
        ends = [each.kind for each in story if each.kind in ("ENDED", "REFUSED")]
        assert len(ends) == 1, story
