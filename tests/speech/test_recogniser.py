from collections.abc import Sequence
from dataclasses import replace
from difflib import SequenceMatcher
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from lipmotion import Model, errors, load_model, types
from lipmotion.speech.recognition import adaptation, recogniser
from lipmotion.speech.recognition.adaptation_estimation import EstimatedAdaptation, estimate_adaptation
from lipmotion.speech.recognition.general import NOISES, combine_likelihoods, combine_phones, load_general
from lipmotion.speech.recognition.recognised_speech import (
    SLIVER_FRAMES,
    AlignedWords,
    LabelledFrames,
    RecognisedWord,
    build_recognition,
    label_words,
    splice,
    time_phones,
)
from lipmotion.speech.sound.voice_activity import Stretch
from lipmotion.stats.constrained_mllr import log_determinant
from lipmotion.types import Audio, Timeline, Unit
from lipmotion.units import PAUSE, PHONES, SILENCE, Lexicon
from lipmotion.units.phones import SHORT_PAUSE_S, count_phone_edits
from pipeline.made import features_of, read_sound
from testing.formant_synthesiser import synthesise
from testing.toy import WORDS, ToySentence, toy_sentences


@pytest.fixture(scope="module")
def sentences() -> list[ToySentence]:
    return toy_sentences(12)


@pytest.fixture(scope="module")
def hmm(toy_model: Model) -> Any:
    return toy_model.phones


def align(hmm: Any, audio: Audio, words: Sequence[str], lexicon: Lexicon, kind: str = "own") -> Timeline[Unit]:
    sound = read_sound(audio)
    return recogniser.Recogniser(hmm, kind).align(sound, words, lexicon)


def recognise(hmm: Any, audio: Audio, kind: str = "own") -> Timeline[Unit]:
    sound = read_sound(audio)
    return recogniser.Recogniser(hmm, kind).recognise(sound).units


def phones(units: Timeline[Unit]) -> list[str]:
    return [span.label.phone for span in units]


def with_pause(duration_s: float) -> Audio:
    """Say ``papa mama`` with a pause between the words."""
    said = [(phone, 0.17 if phone[0] == "a" else 0.105) for word in ("papa", "mama") for phone in WORDS[word]]
    return synthesise([("sil", 0.4), *said[:4], ("sil", duration_s), *said[4:], ("sil", 0.5)])[0]


def covers(units: Timeline[Unit], duration_s: float) -> bool:
    """Do the spans follow one another without a gap, from 0 to the end?"""
    edges_s = [0.0, *(span.end_s for span in units)]
    return edges_s == [*(span.start_s for span in units), duration_s]


def test_the_words_are_found_where_they_are(hmm: Any, sentences: list[ToySentence]) -> None:
    errors_s = []
    for sentence in sentences[::2]:
        found = align(hmm, sentence.audio, sentence.words, Lexicon())
        assert phones(found) == phones(sentence.units)
        assert [span.label.word for span in found] == [span.label.word for span in sentence.units]
        assert covers(found, sentence.audio.duration_s)
        errors_s += [a.start_s - b.start_s for a, b in zip(found, sentence.units, strict=True)][1:]
    assert np.mean(np.abs(errors_s)) < 0.03
    assert np.percentile(np.abs(errors_s), 90) < 0.05


def test_frame_n_reaches_from_half_a_frame_before_to_half_a_frame_after_and_silences_are_one() -> None:
    bounds = np.array([0, 10, 12, 40, 60, 80, 100])
    found = time_phones([(phone, "") for phone in ("sil", "p", "sil", "aa", "sil", "sil")], bounds, 1.0)
    assert [span.start_s for span in found] == pytest.approx([0, 0.095, 0.115, 0.395, 0.595])
    assert covers(found, 1.0)
    assert phones(found) == ["sil", "p", "sil", "aa", "sil"]


