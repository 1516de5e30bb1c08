"""All SQL of the providers; each query finds only providers that its caller may see."""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

from sqlalchemy import ColumnElement, false, func, select, true, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.drones import ExchangingProviders
from skyway.delivery.offer import Tariff
from skyway.ids import DroneModelId, NetworkId, ProviderId, StationId
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import PageQuery
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_provider_registry.change_store import mark_providers
from skyway_provider_registry.providers.provider import Provider, ProviderChange
from skyway_provider_registry.tables import drones, providers


class DroneKind(NamedTuple):
    """Drones of one provider that have the same model and home."""

    provider_id: ProviderId
    network_id: NetworkId
    model_id: DroneModelId
    home_station_id: StationId
    tariff: Tariff


def owned(caller: Caller, provider_id: ColumnElement[str]) -> ColumnElement[bool]:
    """Whether the caller may see and change the data of a provider.

    An operator may for all providers, a provider for itself, and other callers for none.
    """
    if caller.role == "operator":
        return true()
    if caller.role == "provider":
        return provider_id == caller.subject_id
    return false()


async def add(tx: Tx, provider: Provider) -> None:
    """Store a new provider."""
    await mark_providers(tx)
    values = {"created_ms": moment_to_ms(provider.created_at), **_values(provider)}
    await tx.execute(providers.insert().values(values))


async def change(
    tx: Tx, caller: Caller, *, provider_id: ProviderId, changes: ProviderChange
) -> None:
    """Change the fields that are given.

    Raises
    ------
    NotFound
        There is no such provider, or the caller may not see it.
    """
    await mark_providers(tx)  # first: no other change comes between the reading and the writing
    provider = await of_caller(tx.connection, caller, provider_id=provider_id)
    values = _values(provider.merged(changes))
    await tx.execute(update(providers).where(providers.c.provider_id == provider_id).values(values))


async def of_caller(
    connection: AsyncConnection, caller: Caller, *, provider_id: ProviderId
) -> Provider:
    """The provider, if the caller may see all of it.

    Raises
    ------
    NotFound
        There is no such provider, or the caller may not see it.
    """
    condition = owned(caller, providers.c.provider_id)
    return await _one(connection, provider_id, condition)


async def by_id(connection: AsyncConnection, provider_id: ProviderId) -> Provider:
    """The provider with this id, for any caller."""
    return await _one(connection, provider_id, true())


async def page_of_caller(
    connection: AsyncConnection, caller: Caller, query: PageQuery
) -> Sequence[Provider]:
    """Up to limit + 1 providers that the caller may see, sorted by id."""
    return await _page(connection, query, owned(caller, providers.c.provider_id))


async def page_of_all(connection: AsyncConnection, query: PageQuery) -> Sequence[Provider]:
    """Up to limit + 1 of all providers, sorted by id."""
    return await _page(connection, query, true())


async def every(connection: AsyncConnection) -> Sequence[Provider]:
    """All providers, sorted by id."""
    found = await connection.execute(select(providers).order_by(providers.c.provider_id))
    return [_provider(row) for row in found]


async def exchanging(connection: AsyncConnection) -> ExchangingProviders:
    """The active providers that exchange deliveries."""
    found = await connection.execute(
        select(providers.c.provider_id, providers.c.tariff).where(
            providers.c.exchanges_deliveries, providers.c.state == "ACTIVE"
        )
    )
    tariffs = {row.provider_id: Tariff.read(row.tariff) for row in found}
    return ExchangingProviders(tariffs=tariffs)


async def homes(connection: AsyncConnection, provider_id: ProviderId) -> Sequence[StationId]:
    """A home of this provider's drones in each network."""
    statement = (
        select(func.min(drones.c.home_station_id))
        .where(drones.c.provider_id == provider_id)
        .group_by(drones.c.network_id)
    )
    return list((await connection.execute(statement)).scalars())


async def kinds_of_drones(connection: AsyncConnection) -> Sequence[DroneKind]:
    """The kinds of drones of all active providers, sorted."""
    names = (
        providers.c.provider_id,
        drones.c.network_id,
        drones.c.model_id,
        drones.c.home_station_id,
    )
    query = (
        select(*names, providers.c.tariff)
        .join_from(providers, drones, drones.c.provider_id == providers.c.provider_id)
        .where(providers.c.state == "ACTIVE")
        .distinct()
        .order_by(*names)
    )
    tariff_of = lru_cache(Tariff.read)  # most kinds of a provider share one
    return [DroneKind(*row[:4], tariff_of(row.tariff)) for row in await connection.execute(query)]


async def _one(
    connection: AsyncConnection, provider_id: ProviderId, condition: ColumnElement[bool]
) -> Provider:
    statement = select(providers).where(providers.c.provider_id == provider_id, condition)
    row = (await connection.execute(statement)).one_or_none()
    if row is None:
        raise NotFound("provider", provider_id)
    return _provider(row)


async def _page(
    connection: AsyncConnection, query: PageQuery, condition: ColumnElement[bool]
) -> Sequence[Provider]:
    statement = select(providers).where(condition)
    if (after := query.after_id()) is not None:
        statement = statement.where(providers.c.provider_id > after)
    statement = statement.order_by(providers.c.provider_id).limit(query.limit + 1)
    return [_provider(row) for row in await connection.execute(statement)]


def _values(provider: Provider) -> dict[str, object]:
    """The columns of what may change, and the id."""
    values = provider.model_dump(exclude={"tariff", "created_at"})
    return {**values, "tariff": provider.tariff.model_dump_json()}


def _provider(row: AnyRow) -> Provider:
    return Provider(
        provider_id=row.provider_id,
        name=row.name,
        tariff=Tariff.read(row.tariff),
        terms=row.terms,
        state=row.state,
        loading=row.loading,
        standby=row.standby,
        exchanges_deliveries=row.exchanges_deliveries,
        created_at=ms_to_moment(row.created_ms),
    )
