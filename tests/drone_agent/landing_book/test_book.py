"""The landing book: what it reads, and when it reads again."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

PATH = "/v1/networks/texas/stations"


def names(book: Any, step: Any) -> set[str]:
    return {one.station_id for one in book.around(step).landings_along(step)}


@pytest.fixture
def read(make_book: Any, flight: Any, version: Any, reads: Any) -> Any:
    """A book that has read what lies around the flight from home to the shop."""

    async def make(*keys: str, **settings: Any) -> Any:
        book = make_book(*keys, **settings)
        book.note_version(version())
        around = book.around(flight())
        await reads(book, lambda: around.edition == 1)
        return book

    return make


async def test_stations_that_no_mission_names_are_read_page_by_page(
    read: Any, flight: Any, cloud: Any
) -> None:
    cloud.places |= {f"field_{number}": (-97.95, 30.0 + number / 1000) for number in range(9)}

    book = await read()

    assert cloud.asked == [PATH] * 6
    assert {"home", "shop", "field_0", "field_3"} < names(book, flight())


async def test_no_station_is_read_before_the_networks_version_arrives(
    make_book: Any, flight: Any, version: Any, reads: Any, cloud: Any
) -> None:
    book = make_book()
    around = book.around(flight())
    reading = asyncio.create_task(book.run())
    for _ in range(20):
        await asyncio.sleep(0)
    asked_before = list(cloud.asked)
    reading.cancel()

    book.note_version(version())
    await reads(book, lambda: around.edition == 1)

    assert (asked_before, len(cloud.asked)) == ([], 2)


async def test_the_same_surroundings_are_read_once_for_all_drones(
    read: Any, flight: Any, reads: Any, cloud: Any
) -> None:
    book = await read()

    others = [book.around(flight()) for _ in range(100)]
    elsewhere = book.around(flight("barn", "shop"))
    await reads(book, lambda: elsewhere.edition <= 1)

    assert len(cloud.asked) == 2
    assert {around.edition for around in others} == {1}


async def test_another_version_is_read_again_and_the_same_one_is_not(
    read: Any, flight: Any, version: Any, reads: Any, cloud: Any
) -> None:
    book = await read()
    cloud.places.pop("barn")
    cloud.places["mill"] = (-97.96, 30.01)

    book.note_version(version(1))
    around = book.around(flight())
    before = names(book, flight())
    book.note_version(version(2))
    await reads(book, lambda: around.edition == 2)

    assert (before, names(book, flight())) == ({"home", "shop", "barn"}, {"home", "shop", "mill"})


async def test_a_station_that_was_closed_is_skipped_after_the_next_read(
    read: Any, flight: Any, reads: Any, cloud: Any
) -> None:
    book = await read(good_for_s=0.0)
    cloud.closed.add("barn")

    around = book.around(flight())
    await reads(book, lambda: around.edition == 2)

    assert names(book, flight()) == {"home", "shop"}


async def test_stations_of_another_network_are_no_landings(
    read: Any, flight: Any, version: Any, reads: Any, cloud: Any
) -> None:
    book = await read()
    moor = {"moor": (-97.97, 30.01), "fen": (-97.93, 30.01)}
    cloud.places, cloud.network_id = moor, "louisiana"

    book.note_version(version(1, "louisiana"))
    around = book.around(flight())
    await reads(book, lambda: around.edition == 2)

    assert names(book, flight()) == {"home", "shop", "barn"}
    assert names(book, flight("moor", "fen", moor)) == {"moor", "fen"}


async def test_a_removed_network_does_not_stop_the_reading_of_others(
    make_book: Any, flight: Any, version: Any, reads: Any, cloud: Any
) -> None:
    book = make_book()
    for network_id in ("gone", "texas", "lost"):
        book.note_version(version(1, network_id))

    around = book.around(flight())
    await reads(book, lambda: around.edition == 1)

    assert names(book, flight()) == {"home", "shop", "barn"}


async def test_stations_are_available_after_a_start_without_the_cloud(
    read: Any, make_book: Any, flight: Any, cloud: Any
) -> None:
    await read()
    cloud.is_down = True

    assert names(make_book(), flight()) == {"home", "shop", "barn"}


async def test_new_stations_are_written_at_the_end(
    read: Any, make_book: Any, flight: Any, reads: Any, cloud: Any
) -> None:
    book = await read()
    elsewhere = {"home": (-98.0, 30.0), "mill": (-98.2, 30.0)}
    cloud.places |= elsewhere

    around = book.around(flight("home", "mill", elsewhere))
    await reads(book, lambda: around.edition == 1)

    assert "mill" in names(make_book(), flight("home", "mill", elsewhere))


async def test_stations_from_the_disk_are_read_again_from_the_cloud(
    read: Any, flight: Any, cloud: Any
) -> None:
    await read()
    cloud.places.pop("barn")

    book = await read()

    assert names(book, flight()) == {"home", "shop"}


@pytest.mark.parametrize("content", ["", "{", '{"tiles": [{"tile": [1]}]}'])
def test_a_damaged_file_is_read_as_an_empty_book(
    make_book: Any, flight: Any, tmp_path: Path, content: str
) -> None:
    (tmp_path / "landing-book.json").write_text(content)

    assert names(make_book(), flight()) == set()


async def test_without_a_key_the_book_stops_without_reading(
    make_book: Any, flight: Any, version: Any, cloud: Any
) -> None:
    cloud.keys.clear()
    book = make_book("dk_1", "dk_2")
    book.note_version(version())
    book.around(flight())

    await asyncio.wait_for(book.run(), 60)

    assert cloud.asked == [PATH] * 2
    assert not book.uses_versions
    assert names(book, flight()) == set()


async def test_the_next_drones_key_is_used_when_one_is_refused(
    read: Any, flight: Any, cloud: Any
) -> None:
    cloud.keys = {"dk_2"}

    book = await read("dk_1", "dk_2")

    assert names(book, flight()) == {"home", "shop", "barn"}


async def test_a_cloud_that_is_down_is_asked_again(
    make_book: Any, flight: Any, version: Any, reads: Any, cloud: Any
) -> None:
    cloud.is_down = True
    book = make_book(again_after_s=0.01)
    book.note_version(version())
    around = book.around(flight())

    await reads(book, lambda: len(cloud.asked) >= 3)
    before = around.landings_along(flight())
    cloud.is_down = False
    await reads(book, lambda: bool(around.landings_along(flight())))

    assert before == ()
