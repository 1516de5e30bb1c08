"""A new order of instructions, for a drone that has forgotten the present one."""

import logging

from skyway.contracts.drone_report import DroneState
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.dispatch import reissue
from skyway_composition.missions.following.failure import wait_for_revision
from skyway_composition.missions.revisions.proposal import drop
from skyway_composition.missions.watch import Watch

log = logging.getLogger(__name__)


async def open_stream(watch: Watch, link: DroneLink, state: DroneState) -> None:
    """Begin a new order of instructions; what was not answered in the old one is sent anew."""
    log.warning(
        "new stream", extra={"drone_id": link.drone_id, "stream": link.in_new_stream(state).stream}
    )
    await watch.courier.withdraw_open(watch.tx, link)
    watch.note_link(link.in_new_stream(state))
    record = watch.missions.get(link.drone_id)
    if record is None:
        return
    if record.mission.state == "BOOKED":
        await reissue(watch, record)
    else:
        if record.proposal is not None:
            record = await drop(watch, record)
        detail = "the drone has lost its journal and with it the mission"
        await wait_for_revision(watch, record, code="JOURNAL_LOST", detail=detail)
