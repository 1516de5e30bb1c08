"""What Mosquitto reads: its configuration and rules, beside the passwords of the registry."""

import getpass
import os
from urllib.parse import urlsplit

from skyway.cli.data_folder import DataFolder
from skyway.cli.tls_files import made_tls_files
from skyway.contracts.broker_rules import BrokerRules
from skyway.runtime.mqtt.mosquitto import mosquitto_conf

#: Where drones and customers, and where services meet Mosquitto when no setting says.
_DRONE_PORT = 1883
_SERVICE_PORT = 1884


def write_mosquitto_files(folder: DataFolder, *, host: str = "127.0.0.1") -> None:
    """Write the files with which ``mosquitto -c`` serves this system.

    The ports are those of `SKYWAY_MQTT_DRONE_URL`, for services `SKYWAY_MQTT_URL`, and, where the
    deployment has an authority for drones, `SKYWAY_MQTT_TLS_URL`.
    """
    acl_file = folder.broker / "acl"
    acl_file.write_text(BrokerRules().mosquitto_acl())
    acl_file.chmod(0o600)
    folder.broker_passwords.touch(mode=0o600)
    configuration = mosquitto_conf(
        port=_port("SKYWAY_MQTT_DRONE_URL", _DRONE_PORT),
        service_port=_port("SKYWAY_MQTT_URL", _SERVICE_PORT),
        password_file=folder.broker_passwords.resolve(),
        acl_file=acl_file.resolve(),
        pid_file=folder.broker_pid.resolve(),
        user=getpass.getuser(),
        host=host,
        tls=made_tls_files(folder),
    )
    (folder.broker / "mosquitto.conf").write_text(configuration)


def _port(setting: str, otherwise: int) -> int:
    return urlsplit(os.environ.get(setting, "")).port or otherwise
