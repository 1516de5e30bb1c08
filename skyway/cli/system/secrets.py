"""The secrets of a local system, which the first start makes, or the command `skyway secrets`."""

import secrets
from base64 import b64encode
from pathlib import Path
from typing import Annotated

import typer

from skyway.broker_setup.private_file import write_private
from skyway.cli.data_folder import CLOUD_SERVICES, DataFolder, DataOption, data_folder
from skyway.cli.gateway import fail
from skyway.runtime.errors import InvalidSettings
from skyway.runtime.metrics import METRICS_KEY

#: Broker accounts that exist before any drone: the services' and the operator's.
_BROKER_ACCOUNTS = (*CLOUD_SERVICES, "operator")

#: The services whose messages drones believe only with a signature.
_SIGNERS = ("composition", "gateway")

#: API keys that exist before any request; `skyway up` writes them into keys.env.
_API_KEYS = ("operator_key", "customer_key")


#: The key of a provider of the small world; no service reads it.
_PROVIDER_KEY = "provider_key"


def make_secrets(folder: DataFolder) -> None:
    """Write the missing secrets; only this user can read them."""
    from skyway.runtime.signing.key_pair import PrivateKey

    folder.make()
    for service in CLOUD_SERVICES:
        _write_once(folder.secrets / f"service_{service}", secrets.token_urlsafe(32))
    for account in _BROKER_ACCOUNTS:
        _write_once(folder.secrets / f"mqtt_{account}", secrets.token_urlsafe(24))
    for name in _API_KEYS:
        _write_once(folder.secrets / name, f"sk_{secrets.token_urlsafe(32)}")
    _write_once(folder.secrets / METRICS_KEY, f"mk_{secrets.token_urlsafe(32)}")
    _write_once(folder.secrets / "tracking_key", secrets.token_urlsafe(32))
    # Without it the gateway cannot read the secrets of webhooks any more.
    _write_once(folder.secrets / "webhook_keys", b64encode(secrets.token_bytes(32)).decode())
    for service in _SIGNERS:
        _write_once(folder.secrets / f"signing_{service}", PrivateKey.new().text)
    _publish_signing_keys(folder)


def _publish_signing_keys(folder: DataFolder) -> None:
    """Add the services' public keys to those that drones get; earlier lines stay."""
    from skyway.runtime.signing.cloud_key_file import CLOUD_KEYS, read_signing_key

    file = folder.secrets / CLOUD_KEYS
    before = file.read_text() if file.exists() else ""
    keys = {each: read_signing_key(folder.secrets, each).public_key for each in _SIGNERS}
    lines = [f"{service} {key}\n" for service, key in keys.items()]
    added = "".join(line for line in lines if line not in before)
    if added:
        write_private(file, before + added)


def make_secret(folder: DataFolder, name: str) -> None:
    """Write one more secret, unless it is there."""
    _write_once(folder.secrets / name, secrets.token_urlsafe(32))


def read_secret(folder: DataFolder, name: str) -> str:
    """One secret."""
    return (folder.secrets / name).read_text().strip()


def make_database_passwords(folder: DataFolder, passwords: Path, *, host: str) -> None:
    """Write a password for each PostgreSQL role: for the server, and as the service's passfile.

    `passwords` is a folder that only the server mounts. The server runs as another user, so all
    users who can reach the folder can read its files.
    """
    passwords.mkdir(parents=True, exist_ok=True)
    for role in ("superuser", *CLOUD_SERVICES):
        _write_once(passwords / role, secrets.token_urlsafe(24))
        (passwords / role).chmod(0o644)
    for service in CLOUD_SERVICES:
        password = (passwords / service).read_text().strip()
        line = f"{host}:*:*:skyway_{service}:{password}\n"
        write_private(folder.secrets / f"pgpass_{service}", line)