def test_unknown_sentences_and_digital_silence(hmm: Any, sentences: list[ToySentence]) -> None:
    for sentence in sentences[-3:]:
        found = recognise(hmm, sentence.audio)
        assert covers(found, sentence.audio.duration_s)
        assert set(phones(found)) <= set(hmm.table.units)
        if sentence.split == "test":
            assert SequenceMatcher(None, phones(found), phones(sentence.units)).ratio() > 0.9
        assert all(span.label.word == "" for span in found)
    silent = recognise(hmm, Audio(np.zeros(16_000, np.float32), 16_000))
    assert phones(silent) == [SILENCE]
    assert covers(silent, 1.0)


def test_silence_at_both_ends_is_silence_however_short(hmm: Any, sentences: list[ToySentence]) -> None:
    sentence = sentences[0]
    start, stop = sentence.units.spans[0].end_s - 0.08, sentence.units.spans[-1].start_s + 0.08
    audio = Audio(sentence.audio.samples[round(start * 16_000) : round(stop * 16_000)], 16_000)
    aligned = align(hmm, audio, sentence.words, Lexicon())
    assert phones(aligned)[0] == phones(aligned)[-1] == SILENCE
    assert aligned.spans[0].duration_s < SHORT_PAUSE_S
    recognised = phones(recognise(hmm, audio))
    assert PAUSE not in (recognised[0], recognised[-1])


def test_a_short_pause_between_words_is_a_pause(hmm: Any) -> None:
    ((place, pause),) = (
        (place, span) for place, span in enumerate(recognise(hmm, with_pause(0.18))) if span.label.phone == PAUSE
    )
    assert (place, pause.duration_s < SHORT_PAUSE_S) == (5, True)


def test_a_long_pause_between_words_is_silence(hmm: Any) -> None:
    long = with_pause(0.5)
    for found in (align(hmm, long, ("papa", "mama"), Lexicon()), recognise(hmm, long)):
        assert phones(found) == [SILENCE, *WORDS["papa"], SILENCE, *WORDS["mama"], SILENCE]
        assert found.spans[5].label.word == ""
        assert found.spans[5].duration_s == pytest.approx(0.5, abs=0.12)


def test_a_phone_without_data_takes_the_models_of_a_similar_one(hmm: Any, sentences: list[ToySentence]) -> None:
    sentence = sentences[0]
    assert not {"z", "g"} & set(hmm.table.units)
    found = align(hmm, sentence.audio, sentence.words, Lexicon({"see": (("z", "ih"),)}))
    assert phones(found)[1:3] == ["z", "ih"]  # named as in the lexicon
    errors_s = [a.start_s - b.start_s for a, b in zip(found, sentence.units, strict=True)]
    assert np.abs(errors_s).max() < 0.1


def test_too_many_words_for_the_sound_and_an_unknown_kind_are_refused(hmm: Any, sentences: list[ToySentence]) -> None:
    with pytest.raises(errors.AlignmentError, match=r"50 words take at least \d+ frames of 10 ms, found \d+"):
        align(hmm, sentences[0].audio, ["baby"] * 50, Lexicon())
    with pytest.raises(errors.InputError, match="'best'; required one of: auto, fast, own, general"):
        recogniser.Recogniser(hmm, "best")


@pytest.mark.recordings
def test_words_of_real_recordings_are_found_where_others_found_them(recordings: Path) -> None:
    """GRID's own word times, of twelve sentences."""
    grid, errors_s = recordings / "grid-s1", []
    for name in (grid / "test.txt").read_text().split()[::4][:12]:
        rows = [line.split() for line in (grid / "align" / f"{name}.align").read_text().splitlines()]
        words = [(int(start) / 25_000, word) for start, _, word in rows if word not in (SILENCE, PAUSE)]
        audio = read_sound(grid / "clips" / f"{name}.mkv")
        found = align(load_model().phones, audio, [word for _, word in words], Lexicon(), "auto")
        spoken = groupby((span for span in found if span.label.word), key=lambda span: span.label.word)
        starts_s = [next(spans).start_s for _, spans in spoken]
        errors_s += [a - b for a, (b, _) in zip(starts_s, words, strict=True)]
    assert np.mean(np.abs(errors_s)) < 0.05
    assert abs(np.median(errors_s)) < 0.03


