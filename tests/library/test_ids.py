import re

import pytest
from pydantic import TypeAdapter, ValidationError

from skyway.ids import StationId, sortable_id


def test_a_new_id_fits_topics_and_paths() -> None:
    minted = sortable_id("dlv", unix_ms=1_790_000_000_000, entropy=(1 << 90) - 1)

    assert re.fullmatch(r"dlv_[0-9a-z]{26}", minted)
    assert TypeAdapter(StationId).validate_python(minted) == minted


def test_ids_sort_by_the_moment_of_their_making() -> None:
    moments = [0, 1, 31, 32, 1_000, 1_790_000_000_000]

    minted = [sortable_id("x", unix_ms=moment, entropy=7) for moment in moments]

    assert minted == sorted(minted)
    assert len(set(minted)) == len(minted)


@pytest.mark.parametrize("bad", ["", "a b", "ä", "a/b", "+", "#", "x" * 65])
def test_an_id_that_would_break_a_topic_or_path_is_refused(bad: str) -> None:
    with pytest.raises(ValidationError):
        TypeAdapter(StationId).validate_python(bad)
