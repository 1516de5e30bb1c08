"""A month of deliveries adds up on both sides, on both databases."""

import pytest
from skyway_lab.benchmarks.ledger_month import play


@pytest.fixture
def package() -> str:
    """Whose tables `migrated_url` has."""
    return "skyway_gateway"


@pytest.mark.long
async def test_the_sums_of_a_month_agree(migrated_url: str) -> None:
    sums = await play(migrated_url, deliveries=60, seed=1)

    assert sums.do_agree
    assert set(sums.charges) == {"EUR", "USD"}
    assert min(sums.charges.values()) > 0
