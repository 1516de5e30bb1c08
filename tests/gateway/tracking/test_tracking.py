"""Tracking links: a link shows its delivery, cannot be guessed, and ends when the customer says."""

from datetime import datetime, timedelta
from typing import Any

import pytest

from skyway.contracts.track import Track, TrackedMission, TrackedStep
from skyway.geo import Position
from skyway.ids import DeliveryId, StationId
from tests.gateway.access.test_quotas import replace_part
from tests.gateway.whole_gateway import Gateway, make_request


def path_of(url: str) -> str:
    assert url.startswith("http://gateway/track/")
    return url.removeprefix("http://gateway")


async def requested(gateway: Gateway) -> tuple[str, str]:
    """A new delivery and the path of its tracking page."""
    answer = await gateway.post(make_request(packages=2, reference="a secret reference"))
    assert answer.status_code == 202, answer.text
    return answer.json()["delivery_id"], path_of(answer.json()["tracking_url"])


async def status(gateway: Gateway, path: str) -> int:
    gateway.clock.advance(timedelta(seconds=2))  # each link is looked up once a second
    return (await gateway.http.get(f"{path}/state")).status_code


def link(delivery_id: str) -> str:
    return f"/v1/deliveries/{delivery_id}/tracking-link"


async def test_the_page_needs_no_key_and_forbids_all_but_its_own_files(gateway: Gateway) -> None:
    _, path = await requested(gateway)

    page = await gateway.http.get(path)

    assert page.status_code == 200
    assert "default-src 'none'" in page.headers["content-security-policy"]
    assert "unsafe" not in page.headers["content-security-policy"]
    assert page.headers["x-robots-tag"] == "noindex, nofollow"
    assert page.headers["referrer-policy"] == "no-referrer"
    for name in ("tracking.js", "tracking.css", "way_map.js", "said.js", "glide.js", "walk.js"):
        assert (await gateway.http.get(f"/track/assets/{name}")).status_code == 200
    assert (await gateway.http.get("/track/assets/__init__.py")).status_code == 404


async def test_the_state_says_nothing_about_customer_price_and_provider(gateway: Gateway) -> None:
    delivery_id, path = await requested(gateway)
    while await gateway.book_next():
        pass

    answer = await gateway.http.get(f"{path}/state")

    state: dict[str, Any] = answer.json()
    assert state["stage"] == "PLANNED"
    assert [package["state"] for package in state["packages"]] == ["CREATED", "CREATED"]
    for secret in ("alice", "prv_", "drn_", "a secret reference", "amount", "soc", delivery_id):
        assert secret not in answer.text


async def test_the_proof_shows_place_and_mass_and_nothing_about_the_drone(
    gateway: Gateway,
) -> None:
    delivery_id, path = await requested(gateway)
    while await gateway.book_next():
        pass
    for seq, kind in enumerate(("ACCEPTED", "LOADING", "LOADED"), start=1):
        await gateway.report(delivery_id, kind, seq=seq)
    evidence = {
        "mass_kg": {"p1": 0.52},
        "load_before_kg": 1.02,
        "place": {"station_id": "mcqueeney", "position": [-98.0, 29.6]},
    }
    place: dict[str, Any] = {"package_ids": ["p1"], "station_id": "mcqueeney", "soc": 0.611}
    await gateway.report(delivery_id, "DELIVERED", seq=4, **place, data=evidence)

    answer = await gateway.http.get(f"{path}/state")

    delivered, on_its_way = answer.json()["packages"]
    assert delivered["proof_station_id"] == "mcqueeney"
    assert (delivered["proof_position"], delivered["proof_mass_kg"]) == ([-98.0, 29.6], 0.52)
    assert (on_its_way["proof_position"], on_its_way["proof_mass_kg"]) == (None, None)
    for secret in ("1.02", "0.611", "drn_", "prv_"):
        assert secret not in answer.text


async def test_a_change_is_shown_although_the_page_was_read_a_moment_ago(
    gateway: Gateway,
) -> None:
    delivery_id, path = await requested(gateway)
    first = await gateway.http.get(f"{path}/state")
    shown = (DeliveryId(delivery_id), path.rpartition("/")[2])
    assert await gateway.parts.pages.may_follow(shown)  # as an open stream asks

    await gateway.http.post(
        f"/v1/deliveries/{delivery_id}/cancel", headers=gateway.customer, json={}
    )
    second = await gateway.http.get(f"{path}/state")

    assert (first.json()["state"], second.json()["state"]) == ("REQUESTED", "CANCELLED")


async def test_a_link_that_was_guessed_is_not_found(gateway: Gateway) -> None:
    delivery_id, path = await requested(gateway)
    other_id, other = await requested(gateway)
    token = path.rpartition("/")[2]

    for wrong in (
        f"/track/{delivery_id}/{token[:-1]}{'y' if token.endswith('x') else 'x'}",
        f"/track/{delivery_id}/",
        f"/track/{other_id}/{token}",
        f"/track/dlv_absent/{token}",
        f"/track/{delivery_id}/%C3%A9",
    ):
        assert await status(gateway, wrong) == 404, wrong
    assert await status(gateway, other) == 200


