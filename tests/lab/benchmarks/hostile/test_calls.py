"""Calls of the public API with extreme values, made from its OpenAPI document."""

import itertools
import json
import random
from urllib.parse import urlsplit

import pytest
from skyway_lab.benchmarks.hostile.bodies import places, with_all_fields, with_value
from skyway_lab.benchmarks.hostile.calls import Body, Call, all_calls, every_variant, forged_calls
from skyway_lab.benchmarks.hostile.extremes import all_texts, extremes_for

_OPTIONAL = {"anyOf": [{"type": "null"}, {"type": "integer"}]}
KNOWN = {"delivery_id": ("dlv_1",), "station_id": ("sta_1",)}
EXAMPLE = {"pickup": {"station_id": "x"}, "n": 1}
REQUEST = Call("post", "/v1/deliveries", (), (), (Body(EXAMPLE, EXAMPLE),))
READ = Call("get", "/v1/deliveries/{delivery_id}", ("delivery_id",), ("limit",))


@pytest.mark.long
def test_every_operation_of_the_document_is_called_and_bodies_have_examples() -> None:
    calls = all_calls()

    assert {"POST /v1/deliveries", "DELETE /v1/keys/{key_id}"} <= {each.name for each in calls}
    forged = forged_calls(calls, {}, _chance())
    assert len({each.call.name for each in itertools.islice(forged, 50_000)}) == len(calls)
    bodies = {each.name: len(each.bodies) for each in calls}
    # A request, or the choice of an offer.
    assert (bodies["POST /v1/quotes"], bodies["POST /v1/deliveries"]) == (1, 2)


def test_every_field_and_parameter_has_every_extreme_value_once() -> None:
    read, request = [*every_variant(READ)], [*every_variant(REQUEST)]

    assert len(read) == 1 + 2 * len(all_texts())
    sent = [json.dumps(each.body, sort_keys=True) for each in request if each.raw is None]
    for number in extremes_for(1):
        assert json.dumps(EXAMPLE | {"n": number}, sort_keys=True) in sent
    for text in extremes_for("x"):
        changed = EXAMPLE | {"pickup": {"station_id": text}}
        assert json.dumps(changed, sort_keys=True) in sent


def test_a_field_that_the_example_leaves_out_is_tried_too() -> None:
    schemas = {
        "Body": {"properties": {"at": {"type": "string", "format": "date-time"}, "n": _OPTIONAL}},
    }

    full = with_all_fields({"n": 5}, {"$ref": "#/components/schemas/Body"}, schemas)

    assert full == {"n": 5, "at": "2026-03-02T08:17:00Z"}
    assert [*places(full)] == [(), ("at",), ("n",)]
    assert with_value({"n": 5}, full, ("at",), None) == {"n": 5, "at": None}


def test_what_lies_around_a_field_is_added_with_it() -> None:
    full = {"qos": {"providers": {"denied": ["x"]}}}

    assert with_value({}, full, ("qos", "providers", "denied", 0), 7) == {
        "qos": {"providers": {"denied": [7]}}
    }


def test_known_ids_stand_in_paths_and_bodies() -> None:
    forged = list(itertools.islice(forged_calls([REQUEST, READ], KNOWN, _chance()), 200))

    assert any(each.target.startswith("/v1/deliveries/dlv_1") for each in forged)
    assert any(b'"station_id": "sta_1"' in (each.body or b"") for each in forged)


def test_no_extreme_value_adds_a_segment_to_a_path() -> None:
    for each in itertools.islice(forged_calls([READ], KNOWN, _chance()), 300):
        assert urlsplit(each.target).path.count("/") == 3


def test_most_bodies_can_be_read_and_some_cannot() -> None:
    forged = list(itertools.islice(forged_calls([REQUEST], KNOWN, _chance()), 300))
    readable = [each for each in forged if _is_json(each.body or b"")]

    assert len(forged) / 2 < len(readable) < len(forged)


def _chance() -> random.Random:
    return random.Random(1)


def _is_json(body: bytes) -> bool:
    try:
        json.loads(body)
    except (ValueError, RecursionError):
        return False
    return True
