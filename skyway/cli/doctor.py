"""`skyway doctor`: asks everything that Skyway needs, and says what answered."""

import asyncio
import importlib.util
import os
import secrets
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final
from urllib.parse import urlsplit

import typer

from skyway.cli.data_folder import CLOUD_SERVICES, DataFolder, DataOption, data_folder
from skyway.cli.gateway import chosen_key, read_keys
from skyway.errors import SkywayError

if TYPE_CHECKING:
    import httpx

#: How long a database, a broker and a gateway may take to answer, wall seconds.
_ANSWERS_WITHIN_S: Final = 5.0

_EMBEDDED_BROKER: Final = "the embedded broker (a hardened amqtt)"


@dataclass(frozen=True, slots=True)
class Finding:
    """The result of one check; `is_trouble` when somebody must act before Skyway works."""

    subject: str
    detail: str
    is_trouble: bool = False


def doctor_command(data: DataOption = None) -> None:
    """Ask database, broker and gateway, and say what is missing; exit code 1 when something is."""
    from rich.console import Console

    console = Console()
    findings = list(_findings(data_folder(data)))
    for finding in findings:
        mark = "[red]missing[/]" if finding.is_trouble else "[green]ok[/]"
        console.print(f"{mark:>16}  [bold]{finding.subject}[/]  {finding.detail}", soft_wrap=True)
    raise typer.Exit(1 if any(finding.is_trouble for finding in findings) else 0)


def _findings(folder: DataFolder) -> Iterator[Finding]:
    from skyway.cli.system.children import PACKAGES

    for package in (*PACKAGES.values(), "skyway_drone_agent"):
        is_missing = importlib.util.find_spec(package) is None
        yield Finding(package, "is not installed: make setup" if is_missing else "", is_missing)
    yield from _data_folder(folder)
    yield from _databases(folder)
    is_running, gateway = _gateway(folder)
    yield _broker(folder, is_running=is_running)
    yield gateway
    if is_running and not gateway.is_trouble:
        yield from _contents(folder)


def _data_folder(folder: DataFolder) -> Iterator[Finding]:
    if not folder.keys_file.exists():
        detail = f"{folder.path} holds no keys yet: skyway up makes them on its first start"
        yield Finding("data folder", detail)
        return
    yield Finding("data folder", str(folder.path))
    open_secrets = [path.name for path in folder.secrets.iterdir() if path.stat().st_mode & 0o077]
    if open_secrets:
        detail = f"other users can read {', '.join(open_secrets)}: chmod 600"
        yield Finding("secrets", detail, is_trouble=True)


def _databases(folder: DataFolder) -> Iterator[Finding]:
    url = os.environ.get("SKYWAY_DATABASE_URL")
    if url is not None:
        yield asyncio.run(_postgresql(url))
        return
    files = {name: folder.database_file(name) for name in CLOUD_SERVICES}
    if not any(file.exists() for file in files.values()):
        yield Finding("database", "SQLite; skyway up makes the files on its first start")
        return
    for name, file in files.items():
        yield _sqlite(f"database of {name}", file)


