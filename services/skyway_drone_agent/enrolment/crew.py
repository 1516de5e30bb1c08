"""The drones that one agent process serves, with their current credentials."""

import asyncio
import logging
from collections.abc import Callable, Iterable
from typing import Final, Protocol

from skyway_drone_agent.enrolled_drone import EnrolledDrone
from skyway_drone_agent.enrolment.cloud import CloudAccess, CloudRefused, CloudUnreachable
from skyway_drone_agent.enrolment.credentials import CredentialsFolder, KeptCredentials
from skyway_drone_agent.enrolment.enrol import begin_rotation, settle_rotation

log = logging.getLogger(__name__)

#: Wall seconds between two attempts to finish a rotation.
_AGAIN_AFTER_S: Final = 10.0


class Crew(Protocol):
    """Drones to serve."""

    @property
    def drones(self) -> tuple[EnrolledDrone, ...]:
        """The drones, each with what it logs in with."""
        ...

    @property
    def accesses(self) -> tuple[CloudAccess, ...]:
        """The drones' access to the cloud; empty without an enrolment."""
        ...

    def settle(self) -> None:
        """Finish the rotations that a crash interrupted."""
        ...

    def rotate(self) -> None:
        """Change the credentials of every drone."""
        ...

    async def changed(self) -> None:
        """Return once the credentials of drones have changed; it may never return."""
        ...


class RegisteredCrew:
    """Drones of a fleet file, which keep the passwords of their registration."""

    def __init__(self, drones: tuple[EnrolledDrone, ...]) -> None:
        self._drones = drones

    @property
    def drones(self) -> tuple[EnrolledDrone, ...]:
        """The drones of the file."""
        return self._drones

    @property
    def accesses(self) -> tuple[CloudAccess, ...]:
        """None: a registration gives no key."""
        return ()

    def settle(self) -> None:
        """Do nothing: there are no rotations."""

    def rotate(self) -> None:
        """Do nothing: `read_settings` refuses to rotate these drones."""

    async def changed(self) -> None:
        """Wait for ever."""
        await asyncio.Event().wait()


class EnrolledCrew:
    """Drones that enrolled. No other process may serve them during a rotation."""

    def __init__(
        self,
        kept: Iterable[KeptCredentials],
        folder: CredentialsFolder,
        *,
        again_after_s: float = _AGAIN_AFTER_S,
    ) -> None:
        self._kept = {each.drone.drone_id: each for each in kept}
        self._folder = folder
        self._again_after_s = again_after_s

    @property
    def drones(self) -> tuple[EnrolledDrone, ...]:
        """The drones, each with the credentials that were last in force."""
        return tuple(each.drone for each in self._kept.values())

    @property
    def accesses(self) -> tuple[CloudAccess, ...]:
        """The drones' own keys."""
        return tuple(CloudAccess(each.api_url, each.drone.key) for each in self._kept.values())

    async def changed(self) -> None:
        """Return once an interrupted rotation has finished; without one never."""
        before = self.drones
        while any(each.following for each in self._kept.values()):
            await asyncio.sleep(self._again_after_s)
            await asyncio.to_thread(self.settle)
            if self.drones != before:
                return
        await asyncio.Event().wait()

    def rotate(self) -> None:
        """Change the credentials of every drone; after a failure a drone keeps its credentials."""
        self._each(begin_rotation)
        self.settle()

    def settle(self) -> None:
        """Finish the rotations that have begun; without the cloud the old credentials stay."""
        self._each(settle_rotation)

    def _each(self, do: Callable[[KeptCredentials, CredentialsFolder], KeptCredentials]) -> None:
        for drone_id, kept in self._kept.items():
            try:
                self._kept[drone_id] = do(kept, self._folder)
            except (CloudUnreachable, CloudRefused) as error:
                log.warning(
                    "credentials not rotated", extra={"drone_id": drone_id, "reason": str(error)}
                )