@pytest.mark.parametrize("kind", ["auto", "fast", "general"])
def test_every_kind_gives_phones_from_start_to_end(hmm: Any, sentences: list[ToySentence], kind: str) -> None:
    sentence = sentences[0]
    found = recognise(hmm, sentence.audio, kind)
    assert covers(found, sentence.audio.duration_s)
    assert set(phones(found)) <= set(PHONES)
    aligned = align(hmm, sentence.audio, sentence.words, Lexicon(), kind)
    errors_s = [a.start_s - b.start_s for a, b in zip(aligned, sentence.units, strict=True)]
    assert np.median(np.abs(errors_s)) < 0.03


def test_own_models_that_learned_little_do_not_align(hmm: Any, sentences: list[ToySentence]) -> None:
    """They still say what was said; where it was is left to the general models."""
    assert hmm.mixtures.size[1] <= recogniser.FEW_GAUSSIANS
    said, lexicon = sentences[0], Lexicon()
    aligned = align(hmm, said.audio, said.words, lexicon, "auto")
    assert aligned == align(hmm, said.audio, said.words, lexicon, "general")
    assert aligned != align(hmm, said.audio, said.words, lexicon, "own")
    found = recognise(hmm, said.audio, "auto")
    again = recogniser.Recogniser(hmm, "general").align_phones(said.audio, found)
    assert phones(found) == phones(again)
    assert [span.start_s for span in found] == pytest.approx([span.start_s for span in again], abs=0.011)


def test_all_phones_are_there_and_the_own_ones_are_as_they_were(toy_model: Model) -> None:
    own = toy_model.phones
    combined = combine_phones(own)
    table = combined.hmm.table
    assert set(table.units) == {*PHONES, *NOISES}
    assert table.free[0] == SILENCE
    assert len(combined.columns) == len(table.names) == len(combined.hmm.mixtures.means)
    for index, name in enumerate(own.table.names):
        there = table.names.index(name)
        assert np.array_equal(combined.hmm.mixtures.means[there], own.mixtures.means[index])
    assert combined.hmm.stay("b", 0) == own.stay("b", 0)
    assert np.exp(combined.hmm.bigram.log_probability).sum(axis=1) == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize("trust", [0.0, 0.4])
def test_evidence_is_the_sum_of_both(toy_model: Model, trust: float) -> None:
    own, general = np.random.default_rng(0).normal(size=(2, 9, 39)).astype(np.float32)
    combined = combine_phones(toy_model.phones)
    log_likelihoods = combine_likelihoods(combined, own, trust, general)
    own_values = trust * combined.hmm.mixtures.log_likelihood(own)
    wanted = load_general().log_density(general)[:, combined.columns] + own_values
    assert log_likelihoods.frames == 9
    assert log_likelihoods.log_density(0, 9, None) == pytest.approx(wanted, abs=2e-3)
    some = np.array([5, 2, 40])
    assert log_likelihoods.log_density(3, 7, some) == pytest.approx(wanted[3:7, some], abs=2e-3)


BASE = [LabelledFrames(0, "sil"), LabelledFrames(20, "aa"), LabelledFrames(50, "t"), LabelledFrames(70, "sil")]
ALIGNED = AlignedWords(
    words=("a", "boat"),
    phones=("sil", "ax", "sp", "b", "ow", "t", "sil"),
    of_word=np.array([-1, 0, -1, 1, 1, 1, -1]),
    bounds=np.array([0, 10, 20, 22, 30, 50, 60, 80]),
    densities=np.zeros(80, np.intp),
)


