"""What proves that a drone does not fly a booking, and has not flown it.

The drone's own word is the best proof: it names another mission, or none, and we have read all of
its events. Silence is a proof only to a process that has listened all the time.
"""

from datetime import datetime

from skyway.units import moment_to_ms
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.mission.record import MissionRecord


def says_not_flown(record: MissionRecord, link: DroneLink) -> bool:
    """Whether the drone has said since the expiry that it does not fly the booking.

    A drone that stands idle may have flown the whole mission while nobody listened. Then its state
    names events that were not read here.
    """
    state, doubt = link.state, record.mission.doubt
    if state is None or moment_to_ms(state.at) <= record.expires_ms:
        return False
    if state.mission_id == record.mission_id or link.has_unread_events:
        return False
    return doubt is None or doubt.code != "JOURNAL_LOST"


def silence_proves_not_flown(
    record: MissionRecord, link: DroneLink, *, ack_due_at: datetime, has_listened: bool
) -> bool:
    """Whether a disconnected drone would have answered by now if it had accepted the booking.

    A drone loads only if the broker had its answer before the instruction expired. `has_listened`:
    this process has received and handled everything since the booking was sent.
    """
    has_lost_journal = record.mission.doubt is not None and record.mission.doubt.code == (
        "JOURNAL_LOST"
    )
    has_expired = moment_to_ms(ack_due_at) > record.expires_ms
    return link.is_gone and has_expired and has_listened and not has_lost_journal
