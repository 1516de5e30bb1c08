"""The password file holds every account, and the broker is notified of changes."""

import asyncio
import stat
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from skyway_provider_registry.enrolment import credential_store
from skyway_provider_registry.enrolment.password_file import PasswordFile

from skyway.broker_setup.mosquitto_accounts import MosquittoAccounts
from skyway.broker_setup.nats_accounts import NatsAccounts, is_nats_hash
from skyway.broker_setup.passwords import hash_password, matches, read_password_file
from skyway.runtime.errors import InvalidSettings, MqttUnavailable, ServiceUnavailable
from skyway.runtime.sql.database import Database

pytestmark = pytest.mark.databases("sqlite")

#: Says that it is ready, and which signals came.
BROKER = """
import signal
signal.signal(signal.SIGHUP, lambda *_: print("SIGHUP", flush=True))
print("ready", flush=True)
while True:
    signal.pause()
"""


@pytest.fixture
def broker() -> Iterator["subprocess.Popen[str]"]:
    with subprocess.Popen(
        [sys.executable, "-c", BROKER], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        yield process
        process.kill()


async def put_customer(db: Database, name: str) -> None:
    async with db.write() as tx:
        await credential_store.put_person(
            tx, "CUSTOMER", name, password_hash=hash_password(f"password of {name}")
        )


async def test_our_own_processes_log_in_with_their_secrets(
    password_file: PasswordFile, tmp_path: Path
) -> None:
    await password_file.refresh()

    accounts = read_password_file(tmp_path / "service_passwords")
    assert sorted(accounts) == ["composition", "gateway", "registry"]
    assert all(matches(f"mqtt password of {name}", accounts[name]) for name in accounts)
    others = read_password_file(tmp_path / "passwords")
    assert sorted(others) == ["operator/deployment"]
    assert matches("mqtt password of operator", others["operator/deployment"])


async def test_the_access_rules_name_all_operators(
    db: Database, password_file: PasswordFile, tmp_path: Path
) -> None:
    async with db.write() as tx:
        await credential_store.put_person(
            tx, "OPERATOR", "operator/olga", password_hash=hash_password("of olga")
        )

    await password_file.refresh()

    rules = (tmp_path / "client_acl").read_text().splitlines()
    users = [line for line in rules if line.startswith("user ")]
    assert users == ["user operator/deployment", "user operator/olga"]


async def test_only_this_user_can_read_the_file(
    password_file: PasswordFile, tmp_path: Path
) -> None:
    await password_file.refresh()

    assert stat.S_IMODE((tmp_path / "passwords").stat().st_mode) == 0o600


async def test_a_reader_sees_the_old_file_or_the_new_one(
    db: Database, password_file: PasswordFile, tmp_path: Path
) -> None:
    await password_file.refresh()
    with (tmp_path / "passwords").open() as old:
        await put_customer(db, "ann")
        await password_file.refresh()

        assert "ann:" not in old.read()
    assert "ann" in read_password_file(tmp_path / "passwords")


@pytest.mark.databases("sqlite", "postgresql")
async def test_simultaneous_calls_all_find_their_account_in_the_file(
    db: Database, password_file: PasswordFile, tmp_path: Path
) -> None:
    async def register(name: str) -> bool:
        await put_customer(db, name)
        await password_file.refresh()
        return name in read_password_file(tmp_path / "passwords")

    found = await asyncio.gather(*(register(f"customer-{n}") for n in range(20)))

    assert all(found)


@dataclass(frozen=True, slots=True)
class SlowAccounts(MosquittoAccounts):
    """Writes its files only when it may."""

    began: threading.Event = field(default_factory=threading.Event)
    may_write: threading.Event = field(default_factory=threading.Event)

    def write(self, *files: Mapping[str, str]) -> None:
        self.began.set()
        assert self.may_write.wait(60)
        MosquittoAccounts(self.password_file).write(*files)


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_slow_replica_does_not_replace_the_accounts_of_a_faster_one(
    db: Database, secrets_dir: Path, tmp_path: Path, password_file: PasswordFile
) -> None:
    path = tmp_path / "passwords"
    broker = SlowAccounts(path)
    slow = PasswordFile(broker, db=db, secrets_dir=secrets_dir, broker_pid_file=None)
    slow_write = asyncio.create_task(slow.refresh())
    assert await asyncio.to_thread(broker.began.wait, 60)

    await put_customer(db, "ann")
    write = asyncio.create_task(password_file.refresh())
    for _ in range(10):
        await asyncio.to_thread(path.exists)  # a replica that does not wait writes now
    broker.may_write.set()
    await asyncio.gather(slow_write, write)

    assert "ann" in read_password_file(path)


async def test_a_file_that_cannot_be_written_is_written_later(
    db: Database, secrets_dir: Path, tmp_path: Path
) -> None:
    path = tmp_path / "later" / "passwords"
    password_file = PasswordFile(
        MosquittoAccounts(path),
        db=db,
        secrets_dir=secrets_dir,
        broker_pid_file=None,
    )

    with pytest.raises(ServiceUnavailable):
        await password_file.refresh()
    path.parent.mkdir()
    await password_file.step()

    assert "operator/deployment" in read_password_file(path)


async def test_for_nats_the_file_holds_services_and_drones_with_their_rights(
    db: Database, secrets_dir: Path, tmp_path: Path
) -> None:
    path = tmp_path / "accounts"
    password_file = PasswordFile(
        NatsAccounts(path),
        db=db,
        secrets_dir=secrets_dir,
        broker_pid_file=None,
    )

    await password_file.refresh()

    text = path.read_text()
    for name in ("gateway", "registry", "composition", "operator/deployment"):
        assert f'"user": "{name}"' in text
    assert is_nats_hash(password_file.hash_password("secret"))


async def test_nothing_is_written_when_nothing_has_changed(
    password_file: PasswordFile, tmp_path: Path
) -> None:
    await password_file.refresh()
    (tmp_path / "passwords").unlink()

    await password_file.step()

    assert not (tmp_path / "passwords").exists()


async def test_the_hash_of_a_password_is_enough(
    db: Database, secrets_dir: Path, tmp_path: Path
) -> None:
    (secrets_dir / "mqtt_operator").unlink()
    (secrets_dir / "mqtt_operator.hash").write_text(hash_password("of the operator") + "\n")
    path = tmp_path / "passwords"
    password_file = PasswordFile(
        MosquittoAccounts(path),
        db=db,
        secrets_dir=secrets_dir,
        broker_pid_file=None,
    )

    await password_file.refresh()

    assert matches("of the operator", read_password_file(path)["operator/deployment"])


async def test_a_missing_secret_is_named(db: Database, secrets_dir: Path, tmp_path: Path) -> None:
    (secrets_dir / "mqtt_operator").unlink()
    path = tmp_path / "passwords"
    password_file = PasswordFile(
        MosquittoAccounts(path),
        db=db,
        secrets_dir=secrets_dir,
        broker_pid_file=None,
    )

    with pytest.raises(InvalidSettings, match="mqtt_operator"):
        await password_file.refresh()


@pytest.fixture
def named_file(
    db: Database, secrets_dir: Path, tmp_path: Path, broker: "subprocess.Popen[str]"
) -> PasswordFile:
    pid_file = tmp_path / "broker.pid"
    pid_file.write_text(f"{broker.pid}\n")
    return PasswordFile(
        MosquittoAccounts(tmp_path / "passwords"),
        db=db,
        secrets_dir=secrets_dir,
        broker_pid_file=pid_file,
    )


async def next_signal(broker: "subprocess.Popen[str]") -> str:
    assert broker.stdout is not None
    async with asyncio.timeout(60):
        return await asyncio.to_thread(broker.stdout.readline)


async def test_the_broker_is_notified_by_sighup(
    named_file: PasswordFile, broker: "subprocess.Popen[str]"
) -> None:
    await named_file.refresh()

    assert await next_signal(broker) == "SIGHUP\n"


async def test_a_broker_that_was_reading_is_notified_once_more(
    named_file: PasswordFile, broker: "subprocess.Popen[str]"
) -> None:
    await named_file.refresh()
    assert await next_signal(broker) == "SIGHUP\n"

    for _ in range(5):
        await named_file.step()
    assert await next_signal(broker) == "SIGHUP\n"

    broker.terminate()
    assert await next_signal(broker) == ""  # no third time


@pytest.mark.parametrize("content", [None, "", "mosquitto", "0", "-1", "1", "999999999"])
async def test_a_broker_that_is_not_there_is_no_error(
    db: Database, secrets_dir: Path, tmp_path: Path, content: str | None
) -> None:
    pid_file = tmp_path / "broker.pid"
    if content is not None:
        pid_file.write_text(content)
    password_file = PasswordFile(
        MosquittoAccounts(tmp_path / "passwords"),
        db=db,
        secrets_dir=secrets_dir,
        broker_pid_file=pid_file,
    )

    await password_file.refresh()

    assert (tmp_path / "passwords").exists()


@pytest.mark.databases("sqlite", "postgresql")
async def test_the_connection_of_a_drone_whose_credentials_end_is_ended_once_the_files_say_so(
    db: Database, secrets_dir: Path, tmp_path: Path, api: Any
) -> None:
    ended: list[str] = []

    async def end(account: str) -> None:
        assert f"user {account}" in (tmp_path / "client_acl").read_text()
        ended.append(account)
        raise MqttUnavailable("the broker is away")

    password_file = PasswordFile(
        MosquittoAccounts(tmp_path / "passwords"),
        db=db,
        secrets_dir=secrets_dir,
        broker_pid_file=None,
        end_connection=end,
    )
    drones = [await api.drone(await api.provider()) for _ in range(2)]
    accounts = [f"{drone['provider_id']}/{drone['drone_id']}" for drone in drones]
    for drone in drones:
        body = {"enrolment_token": drone["enrolment_token"]}
        await api("service:gateway", "POST", "/v1/enrolments", body)

    for drone in drones:
        path = f"/v1/providers/{drone['provider_id']}/drones/{drone['drone_id']}/credentials"
        await api(f"provider:{drone['provider_id']}", "DELETE", path)
        await password_file.refresh()
    for _ in range(4):
        await password_file.step()

    # What ended before the first write of this process is not ended again; all else is tried twice.
    assert ended == [accounts[1]] * 2
