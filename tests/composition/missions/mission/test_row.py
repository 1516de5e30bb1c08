"""The cache of JSON values: a recent text is not parsed again, another text is."""

from skyway_composition.missions.mission.row import MOST, JsonCache

from skyway.json_model import JsonModel


class Note(JsonModel):
    text: str


def test_a_written_value_is_read_without_parsing() -> None:
    cache, note = JsonCache(Note), Note(text="a")

    assert cache.read(cache.write(note)) is note


def test_a_text_that_was_read_is_not_parsed_again() -> None:
    cache = JsonCache(Note)

    assert cache.read('{"text": "a"}') is cache.read('{"text": "a"}')


def test_a_text_written_by_another_replica_is_parsed() -> None:
    cache = JsonCache(Note)
    cache.write(Note(text="a"))

    assert cache.read('{"text":"b","of_a_newer_version":1}') == Note(text="b")


def test_a_value_that_left_the_cache_is_parsed_again() -> None:
    cache, note = JsonCache(Note), Note(text="first")
    text = cache.write(note)
    for number in range(MOST):
        cache.write(Note(text=str(number)))

    assert cache.read(text) == note
    assert cache.read(text) is not note
