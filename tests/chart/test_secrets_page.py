"""docs/kubernetes.md: its lines make every Secret that the chart mounts, with every file."""

import re
import shlex
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from skyway.cli.main import make_app
from tests.chart.rendered import Outcomes

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/kubernetes.md").read_text()
VALUES = yaml.safe_load((ROOT / "deploy/helm/skyway/values.yaml").read_text())


def made_secrets(folder: Path) -> dict[str, set[str]]:
    """The keys of each Secret that the lines of the page make, in a folder of secrets."""
    found = {}
    for line in re.findall(r"create secret generic (.+)$", PAGE, re.MULTILINE):
        name, *options = shlex.split(line)
        sources = [folder / each.removeprefix("--from-file=") for each in options]
        files = [file for each in sources for file in (each.iterdir() if each.is_dir() else [each])]
        assert all(file.is_file() for file in files), line
        found[name] = {file.name for file in files}
    return found


@pytest.fixture
def secrets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, set[str]]:
    """The Secrets of the page, after its own `skyway secrets`."""
    line = re.search(r"^skyway (secrets --data .+)$", PAGE, re.MULTILINE)
    assert line is not None
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(make_app(), shlex.split(line[1]))
    assert done.exit_code == 0, done.output
    return made_secrets(tmp_path)


def test_the_page_makes_every_secret_that_the_values_name(secrets: dict[str, set[str]]) -> None:
    assert secrets.keys() == set(VALUES["secrets"].values())


def test_every_key_that_the_chart_names_is_a_file(
    secrets: dict[str, set[str]], outcomes: Outcomes
) -> None:
    for case in ("default", "everything"):
        for pod in outcomes[case].pods():
            mounted = {name: keys for name, keys in pod.secrets().items() if name != "database-ca"}
            for name, keys in mounted.items():
                assert set(keys or ()) <= secrets[name]
    for monitor in outcomes["everything"].of("ServiceMonitor"):
        credentials = monitor["spec"]["endpoints"][0]["authorization"]["credentials"]
        assert credentials["key"] in secrets[credentials["name"]]


def test_passwords_are_for_the_host_of_the_database(
    secrets: dict[str, set[str]], tmp_path: Path
) -> None:
    for service in ("gateway", "registry", "composition"):
        passfile = tmp_path / "cluster/service-secrets" / service / "pgpass"
        assert "pgpass" in secrets[VALUES["secrets"][service]]
        assert passfile.read_text().startswith(f"db.example.org:*:*:skyway_{service}:")


def test_the_values_of_the_page_are_accepted(outcomes: Outcomes) -> None:
    assert outcomes.findings("page", "error") is None
    assert outcomes.findings("page", "invalid") == []