def test_a_stretch_nothing_or_all_is_replaced() -> None:
    part = (Stretch(30, 60), [LabelledFrames(30, "b", 0), LabelledFrames(45, "iy", 0)])
    assert splice(BASE, [part], 100) == [*BASE[:2], *part[1], LabelledFrames(60, "t"), BASE[3]]
    assert splice(BASE, [], 100) == BASE
    whole = [LabelledFrames(0, "b", 0)]
    assert splice(BASE, [(Stretch(0, 100), whole)], 100) == whole
    sliver = (Stretch(22, 69), [LabelledFrames(22, "b", 0)])
    assert SLIVER_FRAMES > 2
    assert [label.phone for label in splice(BASE, [sliver], 100)] == ["sil", "b", "sil"]


def test_labels_are_those_of_the_words_that_are_believed() -> None:
    ((frames, labels),) = label_words(ALIGNED, Stretch(100, 180), np.array([True, True]), 5)
    assert frames == Stretch(100, 180)  # all
    assert [label.word for label in labels] == [-1, 5, -1, 6, 6, 6, -1]
    assert [label.first for label in labels] == [100, 110, 120, 122, 130, 150, 160]
    ((frames, labels),) = label_words(ALIGNED, Stretch(100, 180), np.array([False, True]), 0)
    assert frames == Stretch(122, 160)
    assert [label.phone for label in labels] == ["b", "ow", "t"]
    assert not list(label_words(ALIGNED, Stretch(100, 180), np.array([False, False]), 0))


def test_what_was_recognised() -> None:
    labels = [LabelledFrames(*each) for each in ((0, "sil"), (10, "b", 0), (20, "iy", 0), (40, "z"))]
    clip = read_sound(Audio(np.zeros(8000, np.float32), 16_000))
    found, doubtful = (build_recognition(labels, [RecognisedWord("bee", sure)], clip, None) for sure in (0.8, 0.3))
    (word,) = found.words
    assert (word.start_s, word.end_s, word.label.text) == (pytest.approx(0.1), pytest.approx(0.4), "bee")
    assert [span.label.word for span in found.units] == ["", "bee", "bee", ""]
    assert (found.word_s, found.phone_s) == pytest.approx((0.3, 0.105))
    assert found.confidence == pytest.approx(0.8)
    assert (found.reliability, doubtful.reliability) == pytest.approx((1, 0))
    shares = [replace(found, posterior=posterior).reliability for posterior in (0.6, 0.8, 0.95)]
    assert shares == pytest.approx([0, 0.5, 1])
    wordless = build_recognition([LabelledFrames(0, "sil")], [], clip, None)
    assert replace(wordless, posterior=0.575).reliability == pytest.approx(0.5)


@pytest.fixture(scope="module")
def audio() -> types.Audio:
    return toy_sentences(3)[0].audio


def some() -> adaptation.Adaptation:
    draw = np.random.default_rng(0)
    return adaptation.Adaptation(1.06, 0.25, draw.normal(size=(39, 40)), draw.normal(size=(3, 13, 14)))


def test_own_features_are_warped_then_transformed_and_general_ones_stream_by_stream(audio: types.Audio) -> None:
    sound, nothing, one = read_sound(audio), adaptation.create_adaptation(1.0, 0.5), some()
    plain = sound.general_features
    assert np.array_equal(nothing.own_features(sound), sound.mfcc().values)
    assert np.array_equal(nothing.general_features(sound), plain)
    expected = sound.mfcc(1.06).values @ one.own[:, :-1].T + one.own[:, -1]
    np.testing.assert_allclose(one.own_features(sound), expected, rtol=1e-4, atol=1e-3)
    found = one.general_features(sound)
    for number, transform in enumerate(one.general):
        columns = slice(13 * number, 13 * number + 13)
        expected = plain[:, columns] @ transform[:, :-1].T + transform[:, -1]
        np.testing.assert_allclose(found[:, columns], expected, rtol=1e-3, atol=1e-3)