def _sqlite(subject: str, file: Path) -> Finding:
    """Whether SQLite can open the file and read its tables."""
    try:
        with closing(sqlite3.connect(f"{file.as_uri()}?mode=ro", uri=True)) as connection:
            (tables,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except sqlite3.Error as error:
        return Finding(subject, f"SQLite cannot read {file}: {error}", is_trouble=True)
    return Finding(subject, f"SQLite {sqlite3.sqlite_version} reads {file} ({tables} tables)")


async def _postgresql(url: str) -> Finding:
    """Whether the PostgreSQL server of this URL lets us in, and its version."""
    import asyncpg

    from skyway.runtime.sql.server_url import driver_url

    parts = urlsplit(url)
    where = f"PostgreSQL at {parts.hostname or 'a local socket'}"
    try:
        async with asyncio.timeout(_ANSWERS_WITHIN_S):
            connection = await asyncpg.connect(driver_url(url))
            try:
                answer = await connection.fetchval("SHOW server_version")
            finally:
                await connection.close()
    except TimeoutError:
        return Finding("database", f"{where} does not answer", is_trouble=True)
    except OSError as error:
        return Finding("database", f"{where} does not answer: {error}", is_trouble=True)
    except (ValueError, SkywayError, asyncpg.PostgresError, asyncpg.InterfaceError) as error:
        return Finding("database", f"{where} refuses the connection: {error}", is_trouble=True)
    return Finding("database", f"{where} answers: version {answer}")


def _broker(folder: DataFolder, *, is_running: bool) -> Finding:
    """Whether the broker lets the operator in.

    The embedded broker answers only while the system runs; a broker that `SKYWAY_MQTT_URL` names
    must always answer.
    """
    from skyway.cli.system.children import named_broker

    named = named_broker()
    settings = read_keys(folder)
    if named is None and not (is_running and settings.get("SKYWAY_MQTT_URL")):
        return Finding("broker", f"{_EMBEDDED_BROKER}: skyway up starts it")
    # Where services have a listener of their own, operators cannot log in there.
    url = os.environ.get("SKYWAY_MQTT_DRONE_URL") or named or settings.get("SKYWAY_MQTT_URL", "")
    what = f"the broker at {url}" if named else f"{_EMBEDDED_BROKER} at {url}"
    password = settings.get("SKYWAY_MQTT_OPERATOR_PASSWORD", "")
    try:
        asyncio.run(_log_in(url, password))
    except TimeoutError:
        return Finding("broker", f"{what} does not answer", is_trouble=True)
    except OSError as error:
        why = error.strerror or error
        return Finding("broker", f"{what} does not answer: {why}", is_trouble=True)
    except SkywayError as error:
        detail = f"{what} answers, but refuses the operator's account: {error}"
        return Finding("broker", detail, is_trouble=True)
    return Finding("broker", f"{what} answers and accepts the operator's account")


async def _log_in(url: str, password: str) -> None:
    """Connect to every node of the broker as the operator, and leave it again."""
    from skyway.contracts.broker_rules import DEPLOYMENT_OPERATOR
    from skyway.runtime.mqtt.address import BrokerAddress
    from skyway.runtime.mqtt.connection import Login, MqttConnection

    login = Login(f"doctor-{secrets.token_hex(8)}", DEPLOYMENT_OPERATOR, password, keepalive_s=10)
    for address in BrokerAddress.parse_all(url):
        link = MqttConnection(login, will=None, on_message=lambda _name, _payload, _retained: None)
        try:
            async with asyncio.timeout(_ANSWERS_WITHIN_S):
                await link.open(address)
        finally:
            link.close()


def _gateway(folder: DataFolder) -> tuple[bool, Finding]:
    """Whether the gateway answers, and whether everything that it needs is ready."""
    import httpx

    url = read_keys(folder).get("SKYWAY_GATEWAY_URL", "")
    try:
        answer = httpx.get(f"{url}/readyz", timeout=_ANSWERS_WITHIN_S)
    except (httpx.HTTPError, httpx.InvalidURL) as error:
        if not url:
            return False, Finding("gateway", "not running: skyway up")
        return False, Finding("gateway", f"{url} does not answer ({error}): skyway up")
    if answer.is_success:
        has_broker = answer.json().get("checks", {}).get("mqtt", True)
        ready = "ready" if has_broker else "ready, but it has no connection to the broker"
        return True, Finding("gateway", f"{url} answers: {ready}", is_trouble=not has_broker)
    return True, Finding("gateway", f"{url} answers: {_detail(answer)}", is_trouble=True)


def _detail(problem: "httpx.Response") -> str:
    try:
        return str(problem.json()["detail"])
    except (ValueError, KeyError, TypeError):
        return problem.text


def _contents(folder: DataFolder) -> Iterator[Finding]:
    """What an empty system still needs before it can deliver; an empty system is no trouble."""
    import httpx

    settings = read_keys(folder)
    url, key_name = settings["SKYWAY_GATEWAY_URL"], chosen_key(settings)
    if key_name is None:
        yield Finding("keys", "no key is set: skyway up writes keys.env", is_trouble=True)
        return
    requested = {
        "networks": "no network is published: skyway network import bundled",
        "providers": "no provider is registered: skyway fleet --drones 10",
    }
    for subject, advice in requested.items():
        headers = {"Authorization": f"Bearer {settings[key_name]}"}
        try:
            answer = httpx.get(
                f"{url}/v1/{subject}?limit=1", headers=headers, timeout=_ANSWERS_WITHIN_S
            )
        except httpx.HTTPError as error:
            yield Finding(subject, f"no answer: {error}", is_trouble=True)
            continue
        if not answer.is_success:
            yield Finding(subject, _detail(answer), is_trouble=True)
        elif not answer.json()["items"]:
            yield Finding(subject, advice)
