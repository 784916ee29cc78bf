import json
from pathlib import Path

import pytest

from lipmotion.types import Span, Timeline, Unit
from lipmotion.types.delivery import NEUTRAL, MoodKey, MoodTag
from lipmotion.units import split_words
from lipmotion.units.spoken_text import SYNONYMS, parse_tagged_text, remove_known_tags, time_moods


def test_tags_hold_until_the_next_and_end_tags_are_neutral():
    text = "It is 3 < 4, and (really) a > b."  # without tags it is returned as it is
    assert parse_tagged_text(text) == (text, ())
    plain, tags = parse_tagged_text("One [Angry] two <smile>three</smile> four [sad: 0.25]")
    assert split_words(plain) == ("one", "two", "three", "four")
    wanted = (0.25, "angry"), (0.5, "happy", 0.6), (0.75, NEUTRAL), (1.0, "sad", 0.25)
    assert tags == tuple(MoodTag(*each) for each in wanted)


MARKUP = json.loads(Path(__file__).with_name("said_texts.json").read_text("utf-8"))["markup"]


@pytest.mark.parametrize(("text", "words", "named"), MARKUP)
def test_markup_and_names_of_speakers_are_named_and_not_spoken(caplog, text, words, named):
    assert " ".join(split_words(parse_tagged_text(text).text)) == words
    assert named in caplog.text
    assert bool(caplog.records) == bool(named)


def test_manners_and_what_somebody_does_between_asterisks_are_tags_too():
    for text, moods in (
        ("[whispers] one </whispers> two", ["whisper", "plain"]),
        ("*laughs* {angry}no{/angry} *gasps*", ["happy", "angry", NEUTRAL, "surprised"]),
    ):
        assert [tag.mood for tag in parse_tagged_text(text).tags] == moods


def test_known_tags_alone_can_be_taken_out():
    assert remove_known_tags("<html> [happy] hello").split() == ["<html>", "hello"]


def test_every_synonym_means_a_mood():
    for mood, strength in SYNONYMS.values():
        MoodKey(0.0, mood, strength)
        assert strength > 0


@pytest.mark.parametrize("words", [True, False])
def test_moods_begin_with_the_word_after_the_tag(words):
    said = [("sil", ""), ("ay", "i"), ("aa", "a"), ("iy", "e"), ("sil", "")]
    spans = tuple(Span(0.2 * n, 0.2 * (n + 1), Unit(phone, word=word * words)) for n, (phone, word) in enumerate(said))
    keys = time_moods((MoodTag(0.0, "sad"), MoodTag(2 / 3, "happy", 0.5), MoodTag(1.0, NEUTRAL)), Timeline(spans))
    assert [key.label for key in keys] == ["sad", "happy:0.5", NEUTRAL]
    assert [key.time_s for key in keys] == pytest.approx([0.0, 0.6, 0.8 if words else 1.0])
    assert time_moods((), Timeline(spans)) == ()