def write_keys_file(
    folder: DataFolder, gateway_url: str, mqtt_url: str, *, own_broker_url: str = ""
) -> None:
    """Write the keys and addresses as lines that a shell can source.

    `own_broker_url` is the URL of the embedded broker, if the system runs it.
    """
    from skyway.cli.system.children import OWN_BROKER_URL

    values = {
        "SKYWAY_GATEWAY_URL": gateway_url,
        "SKYWAY_MQTT_URL": mqtt_url,
        OWN_BROKER_URL: own_broker_url,
        "SKYWAY_OPERATOR_KEY": read_secret(folder, "operator_key"),
        "SKYWAY_CUSTOMER_KEY": read_secret(folder, "customer_key"),
        "SKYWAY_METRICS_KEY": read_secret(folder, METRICS_KEY),
        "SKYWAY_MQTT_OPERATOR_PASSWORD": read_secret(folder, "mqtt_operator"),
    }
    if (folder.secrets / _PROVIDER_KEY).exists():
        values["SKYWAY_PROVIDER_KEY"] = read_secret(folder, _PROVIDER_KEY)
    lines = [f"export {name}={value}\n" for name, value in values.items()]
    write_private(folder.keys_file, "".join(lines))


def keep_provider_key(folder: DataFolder, key: str) -> None:
    """Keep the key of a provider, for the command line: here and in keys.env."""
    path = folder.secrets / _PROVIDER_KEY
    if not path.exists():
        write_private(path, key + "\n")
        line = f"export SKYWAY_PROVIDER_KEY={key}\n"
        write_private(folder.keys_file, folder.keys_file.read_text() + line)


def _write_once(path: Path, content: str) -> None:
    if not path.exists():
        write_private(path, content + "\n")


def secrets_command(
    gateway_url: Annotated[str, typer.Option(help="For keys.env.")] = "http://127.0.0.1:8000",
    mqtt_url: Annotated[str, typer.Option(help="For keys.env.")] = "mqtt://127.0.0.1:1883",
    mosquitto_host: Annotated[
        str, typer.Option(help="The address on which Mosquitto listens.")
    ] = "127.0.0.1",
    mosquitto_user: Annotated[
        str | None,
        typer.Option(
            help="The user that Mosquitto becomes when root starts it; only root can give its"
            " files to another user."
        ),
    ] = None,
    tls_name: Annotated[
        list[str] | None,
        typer.Option(
            metavar="HOST",
            help="A name or address of the broker; repeat it for more. Makes an authority that"
            " signs drones' certificates, and a TLS listener that requires them.",
        ),
    ] = None,
    postgres_host: Annotated[
        str | None, typer.Option(help="Make database passwords for this server.")
    ] = None,
    postgres_passwords: Annotated[
        Path | None, typer.Option(help="The folder in which that server finds them.")
    ] = None,
    service_secrets: Annotated[
        Path | None,
        typer.Option(
            help="Write a folder for each service here, with the secrets that it reads only."
        ),
    ] = None,
    data: DataOption = None,
) -> None:
    """Make the missing secrets, keys.env and Mosquitto's configuration."""
    from skyway.cli.system import broker_files
    from skyway.cli.system.service_secrets import write_service_secrets

    if (postgres_host is None) != (postgres_passwords is None):
        fail("--postgres-host and --postgres-passwords go together")
    folder = data_folder(data)
    make_secrets(folder)
    write_keys_file(folder, gateway_url, mqtt_url)
    if mosquitto_user is not None:
        try:
            broker_files.give_broker_files(folder, mosquitto_user)
        except InvalidSettings as error:
            fail(str(error))
    if tls_name:
        broker_files.make_drone_ca(folder, tls_name)
    broker_files.write_mosquitto_files(folder, host=mosquitto_host)
    if postgres_host is not None and postgres_passwords is not None:
        make_database_passwords(folder, postgres_passwords, host=postgres_host)
    if service_secrets is not None:
        write_service_secrets(folder, service_secrets)
    typer.echo(f"secrets, keys.env and the broker's files are in {folder.path}", err=True)
