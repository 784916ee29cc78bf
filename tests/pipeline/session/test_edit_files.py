import sys
from dataclasses import replace

import numpy as np
import pytest

from lipmotion import Delivery, Edits, Request, Staging, animate, load_model
from lipmotion.errors import InputError
from lipmotion.formats.sound import write_sound
from lipmotion.pipeline.edit_files import EditFile, create_edit_file, read_edits, write_edits
from lipmotion.pipeline.edits import STEPS, MoodStep, parse_step
from lipmotion.storage.sources import sha256_of
from lipmotion.types import Outlook, Span, Timeline, Unit
from lipmotion.units import group_words

SENTENCES = (
    "word 3 is blue",
    "word 3 is tear said t eh r",
    "say how are you from 1.0 to 2.5",
    "say hello zoe from 1.0 to 2.5 with zoe z ow iy, hello hh eh l ow",
    "phone 12 is p",
    "phone 12 begins 1.2",
    "phone 12 ends 1.24",
    "split phone 3 at 0.7",
    "remove phone 2",
    "insert m from 0.5 to 0.56",
    "pin jawOpen 1e-05 at 1.2",
    "pin opening 0.1 at 1.2 slope -0.5",
    "unpin opening at 1.2",
    "gain 1.3 from 1.0 to 2.0",
    "gain jawOpen 0.8 from 1.0 to 2.0",
    "draw opening 0.1 0.12 0.0 from 1.0 to 1.5",
    "hold from 1.0 to 1.3",
    "lock from 1.0 to 1.5",
    "unlock from 1.0 to 1.5",
    "mood happy:0.7 at 1.2",
    "set intensity 1.2",
)


def test_every_kind_of_edit_is_a_sentence():
    steps = [parse_step(sentence) for sentence in SENTENCES]
    assert {step.form for step in steps} == set(STEPS)
    assert tuple(map(str, steps)) == SENTENCES
    assert [parse_step(str(step)) for step in steps] == steps


@pytest.mark.parametrize(
    ("sentence", "message"),
    [
        ("phone twelve is p", "is no edit; required one of: phone NUMBER is PHONE; phone NUMBER begins"),
        ("jump", "is no edit; required one of: word NUMBER is WORD"),
        ("pin opening 1,2 at 1", "is no edit; required one of: pin CHANNEL VALUE at TIME; pin"),
        ("pin opening nan at 1", "is no edit"),
        ("gain 9 from 0 to 1", "the gain is 9, required 0 to 3"),
        ("word 1 is tear said t eh R", "unknown phone 'R'"),
        ("word 1 is tear said t sil", "a word has no silence in it"),
        ("say hello from 2 to 1", "required an end after the start"),
        ("say zoe from 1 to 2 with zoe", "'zoe' has no phones; required WORD PHONES, WORD"),
        ("say zoe from 1 to 2 with zoe z sil", "a word has no silence in it"),
        ("say zoe from 2 to 1 with zoe z ow iy", "required an end after the start"),
        ("hold from 2 to 1", "required an end after the start"),
        ("draw opening 0.1 from 1 to 2", "1 values are drawn, required 2 to"),
        ("lock from 2 to 1", "required an end after the start"),
        ("mood gloomy at 1", "the mood is 'gloomy', required one of: neutral, happy"),
        ("mood happy,sad at 1", "required one mood"),
        ("set loudness 2", "nothing is called 'loudness'; required one of: intensity"),
        ("set intensity loud", "required a number"),
        ("set intensity 9", "required 0 to 3"),
        ("set stepped maybe", "required one of: true, false"),
    ],
)
def test_sentences_that_state_no_edit(sentence, message):
    with pytest.raises(InputError, match=message):
        parse_step(sentence)


def test_delivery_and_staging_are_set_where_nothing_else_is_asked_for():
    edits = Edits().then("set intensity 1.2", "set stepped true", "set size 360", "set intensity 1.3")
    assert edits.delivery() == Delivery(intensity=1.3, stepped=True)
    assert edits.delivery(Delivery(intensity=2.0)).intensity == 2.0
    assert edits.staging() == Staging(size=360)


def test_moods_are_added_to_those_that_are_asked_for():
    edits = Edits().then("mood sad at 2.0", "mood happy:0.7 at 1.0", "mood angry at 2.0")
    assert edits.delivery().mood == "happy:0.7 at 1, angry at 2"
    assert edits.delivery(Delivery(mood="tired")).mood == "tired at 0, happy:0.7 at 1, angry at 2"
    assert Edits().then("set mood tense:0.5").delivery().mood == "tense:0.5"


