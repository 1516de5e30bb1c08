"""Mosquitto's files: its configuration, its access rules, and its TLS files."""

import os
import pwd
from collections.abc import Sequence
from urllib.parse import urlsplit

from skyway.broker_setup.account_files import client_files, revoked_file, service_files
from skyway.broker_setup.mosquitto import TlsFiles, mosquitto_conf
from skyway.broker_setup.private_file import write_private
from skyway.cli.data_folder import DataFolder
from skyway.contracts.broker_rules import BrokerRules
from skyway.runtime.errors import InvalidSettings

#: Mosquitto's ports for drones and customers, and for services, when no setting names them.
_DRONE_PORT = 1883
_SERVICE_PORT = 1884


def write_mosquitto_files(folder: DataFolder, *, host: str = "127.0.0.1") -> None:
    """Write the files with which ``mosquitto -c`` serves this system.

    The settings `SKYWAY_MQTT_DRONE_URL`, `SKYWAY_MQTT_URL` (for services) and `SKYWAY_MQTT_TLS_URL`
    (where the deployment has an authority for drones) name the ports.
    """
    passwords = folder.broker_passwords.resolve()
    clients, services, rules = client_files(passwords), service_files(passwords), BrokerRules()
    write_private(services.acl_file, rules.service_acl())
    # The registry writes these files, with the operators and all accounts.
    if not clients.acl_file.exists():
        write_private(clients.acl_file, rules.client_acl())
    for file in (clients.password_file, services.password_file):
        if not file.exists():
            write_private(file, "")
    configuration = mosquitto_conf(
        port=_port("SKYWAY_MQTT_DRONE_URL", _DRONE_PORT),
        service_port=_port("SKYWAY_MQTT_URL", _SERVICE_PORT),
        password_file=passwords,
        pid_file=folder.broker_pid.resolve(),
        # Root must not serve the internet: Mosquitto becomes the owner of its files.
        user=folder.broker.owner(),
        host=host,
        tls=made_tls_files(folder),
    )
    (folder.broker / "mosquitto.conf").write_text(configuration)


def give_broker_files(folder: DataFolder, user: str) -> None:
    """Give the folder of the broker's files to a user, who may pass through the data folder.

    Raises
    ------
    InvalidSettings
        There is no such user, or this process is not root.
    """
    try:
        owner = pwd.getpwnam(user)
        for path in (folder.broker, *folder.broker.iterdir()):
            os.chown(path, owner.pw_uid, owner.pw_gid)
    except (KeyError, PermissionError) as error:
        raise InvalidSettings(f"cannot give {folder.broker} to {user}: {error}") from error
    folder.path.chmod(0o711)


def _port(setting: str, otherwise: int) -> int:
    return urlsplit(os.environ.get(setting, "")).port or otherwise


#: Mosquitto's TLS port for drones, when no setting names it.
_TLS_PORT = 8883


def made_tls_files(folder: DataFolder) -> TlsFiles | None:
    """The files; None when the deployment has no authority."""
    files = tls_files(folder)
    return files if files.certificate_file.exists() else None


def tls_files(folder: DataFolder) -> TlsFiles:
    """The paths of the files, which may not exist yet."""
    broker = folder.broker.resolve()
    return TlsFiles(
        port=urlsplit(os.environ.get("SKYWAY_MQTT_TLS_URL", "")).port or _TLS_PORT,
        ca_file=broker / "ca.pem",
        certificate_file=broker / "server.pem",
        key_file=broker / "server-key.pem",
    )


def make_drone_ca(folder: DataFolder, broker_names: Sequence[str]) -> None:
    """Make the authority once, and at each call a new certificate for the broker's names."""
    # Imported here: X.509 takes a tenth of a second, and no other command needs it.
    from skyway.broker_setup.certificates import CertificateAuthority

    authority = CertificateAuthority.make(folder.drone_ca)
    signed = authority.sign_broker(broker_names)
    files = tls_files(folder)
    # Copies in the broker's folder: the broker needs nothing else of the authority's folder.
    write_private(files.ca_file, authority.certificate_pem)
    write_private(files.key_file, signed.private_key_pem)
    write_private(files.certificate_file, signed.certificate_pem)
    # The registry replaces it; without the file Mosquitto does not start.
    if not (revoked := revoked_file(folder.broker_passwords)).exists():
        write_private(revoked, authority.revoked_pem())
