"""The drones that one agent process serves, with the credentials that work now."""

import asyncio
import logging
from collections.abc import Callable, Iterable
from typing import Final, Protocol

from skyway_drone_agent.enrolled_drone import EnrolledDrone
from skyway_drone_agent.enrolment.cloud import CloudAccess, CloudRefused, CloudUnreachable
from skyway_drone_agent.enrolment.credentials import CredentialsFolder, KeptCredentials
from skyway_drone_agent.enrolment.rotate import begin, settle

log = logging.getLogger(__name__)

#: Wall seconds between two attempts to find out which credentials are in force.
_AGAIN_AFTER_S: Final = 10.0


class Crew(Protocol):
    """Drones to serve."""

    @property
    def drones(self) -> tuple[EnrolledDrone, ...]:
        """The drones, each with what it logs in with."""
        ...

    @property
    def accesses(self) -> tuple[CloudAccess, ...]:
        """What the drones ask the cloud with; none without an enrolment."""
        ...

    def settle(self) -> None:
        """Find out which credentials are in force, where a crash left that open."""
        ...

    def rotate(self) -> None:
        """Change the credentials of every drone."""
        ...

    async def changed(self) -> None:
        """Return once drones have other credentials than before; it may never."""
        ...


class RegisteredCrew:
    """Drones of a fleet file: their passwords are those of their registration, for ever."""

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
        """Nothing is ever open."""

    def rotate(self) -> None:
        """Nothing can be changed: see `read_settings`."""

    async def changed(self) -> None:
        """Wait for ever."""
        await asyncio.Event().wait()


class EnrolledCrew:
    """Drones that enrolled; nobody else may serve them while this changes their credentials."""

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
        """The drones, each with what it logs in with as far as is known."""
        return tuple(each.drone for each in self._kept.values())

    @property
    def accesses(self) -> tuple[CloudAccess, ...]:
        """The drones' own keys."""
        return tuple(CloudAccess(each.api_url, each.drone.key) for each in self._kept.values())

    async def changed(self) -> None:
        """Return once a rotation that a crash cut short has come to its end; never without one."""
        before = self.drones
        while any(each.following for each in self._kept.values()):
            await asyncio.sleep(self._again_after_s)
            await asyncio.to_thread(self.settle)
            if self.drones != before:
                return
        await asyncio.Event().wait()

    def rotate(self) -> None:
        """Change the credentials of every drone; one whose change fails keeps what it has."""
        self._each(begin)
        self.settle()

    def settle(self) -> None:
        """End what rotations were begun; without the cloud the old credentials are used."""
        self._each(settle)

    def _each(self, do: Callable[[KeptCredentials, CredentialsFolder], KeptCredentials]) -> None:
        for drone_id, kept in self._kept.items():
            try:
                self._kept[drone_id] = do(kept, self._folder)
            except (CloudUnreachable, CloudRefused) as error:
                log.warning("not rotated", extra={"drone_id": drone_id, "reason": str(error)})