@pytest.mark.parametrize("suffix", [".json", ".toml"])
def test_what_is_written_is_read_again(tmp_path, suffix):
    path = tmp_path / f"a.edits{suffix}"
    spans = (Span(0.0, 0.3, Unit("sil")), Span(0.3, 1 / 3 + 0.1, Unit("p", "sil-p+l", 'pl"ease', confidence=0.25)))
    outlook = Outlook("words", 0.5, None, 30.5, ("a \\ transcript",))
    file = EditFile(
        Edits().then(*SENTENCES),
        Request(tmp_path / "in" / "a b.wav", pauses="natural"),
        Timeline(spans),
        outlook,
        sha256="ab",
    )
    write_edits(file, path)
    if suffix == ".toml" and sys.version_info < (3, 11):
        with pytest.raises(InputError, match=r"read by Python 3\.11"):
            read_edits(path)
        return
    found = read_edits(path)
    assert (found.edits, found.units, found.outlook) == (file.edits, file.units, file.outlook)
    assert (found.named, found.sha256) == (file.named, "ab")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[]", "not a file of edits"),
        ("{", "not a file of edits"),
        ('{"format": "lipmotion.edits", "version": 9}', "edits of version 9, required 1"),
        ('{"format": "lipmotion.edits", "version": 1, "stops": []}', "unknown member 'stops'"),
        ('{"format": "lipmotion.edits", "version": 1, "steps": "lock"}', "required a list"),
        ('{"format": "lipmotion.edits", "version": 1, "steps": ["jump"]}', "'jump' is no edit"),
        ('{"format": "lipmotion.edits", "version": 1, "units": [{"phone": "p"}]}', "start_s"),
    ],
)
def test_files_that_are_refused(tmp_path, text, message):
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_edits(path)


def test_a_file_holds_the_moods_of_tags(toy_sentence, toy_model_file, tmp_path):
    words, recording = toy_sentence.words, tmp_path / "a.wav"
    write_sound(recording, toy_sentence.audio)
    tagged = f"[happy:0.5] {words[0]} [angry] {' '.join(words[1:])}"
    file = create_edit_file(Request(recording, tagged, model=toy_model_file))[0]
    first, second = (step for step in file.edits.steps if isinstance(step, MoodStep))
    assert (str(first), second.mood) == ("mood happy:0.5 at 0.0", "angry")
    spoken = [span for span in group_words(file.units or Timeline(())) if span.label]
    assert second.time_s == pytest.approx(spoken[1].start_s)


def test_a_file_replays_what_was_recognised(toy_speech, toy_model_file, tmp_path):
    """The phones in the file are the base: the motion is that of the session in which they were edited."""
    asked = Request(toy_speech, recogniser="own", model=toy_model_file)
    path, edits = tmp_path / "a.json", Edits().then("phone 3 is p", "pin jawOpen 0.2 at 1.0")
    write_edits(replace(create_edit_file(asked)[0], edits=edits), path)
    read = read_edits(path)
    plain = animate(Request(toy_speech, recogniser="own"), model=load_model(toy_model_file), edits=edits)
    replayed = read.session().generate(read.edits)
    assert np.array_equal(replayed.motion.values, plain.motion.values)
    assert (replayed.units, replayed.outlook, replayed.curve_edits) == (plain.units, plain.outlook, plain.curve_edits)


def test_edits_of_another_sound_are_refused(toy_speech, toy_model_file, tmp_path):
    """Of the same length, and wherever it lies; without a digest, as in earlier files, they are taken."""
    sound, path = tmp_path / "a.wav", tmp_path / "a.edits.json"
    sound.write_bytes(toy_speech.read_bytes())
    file = create_edit_file(Request(sound, recogniser="own", model=toy_model_file))[0]
    write_edits(file, path)
    assert read_edits(path).sha256 == sha256_of(toy_speech)
    other = tmp_path / "other.wav"
    other.write_bytes(sound.read_bytes()[:-2] + b"\0\1")
    model = load_model(toy_model_file)
    phones = [span.label.phone for span in file.units or ()]
    assert [span.label.phone for span in animate(toy_speech, model=model, edits=path).units] == phones
    with pytest.raises(InputError, match="another recording"):
        animate(other, model=model, edits=path)
    other.replace(sound)
    with pytest.raises(InputError, match="another recording"):
        read_edits(path).session()
    unknown = replace(file, sha256="")
    assert [span.label.phone for span in animate(sound, model=model, edits=unknown).units] == phones