async def test_guesses_are_paid_by_their_address(
    gateway: Gateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gateway.parts.meters.addresses, "_now", lambda: 0.0)  # nothing refills
    delivery_id, _ = await requested(gateway)

    answers = [await gateway.http.get(f"/track/{delivery_id}/guess{number}") for number in range(3)]

    left = [int(answer.headers["ratelimit-remaining"]) for answer in answers]
    assert left[0] - left[1] == 11


async def test_a_renewed_link_ends_the_earlier_one(gateway: Gateway) -> None:
    delivery_id, path = await requested(gateway)

    renewed = await gateway.http.post(link(delivery_id), headers=gateway.customer)

    assert renewed.status_code == 201
    new_path = path_of(renewed.json()["tracking_url"])
    assert new_path != path
    assert await status(gateway, path) == 404
    assert await status(gateway, new_path) == 200
    shown = await gateway.http.get(link(delivery_id), headers=gateway.customer)
    assert path_of(shown.json()["tracking_url"]) == new_path


async def test_a_withdrawn_link_ends_until_it_is_renewed(gateway: Gateway) -> None:
    delivery_id, path = await requested(gateway)

    withdrawn = await gateway.http.delete(link(delivery_id), headers=gateway.customer)
    again = await gateway.http.delete(link(delivery_id), headers=gateway.customer)

    assert (withdrawn.status_code, again.status_code) == (204, 204)
    assert await status(gateway, path) == 404
    shown = await gateway.http.get(link(delivery_id), headers=gateway.customer)
    assert shown.json() == {"tracking_url": None}
    renewed = await gateway.http.post(link(delivery_id), headers=gateway.customer)
    assert path_of(renewed.json()["tracking_url"]) != path
    assert await status(gateway, path_of(renewed.json()["tracking_url"])) == 200
    assert await status(gateway, path) == 404


async def test_no_earlier_link_comes_back_when_a_link_is_renewed_or_withdrawn_again(
    gateway: Gateway,
) -> None:
    delivery_id, path = await requested(gateway)
    paths = [path]
    for is_withdrawn in (False, False, True, True):
        if is_withdrawn:
            await gateway.http.delete(link(delivery_id), headers=gateway.customer)
        renewed = await gateway.http.post(link(delivery_id), headers=gateway.customer)
        paths.append(path_of(renewed.json()["tracking_url"]))

    assert len(set(paths)) == 5
    assert [await status(gateway, each) for each in paths] == [404] * 4 + [200]


async def test_an_open_page_may_not_be_followed_after_its_link_was_withdrawn(
    gateway: Gateway,
) -> None:
    delivery_id, path = await requested(gateway)
    shown = (DeliveryId(delivery_id), path.rpartition("/")[2])
    assert await gateway.parts.pages.may_follow(shown)

    await gateway.http.delete(link(delivery_id), headers=gateway.customer)
    gateway.clock.advance(timedelta(seconds=1))

    assert not await gateway.parts.pages.may_follow(shown)


