"""What the routes of all rooms use."""

from dataclasses import dataclass

from skyway.runtime.clock import FleetClock
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database


@dataclass(frozen=True, slots=True)
class Context:
    """The gateway's database, the clock, and new ids."""

    db: Database
    clock: FleetClock
    mint: Mint
