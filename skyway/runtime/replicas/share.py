"""Decides which replica leads and which replica owns a drone, from the list of live replicas.

Replicas that see the same list decide the same. While their lists differ, two replicas may lead or
own the same drone, or a drone may have no owner for a moment.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import blake2b
from typing import Final

#: The most drones whose ownership is cached, about 100 bytes each.
_MOST_REMEMBERED: Final = 200_000


@dataclass(frozen=True, slots=True, order=True)
class Member:
    """A live replica, and when it joined, by the database's clock.

    `is_listening`: whether it is connected to the broker. Only then it owns drones.
    """

    joined_wall_ms: int
    replica_id: str
    is_listening: bool


@dataclass(frozen=True)
class Replicas:
    """The live replicas of a service, as the replica `own_id` sees them."""

    own_id: str
    members: tuple[Member, ...] = ()
    #: The answers of `owns`: most messages are from drones that were asked about before.
    _owned: dict[str, bool] = field(default_factory=dict, repr=False, compare=False)

    @cached_property
    def leads(self) -> bool:
        """Whether this replica leads: of those that listen, or else of all, it joined first.

        So the lead changes only when the leader leaves. A leader without a connection to the broker
        could announce neither stations nor networks, and nobody else would.
        """
        able = [each for each in self.members if each.is_listening] or self.members
        return bool(able) and min(able).replica_id == self.own_id

    @cached_property
    def listeners(self) -> frozenset[str]:
        """The replicas that share the drones: all that listen, and always this replica.

        The others may not see yet that this replica is connected, but it must miss no message.
        """
        listening = (each.replica_id for each in self.members if each.is_listening)
        return frozenset([self.own_id, *listening])

    def owns(self, drone_id: str) -> bool:
        """Whether this replica handles the messages of a drone."""
        is_owned = self._owned.get(drone_id)
        if is_owned is None:
            if len(self._owned) >= _MOST_REMEMBERED:
                self._owned.clear()
            is_owned = owner_of(drone_id, self.listeners) == self.own_id
            self._owned[drone_id] = is_owned
        return is_owned

    def forget_owned(self) -> None:
        """Free what was remembered of each drone; `owns` computes it again."""
        self._owned.clear()

    def may_own_more_than(self, before: "Replicas") -> bool:
        """Whether this replica may own drones that it did not own before."""
        return not before.listeners <= self.listeners


def owner_of(drone_id: str, replica_ids: Iterable[str]) -> str:
    """The replica with the largest hash of itself and the drone (rendezvous hashing).

    When a replica joins or leaves, only the drones of this replica change their owner. Source:
    Thaler and Ravishankar, "Using name-based mappings to increase hit rates", 1998.
    """
    return max(replica_ids, key=lambda each: (_weight(each, drone_id), each))


def _weight(replica_id: str, drone_id: str) -> bytes:
    return blake2b(f"{replica_id} {drone_id}".encode(), digest_size=8).digest()
