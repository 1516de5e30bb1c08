"""Viewers see exactly what is in their scope, from any moment on."""

import random
from typing import Any

import pytest
from skyway_gateway.live.picture import FLEETS, OPERATORS, Item, Key, Picture, Readers
from skyway_gateway.live.scope import Scope
from skyway_gateway.live.view import LOOK_EVERY_S, TooSlow, View

from skyway.errors import InvalidInput
from skyway.geo import Box
from skyway.runtime.http.identity import Caller
from tests.gateway.live.merged import event_of, shown_after

OPERATOR = Scope.of(Caller("operator", "op"), kinds=None, bbox=None)


def scope_of(role: str, bbox: str | None, kinds: str | None) -> Scope:
    subjects = {"operator": "op", "provider": "prv_1", "customer": "shop"}
    caller = Caller(role, subjects[role])  # type: ignore[arg-type]  # one of the roles
    return Scope.of(caller, kinds=kinds, bbox=bbox)


def random_item(chance: random.Random) -> Item:
    readers = chance.choice(
        (
            OPERATORS,
            FLEETS,
            Readers(operators=True, provider_id="prv_1"),
            Readers(operators=True, provider_id="prv_2"),
            Readers(customer_id="shop"),
        )
    )
    longitude, latitude = chance.uniform(-180, 180), chance.uniform(-10, 10)
    if chance.random() < 0.5:
        longitude = chance.uniform(-2, 7)
    bounds = chance.choice((None, Box.around([(longitude, latitude)])))
    return Item({"value": chance.randrange(3), "more": {"x": chance.randrange(2)}}, readers, bounds)


def seen(scope: Scope, picture: Picture) -> dict[str, dict[str, Any]]:
    """What the scope must show: judged item by item, without any stream."""
    shown: dict[str, dict[str, Any]] = {}
    for key, item in picture.every_item():
        if scope.sees(key, item):
            shown.setdefault(key.kind, {})[key.item_id] = item.document
    return shown


@pytest.mark.parametrize("kinds", [None, "drones"])
@pytest.mark.parametrize("bbox", [None, "0,0,5,5", "175,-5,-175,5"])
@pytest.mark.parametrize("role", ["operator", "provider", "customer"])
def test_a_snapshot_and_its_changes_always_show_the_present_picture(
    role: str, bbox: str | None, kinds: str | None
) -> None:
    scope = scope_of(role, bbox, kinds)
    chance = random.Random(f"{role} {bbox} {kinds}")
    picture, view = Picture(), View(scope, "abcdef01")
    view.begin(picture)
    late_frames: list[bytes] = []
    frames = [view.snapshot(picture).content]
    for look in range(60):
        keys = [
            Key(chance.choice(("drones", "alarms")), str(chance.randrange(8))) for _ in range(4)
        ]
        picture.put((key, random_item(chance)) for key in keys[:3])
        picture.remove(keys[3:])
        before = picture.number
        tick = picture.tick()
        if tick is not None:
            view.apply(tick)
        new = [frame.content for frame in view.frames_after(before)]
        frames += new
        if look == 30:
            late_frames = [view.snapshot(picture).content]
        elif look > 30:
            late_frames += new

        assert shown_after(frames) == seen(scope, picture)
    assert shown_after(late_frames) == seen(scope, picture)


def test_an_item_that_changes_back_between_two_looks_is_not_sent() -> None:
    picture = Picture()
    key, item = Key("alarms", "a"), Item({"level": "URGENT"}, OPERATORS)
    picture.put([(key, item)])
    picture.tick()

    picture.remove([key])
    picture.put([(key, item)])

    assert picture.tick() is None


def test_a_viewer_who_is_too_far_behind_is_put_out() -> None:
    picture, view = Picture(), View(OPERATOR, "abcdef01")
    view.begin(picture)
    for number in range(300):
        picture.put([(Key("alarms", "a"), Item({"number": number}, OPERATORS))])
        tick = picture.tick()
        assert tick is not None
        view.apply(tick)

    with pytest.raises(TooSlow):
        view.frames_after(0)
    assert view.frames_after(299)[0].number == 300


def test_a_viewer_may_be_a_minute_behind_if_each_look_brings_a_change() -> None:
    picture, view = Picture(), View(OPERATOR, "abcdef01")
    view.begin(picture)
    looks = round(60 / LOOK_EVERY_S)
    for number in range(looks):
        picture.put([(Key("alarms", "a"), Item({"number": number}, OPERATORS))])
        tick = picture.tick()
        assert tick is not None
        view.apply(tick)

    assert len(view.frames_after(0)) == looks
    assert view.can_resume("abcdef01", 0, latest=picture.number)


def test_a_viewer_resumes_only_in_the_same_run_and_within_what_is_kept() -> None:
    picture, view = Picture(number=7), View(OPERATOR, "abcdef01")
    view.begin(picture)

    assert view.can_resume("abcdef01", 7, latest=7)
    assert not view.can_resume("abcdef01", 6, latest=7)
    assert not view.can_resume("abcdef01", 8, latest=7)
    assert not view.can_resume("00000000", 7, latest=7)


def test_viewers_between_two_changes_share_the_bytes_of_their_snapshot() -> None:
    picture, view = Picture(), View(OPERATOR, "abcdef01")
    picture.put([(Key("alarms", "a"), Item({"level": "URGENT"}, OPERATORS))])
    picture.tick()
    view.begin(picture)

    first, second = view.snapshot(picture), view.snapshot(picture)

    assert first.content is second.content
    assert event_of(first.content) == (
        "abcdef01-1",
        "snapshot",
        {"alarms": {"a": {"level": "URGENT"}}},
    )


@pytest.mark.parametrize(
    ("kinds", "bbox", "field"),
    [
        ("drones,homes", None, "kinds"),
        ("", None, "kinds"),
        (None, "1,2,3", "bbox"),
        (None, "a,b,c,d", "bbox"),
        (None, "0,5,5,0", "bbox"),
        (None, "0,0,181,0", "bbox"),
        (None, "nan,0,1,1", "bbox"),
        (None, "inf,0,1,1", "bbox"),
    ],
)
def test_a_wrong_question_names_its_field(kinds: str | None, bbox: str | None, field: str) -> None:
    with pytest.raises(InvalidInput) as refused:
        Scope.of(Caller("operator", "op"), kinds=kinds, bbox=bbox)
    assert refused.value.field == field


def test_a_drone_sees_nothing() -> None:
    scope = Scope.of(Caller("drone", "drn_1"), kinds=None, bbox=None)

    assert not scope.sees(Key("stations", "s"), Item({}, FLEETS))
