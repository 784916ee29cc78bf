from dataclasses import replace

import numpy as np
import pytest

from lipmotion import Model
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.features.speaker_similarity import (
    WARPS,
    mean_speaker_vector,
    speaker_similarity,
    speaker_vector,
    voice_knowledge,
)
from lipmotion.speech.sound.acoustic_conditions import noisy_audio
from lipmotion.types import Audio
from testing.toy import toy_sentences


def test_a_warped_voice_is_warped_back(toy_model: Model) -> None:
    """Its spectra are those of the known voice, stretched."""
    audio = toy_sentences(3)[0].audio
    before = speaker_similarity(toy_model.phones, analysed(audio)).score
    for factor, expected in ((1.12, 0.88), (0.89, 1.12)):
        positions = np.arange(0, len(audio.samples) - 1, factor)
        other = Audio(np.interp(positions, np.arange(len(audio.samples)), audio.samples).astype(np.float32), 16_000)
        similarity = speaker_similarity(toy_model.phones, analysed(other))
        assert abs(similarity.warp - expected) < 0.07
        assert similarity.score < before


def test_the_warp_chosen_is_the_most_similar(toy_model: Model) -> None:
    audio = analysed(toy_sentences(3)[1].audio)
    similarity = speaker_similarity(toy_model.phones, audio)
    (passage,) = audio.passages
    fits = {warp: toy_model.phones.fit(passage.audio.mfcc(warp).values) for warp in WARPS}
    assert similarity.warp == max(fits, key=lambda warp: fits[warp])
    assert similarity.score == pytest.approx(max(fits.values()) - toy_model.phones.typical_fit)


def test_a_recording_is_judged_by_its_longest_passage(toy_model: Model) -> None:
    """Silence, and a short line by another voice, change nothing."""
    line, other = (
        sentence.audio.samples[: len(sentence.audio.samples) // 160 * 160] for sentence in toy_sentences(3)[:2]
    )
    silence = np.zeros(5 * 16_000, np.float32)
    alone = speaker_similarity(toy_model.phones, analysed(Audio(np.pad(line, 8000), 16_000)))
    short = np.interp(np.arange(160 * 200) * 1.3, np.arange(len(other)), other)
    for parts in ((silence, line, silence), (short, silence, line, silence), (silence, line, silence, short)):
        audio = analysed(Audio(np.concatenate(parts).astype(np.float32), 16_000))
        found = speaker_similarity(toy_model.phones, audio)
        assert found.warp == alone.warp
        assert found.score == pytest.approx(alone.score, abs=1e-3)
    assert speaker_similarity(toy_model.phones, analysed(Audio(short.astype(np.float32), 16_000))).score != alone.score


def test_voices_are_known_by_their_similarity(toy_model: Model) -> None:
    audio, phones = analysed(toy_sentences(3)[1].audio), replace(toy_model.phones, speaker=None)
    score = speaker_similarity(phones, audio).score
    shifted = [replace(phones, typical_fit=phones.typical_fit + score - other) for other in (-20, -9, -6, -3, 2)]
    assert [voice_knowledge(hmm, audio) for hmm in shifted] == pytest.approx([0, 0, 0.5, 1, 1])


def test_a_known_voice_in_noise_is_not_a_stranger(toy_model: Model) -> None:
    """Noise makes it dissimilar to its training; its speaker vector says more, and never less."""
    sounds = [analysed(sentence.audio) for sentence in toy_sentences(6)]
    mean = mean_speaker_vector(sounds[:5])
    old, known, opposite = (replace(toy_model.phones, speaker=speaker) for speaker in (None, mean, -mean))
    noisy = analysed(noisy_audio(sounds[5], "white", 15))
    assert voice_knowledge(old, sounds[5]) == voice_knowledge(known, sounds[5]) > 0.9
    assert voice_knowledge(known, noisy) > voice_knowledge(old, noisy) + 0.3
    assert voice_knowledge(opposite, noisy) == voice_knowledge(old, noisy)


def test_a_speaker_vector_is_that_of_sound_alone() -> None:
    sound = toy_sentences(3)[0].audio.samples
    line = sound[: len(sound) // 320 * 320]
    alone, longer, louder = (
        speaker_vector(analysed(Audio(samples.astype(np.float32), 16_000)))
        for samples in (line, np.pad(line, 32_000), line / 8)
    )
    assert longer == pytest.approx(alone, abs=0.2)
    assert louder == pytest.approx(alone, abs=0.05)
    assert not speaker_vector(analysed(Audio(np.zeros(16_000, np.float32), 16_000))).any()
