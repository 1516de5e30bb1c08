"""The rules of networks: a version never changes, and stations are those of the current version."""

import hashlib
from collections.abc import Mapping
from typing import Final

from sqlalchemy import and_, func, literal_column, or_, select

from skyway.network.geojson_text import read_network_text
from skyway.runtime.verification.rule import Rule
from skyway.runtime.verification.survey import Survey
from skyway_composition.tables import network_versions, networks, stations

_is_current = and_(
    network_versions.c.network_id == networks.c.network_id,
    network_versions.c.version == networks.c.version,
)

#: The values of a row of `stations`.
_Station = tuple[str | None, int, float, float]


async def _changed_contents(survey: Survey) -> list[str]:
    return [
        f"{row.network_id} version {row.version}"
        async for row in survey.each(select(network_versions))
        if hashlib.sha256(row.content).hexdigest() != row.sha256
    ]


async def _other_stations(survey: Survey) -> list[str]:
    stored: dict[str, dict[str, _Station]] = {}
    async for row in survey.each(select(stations)):
        values = (row.name, row.pads, row.longitude_deg, row.latitude_deg)
        stored.setdefault(row.network_id, {})[row.station_id] = values
    query = select(networks.c.network_id, network_versions.c.content).join(
        network_versions, _is_current
    )
    found: list[str] = []
    for row in await survey.rows(query):
        published, own = _published(row.content), stored.pop(row.network_id, {})
        found += sorted(
            station_id
            for station_id in published.keys() | own.keys()
            if published.get(station_id) != own.get(station_id)
        )
    return found + [station_id for own in stored.values() for station_id in own]


def _published(content: bytes) -> Mapping[str, _Station]:
    network = read_network_text(content)
    return {
        each.station_id: (each.name, each.pads, *each.position)
        for each in network.stations.values()
    }


NETWORKS: Final = (
    Rule(
        "I12 a current version is kept",
        select(networks.c.network_id).where(
            ~select(literal_column("1"))
            .where(
                _is_current,
                network_versions.c.sha256 == networks.c.sha256,
                network_versions.c.published_ms == networks.c.published_ms,
            )
            .exists()
        ),
        "Restore the row of `network_versions` from a backup, or publish the network again: PUT "
        "/v1/networks/{id}.",
    ),
    Rule(
        "I12 a network has all its versions up to the current one",
        select(networks.c.network_id)
        .join(network_versions, network_versions.c.network_id == networks.c.network_id)
        .group_by(networks.c.network_id, networks.c.version)
        .having(
            or_(
                func.count() != networks.c.version,
                func.max(network_versions.c.version) != networks.c.version,
            )
        ),
        "Restore the missing rows of `network_versions` from a backup.",
    ),
    Rule(
        "I12 a version's content has its hash",
        _changed_contents,
        "The content was changed without a new version. Restore it from a backup; if it is the "
        "current one, you may also publish the right content: PUT /v1/networks/{id}.",
    ),
    Rule(
        "I12 the stations are those of the current version",
        _other_stations,
        "Publish a new version of the network (PUT /v1/networks/{id}): it writes all stations.",
    ),
)
