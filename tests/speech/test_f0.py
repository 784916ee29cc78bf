"""The plain twin of the correlations of ``speech.features.f0``: one frame, one lag at a time.

Written from its description: a windowed-sinc band pass of 255 taps from 50 to 1200 Hz that stops 0 Hz, every fourth
sample; 160 of them centred on the frame, weighted by a Hann window; correlated with itself, normalised. A thousandth of
the power of the slope of the full signal, 10 ms either side, counts as silence.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

from lipmotion import Model
from lipmotion.speech.features import f0
from lipmotion.speech.sound.acoustic_conditions import mix_noise
from lipmotion.speech.sound.speaker_similarity import WARPS, embed_speaker, measure_similarity, rate_knowledge
from lipmotion.types import Audio
from pipeline.made import read_sound
from speech.mfcc_oracle import sample
from testing.formant_synthesiser import PHONE_TARGETS, synthesise
from testing.toy import toy_sentences

RATE_HZ = 16_000
VOWELS = {"a": (730, 1090, 2440), "i": (290, 2200, 2950), "u": (320, 900, 2250)}
Array = NDArray[np.float64]


def noise(count: int, seed: int = 0) -> NDArray[np.float32]:
    return np.random.default_rng(seed).normal(0, 0.1, count).astype(np.float32)


def voice(hertz: Array, vowel: str = "a", noise_db: float = -40.0) -> NDArray[np.float32]:
    """Return glottal pulses through three formants, and noise; ``hertz`` holds the frequency at every sample."""
    phase = np.cumsum(hertz / RATE_HZ) % 1 / 0.6
    samples = lfilter([0.5], [1, -0.5], np.where(phase < 1, phase * (2 - 3 * phase), 0))
    for centre in VOWELS[vowel]:
        radius = np.exp(-np.pi * (40 + 0.05 * centre) / RATE_HZ)
        feedback = [1, -2 * radius * np.cos(2 * np.pi * centre / RATE_HZ), radius**2]
        samples = lfilter([sum(feedback)], feedback, samples)
    samples /= samples.std()
    return (0.1 * (samples + 10 ** (noise_db / 20) * 10 * noise(len(samples)))).astype(np.float32)


def steady(hertz: float, duration_s: float = 1.0) -> Array:
    return np.full(round(duration_s * RATE_HZ), float(hertz))


def found(samples: NDArray[np.float32]) -> Array:
    """Return F0 in hertz."""
    return np.exp(f0.log_f0(Audio(samples, RATE_HZ)).astype(float))


def at_frames(hertz: Array) -> Array:
    frames = len(hertz) // 160 + 1
    return hertz[np.minimum(np.arange(frames) * 160, len(hertz) - 1)]


def test_correlations_are_their_slow_twin() -> None:
    samples = voice(np.linspace(90, 200, 1700)) + noise(1700) / 20
    assert f0.list_lags()[1::2].tolist() == list(range(10, 68))
    for n in (0, 5, 10):
        fast = f0.correlate_frames(samples, slice(0, 11), 1e-5)[n]  # type: ignore[arg-type]
        x = frame(samples.astype(float), n)
        silence = 1e-5 + frication(samples.astype(float), n)
        slow = [correlation(x, int(lag), silence) for lag in f0.list_lags()[1::2]]
        assert fast[1::2] == pytest.approx(slow, abs=1e-4)


def test_the_best_peaks_are_the_candidates() -> None:
    correlation = np.zeros((2, len(f0.list_lags())), np.float32)
    correlation[0, 39:42] = 0.5, 0.9, 0.7
    pitch, cost = f0.find_candidates(correlation)
    lag = f0.list_lags()[40] + 0.5 / 6  # the top of the parabola, a sixth of a step later
    assert np.exp(pitch[0, 0]) == pytest.approx(4000 / lag)
    assert cost[0, 0] == pytest.approx(1 - (0.9 + 1 / 120) * (1 - 0.2 * lag / (4000 / 60)))
    assert np.isinf(cost[1:, 0]).all()
    assert np.isinf(cost[:, 1]).all()


def test_very_short_recordings_work() -> None:
    for count in (400, 401, 639, 1600):
        hertz = found(voice(steady(200))[:count])
        assert len(hertz) == count // 160 + 1
        assert np.nanmax(np.abs(hertz / 200 - 1), initial=0) < 0.5
    assert found(voice(steady(200, 0.1)))[2:-2] == pytest.approx(200, rel=0.02)


def test_a_known_frequency_is_found() -> None:
    """Within half a per cent; less surely in the 30 ms where the signal is reflected."""
    for hertz, vowel in ((62, "u"), (80, "i"), (110, "a"), (211, "i"), (300, "u"), (390, "a")):
        assert found(voice(steady(hertz, 0.5), vowel))[3:-3] == pytest.approx(hertz, rel=0.005)


def test_glides_have_no_jumps_and_frame_n_is_centred_at_n_times_10_ms() -> None:
    """The first is longer than a block."""
    for vowel, noise_db, (first_hz, last_hz) in (("a", -3, (65, 390)), ("i", -10, (390, 65)), ("u", -40, (120, 240))):
        hertz = first_hz * (last_hz / first_hz) ** np.linspace(0, 1, (12 if noise_db == -3 else 3) * RATE_HZ)
        ratio = found(voice(hertz, vowel, noise_db))[2:-2] / at_frames(hertz)[2:-2]
        assert np.abs(np.log(ratio)).max() < 0.1
        assert np.abs(np.log(ratio)).mean() < 0.01
    hertz = 100 * 1.01 ** (np.arange(RATE_HZ) / 160)  # one per cent a frame: one too early or late would be seen
    assert abs(np.log(found(voice(hertz)) / at_frames(hertz))[5:-5].mean()) < 0.002


def test_speech_is_voiced_where_it_is() -> None:
    for pitch_hz in (70, 220):
        names = ["sil", *(name for name in PHONE_TARGETS if name not in ("sil", "sp")), "sil"]
        audio, phones = synthesise([(name, 0.15) for name in names], pitch_hz=pitch_hz)
        result = np.exp(f0.log_f0(audio).astype(float))
        known = pitch_hz * np.linspace(1.06, 0.94, len(result))
        error = np.abs(result / known - 1)
        assert np.nanmedian(error) < 0.005
        assert np.mean(error[~np.isnan(error)] < 0.08) > 0.99
        assert np.nanmax(error) < 0.3  # no octaves
        time_s = np.arange(len(result)) / 100
        for span in phones:
            inner = ~np.isnan(result[(time_s > span.start_s + 0.03) & (time_s < span.end_s - 0.03)])
            if all(segment.voicing >= 0.3 for segment in PHONE_TARGETS[span.label.phone]):
                assert inner.all(), span
            if all(segment.voicing == 0 for segment in PHONE_TARGETS[span.label.phone]):
                assert not inner.any(), span


def test_noise_hiss_and_silence_have_no_voice() -> None:
    forward, back = butter(4, 3000, fs=RATE_HZ, btype="high")
    unvoiced = [np.convolve(noise(8 * RATE_HZ), smoothing) for smoothing in ([1.0], list(np.hanning(16)))]
    unvoiced += [lfilter(forward, back, noise(8 * RATE_HZ))]
    for samples in (*unvoiced, *(np.full(16_000, value) for value in (0.0, 1e-30, 0.3, 0.1234567))):
        assert np.isnan(found(samples.astype(np.float32))).all()


def test_voice_is_bounded_by_silence_and_a_faint_echo_of_it_is_silence() -> None:
    samples = np.concatenate([np.zeros(8000), voice(steady(150)), np.zeros(8000)]).astype(np.float32)
    voiced = np.flatnonzero(~np.isnan(found(samples)))
    assert voiced.tolist() == list(range(voiced[0], voiced[-1] + 1))
    assert 48 <= voiced[0] <= 52
    assert 148 <= voiced[-1] <= 152
    loud = voice(steady(150))
    echoed = found(np.concatenate([loud, 0.003 * loud]))
    assert not np.isnan(echoed[3:97]).any()
    assert np.isnan(echoed[105:]).all()


def test_loudness_and_an_offset_change_nothing() -> None:
    samples = np.concatenate([voice(steady(130)), noise(8000), voice(np.linspace(90, 180, 8000), "i")])
    whole = found(samples)
    for gain in (1e-6, 1e5):
        assert found((gain * samples).astype(np.float32)) == pytest.approx(whole, rel=1e-3, nan_ok=True)
    samples = voice(steady(130))
    assert found(samples + np.float32(0.5)) == pytest.approx(found(samples), rel=2e-3, nan_ok=True)


def test_level_and_pitch_of_a_tone_that_rises_and_gets_louder():
    time_s = np.arange(32_000) / 16_000
    hz, gain = np.where(time_s < 1, 120.0, 180.0), np.where(time_s < 1, 0.1, 0.4)
    phase = 2 * np.pi * np.cumsum(hz) / 16_000
    samples = gain * sum(np.sin(k * phase) / k for k in range(1, 6))
    voice = f0.find_prosody(Audio(samples.astype(np.float32), 16_000))
    assert len(voice.level_db) == len(voice.log_f0) == 201
    assert voice.level_db[120:180].mean() - voice.level_db[20:80].mean() == pytest.approx(20 * np.log10(4), abs=0.3)
    assert np.exp(np.nanmedian(voice.log_f0[20:80])) == pytest.approx(120, rel=0.03)
    assert np.exp(np.nanmedian(voice.log_f0[120:180])) == pytest.approx(180, rel=0.03)


def test_silence_is_quiet_and_without_pitch_and_a_level_is_the_mean_power_of_10_ms_before_and_after():
    silent = f0.find_prosody(Audio(np.zeros(16_000, np.float32), 16_000))
    assert silent.level_db.max() < -80
    assert not np.isfinite(silent.log_f0).any()
    samples = np.random.default_rng(4).normal(0, 0.1, 1_650).astype(np.float32)
    levels = f0.find_prosody(Audio(samples, 16_000)).level_db
    around = [samples[max(160 * n - 160, 0) : 160 * n + 160].astype(float) for n in range(11)]
    assert levels == pytest.approx([10 * np.log10(np.mean(part**2) + 1e-9) for part in around])


TIMES = np.arange(-127, 128) / 8000
TAPS = np.hamming(255) * (1200 * np.sinc(1200 * TIMES) - 50 * np.sinc(50 * TIMES)) / 8000
TAPS -= TAPS.sum() / np.hamming(255).sum() * np.hamming(255)


def frame(samples: Array, n: int) -> Array:
    """Return 160 low-passed samples, 0.25 ms apart, around 10 · n ms: the middle is between the two in the middle."""
    low = np.correlate(np.pad(samples, 500, "reflect"), TAPS, "same")
    return low[500 + 160 * n - 318 :: 4][:160]


def correlation(x: Array, lag: int, silence: float) -> float:
    """Return the correlation of a frame with itself ``lag`` samples later."""
    window = np.sin(np.pi * (np.arange(160) + 0.5) / 160) ** 2
    weights, early, late = window[: 160 - lag] * window[lag:], x[: 160 - lag], x[lag:]
    energy = np.sqrt((weights * early**2).sum() * (weights * late**2).sum())
    return float((weights * early * late).sum() / (energy + silence * weights.sum()))


def frication(samples: Array, n: int) -> float:
    """Return the power that a frame's frication adds to silence."""
    times = range(160 * n - 161, 160 * n + 160)
    return float(np.square(np.diff([sample(samples, t) for t in times])).mean() / 1000)


