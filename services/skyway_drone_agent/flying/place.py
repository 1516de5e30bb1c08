"""Writes to the journal where people have put a drone that was down."""

from collections.abc import Sequence

from skyway.errors import SkywayError
from skyway.ids import DroneId
from skyway.runtime.errors import InvalidSettings
from skyway_drone_agent.enrolled_drone import EnrolledDrone
from skyway_drone_agent.journal.journal_folder import JournalFolder
from skyway_drone_agent.journal.record_effects import logbook_after
from skyway_drone_agent.journal.records import Placed


class NotDown(SkywayError):
    """The drone stands or flies, so its position cannot be set."""

    def __init__(self, drone_id: DroneId) -> None:
        super().__init__(f"{drone_id} is not down, so its position cannot be set")
        self.drone_id = drone_id


def place(drones: Sequence[EnrolledDrone], folder: JournalFolder, placed: Placed) -> None:
    """Write where the empty drone stands now; its mission is over."""
    if len(drones) != 1:
        raise InvalidSettings(f"--placed-at is for one drone, and there are {len(drones)}")
    (drone,) = drones
    journal = folder.journal_of(drone.drone_id)
    logbook = journal.read(at_first=drone.at_first())
    if not logbook.is_down:
        raise NotDown(drone.drone_id)
    # The whole file is rewritten: its last line may be torn, and must not get a line after it.
    journal.compact(logbook_after(logbook, placed))
