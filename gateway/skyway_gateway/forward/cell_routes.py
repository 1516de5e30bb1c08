"""Passes calls on to the servers of composition: to one, or to all.

A call whose path has a network or a station goes to the server of that network. A call with another
id, such as a mission's, goes to all servers, and only one knows the id. A list is merged from the
lists of all servers; the header `Skyway-Silent-Cells` names the servers whose part is missing.

A cursor is the sort key of the last item on a page. It means the same at every server, so every
server gets the caller's cursor, and the merged page has a cursor of the same form.
"""

import asyncio
import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, Final

import httpx
from fastapi import Request, Response
from fastapi.responses import StreamingResponse
from pydantic import TypeAdapter

from skyway.cells import ANSWERS_WITHIN_S, CellClients, ask_all
from skyway.errors import InvalidInput
from skyway.ids import NetworkId, StationId
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.csv_answers import CSV, csv_answer, prefers
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import encode_cursor
from skyway_gateway.clients import NetworkFinder
from skyway_gateway.forward.document import columns_of_list
from skyway_gateway.forward.table import Forwarded

#: A JSON object from our own services, which is valid and is not checked again.
_Json = dict[str, Any]


@dataclass(frozen=True, slots=True)
class ListOrder:
    """The member by which a list is sorted."""

    member: str
    is_newest_first: bool = False


#: The lists that may span networks, by their paths.
MERGED: Final[Mapping[str, ListOrder]] = {
    "/v1/networks": ListOrder("network_id"),
    "/v1/missions": ListOrder("mission_id", is_newest_first=True),
    "/v1/closures": ListOrder("closure_id"),
    "/v1/zones": ListOrder("closure_id"),
    "/v1/ground-stops": ListOrder("closure_id"),
    "/v1/alarms": ListOrder("alarm_id", is_newest_first=True),
    "/v1/quarantine": ListOrder("quarantine_id", is_newest_first=True),
    "/v1/providers/{provider_id}/schedule": ListOrder("drone_id"),
    "/v1/stats/pads": ListOrder("station_id"),
    "/v1/stats/drones": ListOrder("drone_id"),
}

#: The counts that may span networks: objects of numbers.
COUNTED: Final = frozenset({"/v1/stats/missions"})

#: The member that weights a share: the number of pads or drones that the share belongs to.
_SHARED_BY: Final = ("pads", "drones")


def merged_page(pages: Sequence[_Json], order: ListOrder, *, limit: int) -> _Json:
    """The first items of all pages, at most `limit`; other members come from the first page."""
    items = sorted(
        (item for page in pages for item in page["items"]),
        key=lambda item: str(item[order.member]),
        reverse=order.is_newest_first,
    )
    has_more = len(items) > limit or any(page.get("next_cursor") for page in pages)
    shown = items[:limit]
    cursor = encode_cursor((shown[-1][order.member],)) if has_more and shown else None
    merged = {**pages[0], "items": shown, "next_cursor": cursor}
    if "total" in merged:
        merged["total"] = _total(page["total"] for page in pages)
    return merged


def merged_counts(answers: Sequence[_Json]) -> _Json:
    """The sums of all objects of numbers; other members come from the first answer."""
    merged = dict(answers[0])
    for name, value in answers[0].items():
        if isinstance(value, dict):
            sums: Counter[str] = Counter()
            for answer in answers:
                sums.update(answer[name])
            merged[name] = dict(sums)
    return merged


def _total(totals: Iterable[_Json]) -> _Json:
    """The sums of numbers. A share is weighted by the number of its pads or drones."""
    parts = list(totals)
    merged = {name: sum(each[name] or 0 for each in parts) for name in parts[0]}
    if "utilisation" in merged:
        [shared_by] = [name for name in _SHARED_BY if name in merged]
        whole = merged[shared_by]
        used = sum((each["utilisation"] or 0) * each[shared_by] for each in parts)
        merged["utilisation"] = used / whole if whole else None
    return merged


#: The header that names the servers whose part of a list is missing.
SILENT_HEADER: Final = "Skyway-Silent-Cells"

#: The calls whose body names a network.
_NAMED_IN_BODY: Final = ("/v1/zones", "/v1/ground-stops")
_PROBLEMS: Final = "/v1/compositions"

#: A problem with a larger body contains its own network, so any server can plan it.
_LARGEST_REFERENCE_BYTES: Final = 1024 * 1024

#: Reads a limit as the servers do: `5.0` is a whole number.
_LIMIT: Final = TypeAdapter(int)