def test_a_warped_voice_is_warped_back(toy_model: Model) -> None:
    """Its spectra are those of the known voice, stretched."""
    audio = toy_sentences(3)[0].audio
    before = measure_similarity(toy_model.phones, read_sound(audio)).score
    for factor, expected in ((1.12, 0.88), (0.89, 1.12)):
        positions = np.arange(0, len(audio.samples) - 1, factor)
        other = Audio(np.interp(positions, np.arange(len(audio.samples)), audio.samples).astype(np.float32), 16_000)
        similarity = measure_similarity(toy_model.phones, read_sound(other))
        assert abs(similarity.warp - expected) < 0.07
        assert similarity.score < before


def test_the_warp_chosen_is_the_most_similar(toy_model: Model) -> None:
    audio, phones = read_sound(toy_sentences(3)[1].audio), toy_model.phones
    similarity = measure_similarity(phones, audio)
    (passage,) = audio.passages
    fits = {warp: phones.fit(passage.audio.mfcc(warp).values) for warp in WARPS}
    assert similarity.warp == max(fits, key=lambda warp: fits[warp])
    assert similarity.score == pytest.approx(max(fits.values()) - phones.typical_fit)


def test_voices_are_known_by_their_similarity(toy_model: Model) -> None:
    audio, phones = read_sound(toy_sentences(3)[1].audio), replace(toy_model.phones, speaker=None)
    score = measure_similarity(phones, audio).score
    levels = [phones.typical_fit + score - other for other in (-20, -9, -6, -3, 2)]
    shifted = [rate_knowledge(replace(phones, typical_fit=level), audio) for level in levels]
    assert shifted == pytest.approx([0, 0, 0.5, 1, 1])