def test_arrays_and_back_and_damaged_arrays() -> None:
    one, broken = some(), np.eye(39, 40)
    again = adaptation.adaptation_from_arrays(adaptation.adaptation_to_arrays(one))
    assert all(np.array_equal(value, vars(again)[name]) for name, value in vars(one).items())
    broken.flat[3] = np.nan
    for damage, says in (
        ({"own": None}, "own"),
        ({"general": np.zeros((13, 14))}, "general of shape"),
        ({"numbers": np.array([1.0, 1.5])}, "a warp of 1.0 and a weight of the own models of 1.5"),
        ({"numbers": np.array([0.0, 0.5])}, "a warp of 0.0"),
        ({"numbers": np.array(["a", "b"])}, "numbers holds <U1, required fractions"),
        ({"own": broken}, "own holds values that are not finite"),
    ):
        damaged = adaptation.adaptation_to_arrays(one) | damage
        arrays = {name: values for name, values in damaged.items() if values is not None}
        with pytest.raises(errors.ModelFormatError, match=f"{says}.*adapt the model again"):
            adaptation.adaptation_from_arrays(arrays)


@pytest.fixture(scope="module")
def voice() -> list[types.Audio]:
    """Not those that the toy model was trained on, but of the same voice."""
    return [sentence.audio for sentence in toy_sentences(12)[8:]]


@pytest.fixture(scope="module")
def same_speaker(toy_model: Model, voice: list[types.Audio]) -> EstimatedAdaptation:
    return estimate_adaptation(toy_model.phones, voice)


def fit(model: Model, found: EstimatedAdaptation, audio: types.Audio) -> float:
    adapted = found.adaptation.own_features(read_sound(audio))
    return model.phones.fit(adapted) + log_determinant(found.adaptation.own)


@pytest.mark.long
def test_the_speaker_of_the_training_has_full_weight_and_changes_little(
    toy_model: Model, voice: list[types.Audio], same_speaker: EstimatedAdaptation
) -> None:
    one = same_speaker.adaptation
    assert (one.warp, one.own_weight) == (1.0, 1.0)
    assert 0.3 < same_speaker.speech_s / sum(audio.duration_s for audio in voice) < 1
    before, after = (recogniser.Recogniser(toy_model.phones, "own", how) for how in (None, one))
    for audio in voice:
        features = features_of(audio)
        changed = one.own_features(read_sound(audio)) - features.values
        assert np.sqrt(np.square(changed).mean()) < 0.5
        first, then = ([s.label.phone for s in each.recognise(audio).units] for each in (before, after))
        assert count_phone_edits(first, then) <= 2
    long = estimate_adaptation(toy_model.phones, voice * 3)  # features and their deltas move together
    assert long.speech_s == pytest.approx(3 * same_speaker.speech_s, rel=0.1)
    assert long.speech_s > 10
    assert np.abs(long.adaptation.own[:13, 13:39]).max() > 1e-3


@pytest.mark.long
def test_a_voice_in_another_channel_becomes_more_probable(toy_model: Model, voice: list[types.Audio]) -> None:
    """By features of a short recording that move apart from their deltas and these from theirs."""
    telephone = butter(2, [300 / 8000, 3000 / 8000], "band")
    sounds = (np.asarray(lfilter(*telephone, audio.samples), np.float32) for audio in voice[:2])
    one, other = (types.Audio(samples, 16_000) for samples in sounds)
    found = estimate_adaptation(toy_model.phones, [other])
    plain = toy_model.phones.fit(read_sound(one).mfcc(found.adaptation.warp).values)
    assert fit(toy_model, found, one) > plain + 0.5
    block, own = np.arange(39) // 13, found.adaptation.own[:, :-1]
    between = block[:, None] != block
    assert not own[between].any()
    assert np.abs(own[~between]).sum() > 39


def test_too_little_speech(toy_model: Model, voice: list[types.Audio]) -> None:
    loud = int(np.abs(voice[0].samples).argmax())
    short = np.pad(voice[0].samples[max(loud - 4000, 0) : loud + 4000], 16_000)
    for samples, message in (
        (0.01 * np.random.default_rng(0).normal(size=32_000), "found 0.0 s of speech"),
        (short, r"found 0.\d s of speech, required at least 1 s"),
    ):
        with pytest.raises(errors.InputError, match=message):
            estimate_adaptation(toy_model.phones, [types.Audio(samples.astype(np.float32), 16_000)])
