"""Each drone has one owner, and a replica that joins or leaves moves only its own drones."""

from collections import Counter

from hypothesis import given, settings
from hypothesis import strategies as st

from skyway.runtime.replicas.share import Member, Replicas, owner_of

DRONES = [f"drn_{number}" for number in range(200)]

replica_ids = st.sets(st.text(min_size=1, max_size=8), min_size=1, max_size=8)


def seen_by(own_id: str, replica_ids: set[str], *, listening: set[str]) -> Replicas:
    return Replicas(
        own_id,
        tuple(
            Member(number, each, is_listening=each in listening)
            for number, each in enumerate(sorted(replica_ids))
        ),
    )


@settings(max_examples=25)
@given(replica_ids)
def test_each_drone_has_exactly_one_owner_and_one_replica_leads(ids: set[str]) -> None:
    views = [seen_by(each, ids, listening=ids) for each in ids]

    assert all(sum(view.owns(drone_id) for view in views) == 1 for drone_id in DRONES)
    assert sum(view.leads for view in views) == 1


@settings(max_examples=25)
@given(replica_ids, st.text(min_size=1, max_size=8))
def test_a_replica_that_joins_or_leaves_moves_only_its_own_drones(ids: set[str], one: str) -> None:
    without, within = ids - {one} or {"another"}, ids | {one}

    for drone_id in DRONES:
        owner = owner_of(drone_id, within)
        assert owner in (one, owner_of(drone_id, without))


@settings(max_examples=25)
@given(replica_ids, st.data())
def test_a_drone_has_an_owner_while_some_replicas_do_not_see_the_new_one(
    ids: set[str], data: st.DataObject
) -> None:
    """The new replica sees all replicas. The others see the new replica now or later."""
    new = data.draw(st.sampled_from(sorted(ids)))
    late = data.draw(st.sets(st.sampled_from(sorted(ids)))) - {new}
    views = [
        seen_by(each, ids - {new} if each in late else ids, listening=ids) for each in sorted(ids)
    ]

    assert all(any(view.owns(drone_id) for view in views) for drone_id in DRONES)


def test_a_replica_without_a_connection_leaves_the_lead_and_its_drones_to_the_others() -> None:
    ids = {"a", "b", "c"}
    first, second, third = (seen_by(each, ids, listening={"b", "c"}) for each in sorted(ids))

    assert [each.leads for each in (first, second, third)] == [False, True, False]
    assert seen_by("a", ids, listening=set()).leads
    assert all(second.owns(each) + third.owns(each) == 1 for each in DRONES)


def test_a_replica_owns_its_drones_before_the_database_says_that_it_listens() -> None:
    """Others may already count on it; a message without any owner would be lost."""
    alone = seen_by("a", {"a"}, listening=set())
    joining = seen_by("a", {"a", "b"}, listening={"b"})

    assert all(alone.owns(each) for each in DRONES)
    assert 50 < sum(joining.owns(each) for each in DRONES) < 150


def test_a_replica_owns_more_only_when_another_one_is_gone() -> None:
    three, two = (seen_by("a", ids, listening=ids) for ids in ({"a", "b", "c"}, {"a", "b"}))

    assert two.may_own_more_than(three)
    assert not three.may_own_more_than(two)


def test_four_replicas_own_about_the_same_number_of_drones() -> None:
    counted = Counter(owner_of(f"drn_{number}", "abcd") for number in range(4_000))

    assert all(900 < each < 1_100 for each in counted.values())


def test_a_replica_in_the_place_of_another_one_may_change_who_owns_what() -> None:
    """One list has as many replicas as the other."""
    before = seen_by("a", {"a", "b"}, listening={"a", "b"})
    now = seen_by("a", {"a", "c"}, listening={"a", "c"})

    assert now.may_own_more_than(before)
    assert any(now.owns(each) and not before.owns(each) for each in DRONES)
