"""A geocoder over HTTP that answers GeoJSON, as Photon, Pelias and Nominatim do.

The URL is the operator's, so its host is trusted. Its answers are checked: their size, their form,
and each position. No address is logged.
"""

import asyncio
import json
from collections.abc import Iterator, Mapping
from datetime import timedelta
from typing import Any, Final
from urllib.parse import quote

import httpx
from pydantic import TypeAdapter, ValidationError

from skyway.geo import Position
from skyway.runtime.answer_cache import AnswerCache
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import ServiceUnavailable
from skyway_gateway.places.geocoder import FoundPlace
from skyway_gateway.settings import ADDRESS

#: How long one address may take, wall seconds, and the largest answer.
_TIMEOUT_S: Final = 5.0
_MOST_BYTES: Final = 256 * 1024

#: How long an answer is used again, wall time, and the most answers in memory.
_KEPT: Final = timedelta(hours=1)
_MOST_CACHED: Final = 2_000

#: The places of one answer that are looked at, the likeliest, and the longest label.
_MOST_PLACES: Final = 5
_LONGEST_LABEL: Final = 200

#: The members of a feature that make a label where it has none: those of Photon.
_PARTS: Final = ("name", "street", "housenumber", "postcode", "city", "country")

_POSITION: Final = TypeAdapter(Position)


class HttpGeocoder:
    """The geocoder at a URL in which `{address}` stands for the address."""

    limits = "the geocoder finds no such address; give a location or a plus code"
    #: Others wait for the same geocoder, and its owner may pay for each address. Our own choice.
    cost = 10.0

    def __init__(
        self, url: str, clock: FleetClock, *, transport: httpx.AsyncBaseTransport | None = None
    ) -> None:
        self._url = url
        self._client = httpx.AsyncClient(
            timeout=_TIMEOUT_S,
            transport=transport,
            follow_redirects=False,
            trust_env=False,
            # Not compressed: a small answer could become a large one.
            headers={"user-agent": "Skyway/1", "accept-encoding": "identity"},
        )
        self._cached = AnswerCache(self._ask, clock=clock, kept=_KEPT, most=_MOST_CACHED)

    async def close(self) -> None:
        """Close all connections."""
        await self._client.aclose()

    async def find(self, address: str) -> tuple[FoundPlace, ...]:
        """The places that the address may mean, the likeliest first.

        Raises
        ------
        ServiceUnavailable
            The geocoder does not answer now, or does not answer GeoJSON.
        """
        asked = " ".join(address.split())
        cached = self._cached.cached(asked)
        return cached if cached is not None else await self._cached.ask(asked)

    async def _ask(self, address: str) -> tuple[FoundPlace, ...]:
        url = self._url.replace(ADDRESS, quote(address, safe=""))
        try:
            async with asyncio.timeout(_TIMEOUT_S):
                return tuple(_places(json.loads(await self._read(url))))
        except TimeoutError as error:
            raise _unavailable(f"no answer within {_TIMEOUT_S:g} s") from error
        except httpx.HTTPError as error:
            # The error's own text may hold the URL, and so the address.
            raise _unavailable(type(error).__name__) from None
        except (ValueError, RecursionError) as error:
            raise _unavailable("its answer is not GeoJSON") from error

    async def _read(self, url: str) -> bytes:
        body = bytearray()
        async with self._client.stream("GET", url) as answer:
            if not answer.is_success:
                raise _unavailable(f"it answered with the status {answer.status_code}")
            async for chunk in answer.aiter_bytes():
                body += chunk
                if len(body) > _MOST_BYTES:
                    raise _unavailable(f"its answer has more than {_MOST_BYTES} bytes")
        return bytes(body)


def _unavailable(detail: str) -> ServiceUnavailable:
    return ServiceUnavailable("the geocoder", detail, code="GEOCODER")


def _places(document: Any) -> Iterator[FoundPlace]:  # any JSON
    """The first places of a collection of features; features without a valid point are left out."""
    features = document.get("features") if isinstance(document, Mapping) else None
    if not isinstance(features, list):
        raise ValueError("no collection of features")  # noqa: TRY004 - its text is not a type
    for feature in features[:_MOST_PLACES]:
        try:
            geometry, properties = feature["geometry"], feature.get("properties") or {}
            position = _POSITION.validate_python(geometry["coordinates"][:2])
            place = FoundPlace(_label(properties), position)
        except (TypeError, KeyError, AttributeError, ValidationError):
            continue
        yield place


def _label(properties: Mapping[str, Any]) -> str:  # any JSON
    whole = properties.get("label") or properties.get("display_name")
    parts = [properties.get(name) for name in _PARTS]
    text = str(whole or ", ".join(str(part) for part in parts if part))
    return "".join(each for each in text if each.isprintable())[:_LONGEST_LABEL]
