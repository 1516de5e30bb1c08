"""Reports of drones about their connections."""

from datetime import UTC, datetime

from skyway.contracts.drone_report import Connection
from skyway.contracts.topics import CONNECTION
from skyway.runtime.mqtt.inbox import Received


def connection(drone_id: str, status: str, provider_id: str = "prv_1") -> Received[Connection]:
    """A report as the gateway receives it."""
    body = {"message_id": "msg_1", "session": 1, "connection_number": 1, "status": status}
    message = Connection.model_validate(body | {"sent_at": datetime(2026, 3, 1, 12, tzinfo=UTC)})
    return Received(CONNECTION, (provider_id, drone_id), message, retained=False)
