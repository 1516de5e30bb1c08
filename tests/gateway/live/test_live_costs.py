"""What the live picture costs: nobody makes the gateway look at more than its own items."""

from collections.abc import AsyncIterator
from contextlib import AsyncExitStack

import pytest
from skyway_gateway.live.feed import VIEW_COST, LiveFeed
from skyway_gateway.live.picture import FLEETS, Item, Key, Picture, Readers
from skyway_gateway.live.routes import pay
from skyway_gateway.live.scope import Scope
from skyway_gateway.live.viewer_frames import SNAPSHOT_COST, ViewerFrames

from skyway.runtime.errors import BudgetSpent
from skyway.runtime.http.identity import Caller, CallerRole
from skyway.runtime.limits import Budget, Meter
from tests.gateway.access.test_quotas import quotas
from tests.gateway.live.merged import event_of
from tests.gateway.whole_gateway import Gateway

_ROGUE = Caller("provider", "rogue")
_ROLES: tuple[CallerRole, ...] = ("customer", "provider")


def part(role: CallerRole, number: int = 0, subject_id: str = "rogue") -> Scope:
    """Another part of the picture for each number."""
    return Scope.of(Caller(role, subject_id), kinds=None, bbox=f"{number},0,90,10")


@pytest.fixture
async def opened() -> AsyncIterator[AsyncExitStack]:
    async with AsyncExitStack() as stack:
        yield stack


@pytest.fixture
def feed() -> LiveFeed:
    """A feed of an empty picture that is complete."""
    feed = LiveFeed((), most_views=3)
    feed._is_complete.set()
    return feed


def drone(number: int, value: int) -> tuple[Key, Item]:
    readers = Readers(operators=True, provider_id="prv_honest")
    return Key("drones", f"drn_{number}"), Item({"value": value}, readers)


@pytest.mark.parametrize("role", _ROLES)
def test_items_of_others_are_not_looked_at(role: CallerRole) -> None:
    picture, scope = Picture(), part(role)
    picture.put(drone(number, 0) for number in range(100))
    picture.put([(Key("services", "registry"), Item({"is_answering": True}, FLEETS))])
    first = picture.tick()
    picture.put(drone(number, 1) for number in range(100))
    second = picture.tick()

    assert first is not None
    assert second is not None
    assert len(scope.changes_in(first)) == len(scope.part_of(picture)) == (role == "provider")
    assert scope.changes_in(second) == []


def test_an_item_that_several_groups_see_is_one_change() -> None:
    picture = Picture()
    own = Readers(all_providers=True, provider_id="rogue")
    picture.put([(Key("alarms", "alm_1"), Item({}, own))])
    tick = picture.tick()

    assert tick is not None
    assert len(part("provider").changes_in(tick)) == 1


@pytest.mark.parametrize("role", _ROLES)
async def test_a_tenant_looks_at_a_few_parts_together(
    feed: LiveFeed, opened: AsyncExitStack, role: CallerRole
) -> None:
    for number in range(3):
        await opened.enter_async_context(feed.viewing(part(role, number)))

    with pytest.raises(BudgetSpent) as refused:
        await opened.enter_async_context(feed.viewing(part(role, 3)))
    await opened.enter_async_context(feed.viewing(part(role, 2)))
    await opened.enter_async_context(feed.viewing(part(role, 3, "honest")))

    assert refused.value.code == "LIVE_VIEWS"
    assert len(feed.views_of(role, "rogue")) == 3


async def test_a_part_that_was_left_makes_room_for_another(feed: LiveFeed) -> None:
    for number in range(10):
        async with feed.viewing(part("customer", number)):
            pass

    assert feed.views_of("customer", "rogue") == [part("customer", number) for number in (7, 8, 9)]


async def test_operators_look_at_any_number_of_parts(
    feed: LiveFeed, opened: AsyncExitStack
) -> None:
    for number in range(10):
        await opened.enter_async_context(feed.viewing(part("operator", number)))

    assert feed.viewers == 10


async def test_only_what_is_made_anew_is_paid(feed: LiveFeed, opened: AsyncExitStack) -> None:
    paid: list[float] = []

    async def follow(role: CallerRole, number: int, last_seen: tuple[str, int] | None) -> None:
        frames = ViewerFrames(feed, last_seen, _may_read, pay=paid.append)
        await opened.enter_async_context(frames.opened(part(role, number)))

    await follow("provider", 0, None)
    assert paid == [VIEW_COST, SNAPSHOT_COST]
    await follow("provider", 0, None)
    await follow("provider", 0, (feed.epoch, 0))
    assert paid == [VIEW_COST, SNAPSHOT_COST]
    await follow("provider", 1, None)
    assert paid == [VIEW_COST, SNAPSHOT_COST] * 2


async def test_a_large_snapshot_costs_more_and_is_sent_in_parts(
    feed: LiveFeed, opened: AsyncExitStack
) -> None:
    """A viewer that does not read must not keep a copy of the whole snapshot in memory."""
    paid: list[float] = []
    feed.picture.put(
        (Key("drones", f"drn_{number}"), Item({"text": "x" * 400}, FLEETS)) for number in range(500)
    )
    feed.picture.tick()
    frames = ViewerFrames(feed, None, _may_read, pay=paid.append)
    events = await opened.enter_async_context(
        frames.opened(Scope.of(_ROGUE, kinds=None, bbox=None))
    )

    parts = [await anext(events)]
    while not parts[-1].endswith(b"\n\n"):
        parts.append(await anext(events))

    assert paid == [VIEW_COST, SNAPSHOT_COST + 5]
    assert max(map(len, parts)) == 64 * 1024
    assert event_of(b"".join(parts))[1] == "snapshot"


async def _may_read() -> bool:
    return True


@pytest.mark.parametrize("caller", ["customer", "provider"])
async def test_a_viewer_without_a_budget_is_refused_before_a_view_is_made(
    gateway: Gateway, caller: str
) -> None:
    feed = gateway.parts.live
    feed._is_complete.set()
    meters = gateway.parts.meters
    # Enough for the request itself, and not for the view.
    object.__setattr__(meters, "tenants", Meter(Budget("TENANT_REQUESTS", 0.001, 10)))
    for _ in range(6):
        await gateway.http.get("/v1/clock", headers=getattr(gateway, caller))

    answer = await gateway.http.get("/v1/live", headers=getattr(gateway, caller))

    assert (answer.status_code, answer.json()["code"]) == (429, "TENANT_REQUESTS")
    assert "Retry-After" in answer.headers
    assert feed.viewers == 0


def test_the_costs_are_half_of_a_budget_at_most_and_operators_pay_nothing() -> None:
    meter = Meter(Budget("TENANT_REQUESTS", 0.001, 100))

    pay(meter, Caller("provider", "rogue"), 1_000.0)
    pay(meter, Caller("operator", "op"), 1_000.0)

    assert meter.read("provider:rogue").left == 50
    assert meter.read("operator:op").left == 100


@pytest.mark.parametrize(
    ("caller", "codes"),
    [
        ("customer", {"STREAMS", "LIVE_VIEWS"}),
        ("provider", {"STREAMS", "LIVE_VIEWS"}),
        ("operator", {"STREAMS"}),
    ],
)
async def test_each_sees_its_limits(gateway: Gateway, caller: str, codes: set[str]) -> None:
    shown = await quotas(gateway, getattr(gateway, caller))

    assert shown.keys() & {"STREAMS", "LIVE_VIEWS"} == codes
    assert all(shown[code][1] == 0 for code in codes)
