"""Messages of the outbox for drones and services, published over MQTT."""

from typing import Any, Final, Protocol

from sqlalchemy import Row

from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.outbox.stream_sender import Retry, StreamSender, quick_pace, retry_later
from skyway.runtime.pace import Pace
from skyway.runtime.sql.database import Database

#: Seconds of wall time until a message is sent again: doubled from the first to the last.
_UNCONFIRMED_S: Final = (2.0, 30.0)
#: How long a message is claimed. Longer than the 5 s that a PUBACK may take, and short enough to
#: repeat an instruction before it expires (10 s at least) when its sender was killed.
_MQTT_LEASE_S: Final = 7.0
#: The pause after the broker was lost during a publish. `ready` waits until the broker is back.
_NO_BROKER_S: Final = 0.5


class MqttPort(Protocol):
    """What the sender needs of an MQTT client."""

    async def wait_connected(self) -> None:
        """Return once the broker has accepted us."""
        ...

    async def publish_raw(
        self, name: str, payload: bytes, *, mqtt_qos: int, retained: bool
    ) -> None:
        """Publish; for `mqtt_qos` 1 return after the PUBACK, else raise MqttUnavailable."""
        ...


class MqttSender:
    """Publishes this database's messages until the receiver or the broker confirms them."""

    def __init__(
        self, db: Database, mqtt: MqttPort, clock: FleetClock, *, pace: Pace | None = None
    ) -> None:
        self._mqtt = mqtt
        self._sender = StreamSender(
            db,
            "mqtt",
            self._publish,
            clock=clock,
            pace=pace or quick_pace(),
            lease_s=_MQTT_LEASE_S,
            ready=mqtt.wait_connected,
        )

    async def run(self) -> None:
        """Publish for ever."""
        await self._sender.run()

    async def _publish(self, row: Row[Any]) -> Retry | None:
        try:
            await self._mqtt.publish_raw(
                row.address, row.payload, mqtt_qos=row.mqtt_qos, retained=row.is_retained
            )
        except MqttUnavailable:
            return Retry(after_s=_NO_BROKER_S, attempts=row.attempts)
        if row.confirmed_by == "broker":
            return None
        # A broker's PUBACK is not delivery: the broker may lose what it has acknowledged.
        return retry_later(row, _UNCONFIRMED_S)
