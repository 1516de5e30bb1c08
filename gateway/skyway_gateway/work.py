"""The loops that run beside the gateway's REST answers.

Each replica does the work that it was woken for: it sends what it has written, and books what it
has accepted. Only the leader runs the sweeps, which look for rows from time to time, and finds work
that other replicas left. Bookings are found by all replicas, in turn.
"""

from collections.abc import Awaitable, Callable
from typing import Final, Never

from skyway.contracts.topics import CONNECTION
from skyway.runtime.loops import Loops, always, repeat
from skyway.runtime.minting import mint
from skyway.runtime.mqtt.client import MqttClient
from skyway.runtime.outbox.senders import MqttSender, ReportSender
from skyway.runtime.outbox.stream_sender import unhurried_pace
from skyway.runtime.replicas.membership import LeaderStep, Membership, PollsInTurn
from skyway_gateway.clients import DeliveryReports
from skyway_gateway.ledger.close_months import MonthClosing
from skyway_gateway.live.figures import LiveFigures
from skyway_gateway.notifications.fleet_time import CLOCK_EVERY_S, publish_clock
from skyway_gateway.notifications.seal_secrets import seal_secrets
from skyway_gateway.parts import Parts
from skyway_gateway.retention.pruning import start_pruning
from skyway_gateway.settings import GatewaySettings

#: Seconds of wall time between two steps of a loop that nothing has woken.
_ACCOUNTS_EVERY_S: Final = 10.0
_KEYS_EVERY_S: Final = 0.5
_REFUSED_EVERY_S: Final = 10.0
_SEAL_EVERY_S: Final = 600.0
_OVERDUE_EVERY_S: Final = 1.0
_SCHEDULED_EVERY_S: Final = 0.5
_WAKES_EVERY_S: Final = 0.5
_LATENESS_EVERY_S: Final = 5.0
_MONTHS_EVERY_S: Final = 10.0
_SANDBOX_EVERY_S: Final = 0.25


def start_work(loops: Loops, parts: Parts, mqtt: MqttClient, settings: GatewaySettings) -> None:
    """Start all loops."""
    membership = parts.membership
    membership.start(loops)
    loops.start("listening", _notice_lost_connections(mqtt, membership))
    _start_sending(loops, parts, mqtt)
    loops.start("networks", parts.networks.run(mqtt))
    booking = parts.booking.run(parts.booker, polls=PollsInTurn(membership))
    loops.start("booking", booking)
    waker = parts.waker
    loops.start("connections", waker.follow(mqtt.batches(CONNECTION)))
    wakes = repeat(
        "wakes",
        waker.step,
        every_s=_WAKES_EVERY_S,
        wake=waker.noted,
        polls=PollsInTurn(membership),
    )
    loops.start("wakes", wakes)
    loops.start("live", parts.live.run())
    figures = LiveFigures(parts.live, parts.all_clients, parts.gauges)
    loops.start("live figures", figures.run())
    refused = parts.refused_logins
    logins = repeat("refused keys", refused.write, every_s=_REFUSED_EVERY_S, wake=refused.wake)
    loops.start("refused keys", logins)
    # Each replica forecasts for the deliveries that it books.
    lateness = repeat(
        "lateness", parts.forecast.step, every_s=_LATENESS_EVERY_S, polls=membership.looks
    )
    loops.start("lateness", lateness)
    _start_leading(loops, parts, mqtt)
    start_pruning(
        loops,
        parts.db,
        parts.clock,
        composition=parts.flown_by,
        claimant=parts.booking.claimant,
        settings=settings,
        photos=parts.photos,
        led=lambda step: LeaderStep(membership, step),
    )


def _start_sending(loops: Loops, parts: Parts, mqtt: MqttClient) -> None:
    """Start the loops that send the messages of the outbox, and notify webhooks."""
    polls = parts.membership.polls
    messages = MqttSender(parts.db, mqtt, parts.clock, pace=unhurried_pace(), polls=polls)
    loops.start("messages", messages.run())
    receivers = {"composition": DeliveryReports(parts.servers, parts.find)}
    reports = ReportSender(parts.db, receivers, parts.clock, polls=polls)
    loops.start("reports", reports.run())
    loops.start("webhooks", parts.sender.run(polls=polls))


def _start_leading(loops: Loops, parts: Parts, mqtt: MqttClient) -> None:
    """Start the sweeps, which only the leader runs, for all replicas."""

    async def repeat_clock() -> bool:
        if mqtt.is_connected:
            await publish_clock(mqtt, parts.anchor, mint)
        return False

    async def seal_old_secrets() -> bool:
        await seal_secrets(parts.db, parts.vault, at=parts.clock.wall_now())
        return False

    def sweep(
        name: str,
        step: Callable[[], Awaitable[bool]],
        every_s: float,
        looks: Callable[[], bool] = parts.membership.looks,
    ) -> None:
        led = LeaderStep(parts.membership, step)
        loops.start(name, repeat(name, led, every_s=every_s, polls=looks))

    keys = parts.keys
    # The replica that ends a key is woken for the account of the key, so it closes the account.
    accounts = repeat(
        "accounts",
        keys.close_orphaned_accounts,
        every_s=_ACCOUNTS_EVERY_S,
        wake=keys.wake,
        polls=parts.membership.polls,
    )
    loops.start("accounts", accounts)
    closing = MonthClosing(parts.db, parts.clock, mint, parts.sender.wake)
    sweep("clock", repeat_clock, CLOCK_EVERY_S, always)
    sweep("keys", keys.end_expired_keys, _KEYS_EVERY_S)
    sweep("overdue", parts.overdue_notifier.step, _OVERDUE_EVERY_S)
    sweep("scheduled", parts.schedule_opener.step, _SCHEDULED_EVERY_S)
    sweep("sandbox", parts.player.step, _SANDBOX_EVERY_S)
    sweep("months", closing.step, _MONTHS_EVERY_S)
    sweep("secrets", seal_old_secrets, _SEAL_EVERY_S, always)


async def _notice_lost_connections(mqtt: MqttClient, membership: Membership) -> Never:
    """Let another replica lead while this one is not connected to the broker."""
    while True:
        await mqtt.wait_connected()
        await mqtt.wait_lost()
        membership.set_listening(False)
