"""Which processes a local system starts, and their settings."""

from contextlib import ExitStack
from pathlib import Path

import pytest

from skyway.cli.data_folder import DataFolder
from skyway.cli.system.cells import cells_of, keep_cells
from skyway.cli.system.children import Ports, bind, cell_urls, child, environment
from skyway.cli.system.secrets import make_secrets, write_keys_file

URL = "mqtt://127.0.0.1:1883"


@pytest.fixture
def folder(tmp_path: Path) -> DataFolder:
    made = DataFolder(tmp_path / "data")
    make_secrets(made)
    return made


def source(folder: DataFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a shell does with keys.env."""
    for line in folder.keys_file.read_text().splitlines():
        name, _, value = line.removeprefix("export ").partition("=")
        monkeypatch.setenv(name, value)


def started(folder: DataFolder) -> tuple[set[str], str]:
    """The processes of a start, and the address of the broker that they get."""
    with ExitStack() as held:
        sockets = bind(Ports(gateway=0, broker=0), held)
        return set(sockets), environment(folder, sockets)["SKYWAY_MQTT_URL"]


def test_a_shell_that_sourced_keys_env_still_starts_the_embedded_broker(
    folder: DataFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_keys_file(folder, "http://127.0.0.1:8000", URL, own_broker_url=URL)
    source(folder, monkeypatch)

    processes, url = started(folder)

    assert "broker" in processes
    assert url != URL


def test_a_broker_that_is_named_is_not_started(
    folder: DataFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_keys_file(folder, "http://127.0.0.1:8000", URL, own_broker_url=URL)
    source(folder, monkeypatch)
    monkeypatch.setenv("SKYWAY_MQTT_URL", "mqtt://127.0.0.1:1884")

    processes, url = started(folder)

    assert "broker" not in processes
    assert url == "mqtt://127.0.0.1:1884"


def test_the_keys_of_a_system_with_an_external_broker_name_it(
    folder: DataFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_keys_file(folder, "http://127.0.0.1:8000", URL, own_broker_url=URL)
    source(folder, monkeypatch)
    write_keys_file(folder, "http://127.0.0.1:8000", URL)
    source(folder, monkeypatch)

    processes, url = started(folder)

    assert "broker" not in processes
    assert url == URL


def test_cells_are_kept_and_every_process_knows_their_addresses(
    folder: DataFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep_cells(folder, cells_of(folder, ["texas", "ohio"]))
    cells = cells_of(folder, ["ohio", "north"])
    with ExitStack() as held:
        sockets = bind(Ports(gateway=0, broker=0), held, cells)
        urls = cell_urls(cells, sockets)
        monkeypatch.setenv("SKYWAY_CELLS", "far=http://far")
        settings = environment(folder, sockets, cells)
        process = child(
            "cell-2",
            folder,
            listener=sockets["cell-2"],
            shared=settings,
            database_urls={"cell-2": "sqlite:///cell-2.db"},
        )

    assert cells == {"cell-1": "texas", "cell-2": "ohio", "cell-3": "north"}
    assert settings["SKYWAY_CELLS"].split(",") == [
        *(f"{network}={urls[name]}" for name, network in cells.items()),
        "far=http://far",
    ]
    assert process.command[-1] == "skyway_composition"
    assert process.environment["SKYWAY_CELL_URL"] == urls["cell-2"]
    assert process.environment["SKYWAY_DATABASE_URL"] == "sqlite:///cell-2.db"
