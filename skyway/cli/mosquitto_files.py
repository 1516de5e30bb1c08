"""What Mosquitto reads: its configuration and rules, beside the passwords of the registry."""

import getpass
import os
from urllib.parse import urlsplit

from skyway.cli.data_folder import DataFolder
from skyway.contracts.broker_rules import BrokerRules
from skyway.runtime.mosquitto import mosquitto_conf

#: Where drones and customers meet Mosquitto when `SKYWAY_MQTT_DRONE_URL` does not say.
_DRONE_PORT = 1883


def write_mosquitto_files(folder: DataFolder, service_url: str) -> None:
    """Write the files with which ``mosquitto -c`` serves this system."""
    drone_url = os.environ.get("SKYWAY_MQTT_DRONE_URL")
    acl_file = folder.broker / "acl"
    acl_file.write_text(BrokerRules().mosquitto_acl())
    acl_file.chmod(0o600)
    folder.broker_passwords.touch(mode=0o600)
    configuration = mosquitto_conf(
        port=(urlsplit(drone_url).port if drone_url else None) or _DRONE_PORT,
        service_port=urlsplit(service_url).port or 1884,
        password_file=folder.broker_passwords.resolve(),
        acl_file=acl_file.resolve(),
        pid_file=folder.broker_pid.resolve(),
        user=getpass.getuser(),
    )
    (folder.broker / "mosquitto.conf").write_text(configuration)
