"""A notification goes to an address that was checked, and nowhere else."""

import asyncio
from collections.abc import AsyncIterator, Sequence
from ipaddress import ip_network

import pytest
from skyway_gateway.notifications import post_webhook
from skyway_gateway.notifications.post_webhook import (
    ForbiddenTarget,
    Reply,
    Targets,
    WebhookPost,
)

from skyway.ids import SubjectId
from tests.gateway.notifications.receiver import Receiver, receiving

ALICE = SubjectId("alice")


@pytest.fixture
async def receiver() -> AsyncIterator[Receiver]:
    async with receiving() as opened:
        yield opened


async def send(receiver: Receiver, *addresses: str) -> Reply:
    """Post to a name that only our own check resolves, to these addresses."""

    async def resolve(_host: str, _port: int, _customer_id: SubjectId) -> Sequence[str]:
        return addresses

    targets = Targets(allowed=(ip_network("127.0.0.0/8"),), resolve=resolve)
    async with WebhookPost(targets) as post:
        url = f"http://hooks.invalid:{receiver.port}/in"
        return await post.send(url, ALICE, headers={}, body=b"{}")


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


async def test_an_attempt_ends_although_the_name_is_never_resolved(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(post_webhook, "_TIMEOUT_S", 0.05)

    async def resolve(_host: str, _port: int, _customer_id: SubjectId) -> Sequence[str]:
        await asyncio.Event().wait()
        return ()

    async with WebhookPost(Targets(resolve=resolve)) as post, asyncio.timeout(60):
        reply = await post.send("http://hooks.invalid/in", ALICE, headers={}, body=b"{}")

    assert reply == Reply(None, "no answer within 0 s")


PUBLIC = "93.184.216.34"


def _resolving_to(*addresses: str) -> Targets:
    async def resolve(_host: str, _port: int, _customer_id: SubjectId) -> Sequence[str]:
        return addresses

    return Targets(resolve=resolve)


@pytest.mark.parametrize(
    "url",
    [
        "ftp://example.com/",
        "file:///etc/passwd",
        "gopher://example.com/",
        "example.com",
        "//example.com",
        "http://",
        "http:///path",
        "",
        "http://user:secret@example.com/",
        "http://example.com:0/",
        "http://example.com:99999/",
        "http://[::1",
        "http://xn--/",
    ],
)
async def test_only_plain_http_urls_are_allowed(url: str) -> None:
    with pytest.raises(ForbiddenTarget):
        await _resolving_to(PUBLIC).check(url, ALICE)


@pytest.mark.parametrize(
    "url",
    [
        "http://127.0.0.1/",
        "http://127.1/",
        "http://2130706433/",
        "http://0x7f000001/",
        "http://0177.0.0.1/",
        "http://0/",
        "http://0.0.0.0/",
        "http://localhost/",
        "http://[::1]/",
        "http://[::]/",
        "http://[::ffff:127.0.0.1]/",
        "http://[::ffff:7f00:1]/",
        "http://[64:ff9b::7f00:1]/",
        "http://169.254.169.254/latest/meta-data/",
        "http://10.0.0.1/",
        "http://example.com@127.0.0.1/",
    ],
)
async def test_literal_addresses_of_our_own_network_are_refused(url: str) -> None:
    """Uses the system's resolver, which accepts all these forms of 127.0.0.1."""
    with pytest.raises(ForbiddenTarget):
        await Targets().check(url, ALICE)


@pytest.mark.parametrize(
    "address",
    [
        "10.1.2.3",
        "172.16.0.1",
        "192.168.1.1",
        "100.64.0.1",
        "169.254.1.1",
        "127.0.0.53",
        "0.0.0.0",
        "224.0.0.1",
        "240.0.0.1",
        "255.255.255.255",
        "192.0.2.1",
        "192.0.0.8",
        "192.0.0.9",
        "192.88.99.1",
        "3fff::1",
        "3fff:fff::1",
        "5f00::1",
        "::ffff:192.0.0.9",
        "::",
        "::1",
        "fe80::1%eth0",
        "fc00::1",
        "fec0::1",
        "ff02::1",
        "2001:db8::1",
        "::ffff:10.0.0.1",
        "::10.0.0.1",
        "2002:0a00:0001::1",
        "2001:0:0a00:1::1",
        "64:ff9b::808:808",
        "64:ff9b:1::1",
    ],
)
async def test_a_name_with_a_private_address_is_refused(address: str) -> None:
    with pytest.raises(ForbiddenTarget):
        await _resolving_to(address).check("https://hooks.example.com/", ALICE)
    with pytest.raises(ForbiddenTarget):
        await _resolving_to(PUBLIC, address).check("https://hooks.example.com/", ALICE)


async def test_a_name_without_an_address_is_refused() -> None:
    with pytest.raises(ForbiddenTarget, match="has no address"):
        await _resolving_to().check("https://hooks.example.com/", ALICE)


@pytest.mark.parametrize("address", [PUBLIC, "2606:2800:220:1::1", "::ffff:93.184.216.34"])
async def test_a_public_address_is_allowed(address: str) -> None:
    target = await _resolving_to(address).check("https://hooks.example.com:8443/in?x=1", ALICE)
    assert [str(one) for one in target.addresses] == [
        address.replace("93.184.216.34", "5db8:d822")
        if ":" in address and "." in address
        else address
    ]
    assert target.url.port == 8443


async def test_only_the_allowed_private_network_is_allowed() -> None:
    targets = Targets(allowed=(ip_network("127.0.0.0/8"),))
    target = await targets.check("http://127.0.0.1:9000/in", ALICE)
    assert [str(one) for one in target.addresses] == ["127.0.0.1"]
    assert await targets.check("http://[::ffff:127.0.0.1]/", ALICE)
    for url in ("http://10.0.0.1/", "http://[::1]/"):
        with pytest.raises(ForbiddenTarget):
            await targets.check(url, ALICE)


@pytest.mark.parametrize("address", ["64:ff9b::7f00:1", "64:ff9b::808:808", "64:ff9b:1::1"])
async def test_an_address_that_nat64_translates_is_refused_although_its_network_is_allowed(
    address: str,
) -> None:
    async def resolve(_host: str, _port: int, _customer_id: SubjectId) -> Sequence[str]:
        return [address]

    targets = Targets(allowed=(ip_network("::/0"),), resolve=resolve)

    with pytest.raises(ForbiddenTarget):
        await targets.check("https://hooks.example.com/", ALICE)
