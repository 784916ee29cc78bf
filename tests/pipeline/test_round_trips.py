"""What was written and is given back unedited is what it was; an edit stays where it was made."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lipmotion import Request, animate, cues, read_motion, speak, write
from lipmotion.pipeline.analysis.read_request import read_units
from lipmotion.pipeline.analysis.speech_analysis import analyse
from lipmotion.pipeline.outputs.cues import cue_text
from lipmotion.pipeline.outputs.motion_files import read_generation
from lipmotion.speech.recognition.recognised_speech import relied_on
from lipmotion.types import Generation, Span, Timeline, Unit
from speech import stand_in_voice

LEFT_CORNER = "y_291"
"""A channel of one side of the mouth: an edit may be of that side alone."""
PHONE_FILES = ("a.TextGrid", "a.json", "a.npz")


def test_spoken_text_and_its_phones_give_the_motion_of_speak(monkeypatch, toy_model, tmp_path):
    stand_in_voice.install(monkeypatch)
    sound, said = speak("Papa, see Bob. Mama!", model=toy_model)
    write(said, [tmp_path / name for name in ("a.wav", "a.flac", *PHONE_FILES)], speech=sound)
    for recording, phones in (("a.wav", "a.TextGrid"), ("a.flac", "a.json"), ("a.wav", "a.npz")):
        request = Request(tmp_path / recording, units=read_units(tmp_path / phones))
        again = animate(request, model=toy_model)
        assert np.array_equal(again.motion.values, said.motion.values)
        assert again.units == said.units
        assert cue_text(cues(again), form="pgo") == cue_text(cues(said), form="pgo")


@pytest.mark.parametrize("name", PHONE_FILES)
@pytest.mark.parametrize("words", [None, "all"])
def test_phones_of_a_recording_say_what_is_known_of_them(toy_model, toy_sentence, tmp_path, words, name):
    transcript = " ".join(toy_sentence.words) if words else None
    request = Request(toy_sentence.audio, transcript=transcript, recogniser="own")
    first = analyse(toy_model, request)
    result = animate(request, model=toy_model)
    write(result, tmp_path / name)
    given = Request(toy_sentence.audio, units=read_units(tmp_path / name), recogniser="own")
    again = analyse(toy_model, given)
    assert (
        (again.units_known, again.confidence)
        == (first.units_known, first.confidence)
        == (bool(words), float(bool(words)))
    )
    assert again.units_decide == first.units_decide == bool(words)
    assert np.array_equal(animate(given, model=toy_model).motion.values, result.motion.values)


@pytest.mark.parametrize("name", PHONE_FILES)
def test_corrected_phones_are_known_and_all_others_as_doubtful_as_before(
    toy_model, toy_sentence, generation, tmp_path, name
):
    found = relied_on(toy_sentence.units, 0.25)
    write(replace(generation, units=found), tmp_path / name)
    read = read_units(tmp_path / name)
    assert [span.label.confidence for span in read] == [0.25] * len(found)
    at, border_s = 4, read[4].end_s + 0.02
    spans = list(read)
    spans[at] = replace(spans[at], end_s=border_s)
    spans[at + 1] = replace(spans[at + 1], start_s=border_s)
    edited = tmp_path / f"b{Path(name).suffix}"
    write_as_edited(edited, Timeline(tuple(spans)), found, generation)
    speech = analyse(toy_model, Request(toy_sentence.audio, units=read_units(edited)))
    assert [span.label.confidence for span in speech.units].count(None) == 2
    confidence = np.asarray(speech.confidence)
    known = np.flatnonzero(confidence == 1) / 100
    assert speech.units_decide
    assert not speech.units_known
    assert read[at].start_s - 1e-6 <= known.min() < known.max() <= read[at + 1].end_s
    assert set(np.unique(confidence)) == {0.25, 1.0}


def write_as_edited(path: Path, units: Timeline[Unit], found: Timeline[Unit], generation: Generation) -> None:
    """Write phones as a user leaves them who edited the file of ``found``."""
    write(replace(generation, units=found), path)
    if path.suffix == ".npz":
        with np.load(path) as file:
            arrays = dict(file)
        arrays["document"] = np.array(edited_text(str(arrays["document"]), units, found, "json"))
        np.savez(path, **arrays)
    else:
        path.write_text(edited_text(path.read_text(), units, found, path.suffix), encoding="utf-8")


def edited_text(text: str, units: Timeline[Unit], found: Timeline[Unit], kind: str) -> str:
    """Return the text of a file with the times of phones changed, but not of what was recognised."""
    phones, mark, rest = text.partition('"words"' if kind == ".TextGrid" else '"recognised"')
    for before, after in zip(found, units, strict=True):
        for key, was, now in (
            ("xmax = ", before.end_s, after.end_s),
            ("xmin = ", before.start_s, after.start_s),
            ('"end_s": ', before.end_s, after.end_s),
            ('"start_s": ', before.start_s, after.start_s),
        ):
            phones = phones.replace(f"{key}{was}", f"{key}{now}") if was != now else phones
    return phones + mark + rest


def test_silence_alone_comes_back(generation, tmp_path):
    silent = Timeline((Span(0.0, 1.0 / 3, Unit("sil", confidence=0.0)),))
    write(replace(generation, units=silent), tmp_path / "a.TextGrid")
    assert read_units(tmp_path / "a.TextGrid") == silent


@pytest.mark.parametrize("suffix", ["json", "csv", "npz", "c3d", "livelink.csv", "fap"])
@pytest.mark.parametrize("rate_hz", [25.0, 30_000 / 1001])
def test_motion_that_is_read_and_written_is_what_it_was(generation, tmp_path, suffix, rate_hz):
    first, second = tmp_path / f"a.{suffix}", tmp_path / f"b.{suffix}"
    write(generation, first, rate_hz=rate_hz)
    write(read_generation(first), second)
    (one, phones), (other, same_phones) = read_motion(first), read_motion(second)
    assert one.channels == other.channels
    assert one.rate_hz == other.rate_hz == rate_hz
    assert phones == same_phones
    assert np.array_equal(one.values, other.values)


@pytest.mark.parametrize("suffix", ["json", "csv", "npz", "c3d"])
@pytest.mark.parametrize("output", ["json", "csv", "npz", "c3d"])
def test_an_edited_value_is_the_only_one_that_changes(generation, tmp_path, suffix, output):
    write(generation, tmp_path / f"a.{suffix}")
    given = read_generation(tmp_path / f"a.{suffix}")
    values = given.motion.values.copy()
    columns = sorted(given.motion.column(name) for name in ("opening", LEFT_CORNER))
    values[50, columns] += 0.125
    write(replace(given, motion=replace(given.motion, values=values)), tmp_path / f"b.{suffix}")
    write(given, tmp_path / f"c.{output}")
    write(read_generation(tmp_path / f"b.{suffix}"), tmp_path / f"d.{output}")
    before, after = (read_motion(tmp_path / f"{name}.{output}")[0].values for name in "cd")
    changed = np.argwhere(before != after)
    assert changed.tolist() == [[50, column] for column in columns]
    assert (after - before)[50, columns] == pytest.approx(0.125, abs=1e-5)


def test_an_edited_opening_leaves_brows_alone_that_are_far_away(generation, tmp_path):
    values = generation.motion.values.copy()
    values[20:25, generation.motion.column("opening")] += 0.3
    edited = replace(generation, motion=replace(generation.motion, values=values))
    write(generation, tmp_path / "a.livelink.csv")
    write(edited, tmp_path / "b.livelink.csv")
    before, after = (read_motion(tmp_path / name)[0] for name in ("a.livelink.csv", "b.livelink.csv"))
    far = before.time_s > 1.25
    assert far.any()
    moved = np.abs(before.values - after.values)[far].max(axis=0)
    mouth = np.array([name.startswith(("mouth", "jaw")) for name in before.names])
    assert moved[~mouth].max() < 1e-4
    assert moved[mouth].max() < 2e-3  # all frames are solved at once, in steps
