"""Calls of the public API with extreme values, made from its OpenAPI document."""

import itertools
import json
import random
from urllib.parse import urlsplit

from benchmarks.hostile.calls import Call, all_calls, forged_calls

KNOWN = {"delivery_id": ("dlv_1",), "station_id": ("sta_1",)}
REQUEST = Call("post", "/v1/deliveries", (), (), {"pickup": {"station_id": "x"}, "n": 1})
READ = Call("get", "/v1/deliveries/{delivery_id}", ("delivery_id",), ("limit",), None)


def test_every_operation_of_the_document_is_called_and_bodies_have_examples() -> None:
    calls = all_calls()

    assert {"POST /v1/deliveries", "DELETE /v1/keys/{key_id}"} <= {each.name for each in calls}
    first = {
        each.call.name for each in itertools.islice(forged_calls(calls, {}, _chance()), len(calls))
    }
    assert len(first) == len(calls)
    assert all(each.body for each in calls if each.name == "POST /v1/quotes")


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
