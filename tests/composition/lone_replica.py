"""A replica of composition that knows no other: it owns every drone."""

from skyway_composition.tables import replicas

from skyway.runtime.clock import FleetClock
from skyway.runtime.replicas.membership import Membership
from skyway.runtime.replicas.replica_store import ReplicaStore
from skyway.runtime.sql.database import Database


def lone_replica(db: Database, clock: FleetClock) -> Membership:
    return Membership(ReplicaStore(db, replicas), own_id="only", clock=clock)
