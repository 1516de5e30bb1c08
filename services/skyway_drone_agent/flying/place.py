"""Placing: people have fetched a drone that was down, and tell its journal where it stands now."""

from collections.abc import Sequence

from skyway.errors import SkywayError
from skyway.ids import DroneId
from skyway.runtime.errors import InvalidSettings
from skyway_drone_agent.enrolled_drone import EnrolledDrone
from skyway_drone_agent.journal.journal_folder import JournalFolder
from skyway_drone_agent.journal.record_effects import logbook_after
from skyway_drone_agent.journal.records import Placed


class NotDown(SkywayError):
    """A drone that stands or flies knows where it is."""

    def __init__(self, drone_id: DroneId) -> None:
        super().__init__(f"{drone_id} is not down: it knows where it is")
        self.drone_id = drone_id


def place(drones: Sequence[EnrolledDrone], folder: JournalFolder, placed: Placed) -> None:
    """Write where the drone has been put, empty; its mission is over."""
    if len(drones) != 1:
        raise InvalidSettings(f"--placed-at is about one drone, and there are {len(drones)}")
    (drone,) = drones
    journal = folder.journal_of(drone.drone_id)
    logbook = journal.read(at_first=drone.at_first())
    if not logbook.is_down:
        raise NotDown(drone.drone_id)
    # Anew as a whole: the last line may be torn, and nothing may be written behind it.
    journal.compact(logbook_after(logbook, placed))
