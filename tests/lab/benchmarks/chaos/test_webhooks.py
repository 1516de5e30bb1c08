"""The server of a chaos run keeps only what was sent to the customers of this run."""

from http import HTTPStatus

import aiohttp
from skyway_lab.benchmarks.chaos.webhooks import WebhookServer


async def test_who_notifies_the_last_owner_of_the_port_is_answered_404() -> None:
    async with WebhookServer() as before:
        old_path = before.path_of("shop-1")
    async with WebhookServer() as webhooks, aiohttp.ClientSession() as client:
        host, port = webhooks.address
        for path in (old_path, "/shop-1", "/skyway"):
            async with client.post(f"http://{host}:{port}{path}", data=b"{}") as answer:
                assert answer.status == HTTPStatus.NOT_FOUND

    assert webhooks.received == {}
