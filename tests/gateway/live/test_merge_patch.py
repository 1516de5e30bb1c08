"""JSON merge patches turn one object into another, and say nothing twice."""

from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from skyway_gateway.live.picture import patch_between

from tests.gateway.live.merged import merged

_VALUES = st.recursive(
    st.booleans() | st.integers(-9, 9) | st.text("ab", max_size=2) | st.lists(st.integers(0, 3)),
    lambda inner: st.dictionaries(st.sampled_from("pqr"), inner, max_size=3),
    max_leaves=6,
)
_OBJECTS = st.dictionaries(st.sampled_from("pqrs"), _VALUES, max_size=4)


@given(before=_OBJECTS, after=_OBJECTS)
def test_the_patched_object_is_the_later_one(before: dict[str, Any], after: dict[str, Any]) -> None:
    assert merged(before, patch_between(before, after)) == after


@given(value=_OBJECTS)
def test_equal_objects_need_no_patch(value: dict[str, Any]) -> None:
    assert patch_between(value, value) == {}


def test_only_changed_members_are_sent() -> None:
    before = {"soc": 0.9, "at": "1", "steps": {"1": {"status": "PLANNED", "kind": "FLY"}}}
    after = {"soc": 0.8, "at": "1", "steps": {"1": {"status": "ENDED", "kind": "FLY"}}}

    assert patch_between(before, after) == {"soc": 0.8, "steps": {"1": {"status": "ENDED"}}}
