"""The import rules hold; `make check` prints them in full."""

from pathlib import Path

from importlinter.application.use_cases import create_report, read_user_options
from importlinter.configuration import configure

RULES = Path(__file__).parents[2] / "import-rules.toml"


def test_every_import_rule_is_kept() -> None:
    configure()

    report = create_report(read_user_options(config_filename=str(RULES)))

    assert not report.could_not_run
    broken = [
        contract.name for contract, check in report.get_contracts_and_checks() if not check.kept
    ]
    assert not broken
