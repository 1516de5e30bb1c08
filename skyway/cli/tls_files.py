"""What the broker's TLS listener for drones reads, in a deployment that signs certificates."""

import os
from urllib.parse import urlsplit

from skyway.cli.data_folder import DataFolder
from skyway.runtime.mqtt.mosquitto import TlsFiles

#: Where drones meet Mosquitto over TLS when no setting says.
_TLS_PORT = 8883


def made_tls_files(folder: DataFolder) -> TlsFiles | None:
    """The files; None when the deployment has no authority."""
    files = tls_files(folder)
    return files if files.certificate_file.exists() else None


def tls_files(folder: DataFolder) -> TlsFiles:
    """Where the files are, made or not."""
    broker = folder.broker.resolve()
    return TlsFiles(
        port=urlsplit(os.environ.get("SKYWAY_MQTT_TLS_URL", "")).port or _TLS_PORT,
        ca_file=broker / "ca.pem",
        certificate_file=broker / "server.pem",
        key_file=broker / "server-key.pem",
    )
