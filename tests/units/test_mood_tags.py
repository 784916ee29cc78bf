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


@pytest.mark.parametrize(
    ("text", "words", "named"),
    [
        ("[plays the harp] hello <b>you</b>", "hello you", "[plays the harp], <b>, </b>"),
        ("“What the {i}heck{/i}?{w=0.5} My {b}boat{/b} is gone.”", "what the heck my boat is gone", "{w=0.5}"),
        ("<color=#f00>re</color>d un<b>believ</b>able <sprite index=1>", "red unbelievable", "<sprite index=1>"),
        ("[wave]hey[/wave] you #line:0e12a", "hey you", "#line:0e12a"),
        ("See [[Go north|North]] <<set $y to 2>> (set: $x to 1)", "see go north", "<<set $y to 2>>"),
        ('<speak>hi<break time="1s"/>you</speak>', "hi you", '<break time="1s"/>'),
        ("*coughs* hi (clears his throat) <|en|>you", "hi you", "*coughs*, (clears his throat), <|en|>"),
        ("ANNA\uff1a hi\\nyou", "hi you", "ANNA\uff1a, \\n"),
        ("*really* so", "really so", ""),
        ("ANNA: Please speak.\nBEN: I will.", "please speak i will", "ANNA:, BEN:"),
        ("ZOË: Hi", "hi", "ZOË:"),
        ("Anna (V.O.): Hi", "hi", "Anna (V.O.):"),
        ("[Anna]: Hi\n[ANNA] you", "hi you", "[Anna]:, [ANNA]"),
        ("**ANNA:** Hi", "hi", "ANNA"),
        ("Anna: Hi\nBen: Hello", "hi hello", "Anna:, Ben:"),
        ("SPEAKER 1: a\nspeaker 2: b", "a b", "speaker 2:"),
        ("- Hello.\n- Hi.", "hello hi", ""),
        ("INT. HUT - DAY\n\nANNA\n(low)\nSpeak.\n\nBEN (O.S.)\nI do.", "speak i do", "INT. HUT - DAY, (low)"),
        ("Note: this is said.", "note this is said", ""),
        ("He said: go\nAt 5:30: run", "he said go at five thirty run", ""),
        ("HELP\nme now", "help me now", ""),
        ("0:00\nhi\nAnna Lee  1:07\nyou", "hi you", "0:00, Anna Lee  1:07"),
        ("(00:04) hi\n00:00:09 - you", "hi you", "(00:04), 00:00:09 -"),
        ("1. One hi\n2.You\n3) 20\na) the\nb) end", "one hi you twenty the end", "1., 2., 3), a), b)"),
        ("2. you\n4. me", "two you four me", ""),
        ("5:30 is early\n7:15 is late", "five thirty is early seven fifteen is late", ""),
        ('e "Hello"', "hello", "e"),
        ('e happy "Hello"\n"A voice."\nm "Hi \\"you\\""', "hello a voice hi you", "e happy, m"),
        ('she said "hello"', "she said hello", ""),
        ('Then he went "Hello" and left', "then he went hello and left", ""),
    ],
)
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


def test_links_and_times_are_not_spoken():
    text = parse_tagged_text("see [our site](https://a.org/b) [0:12] and ![a cat](c.png) [2s]").text
    assert text.split() == ["see", "our", "site", "and", "a", "cat"]


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
