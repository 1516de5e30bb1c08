"""New identifiers."""

import re

from skyway.runtime.minting import mint
from tests.counting_mint import CountingMint


def test_minted_identifiers_differ_and_stay_within_the_alphabet() -> None:
    minted = {mint("dlv") for _ in range(1000)}

    assert len(minted) == 1000
    assert all(re.fullmatch(r"dlv_[A-Za-z0-9_-]{1,60}", identifier) for identifier in minted)


def test_a_counting_mint_counts_each_prefix_on_its_own() -> None:
    counting = CountingMint()

    minted = [counting("dlv"), counting("key"), counting("dlv")]

    assert minted == ["dlv_000001", "key_000001", "dlv_000002"]
