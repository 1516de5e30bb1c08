"""`skyway doctor`: what is configured, what is missing, and what to do about it."""

import importlib.util
import os
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from urllib.parse import urlsplit

import httpx
import typer
from rich.console import Console

from skyway.cli.data_folder import DataFolder, data_folder
from skyway.cli.gateway import read_keys
from skyway.cli.system.children import PACKAGES, named_broker
from skyway.cli.system.up import DataOption


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing looked at; `is_trouble` when something must be done before Skyway works."""

    subject: str
    detail: str
    is_trouble: bool = False


def doctor_command(data: DataOption = None) -> None:
    """Say what is configured and what is missing; exits 1 when something is."""
    console = Console()
    findings = list(_findings(data_folder(data)))
    for finding in findings:
        mark = "[red]missing[/]" if finding.is_trouble else "[green]ok[/]"
        console.print(f"{mark:>16}  [bold]{finding.subject}[/]  {finding.detail}")
    raise typer.Exit(1 if any(finding.is_trouble for finding in findings) else 0)


def _findings(folder: DataFolder) -> Iterator[Finding]:
    for package in (*PACKAGES.values(), "skyway_drone_agent"):
        is_missing = importlib.util.find_spec(package) is None
        yield Finding(package, "not installed: make setup" if is_missing else "", is_missing)
    yield _database()
    yield _broker()
    yield from _folder(folder)


def _database() -> Finding:
    url = os.environ.get("SKYWAY_DATABASE_URL")
    if url is None:
        return Finding("database", "SQLite files in the data folder")
    return Finding("database", f"PostgreSQL at {urlsplit(url).hostname or 'a local socket'}")


def _broker() -> Finding:
    url = named_broker()
    if url is None:
        return Finding("broker", "embedded")
    found = shutil.which("mosquitto", path=f"{os.environ.get('PATH', '')}:/usr/sbin")
    return Finding("broker", f"{url}; mosquitto here: {found or 'no'}")


def _folder(folder: DataFolder) -> Iterator[Finding]:
    if not folder.keys_file.exists():
        detail = f"{folder.path} holds no keys yet: skyway up makes them on its first start"
        yield Finding("data folder", detail)
        return
    yield Finding("data folder", str(folder.path))
    open_secrets = [path.name for path in folder.secrets.iterdir() if path.stat().st_mode & 0o077]
    if open_secrets:
        detail = f"others can read {', '.join(open_secrets)}: chmod 600"
        yield Finding("secrets", detail, is_trouble=True)
    url = read_keys(folder).get("SKYWAY_GATEWAY_URL", "")
    try:
        answer = httpx.get(f"{url}/readyz", timeout=5.0)
    except httpx.HTTPError:
        yield Finding("system", "not running: skyway up")
    else:
        is_ready = answer.is_success
        yield Finding("system", f"{url} {'is ready' if is_ready else answer.text}", not is_ready)
