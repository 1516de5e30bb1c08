"""Registering drones: their ids, accounts and answer are made first, and then kept in one write."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

from skyway.contracts.station_check import StationCheck
from skyway.drone.model import DroneModel
from skyway.ids import DroneId, DroneModelId, ProviderId
from skyway.runtime.clock import FleetClock
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Tx
from skyway_provider_registry.changes.store import next_change
from skyway_provider_registry.enrolment import store as accounts
from skyway_provider_registry.enrolment.passwords import new_passwords
from skyway_provider_registry.enrolment.tokens import store as tokens
from skyway_provider_registry.enrolment.tokens.token import TOKEN_LIFE, new_token, token_hash
from skyway_provider_registry.fleets import store
from skyway_provider_registry.fleets.drone import NewDrone, RegisteredDrone
from skyway_provider_registry.fleets.fleet_drone import FleetDrone
from skyway_provider_registry.presence.known import NEVER_SEEN
from skyway_provider_registry.presence.sightings import store as sightings


@dataclass(frozen=True, slots=True)
class PreparedDrones:
    """Drones that are not kept yet: what is kept of them, and what is answered."""

    drones: tuple[FleetDrone, ...]
    password_hashes: Mapping[DroneId, str]
    token_hashes: Mapping[DroneId, str]
    tokens_expire_at: datetime
    shown: tuple[RegisteredDrone, ...]


def prepare(
    new_drones: Sequence[NewDrone],
    *,
    provider_id: ProviderId,
    models: Mapping[DroneModelId, DroneModel],
    stations: StationCheck,
    mint: Mint,
    clock: FleetClock,
) -> PreparedDrones:
    """The drones as they will be kept: plain computing, to be done in a thread."""
    now, wall_now = clock.now(), clock.wall_now()
    drones = tuple(
        FleetDrone(
            drone_id=DroneId(mint("drn")),
            provider_id=provider_id,
            model=models[wanted.model_id],
            home_station_id=wanted.home_station_id,
            home_position=stations.positions[wanted.home_station_id],
            name=wanted.name,
            registration=wanted.registration,
            initial_soc=wanted.soc,
            is_in_maintenance=False,
            created_at=now,
            presence=NEVER_SEEN,
        )
        for wanted in new_drones
    )
    passwords, hashes = new_passwords(drone.drone_id for drone in drones)
    shown_tokens = {drone.drone_id: new_token() for drone in drones}
    return PreparedDrones(
        drones=drones,
        password_hashes=hashes,
        token_hashes={drone_id: token_hash(token) for drone_id, token in shown_tokens.items()},
        tokens_expire_at=wall_now + TOKEN_LIFE,
        shown=tuple(
            drone.shown_once(
                wall_now, password=passwords[drone.drone_id], token=shown_tokens[drone.drone_id]
            )
            for drone in drones
        ),
    )


async def keep(tx: Tx, prepared: PreparedDrones) -> None:
    """Keep drones, their accounts, tokens and room for what they will tell: all or none."""
    change = await next_change(tx)
    await store.add(tx, prepared.drones)
    await sightings.begin(tx, prepared.password_hashes, change=change)
    await accounts.add_drones(tx, prepared.password_hashes)
    await tokens.add_new(tx, prepared.token_hashes, expires_at=prepared.tokens_expire_at)