@dataclass(frozen=True, slots=True)
class ForwardToCells:
    """Finds the servers of a call, and passes the call on."""

    servers: CellClients
    find: NetworkFinder

    async def __call__(self, request: Request, row: Forwarded, caller: Caller | None) -> Response:
        """The answer of the server, or the merged answer of all; an error names a silent cell."""
        client: ServiceClient | None = None
        if not self.servers.cells:
            client = self.servers.default
        elif row.method == "GET" and (row.path in MERGED or row.path in COUNTED):
            return await self._merge(request, row, caller)
        elif row.path in (*_NAMED_IN_BODY, _PROBLEMS):
            client = await self._named_in_body(request, row)
        else:
            client = await self._named_in_path(request)
        if client is None:
            return await self._first_that_knows(request, row, caller)
        return await client.forward(request, request.scope["path"], caller, timeout_s=row.timeout_s)

    async def _named_in_path(self, request: Request) -> ServiceClient | None:
        """The server of the network or station in the path; None if the path names neither."""
        names = request.path_params
        if "network_id" in names:
            return self.servers.of(NetworkId(names["network_id"]))
        station_id = names.get("station_id") or names.get("from_id")
        if station_id is None:
            return None
        return self.servers.of(await self.find.of_station(StationId(station_id)))

    async def _named_in_body(self, request: Request, row: Forwarded) -> ServiceClient:
        """The server of the network that the body names; a problem may have its own network.

        A ground stop without a network is refused: servers cannot begin it in one transaction.
        """
        length = request.headers.get("content-length")
        # Without a length the body may be as large as the largest problem.
        if row.path == _PROBLEMS and (length is None or int(length) > _LARGEST_REFERENCE_BYTES):
            return self.servers.default
        named = _network_named(await request.body(), row)
        if named is None and row.path == "/v1/ground-stops":
            cells = ", ".join(self.servers.cells)
            fault = f"is missing: stop each network by itself, because some have cells ({cells})"
            raise InvalidInput("network_id", fault)
        return self.servers.of(named)

    async def _first_that_knows(
        self, request: Request, row: Forwarded, caller: Caller | None
    ) -> Response:
        """The answer of the server that knows the id; only one server can know it.

        The call does not wait for a server that hangs and does not know it.
        """
        await request.body()  # the request keeps its body, so that each server gets it
        asks = (_ask(each, request, row, caller) for each in self.servers.every().values())
        asked = [asyncio.create_task(each) for each in asks]
        silent: ServiceUnavailable | None = None
        found: Response | None = None
        try:
            for asking in asyncio.as_completed(asked):
                try:
                    found = await asking
                except ServiceUnavailable as error:
                    silent = error
                else:
                    if found.status_code != HTTPStatus.NOT_FOUND:
                        return found
            if silent is None and found is not None:
                return found
            raise silent or ServiceUnavailable("composition", "it has no server")
        finally:
            for task in asked:
                task.cancel()

    async def _merge(self, request: Request, row: Forwarded, caller: Caller | None) -> Response:
        path = request.scope["path"]
        if query := request.url.query:
            path = f"{path}?{query}"

        async def ask(client: ServiceClient) -> dict[str, Any]:
            return await client.call(
                "GET", path, answer=dict[str, Any], caller=caller, timeout_s=row.timeout_s
            )

        within_s = row.timeout_s if row.is_report else ANSWERS_WITHIN_S
        answers = await ask_all(self.servers.every(), ask, within_s=within_s)
        pages = list(answers.given.values())
        if not pages:
            answers.must_be_whole()
        silent = {SILENT_HEADER: "; ".join(answers.silent)} if answers.silent else {}
        if row.path in COUNTED:
            merged = merged_counts(pages)
        else:
            limit = _LIMIT.validate_python(request.query_params.get("limit", 50))
            merged = merged_page(pages, MERGED[row.path], limit=limit)
            if prefers(CSV, request):
                answer = csv_answer(merged, columns_of_list(row.path), request)
                answer.headers.update(silent)
                return answer
        body = json.dumps(merged, ensure_ascii=False).encode()
        return Response(body, media_type="application/json", headers=silent)


def _network_named(body: bytes, row: Forwarded) -> NetworkId | None:
    """The network that a body names; None if it names none, or has another form than expected."""
    try:
        document = json.loads(body)
        if row.path == _PROBLEMS:
            document = document["network"]
        network_id = document["network_id"]
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    return NetworkId(network_id) if isinstance(network_id, str) else None


async def _ask(
    server: ServiceClient, request: Request, row: Forwarded, caller: Caller | None
) -> Response:
    """The answer of one server; ServiceUnavailable if it is silent or fails: it may know the id."""
    path = request.scope["path"]
    answer = await server.forward(request, path, caller, timeout_s=row.timeout_s)
    try:
        body = await whole_body(answer)  # only one of several answers is passed on
    except httpx.HTTPError as error:
        raise ServiceUnavailable(server.name, "it broke off its answer") from error
    if answer.status_code >= HTTPStatus.INTERNAL_SERVER_ERROR:
        raise ServiceUnavailable(server.name, f"it answers {answer.status_code}")
    return Response(body, answer.status_code, answer.headers)


async def whole_body(answer: StreamingResponse) -> bytes:
    """The bytes of an answer that is not streamed on."""
    # Starlette allows text in a stream; those of services have only bytes.
    return b"".join([bytes(part) async for part in answer.body_iterator])  # type: ignore[arg-type]
