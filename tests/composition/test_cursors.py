"""Invented cursors are places in a list and cause no server error, on both databases."""

from typing import Any

import pytest

from skyway.runtime.http.paging import encode_cursor


@pytest.mark.parametrize(("place", "left"), [(2**62, 1), (1, 0), (-(2**62), 0)])
async def test_a_cursor_of_versions_may_hold_any_number(
    composition: Any, place: int, left: int
) -> None:
    path = f"/v1/networks/row/versions?cursor={encode_cursor((place,))}"

    answer = await composition("customer:c", "GET", path)

    assert len(answer.json()["items"]) == left


@pytest.mark.parametrize("place", [(2**62, 0), (0, 2**62)])
async def test_a_cursor_of_reservations_may_hold_any_pad(
    composition: Any, place: tuple[int, int]
) -> None:
    path = f"/v1/stations/b/reservations?cursor={encode_cursor(place)}"

    answer = await composition("customer:c", "GET", path)

    assert answer.json()["items"] == []
