"""`skyway register`: every wrong row of a CSV file is named before the first is registered."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from skyway.cli.main import make_app
from tests.library.cli.conftest import Gateway

FLEET = "/v1/providers/prv_1"
GOOD = "model_id,home_station_id,name,soc\nm300,kyle,Heron,0.5\n\nm300,buda,,\n"


@pytest.fixture
def gateway(answering_gateway: Gateway) -> Gateway:
    answering_gateway.answers |= {
        ("POST", f"{FLEET}/drones?dry_run=true"): (204, b""),
        ("POST", f"{FLEET}/drones"): (201, {"items": [{"drone_id": "drn_1"}]}),
        ("POST", f"{FLEET}/batteries?dry_run=true"): (204, b""),
        ("POST", f"{FLEET}/batteries"): (201, {"items": [{}, {}]}),
    }
    return answering_gateway


def run(kind: str, file: Path, *options: str) -> Any:
    arguments = ["register", kind, str(file), "--provider", "prv_1", *options]
    return CliRunner().invoke(make_app(), arguments)


def csv_file(folder: Path, text: str, encoding: str = "utf-8") -> Path:
    file = folder / "rows.csv"
    file.write_bytes(text.encode(encoding))
    return file


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_good_rows_are_checked_and_registered(
    gateway: Gateway, tmp_path: Path, separator: str, encoding: str
) -> None:
    file = csv_file(tmp_path, GOOD.replace(",", separator), encoding)
    out = tmp_path / "fleet.json"

    result = run("drones", file, "--out", str(out))

    assert result.exit_code == 0, result.output
    assert "2 rows are good\n1 drones are registered" in result.output
    assert json.loads(out.read_text()) == {"items": [{"drone_id": "drn_1"}]}
    assert out.stat().st_mode & 0o777 == 0o600
    bodies = [body for _, _, body in gateway.calls]
    rows = [
        {"model_id": "m300", "home_station_id": "kyle", "name": "Heron", "soc": 0.5},
        {"model_id": "m300", "home_station_id": "buda"},
    ]
    assert bodies == [rows, rows]


def test_a_dry_run_registers_nothing(gateway: Gateway, tmp_path: Path) -> None:
    file = csv_file(tmp_path, "serial,model_id\nS-1,m300\n")

    assert run("batteries", file, "--dry-run").output == "1 rows are good\n"
    assert gateway.called == [("POST", f"{FLEET}/batteries")]
    assert gateway.queries == ["dry_run=true"]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "column 'model_id' is missing"),
        ("model_id\nm300\n", "line 1: column 'home_station_id' is missing"),
        ("model_id,home_station_id,color\n", "column 'color' is not known"),
        ("model_id,home_station_id,model_id\n", "column 'model_id' is not known or stands twice"),
        ("model_id,home_station_id\n", "has no rows below its column names"),
        ("model_id,home_station_id\nm300\n", "line 2: 1 values for 2 columns"),
        ("model_id,home_station_id,soc\nm300,kyle,full\n", "line 2, soc: 'full' is no number"),
        (
            "model_id,home_station_id,registration\nm,k,N1\nm,k,\nm,k,N1\n",
            "line 4, registration: 'N1' stands in line 2 too",
        ),
    ],
)
def test_what_is_wrong_in_a_file_is_named_with_its_line(
    gateway: Gateway, tmp_path: Path, text: str, complaint: str
) -> None:
    result = run("drones", csv_file(tmp_path, text), "--out", str(tmp_path / "out.json"))

    assert result.exit_code == 1
    assert complaint in result.output
    assert len(gateway.calls) == len(gateway.queries)  # nothing but dry runs


def test_a_file_that_is_not_utf_8_is_refused(gateway: Gateway, tmp_path: Path) -> None:
    file = csv_file(tmp_path, GOOD.replace("Heron", "Gänsegeier"), "latin-1")

    assert "is no CSV file in UTF-8" in run("drones", file, "--dry-run").output


def test_faults_that_the_gateway_finds_are_named_with_their_lines(
    gateway: Gateway, tmp_path: Path
) -> None:
    error = {"field": "0.home_station_id", "detail": "station 'atlantis' is unknown"}
    problem = {"detail": "0.home_station_id: unknown", "errors": [error]}
    gateway.answers["POST", f"{FLEET}/drones?dry_run=true"] = (422, problem)
    file = csv_file(tmp_path, "model_id,home_station_id\nm,a\nm,b\nm,c\n")

    result = run("drones", file, "--dry-run")

    assert result.exit_code == 1
    # The gateway of this test finds the first row of each call wrong, until none is left.
    for line in (2, 3, 4):
        assert f"line {line}, home_station_id: station 'atlantis' is unknown" in result.output
