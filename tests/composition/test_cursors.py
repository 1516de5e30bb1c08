"""Cursors that somebody made up, on both databases: places in the list, and no failure of ours."""

from typing import Any

import pytest

from skyway.runtime.http.paging import encode_cursor


@pytest.mark.parametrize(("place", "left"), [(2**62, 1), (1, 0), (-(2**62), 0)])
async def test_versions_below_any_number_can_be_asked_for(
    composition: Any, place: int, left: int
) -> None:
    path = f"/v1/networks/row/versions?cursor={encode_cursor((place,))}"

    answer = await composition("customer:c", "GET", path)

    assert len(answer.json()["items"]) == left


@pytest.mark.parametrize("place", [(2**62, 0), (0, 2**62)])
async def test_reservations_after_any_pad_can_be_asked_for(
    composition: Any, place: tuple[int, int]
) -> None:
    path = f"/v1/stations/b/reservations?cursor={encode_cursor(place)}"

    answer = await composition("customer:c", "GET", path)

    assert answer.json()["items"] == []