def test_a_recording_is_judged_by_its_longest_passage(toy_model: Model) -> None:
    """Silence, and a short line by another voice, change nothing."""
    line, other = (each.audio.samples[: len(each.audio.samples) // 160 * 160] for each in toy_sentences(3)[:2])
    silence = np.zeros(5 * 16_000, np.float32)
    alone = measure_similarity(toy_model.phones, read_sound(Audio(np.pad(line, 8000), 16_000)))
    short = np.interp(np.arange(160 * 200) * 1.3, np.arange(len(other)), other)
    for parts in ((silence, line, silence), (short, silence, line, silence), (silence, line, silence, short)):
        audio = read_sound(Audio(np.concatenate(parts).astype(np.float32), 16_000))
        found = measure_similarity(toy_model.phones, audio)
        assert found.warp == alone.warp
        assert found.score == pytest.approx(alone.score, abs=1e-3)
    of_short = measure_similarity(toy_model.phones, read_sound(Audio(short.astype(np.float32), 16_000)))
    assert of_short.score != alone.score


def test_a_known_voice_in_noise_is_not_a_stranger(toy_model: Model) -> None:
    """Noise makes it dissimilar to its training; its speaker vector says more, and never less."""
    sounds = [read_sound(sentence.audio) for sentence in toy_sentences(6)]
    mean = np.mean([embed_speaker(sound) for sound in sounds[:5]], axis=0)
    old, known, opposite = (replace(toy_model.phones, speaker=speaker) for speaker in (None, mean, -mean))
    noisy = read_sound(mix_noise(sounds[5], "white", 15))
    assert rate_knowledge(old, sounds[5]) == rate_knowledge(known, sounds[5]) > 0.9
    assert rate_knowledge(known, noisy) > rate_knowledge(old, noisy) + 0.3
    assert rate_knowledge(opposite, noisy) == rate_knowledge(old, noisy)


def test_a_speaker_vector_is_that_of_sound_alone() -> None:
    sound = toy_sentences(3)[0].audio.samples
    line = sound[: len(sound) // 320 * 320]
    alone, longer, louder = (
        embed_speaker(read_sound(Audio(samples.astype(np.float32), 16_000)))
        for samples in (line, np.pad(line, 32_000), line / 8)
    )
    assert longer == pytest.approx(alone, abs=0.2)
    assert louder == pytest.approx(alone, abs=0.05)
    assert not embed_speaker(read_sound(Audio(np.zeros(16_000, np.float32), 16_000))).any()
