from collections.abc import Iterator
from typing import Any

import pytest
from pydantic import ValidationError

from skyway.contracts.message_examples import message_examples
from skyway.contracts.topics import ACKS, CLOCK, DELIVERY_EVENTS, INSTRUCTIONS, TOPICS, Topic


def test_an_address_fills_the_placeholders_in_order() -> None:
    assert ACKS("prv_1", "drn_1").name == "skyway/v1/prv_1/drn_1/acks"
    assert CLOCK().name == "skyway/v1/clock"


@pytest.mark.parametrize("ids", [(), ("p",), ("p", "d", "x")])
def test_an_address_needs_as_many_ids_as_placeholders(ids: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match="argument"):
        ACKS(*ids)


def test_a_name_gives_its_ids_back_only_to_its_own_topic() -> None:
    name = DELIVERY_EVENTS("c1", "d1").name

    assert DELIVERY_EVENTS.ids_in(name) == ("c1", "d1")
    assert [topic.ids_in(name) for topic in TOPICS if topic is not DELIVERY_EVENTS] == (
        [None] * (len(TOPICS) - 1)
    )


def test_every_message_reads_back_and_ignores_what_a_newer_writer_adds() -> None:
    for example in message_examples().values():
        message: Any = example
        read = type(message).model_validate_json(message.model_dump_json())
        newer = message.model_dump(mode="json") | {"invented_later": 1}

        assert read == message
        assert type(message).model_validate(newer) == message


def test_an_instruction_of_unknown_kind_is_refused() -> None:
    with pytest.raises(ValidationError):
        INSTRUCTIONS.read(b'{"kind": "SELF_DESTRUCT"}')


WRITTEN_BY_DRONES = [topic for topic in TOPICS if topic.writer == "drone"]


@pytest.mark.parametrize("topic", WRITTEN_BY_DRONES, ids=lambda topic: topic.template)
def test_every_list_in_a_message_of_a_drone_has_a_most(topic: Topic[Any]) -> None:
    schema = topic.schema()
    unbounded = [
        place
        for place, part in parts_of(schema)
        if part.get("type") == "array" and "maxItems" not in part
    ]

    assert unbounded == []


@pytest.mark.parametrize("topic", WRITTEN_BY_DRONES, ids=lambda topic: topic.template)
def test_a_large_message_of_a_drone_is_refused_before_it_is_decoded(topic: Topic[Any]) -> None:
    assert topic.most_bytes is not None

    with pytest.raises(ValidationError) as refused:
        topic.read(b"{" * (topic.most_bytes + 1))

    (fault,) = refused.value.errors()
    assert fault["type"] == "too_large"


def parts_of(schema: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """Every part of a JSON Schema, with its place."""
    if isinstance(schema, dict):
        yield place, schema
        for name, value in schema.items():
            yield from parts_of(value, f"{place}/{name}")
    elif isinstance(schema, list):
        for value in schema:
            yield from parts_of(value, place)