async def test_the_page_shows_only_drones_that_carry_its_packages(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    shown = await gateway.http.get(link(delivery_id), headers=gateway.customer)
    path = path_of(shown.json()["tracking_url"])
    drone = {"provider_id": "prv_1", "drone_id": "drn_1", "position": (-98.05, 29.65)}
    missions = tuple(
        TrackedMission(mission_id=each, steps=(), position_at=None, soc=0.7, **drone)
        for each in (f"msn_{delivery_id[4:]}_1", "msn_other")
    )
    names = {StationId("mcqueeney"): "McQueeney"}
    gateway.composition.tracks[delivery_id] = Track(missions=missions, station_names=names)

    async def drones() -> Any:
        gateway.clock.advance(timedelta(seconds=2))
        return (await gateway.http.get(f"{path}/state")).json()["drones"]

    assert await drones() == []
    for seq, kind in enumerate(("ACCEPTED", "LOADING", "LOADED"), start=1):
        await gateway.report(delivery_id, kind, seq=seq)
    assert await drones() == [{"position": [-98.05, 29.65], "at": None}]
    assert (await gateway.http.get(f"{path}/state")).json()["station_names"] == names


async def test_the_way_begins_where_the_packages_are_loaded(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    shown = await gateway.http.get(link(delivery_id), headers=gateway.customer)
    path = path_of(shown.json()["tracking_url"])
    home, pickup, end = Position(-98.2, 29.5), Position(-98.1, 29.6), Position(-98.0, 29.7)
    began_at = gateway.clock.now()
    steps = tuple(
        TrackedStep(
            kind=kind,
            status="PLANNED",
            from_position=start,
            to_position=stop,
            station_id=StationId("mcqueeney"),
            start_at=began_at,
            end_at=began_at + timedelta(seconds=60 * number),
        )
        for number, (kind, start, stop) in enumerate(
            (("FLY", home, pickup), ("PICK_UP", pickup, pickup), ("FLY", pickup, end)), start=1
        )
    )
    mission = TrackedMission(
        mission_id=f"msn_{delivery_id[4:]}_1",
        provider_id="prv_1",
        drone_id="drn_1",
        steps=steps,
        position=None,
        position_at=None,
        soc=None,
    )
    gateway.composition.tracks[delivery_id] = Track(missions=(mission,))

    gateway.clock.advance(timedelta(seconds=2))
    state = (await gateway.http.get(f"{path}/state")).json()

    [flight] = state["flights"]
    assert (flight["from_position"], flight["to_position"]) == ([-98.1, 29.6], [-98.0, 29.7])
    loaded_at = datetime.fromisoformat(state["loaded_at"])
    assert loaded_at == began_at + timedelta(seconds=120)
    assert datetime.fromisoformat(state["requested_at"]) <= began_at


@pytest.mark.parametrize("method", ["GET", "POST", "DELETE"])
async def test_the_link_of_another_customer_does_not_exist(gateway: Gateway, method: str) -> None:
    delivery_id, path = await requested(gateway)

    answer = await gateway.http.request(method, link(delivery_id), headers=gateway.other)

    assert answer.status_code == 404
    assert await status(gateway, path) == 200


async def test_a_link_ends_a_day_after_its_delivery(gateway: Gateway) -> None:
    delivery_id, path = await requested(gateway)
    await gateway.http.post(
        f"/v1/deliveries/{delivery_id}/cancel", headers=gateway.customer, json={}
    )
    assert (await gateway.get(delivery_id))["state"] == "CANCELLED"

    gateway.clock.advance(timedelta(hours=23, minutes=59))
    assert await status(gateway, path) == 200
    gateway.clock.advance(timedelta(minutes=1))
    assert await status(gateway, path) == 404


async def test_the_way_home_does_not_make_a_link_last_longer(gateway: Gateway) -> None:
    delivery_id, path = await requested(gateway)
    while await gateway.book_next():
        pass
    for seq, kind in enumerate(("ACCEPTED", "LOADING", "LOADED", "ACTIVITY"), start=1):
        await gateway.report(delivery_id, kind, seq=seq)
    await gateway.report(delivery_id, "DELIVERED", seq=5, package_ids=["p1", "p2"])
    assert (await gateway.get(delivery_id))["state"] == "COMPLETED"

    gateway.clock.advance(timedelta(hours=23, minutes=59))
    await gateway.report(delivery_id, "ACTIVITY", seq=6, activity="FLYING")
    assert await status(gateway, path) == 200
    gateway.clock.advance(timedelta(minutes=1))
    assert await status(gateway, path) == 404


async def test_a_delivery_has_few_followers(gateway: Gateway) -> None:
    delivery_id, path = await requested(gateway)
    slots = gateway.parts.followers

    with slots.held(delivery_id):
        assert slots.used(delivery_id) == 1
    replace_part(gateway, "followers", type(slots)("FOLLOWERS", 0))
    refused = await gateway.http.get(f"{path}/events")

    assert (refused.status_code, refused.json()["code"]) == (429, "FOLLOWERS")


async def test_a_link_that_is_asked_often_does_not_keep_composition_busy(
    gateway: Gateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    delivery_id, path = await requested(gateway)
    while await gateway.book_next():
        pass
    asked: list[str] = []
    track = gateway.composition.track

    async def counted(of_delivery: str) -> Track:
        asked.append(of_delivery)
        return await track(of_delivery)

    monkeypatch.setattr(gateway.composition, "track", counted)

    for _ in range(5):
        assert (await gateway.http.get(f"{path}/state")).status_code == 200
    assert asked == [delivery_id]

    gateway.clock.advance(timedelta(seconds=1))
    await gateway.http.post(f"/v1/deliveries/{delivery_id}/cancel", headers=gateway.customer)
    assert (await gateway.http.get(f"{path}/state")).status_code == 200
    assert asked == [delivery_id] * 2


async def test_a_page_that_cannot_be_shown_leaves_no_token_in_the_log(
    gateway: Gateway, caplog: pytest.LogCaptureFixture
) -> None:
    delivery_id, path = await requested(gateway)
    await gateway.execute("ALTER TABLE packages RENAME TO elsewhere")

    assert (await gateway.http.get(f"{path}/state")).status_code == 500
    await gateway.execute("ALTER TABLE elsewhere RENAME TO packages")

    logged = [str(vars(record)) for record in caplog.records] + [caplog.text]
    assert any(f"/track/{delivery_id}/{{token}}/state" in each for each in logged)
    assert not [each for each in logged if path.rpartition("/")[2] in each]
