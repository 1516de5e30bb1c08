"""A notification goes to an address that was checked, and nowhere else."""

from collections.abc import AsyncIterator, Sequence
from ipaddress import ip_network

import pytest
from skyway_gateway.notifications.webhooks.post_webhook import Reply, WebhookPost
from skyway_gateway.notifications.webhooks.targets import Targets

from tests.gateway.notifications.webhooks.receiver import Receiver, receiving


@pytest.fixture
async def receiver() -> AsyncIterator[Receiver]:
    async with receiving() as opened:
        yield opened


async def send(receiver: Receiver, *addresses: str) -> Reply:
    """Post to a name that only our own check resolves, to these addresses."""

    async def resolve(_host: str, _port: int) -> Sequence[str]:
        return addresses

    targets = Targets(allowed=(ip_network("127.0.0.0/8"),), resolve=resolve)
    async with WebhookPost(targets) as post:
        return await post.send(f"http://hooks.invalid:{receiver.port}/in", headers={}, body=b"{}")


async def test_a_name_is_not_resolved_again_after_the_check(receiver: Receiver) -> None:
    reply = await send(receiver, "127.0.0.1")

    assert reply == Reply(204, None)
    [(headers, _)] = receiver.received
    assert headers["host"] == f"hooks.invalid:{receiver.port}"


async def test_the_next_address_is_tried_when_nobody_listens_at_the_first(
    receiver: Receiver,
) -> None:
    assert await send(receiver, "127.0.0.2", "127.0.0.1") == Reply(204, None)


async def test_a_notification_goes_through_no_proxy(
    receiver: Receiver, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("HTTP_PROXY", "ALL_PROXY"):
        monkeypatch.setenv(name, "http://127.0.0.1:9")

    assert await send(receiver, "127.0.0.1") == Reply(204, None)
