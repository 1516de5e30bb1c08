"""`skyway verify` prints what is broken; `--repair` adds what a person can do about it."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from typer.testing import CliRunner

from skyway.cli.data_folder import CLOUD_SERVICES, DataFolder
from skyway.cli.main import make_app
from skyway.cli.verify.looks import Looks, ServiceLook
from skyway.runtime.verification.rule import BrokenRule

BROKEN = BrokenRule("drones stand somewhere", "drn_1", "Look for the drone at its home.")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> DataFolder:
    """A data folder whose registry breaks one rule."""
    made = DataFolder(tmp_path)
    made.make()

    async def urls(_: DataFolder, _cells: Sequence[str]) -> dict[str, str]:
        return dict.fromkeys(CLOUD_SERVICES, "postgresql://nowhere/skyway")

    def look(_: DataFolder, urls: dict[str, str], facts: Path) -> Looks:
        return {
            each: ServiceLook(each, (BROKEN,) if each == "registry" else (), facts / each)
            for each in urls
        }

    monkeypatch.setattr("skyway.cli.system.databases.database_urls", urls)
    monkeypatch.setattr("skyway.cli.verify.looks.look", look)
    return made


@pytest.mark.parametrize("repairs", [False, True])
def test_repair_says_what_a_person_can_do_about_each_violation(
    folder: DataFolder, tmp_path: Path, repairs: bool
) -> None:
    options = ["--repair"] if repairs else []

    result = CliRunner().invoke(make_app(), ["verify", "--data", str(tmp_path), *options])

    first, *others = result.output.splitlines()
    assert first == 'registry: {"rule": "drones stand somewhere", "subject": "drn_1"}'
    assert ("    Look for the drone at its home." in others) == repairs
    assert others[-1] == "1 violations in 3 databases"
    assert result.exit_code == 1
