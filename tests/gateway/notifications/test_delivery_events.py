"""Streams of events: immediately from this process, soon from another one."""

import asyncio

from skyway_gateway.notifications.delivery_events import EventListeners, EventStream

from tests.gateway.whole_gateway import Gateway


async def always() -> bool:
    return True


async def test_a_new_event_wakes_the_stream_immediately(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted()
    stream = EventStream(gateway.parts.db, gateway.parts.listeners, poll_s=3600, heartbeat_s=3600)
    frames = stream.frames(delivery_id, after=0, may_read=always)
    assert (await anext(frames)).startswith("id: 1\nevent: delivery.requested\n")
    waiting = asyncio.ensure_future(anext(frames))
    await gateway.book_next()
    assert (await waiting).startswith("id: 2\nevent: delivery.planned\n")
    await frames.aclose()


async def test_a_stream_finds_events_of_another_replica_in_the_table(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted()
    deaf = EventStream(gateway.parts.db, EventListeners(), poll_s=0.01, heartbeat_s=3600)
    frames = deaf.frames(delivery_id, after=1, may_read=always)
    waiting = asyncio.ensure_future(anext(frames))
    await gateway.book_next()
    assert (await waiting).startswith("id: 2\n")
    await frames.aclose()


async def test_a_silent_stream_sends_comments(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted()
    stream = EventStream(gateway.parts.db, gateway.parts.listeners, poll_s=0.001, heartbeat_s=0)
    frames = stream.frames(delivery_id, after=1, may_read=always)
    assert (await anext(frames)).startswith(":")
    await frames.aclose()


async def test_a_client_that_disconnects_is_no_longer_a_listener(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted()
    stream = EventStream(gateway.parts.db, gateway.parts.listeners, poll_s=3600)
    frames = stream.frames(delivery_id, after=0, may_read=always)
    await anext(frames)
    waiting = asyncio.ensure_future(anext(frames))
    await asyncio.sleep(0)
    assert gateway.parts.listeners.listener_count == 1
    waiting.cancel()
    await asyncio.gather(waiting, return_exceptions=True)
    assert gateway.parts.listeners.listener_count == 0


async def test_a_stream_ends_when_its_key_is_deleted(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted()
    is_known = True

    async def may_read() -> bool:
        return is_known

    stream = EventStream(gateway.parts.db, gateway.parts.listeners, poll_s=3600, check_s=0.001)
    frames = stream.frames(delivery_id, after=0, may_read=may_read)
    await anext(frames)
    waiting = asyncio.ensure_future(anext(frames, None))
    await asyncio.sleep(0)
    is_known = False

    assert await waiting is None
    assert gateway.parts.listeners.listener_count == 0
