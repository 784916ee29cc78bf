import pytest

from lipmotion.errors import InputError
from lipmotion.types import Delivery
from lipmotion.types.delivery import MoodKey, format_moods, parse_moods, sort_moods


def test_a_text_of_moods_is_read_and_written():
    keys = parse_moods("sad at 2.5, Happy:0.7, neutral at 4")
    assert keys == (MoodKey(0.0, "happy", 0.7), MoodKey(2.5, "sad"), MoodKey(4.0, "neutral"))
    assert parse_moods(format_moods(keys)) == keys
    assert parse_moods("") == ()
    exact = (MoodKey(2e-05, "sad", 1e-05), MoodKey(7201.2345, "happy"))
    assert parse_moods(format_moods(exact)) == exact


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("hapy", "is it happy"),
        ("happy:1.2", "required 0 to 1"),
        ("happy:-0.5", "required 0 to 1"),
        ("happy at -1", "required 0 or more"),
        ("happy sad", "with commas"),
        ("happy:", "required MOOD"),
    ],
)
def test_other_texts_are_refused(text, said):
    with pytest.raises(InputError, match=said):
        parse_moods(text)
    with pytest.raises(InputError, match=said):
        Delivery(mood=text)


def test_of_two_moods_at_one_time_the_last_holds_but_a_manner_may_begin_with_a_mood():
    keys = sort_moods([MoodKey(1.0, "sad"), MoodKey(0.0, "happy"), MoodKey(1.0, "angry")])
    assert keys == (MoodKey(0.0, "happy"), MoodKey(1.0, "angry"))
    assert [key.label for key in parse_moods("whisper, sad:0.5, mumble")] == ["sad:0.5", "mumble"]
