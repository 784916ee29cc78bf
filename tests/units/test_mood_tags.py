import pytest

from lipmotion.types import Span, Timeline, Unit
from lipmotion.types.moods import NEUTRAL, MoodKey, MoodTag
from lipmotion.units import words_of
from lipmotion.units.mood_tags import SYNONYMS, moods_in_time, tagged_text, without_known_tags


def test_a_text_without_tags_is_returned_as_it_is():
    text = "It is 3 < 4, and (really) a > b."
    assert tagged_text(text) == (text, ())


def test_tags_hold_until_the_next_and_end_tags_are_neutral():
    plain, tags = tagged_text("One [Angry] two <smile>three</smile> four [sad: 0.25]")
    assert words_of(plain) == ("one", "two", "three", "four")
    assert tags == (
        MoodTag(0.25, "angry"),
        MoodTag(0.5, "happy", 0.6),
        MoodTag(0.75, NEUTRAL),
        MoodTag(1.0, "sad", 0.25),
    )


def test_unknown_tags_are_named_and_not_spoken(caplog):
    plain, tags = tagged_text("[plays the harp] hello <b>you</b>")
    assert words_of(plain) == ("hello", "you")
    assert tags == ()
    assert "[plays the harp], <b>, </b>" in caplog.text


def test_known_tags_alone_can_be_taken_out():
    assert without_known_tags("<html> [happy] hello").split() == ["<html>", "hello"]


def test_manners_are_tags_too():
    tags = tagged_text("[whispers] one </whispers> two")[1]
    assert [tag.mood for tag in tags] == ["whisper", "plain"]


def test_every_synonym_means_a_mood():
    for mood, strength in SYNONYMS.values():
        MoodKey(0.0, mood, strength)
        assert strength > 0


@pytest.mark.parametrize("words", [True, False])
def test_moods_begin_with_the_word_after_the_tag(words):
    said = [("sil", ""), ("ay", "i"), ("aa", "a"), ("iy", "e"), ("sil", "")]
    spans = tuple(Span(0.2 * n, 0.2 * (n + 1), Unit(phone, word=word * words)) for n, (phone, word) in enumerate(said))
    keys = moods_in_time((MoodTag(0.0, "sad"), MoodTag(2 / 3, "happy", 0.5), MoodTag(1.0, NEUTRAL)), Timeline(spans))
    assert [key.label for key in keys] == ["sad", "happy:0.5", NEUTRAL]
    assert [key.time_s for key in keys] == pytest.approx([0.0, 0.6, 0.8 if words else 1.0])
    assert moods_in_time((), Timeline(spans)) == ()
