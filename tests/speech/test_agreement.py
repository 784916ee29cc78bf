from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lipmotion import Model, load_model
from lipmotion.corpora.folder import spell_name
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.recognition.agreement import (
    DOUBTFUL_SCORE,
    FRAME_STEP,
    WORST_SCORE,
    TranscriptFit,
    _joined,
    agreement_score,
    transcript_fit,
)
from lipmotion.speech.recognition.general import PHONES, general_features, general_model
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.voices.installed import installed_voices, speak_sentences
from lipmotion.testing.toy import ToySentence, toy_sentences
from lipmotion.types import Audio, Span, Timeline, Unit
from lipmotion.units import Lexicon, split_words


@pytest.fixture(scope="module")
def sentences() -> list[ToySentence]:
    return toy_sentences(5)


def test_it_is_the_mean_over_phones_and_their_frames_of_the_best_state_of_what_is_said(
    sentences: list[ToySentence],
) -> None:
    """Frame by frame, by name."""
    sentence = sentences[0]
    density = general_model().log_density(general_features(sentence.audio))
    names = {"ax": "AH", "axr": "ER", "ix": "IH"}
    spoken = [
        (n, number, span.label.phone)
        for n in range(len(density))
        for number, span in enumerate(sentence.units)
        if span.start_s - 1e-8 <= n / 100 < span.end_s - 1e-8 and span.label.phone not in ("sil", "sp")
    ]
    wanted: dict[int, list[float]] = {}
    for frame, number, phone in spoken[::FRAME_STEP]:
        row = PHONES.index(names.get(phone, phone.upper()))
        wanted.setdefault(number, []).append(max(density[frame].reshape(len(PHONES), 3)[row].max(), WORST_SCORE))
    mean = np.mean([np.mean(scores) for scores in wanted.values()])
    assert agreement_score(sentence.audio, sentence.units) == pytest.approx(mean, abs=1e-4)


@pytest.mark.long
def test_right_words_agree_and_wrong_ones_do_not(sentences: list[ToySentence], toy_model: Model) -> None:
    phones = Recogniser(toy_model.phones, "auto")
    for said in sentences:
        features = analysed(said.audio).mfcc()
        right, order, wrong = (
            agreement_score(said.audio, phones.align(said.audio, features, words, Lexicon()))
            for words in (said.words, said.words[::-1], ("squash", "six", "fish", "chefs"))
        )
        assert right > DOUBTFUL_SCORE - 0.8 > wrong  # one voice of espeak-ng has -4.9
        assert right > order


def test_loud_silence_is_missing_speech(sentences: list[ToySentence]) -> None:
    audio, units = sentences[0].audio, sentences[0].units
    fit = transcript_fit(audio, Timeline((Span(0.0, audio.duration_s, Unit("sil")),)))
    ((start_s, end_s),) = fit.missing
    spoken = [span for span in units if span.label.phone != "sil"]
    assert (start_s, end_s) == pytest.approx((spoken[0].start_s, spoken[-1].end_s), abs=0.2)
    assert fit.speech_s == pytest.approx(fit.missing_s)
    assert fit.share == pytest.approx(0)
    assert transcript_fit(audio, units).missing == ()


