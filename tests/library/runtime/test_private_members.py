"""The private members of other libraries that the runtime uses are still there.

A release of these libraries may rename them. Then these tests name the member to look for.
"""

import inspect

import aiosqlite
from alembic.script import ScriptDirectory
from paho.mqtt.client import Client
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol


def test_aiosqlite_runs_every_statement_through_execute() -> None:
    """`runtime/sql/sqlite_engines.py` overrides `_execute` and reads the other members."""
    source = inspect.getsource(aiosqlite.Connection)

    assert inspect.iscoroutinefunction(aiosqlite.Connection._execute)
    for member in ("self._connection", "self._running", "self._thread"):
        assert member in source


def test_paho_opens_its_socket_through_create_socket() -> None:
    """`runtime/mqtt/connection.py` overrides `_create_socket`."""
    assert "self._create_socket()" in inspect.getsource(Client)


def test_alembic_lists_the_revisions_of_an_upgrade() -> None:
    """`runtime/sql/upgrade.py` calls `_upgrade_revs`, as alembic's own `upgrade` does."""
    assert list(inspect.signature(ScriptDirectory._upgrade_revs).parameters) == [
        "self",
        "destination",
        "current_rev",
    ]


def test_uvicorn_ends_its_keepalive_timer_when_data_arrive() -> None:
    """`runtime/http/front_protocol.py` calls `_unset_keepalive_if_required` too."""
    assert "self._unset_keepalive_if_required()" in inspect.getsource(
        HttpToolsProtocol.data_received
    )
