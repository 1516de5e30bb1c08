"""Values made of their members, and the cache: only a text that is not recent is parsed."""

from skyway.json_model import JsonCache, JsonModel


class Note(JsonModel):
    text: str


def test_a_value_of_its_members_equals_the_validated_value() -> None:
    members, validated = {"text": "a"}, Note(text="a")

    made = Note.of_members(members)

    assert (made, hash(made), repr(made)) == (validated, hash(validated), repr(validated))
    assert made.model_fields_set == validated.model_fields_set
    assert made.model_copy(update={"text": "b"}) == Note(text="b")
    assert made.model_dump_json() == validated.model_dump_json()


def test_a_written_value_is_read_without_parsing() -> None:
    cache, note = JsonCache(Note, most=3), Note(text="a")

    assert cache.read(cache.write(note)) is note


def test_a_text_that_was_read_is_not_parsed_again() -> None:
    cache = JsonCache(Note, most=3)

    assert cache.read('{"text": "a"}') is cache.read('{"text": "a"}')


def test_a_text_written_by_another_replica_is_parsed() -> None:
    cache = JsonCache(Note, most=3)
    cache.write(Note(text="a"))

    assert cache.read('{"text":"b","of_a_newer_version":1}') == Note(text="b")


def test_a_value_that_left_the_cache_is_parsed_again() -> None:
    cache, note = JsonCache(Note, most=3), Note(text="first")
    text = cache.write(note)
    for number in range(3):
        cache.write(Note(text=str(number)))

    assert cache.read(text) == note
    assert cache.read(text) is not note


def test_each_value_has_its_own_text_after_others_have_left_the_cache() -> None:
    cache, kept = JsonCache(Note, most=3), Note(text="kept")
    text = cache.write(kept)

    # A new value may get the identity of one that has left the cache.
    for number in range(100):
        assert cache.write(Note(text=str(number))) == f'{{"text":"{number}"}}'
    assert cache.write(kept) == text


def test_a_value_is_written_with_its_text_after_an_equal_one_was_written() -> None:
    cache, first, second = JsonCache(Note, most=3), Note(text="a"), Note(text="a")

    assert cache.write(first) == cache.write(second) == cache.write(first)
    assert cache.read(cache.write(second)) == first
