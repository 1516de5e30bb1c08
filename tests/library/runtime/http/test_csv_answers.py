"""Lists as CSV: for whom, with which columns, and with harmless cells."""

import csv
from typing import Annotated

import httpx
import pytest
from fastapi import FastAPI, Query

from skyway.json_model import JsonModel
from skyway.runtime.http.csv_answers import columns_of_models
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter


class Amount(JsonModel):
    amount: int
    currency: str


class Item(JsonModel):
    name: str
    price: Amount | None = None
    tags: tuple[str, ...] = ()
    is_new: bool = False


ITEMS = (
    Item(name="=cmd|' /C calc'!A1", price=Amount(amount=-5, currency="USD"), tags=("a", "b")),
    Item(name='quotes " and, commas\r\nand lines', is_new=True),
    Item(name=" \t+1"),
    Item(name="plain"),
)


@pytest.fixture
def client() -> httpx.AsyncClient:
    """A client of a service with one list."""
    router = ServiceRouter()

    @router.get("/v1/items")
    async def list_items(query: Annotated[PageQuery, Query()]) -> Page[Item]:
        """List items."""
        start = int(query.after_id() or 0)
        rows = [(str(number), item) for number, item in enumerate(ITEMS, 1)][start:]
        return page_of(rows, query, item=lambda row: row[1], sort_key=lambda row: (row[0],))

    app = FastAPI(routes=router.routes)
    return httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://service")


async def rows_of(client: httpx.AsyncClient, url: str = "/v1/items") -> list[dict[str, str]]:
    answer = await client.get(url, headers={"Accept": "text/csv"})
    assert answer.headers["content-type"] == "text/csv; charset=utf-8; header=present"
    assert answer.text.count("\r\n") >= 1
    return list(csv.DictReader(answer.text.splitlines(keepends=True)))


async def test_a_row_is_an_item_and_a_member_of_an_object_has_a_column(
    client: httpx.AsyncClient,
) -> None:
    first, second, *_ = await rows_of(client)

    assert list(first) == ["name", "price.amount", "price.currency", "tags", "is_new"]
    assert (first["price.amount"], first["price.currency"]) == ("-5", "USD")
    assert (first["tags"], first["is_new"]) == ('["a", "b"]', "false")
    assert (second["price.amount"], second["is_new"]) == ("", "true")


async def test_a_cell_is_a_text_where_a_spreadsheet_would_compute(
    client: httpx.AsyncClient,
) -> None:
    names = [row["name"] for row in await rows_of(client)]

    assert names == ["'" + ITEMS[0].name, ITEMS[1].name, "'" + ITEMS[2].name, "plain"]


async def test_the_next_page_is_in_the_header_link(client: httpx.AsyncClient) -> None:
    url, seen = "/v1/items?limit=3", 0
    for _ in range(2):
        answer = await client.get(url, headers={"Accept": "text/csv"})
        seen += len(await rows_of(client, url))
        url = str(answer.links.get("next", {}).get("url", ""))

    assert (seen, url) == (len(ITEMS), "")


@pytest.mark.parametrize(
    ("accept", "media_type"),
    [
        ("", "application/json"),
        ("*/*", "application/json"),
        ("application/json, text/csv;q=0.5", "application/json"),
        ("text/csv, application/json", "text/csv"),
        ("text/csv, */*;q=0.1", "text/csv"),
        ("TEXT/CSV; charset=UTF-8; header=present", "text/csv"),
        ("text/csv;q=0, */*", "application/json"),
    ],
)
async def test_a_caller_gets_the_type_that_it_prefers(
    client: httpx.AsyncClient, accept: str, media_type: str
) -> None:
    answer = await client.get("/v1/items", headers={"Accept": accept})

    assert answer.headers["content-type"].partition(";")[0] == media_type


@pytest.mark.parametrize(
    "accept", ["text/csv; delimiter=semicolon", "text/csv; charset=utf-16", "text/html"]
)
async def test_another_separator_or_type_is_not_acceptable(
    client: httpx.AsyncClient, accept: str
) -> None:
    answer = await client.get("/v1/items", headers={"Accept": accept})

    assert answer.status_code == 406
    assert "application/json or text/csv" in answer.text


def test_items_of_several_forms_have_the_columns_of_all() -> None:
    assert columns_of_models([Amount, Item])[:3] == (("amount",), ("currency",), ("name",))
