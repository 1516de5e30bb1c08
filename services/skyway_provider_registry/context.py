"""What the routes of all rooms use."""

from dataclasses import dataclass

from skyway.runtime.clock import FleetClock
from skyway.runtime.http.identity import ServiceGate
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database


@dataclass(frozen=True, slots=True)
class Context:
    """The registry's database, the gate that gives the caller, the clock, and new ids."""

    db: Database
    gate: ServiceGate
    clock: FleetClock
    mint: Mint