def test_long_phones_are_judged_by_their_sound(sentences: list[ToySentence]) -> None:
    """A vowel that is drawn out is right; another phone in its place is stretched over speech that is left out.

    Over what is quiet it is stretched, too, and nothing is left out.
    """
    said, longer_s = sentences[0], 0.6
    spans = list(said.units)
    place = next(number for number, span in enumerate(spans) if span.label.phone == "iy")
    rate_hz = said.audio.rate_hz
    first, stop = (round(time_s * rate_hz) for time_s in (spans[place].start_s + 0.03, spans[place].end_s - 0.03))
    samples = said.audio.samples
    vowel = np.resize(samples[first:stop], round(longer_s * rate_hz))
    end_s = spans[place].end_s + longer_s
    later = [replace(s, start_s=s.start_s + longer_s, end_s=s.end_s + longer_s) for s in spans[place + 1 :]]

    def missing(phone: str, gain: float = 1.0) -> tuple[tuple[float, float], ...]:
        audio = Audio(np.concatenate([samples[:stop], gain * vowel, samples[stop:]]), rate_hz)
        units = Timeline((*spans[:place], replace(spans[place], end_s=end_s, label=Unit(phone)), *later))
        fit = transcript_fit(audio, units)
        assert (fit.share < 0.8) == bool(fit.missing)
        return fit.missing

    assert missing("iy") == ()
    assert missing("m") == ((spans[place].start_s, end_s),)
    assert missing("m", gain=0.003) == ()


def test_places_near_one_another_are_one_stretch() -> None:
    assert _joined([(0.0, 1.0), (1.4, 2.0), (3.0, 3.5)]) == ((0.0, 2.0), (3.0, 3.5))
    fit = TranscriptFit(-1.0, ((0.0, 2.0), (3.0, 3.5)), 10.0)
    assert fit.missing_s == pytest.approx(2.5)
    assert fit.share == pytest.approx(0.75)
    assert TranscriptFit(DOUBTFUL_SCORE - 0.1, (), 10.0).share == pytest.approx(0)  # of something else


@pytest.mark.recordings
def test_a_part_of_a_transcript_is_noticed_and_a_whole_one_is_not(recordings: Path) -> None:
    """Docs/robustness.md."""
    names = (recordings / "grid-s1" / "val.txt").read_text().split()[::4]
    phones, whole, half = Recogniser(load_model().phones, "auto"), 0, 0
    for name in names:
        audio, words = read_audio(recordings / "grid-s1" / "clips" / f"{name}.mkv"), spell_name(name)
        assert words is not None
        for said, kept in ((words, True), (words[:3], False)):
            units = phones.align(audio, analysed(audio).mfcc(), said, Lexicon())
            noticed = bool(transcript_fit(audio, units).missing)
            whole, half = whole + (kept and noticed), half + (noticed and not kept)
    assert whole == 0
    assert half > 0.7 * len(names)


@pytest.mark.recordings
def test_real_recordings(recordings: Path) -> None:
    """No false alarm, and most transcripts of other clips found (docs/robustness.md)."""
    names = (recordings / "grid-s1" / "val.txt").read_text().split()[::2]
    phones = Recogniser(load_model().phones, "auto")
    right, wrong = [], []
    for name, other in zip(names, [*names[7:], *names[:7]], strict=True):
        audio = read_audio(recordings / "grid-s1" / "clips" / f"{name}.mkv")
        features = analysed(audio).mfcc()
        for clip, found in ((name, right), (other, wrong)):
            words = spell_name(clip)
            assert words is not None
            found.append(agreement_score(audio, phones.align(audio, features, words, Lexicon())))
    assert min(right) > DOUBTFUL_SCORE
    assert np.mean(np.array(wrong) < DOUBTFUL_SCORE) > 0.6


@pytest.mark.long
@pytest.mark.skipif(not installed_voices(), reason="no synthesiser is here")
def test_synthetic_voices_are_believed() -> None:
    """What they say in their own way does not decide alone: by the mean over frames most of them were doubted."""
    texts = "Loyal boys voice their choice to employers.", "Sharp knives belong in the upper drawer."
    phones = Recogniser(load_model().phones, "auto")
    for voice in installed_voices()[::2]:
        audio, _ = next(speak_sentences([texts[0]], voice))
        right, wrong = (
            agreement_score(audio, phones.align(audio, analysed(audio).mfcc(), split_words(text), Lexicon()))
            for text in texts
        )
        assert right > DOUBTFUL_SCORE - 0.5 > wrong  # one voice of espeak-ng has -4.4
