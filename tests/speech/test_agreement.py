from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lipmotion.corpora.grid import words_of_name
from lipmotion.pipeline.model import Model, load_model
from lipmotion.speech.agreement import DOUBTFUL_SCORE, FRAME_STEP, agreement_score
from lipmotion.speech.audio_files import read_audio
from lipmotion.speech.general.acoustic import PHONES, general_model
from lipmotion.speech.general.front_end import general_features
from lipmotion.speech.mfcc import mfcc
from lipmotion.speech.recogniser import Recogniser
from lipmotion.testing.toy import ToySentence, toy_sentences
from lipmotion.types import Span, Timeline, Unit
from lipmotion.units import Lexicon


@pytest.fixture(scope="module")
def sentences() -> list[ToySentence]:
    return toy_sentences(5)


def test_it_is_the_mean_over_frames_of_the_best_state_of_what_is_said(sentences: list[ToySentence]) -> None:
    """Frame by frame, by name."""
    sentence = sentences[0]
    density = general_model().log_density(general_features(sentence.audio))
    names = {"ax": "AH", "axr": "ER", "ix": "IH"}
    spoken = [
        (n, span.label.phone)
        for n in range(len(density))
        for span in sentence.units
        if span.start_s - 1e-8 <= n / 100 < span.end_s - 1e-8 and span.label.phone not in ("sil", "sp")
    ]
    wanted = []
    for frame, phone in spoken[::FRAME_STEP]:
        row = PHONES.index(names.get(phone, phone.upper()))
        wanted.append(density[frame].reshape(len(PHONES), 3)[row].max())
    assert agreement_score(sentence.audio, sentence.units) == pytest.approx(np.mean(wanted), abs=1e-4)


@pytest.mark.long
def test_right_words_agree_and_wrong_ones_do_not(sentences: list[ToySentence], toy_model: Model) -> None:
    phones = Recogniser(toy_model.phones, "auto")
    for said in sentences:
        features = mfcc(said.audio)
        right, order, wrong = (
            agreement_score(said.audio, phones.align(said.audio, features, words, Lexicon()))
            for words in (said.words, said.words[::-1], ("squash", "six", "fish", "chefs"))
        )
        assert right > DOUBTFUL_SCORE > wrong
        assert right > order


def test_silence_agrees_with_everything(sentences: list[ToySentence]) -> None:
    audio = sentences[0].audio
    assert agreement_score(audio, Timeline((Span(0.0, audio.duration_s, Unit("sil")),))) == 0
    assert agreement_score(audio, Timeline((Span(0.5, 0.5, Unit("p")),))) == 0


@pytest.mark.recordings
def test_real_recordings(recordings: Path) -> None:
    """No false alarm, and most transcripts of other clips found (docs/robustness.md)."""
    names = (recordings / "grid-s1" / "val.txt").read_text().split()[::2]
    phones = Recogniser(load_model().phones, "auto")
    right, wrong = [], []
    for name, other in zip(names, [*names[7:], *names[:7]], strict=True):
        audio = read_audio(recordings / "grid-s1" / "clips" / f"{name}.mkv")
        features = mfcc(audio)
        for clip, found in ((name, right), (other, wrong)):
            words = words_of_name(clip)
            assert words is not None
            found.append(agreement_score(audio, phones.align(audio, features, words, Lexicon())))
    assert min(right) > DOUBTFUL_SCORE
    assert np.mean(np.array(wrong) < DOUBTFUL_SCORE) > 0.6
