"""The gauges of the gateway."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from skyway.ids import ProviderId
from skyway.runtime.metrics import Gauge, GaugeSource
from skyway.runtime.outbox.outbox_store import OutboxGauges
from skyway.units import moment_to_ms
from skyway_gateway import gauge_store
from skyway_gateway.gauge_store import StoredQueue
from skyway_gateway.lateness.lateness_forecast import host_delay_ms
from skyway_gateway.lateness.store import KeptPromises, kept_promises
from skyway_gateway.parts import Parts
from skyway_gateway.tables import outbox

#: The states of a delivery that is not over; each is shown, also without a delivery in it.
_STATES: Final = (
    "SCHEDULED",
    "REQUESTED",
    "PLANNED",
    "DISPATCHED",
    "LOADING",
    "IN_PROGRESS",
)

#: A week of packages is much to read, and its shares change slowly; wall seconds.
_PROMISES_KEPT_S: Final = 300.0
_PROMISED: Final = "packages with a P90 that were delivered in the last day or week of fleet time"
_IN_TIME: Final = "those of them that came by their P90"
_LAST: Final = "packages with a P90 among the last from which it is learned, by what was known"
_NO_PROMISES: Final = KeptPromises(
    None, ProviderId(""), packages={"day": 0, "week": 0}, in_time={"day": 0, "week": 0}
)


@dataclass(frozen=True, slots=True)
class GatewayGauges:
    """What stands at the gateway now."""

    parts: Parts

    def sources(self) -> tuple[GaugeSource, ...]:
        """Where the gauges come from."""
        messages = OutboxGauges(self.parts.db, outbox, ("mqtt", "composition"))
        return (
            GaugeSource("deliveries", self._deliveries),
            GaugeSource("queues", self._queues),
            GaugeSource("outbox", messages.read),
            GaugeSource("live", self._live, kept_s=0.0),
            GaugeSource("promises", self._promises, kept_s=_PROMISES_KEPT_S),
            GaugeSource("promise groups", self._groups),
        )

    async def _deliveries(self) -> list[Gauge]:
        async with self.parts.db.survey() as connection:
            by_state = await gauge_store.live_deliveries(connection)
        about = "deliveries that are not over"
        return [
            Gauge("skyway_deliveries", about, by_state.get(state, 0), {"state": state})
            for state in _STATES
        ]

    async def _queues(self) -> list[Gauge]:
        parts = self.parts
        async with parts.db.survey() as connection:
            stored = await gauge_store.stored_queues(connection)
        wall_ms, fleet_ms = moment_to_ms(parts.clock.wall_now()), moment_to_ms(parts.clock.now())
        return [
            *_stored("booking", stored.booking, now_ms=fleet_ms, rate=parts.clock.rate),
            *_stored("waiting", stored.waiting, now_ms=fleet_ms, rate=parts.clock.rate),
            *_stored("webhooks", stored.webhooks, now_ms=wall_ms),
            _depth("quotes", parts.quoting.depth),
            _depth("problems", parts.composing.depth),
            _depth("reports", parts.reporting.depth),
        ]

    async def _promises(self) -> list[Gauge]:
        async with self.parts.db.survey() as connection:
            now_ms = moment_to_ms(self.parts.clock.now())
            host_ms = host_delay_ms(self.parts.clock)
            rows = await kept_promises(connection, now_ms=now_ms, host_delay_ms=host_ms)
        readings = []
        # Before the first such package both are shown as 0, so that rules find them.
        for row in rows or [_NO_PROMISES]:
            pair = {"network": row.network_id or "", "provider": row.provider_id}
            for span, packages in row.packages.items():
                labels = {**pair, "span": span}
                in_time = row.in_time[span]
                readings.append(Gauge("skyway_promised_packages", _PROMISED, packages, labels))
                readings.append(
                    Gauge("skyway_promised_packages_in_time", _IN_TIME, in_time, labels)
                )
        return readings

    async def _groups(self) -> list[Gauge]:
        """How the P90s of the last packages were kept, by what was known of each."""
        readings = []
        for group, covered in sorted(self.parts.forecast.coverage().items(), key=str):
            labels = {
                "known_by": group.known_by or "",
                "weather": group.weather or "",
                "recharges": f"{group.recharges}",
            }
            readings.append(Gauge("skyway_p90_packages", _LAST, covered.packages, labels))
            readings.append(Gauge("skyway_p90_packages_in_time", _IN_TIME, covered.in_time, labels))
        return readings

    async def _live(self) -> list[Gauge]:
        live = self.parts.live
        readings = [Gauge("skyway_live_viewers", "viewers of the live picture", live.viewers)]
        if live.age_s is not None:
            about = "time since the live picture was read completely, while anybody looks"
            readings.append(Gauge("skyway_live_age_seconds", about, live.age_s))
        return readings


def _depth(queue: str, depth: int) -> Gauge:
    return Gauge("skyway_queue_depth", "works that wait in a queue", depth, {"queue": queue})


def _stored(queue: str, stored: StoredQueue, *, now_ms: int, rate: float = 1.0) -> Iterable[Gauge]:
    """The depth of a queue and its age in wall seconds; the clock runs at this rate."""
    age_s = 0.0 if stored.first_ms is None else (now_ms - stored.first_ms) / 1000 / rate
    about = "how long the first work of a queue has been due"
    return (
        _depth(queue, stored.depth),
        Gauge("skyway_queue_age_seconds", about, max(age_s, 0.0), {"queue": queue}),
    )
