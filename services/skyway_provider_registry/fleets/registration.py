"""Checks new drones and changes of drones; prepares ids, accounts and answers, and stores them."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Final

from pydantic import Field

from skyway.broker_setup.passwords import PasswordHash
from skyway.complaints import unknown_name
from skyway.contracts.signature import CloudKeys
from skyway.contracts.station_check import StationCheck
from skyway.delivery.offer import Tariff
from skyway.drone.model import DroneModel
from skyway.errors import InvalidInput
from skyway.ids import DroneId, DroneModelId, ProviderId
from skyway.json_model import JsonModel
from skyway.runtime.clock import FleetClock
from skyway.runtime.minting import Mint
from skyway.runtime.peer_secrets import secret_hash
from skyway.runtime.sql.database import Tx
from skyway_provider_registry.change_store import next_change
from skyway_provider_registry.enrolment import credential_store, signing_store
from skyway_provider_registry.fleets import store
from skyway_provider_registry.fleets.drone import DroneChange, FleetDrone, NewDrone, RegisteredDrone
from skyway_provider_registry.fleets.issue_credentials import (
    TOKEN_LIFE,
    new_passwords,
    new_token,
)
from skyway_provider_registry.homes import StationLookup, home_faults
from skyway_provider_registry.presence import sighting_store as sightings
from skyway_provider_registry.presence.drone_presence import NEVER_SEEN


class RegisteredDrones(JsonModel):
    """The answer to the registration of a list of drones."""

    items: Annotated[
        tuple[RegisteredDrone, ...], Field(description="the new drones, in the order of the list")
    ]


#: The changes that are columns of the same name and value.
_PLAIN_FIELDS: Final = frozenset(("name", "registration", "standby"))


async def changed_columns(
    requested: DroneChange, stations: StationLookup, *, model: DroneModel, tariff: Tariff
) -> dict[str, object]:
    """The columns to set; a new home station is looked up before the write.

    Raises
    ------
    InvalidInput
        There is no such station, or the drone could never fly from it.
    """
    given = requested.model_fields_set
    values: dict[str, object] = {f: getattr(requested, f) for f in given & _PLAIN_FIELDS}
    if requested.state is not None:
        values["is_in_maintenance"] = requested.state == "MAINTENANCE"
    if requested.home_station_id is not None:
        check = await stations.check([requested.home_station_id])
        for fault in home_faults(requested.home_station_id, model, tariff, check):
            raise InvalidInput("home_station_id", fault.detail)
        position = check.positions[requested.home_station_id]
        values["home_station_id"] = requested.home_station_id
        values["network_id"] = check.network_ids[requested.home_station_id]
        values["home_longitude_deg"] = position.longitude_deg
        values["home_latitude_deg"] = position.latitude_deg
    return values


@dataclass(frozen=True, slots=True)
class PreparedDrones:
    """New drones that are not stored yet: the rows to store, and the answer."""

    drones: tuple[FleetDrone, ...]
    password_hashes: Mapping[DroneId, str]
    token_hashes: Mapping[DroneId, str]
    tokens_expire_at: datetime
    public_keys: Mapping[DroneId, str]
    shown: tuple[RegisteredDrone, ...]


def prepare(
    new_drones: Sequence[NewDrone],
    *,
    provider_id: ProviderId,
    models: Mapping[DroneModelId, DroneModel],
    stations: StationCheck,
    mint: Mint,
    clock: FleetClock,
    cloud_keys: CloudKeys,
    hash_password: PasswordHash,
) -> PreparedDrones:
    """The drones as they will be stored; this only computes, so run it in a thread."""
    now, wall_now = clock.now(), clock.wall_now()
    drones = tuple(
        FleetDrone(
            drone_id=DroneId(mint("drn")),
            provider_id=provider_id,
            model=models[new_drone.model_id],
            home_station_id=new_drone.home_station_id,
            home_position=stations.positions[new_drone.home_station_id],
            name=new_drone.name,
            registration=new_drone.registration,
            standby=new_drone.standby,
            initial_soc=new_drone.soc,
            is_in_maintenance=False,
            created_at=now,
            presence=NEVER_SEEN,
            network_id=stations.network_ids[new_drone.home_station_id],
        )
        for new_drone in new_drones
    )
    passwords, hashes = new_passwords((drone.drone_id for drone in drones), hash_password)
    shown_tokens = {drone.drone_id: new_token() for drone in drones}
    return PreparedDrones(
        drones=drones,
        password_hashes=hashes,
        token_hashes={drone_id: secret_hash(token) for drone_id, token in shown_tokens.items()},
        tokens_expire_at=wall_now + TOKEN_LIFE,
        public_keys={
            drone.drone_id: new_drone.public_key
            for drone, new_drone in zip(drones, new_drones, strict=True)
            if new_drone.public_key is not None
        },
        shown=tuple(
            drone.shown_once(
                wall_now,
                password=passwords[drone.drone_id],
                token=shown_tokens[drone.drone_id],
                cloud_keys=cloud_keys,
            )
            for drone in drones
        ),
    )


async def store_drones(tx: Tx, prepared: PreparedDrones) -> None:
    """Store drones, their presence, accounts, tokens and keys: all or none."""
    change = await next_change(tx)
    await store.add(tx, prepared.drones)
    await sightings.begin(tx, prepared.password_hashes, change=change)
    await credential_store.add_accounts(tx, prepared.password_hashes)
    await credential_store.add_tokens(
        tx, prepared.token_hashes, expires_at=prepared.tokens_expire_at
    )
    await signing_store.add_keys(tx, prepared.public_keys)


@dataclass(frozen=True, slots=True)
class RegistrationFault:
    """What is wrong with a field of one drone; `index` is its place in the list, from 0."""

    index: int
    field: str
    detail: str


def faults_of(
    new_drones: Sequence[NewDrone],
    *,
    models: Mapping[DroneModelId, DroneModel],
    tariff: Tariff,
    check: StationCheck,
) -> list[RegistrationFault]:
    """All faults, in the order of the drones."""
    return [
        RegistrationFault(index, field, detail)
        for index, drone in enumerate(new_drones)
        for field, detail in _of_one(drone, models=models, tariff=tariff, check=check)
    ] + list(_repeated_registrations(new_drones))


def _of_one(
    drone: NewDrone,
    *,
    models: Mapping[DroneModelId, DroneModel],
    tariff: Tariff,
    check: StationCheck,
) -> Iterator[tuple[str, str]]:
    if drone.model_id not in models:
        yield "model_id", unknown_name("drone model that you may use", drone.model_id, models)
    model = models.get(drone.model_id)
    for fault in home_faults(drone.home_station_id, model, tariff, check):
        yield fault.field, fault.detail


def taken_faults(new_drones: Sequence[NewDrone], taken: Collection[str]) -> list[RegistrationFault]:
    """The drones whose registration another drone of the provider has."""
    return [
        RegistrationFault(
            index, "registration", f"{each.registration!r} belongs to another of your drones"
        )
        for index, each in enumerate(new_drones)
        if each.registration in taken
    ]


def _repeated_registrations(new_drones: Sequence[NewDrone]) -> Iterator[RegistrationFault]:
    first: dict[str, int] = {}
    for index, drone in enumerate(new_drones):
        if drone.registration is None:
            continue
        first_index = first.setdefault(drone.registration, index)
        if first_index != index:
            detail = (
                f"{drone.registration!r} is also the registration of drone {first_index}"
                " in this list"
            )
            yield RegistrationFault(index, "registration", detail)
