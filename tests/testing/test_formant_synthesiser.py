from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.signal import spectrogram

from lipmotion.errors import InputError
from lipmotion.testing.formant_synthesiser import PHONE_TARGETS, synthesise

RATE_HZ = 16000
TWINS = [("p", "b"), ("t", "d"), ("k", "g"), ("f", "v"), ("th", "dh"), ("s", "z"), ("sh", "zh"), ("ch", "jh")]


def spoken(phone: str, duration_s: float = 0.3, seed: int = 0) -> NDArray[np.float32]:
    """Return the samples of ``phone`` between two silences of 0.2 s."""
    audio, timeline = synthesise([("sil", 0.2), (phone, duration_s), ("sil", 0.2)], seed=seed)
    span = timeline.spans[1]
    return audio.samples[round(span.start_s * RATE_HZ) : round(span.end_s * RATE_HZ)]


def level_db(samples: NDArray[np.float32]) -> float:
    return float(10 * np.log10(np.mean(np.square(samples, dtype=float))))


def share_of_power(samples: NDArray[np.float32], low_hz: float, high_hz: float) -> float:
    power = np.abs(np.fft.rfft(samples)) ** 2
    hertz = np.fft.rfftfreq(len(samples), 1 / RATE_HZ)
    return float(power[(hertz >= low_hz) & (hertz < high_hz)].sum() / power.sum())


def measured_formants(samples: NDArray[np.float32], order: int = 18) -> NDArray[np.float64]:
    """Return the frequencies of the sharp poles of a linear prediction, lowest first."""
    emphasised = np.diff(samples.astype(float)) * np.hamming(len(samples) - 1)
    correlation = np.correlate(emphasised, emphasised, "full")[len(emphasised) - 1 :][: order + 1]
    roots = np.roots(np.concatenate([[1], -solve_toeplitz(correlation[:-1], correlation[1:])]))
    roots = roots[roots.imag > 0]
    width_hz = -np.log(np.abs(roots)) * RATE_HZ / np.pi
    return np.sort(np.angle(roots[width_hz < 400]) * RATE_HZ / 2 / np.pi)


def test_times_are_exact():
    for rate_hz in (16000, 44100):
        phones = [("sil", 0.25), ("m", 0.0831), ("aa", 0.2), ("sil", 0.001)]
        audio, timeline = synthesise(phones, rate_hz=rate_hz)
        assert [span.label.phone for span in timeline] == [phone for phone, _ in phones]
        assert [span.duration_s for span in timeline] == pytest.approx([duration for _, duration in phones])
        assert timeline.spans[0].start_s == 0
        assert all(a.end_s == b.start_s for a, b in pairwise(timeline.spans))
        assert audio.rate_hz == rate_hz
        assert len(audio.samples) == round(sum(duration for _, duration in phones) * rate_hz)
        assert audio.samples.dtype == np.float32


def test_the_sound_begins_and_ends_with_its_phone():
    audio, timeline = synthesise([("sil", 0.2), ("aa", 0.2), ("sil", 0.2), ("s", 0.2), ("sil", 0.2)])
    frames = audio.samples.reshape(-1, RATE_HZ // 200)
    loud_s = np.flatnonzero(np.sqrt(np.square(frames).mean(axis=1)) > 0.01) / 200
    spoken_s = [t for span in timeline.spans[1::2] for t in (span.start_s, span.end_s)]
    edges_s = [loud_s[0], loud_s[loud_s < 0.5][-1], loud_s[loud_s > 0.5][0], loud_s[-1]]
    assert edges_s == pytest.approx(spoken_s, abs=0.015)


def test_silence_is_quiet_and_speech_is_not_clipped():
    assert level_db(spoken("sil")) == pytest.approx(-70, abs=0.5)
    for phone in sorted(set(PHONE_TARGETS) - {"sil", "sp"})[::3]:
        samples = spoken(phone)
        assert level_db(samples) > -50, phone
        assert np.abs(samples).max() < 0.9, phone


def test_the_seed_is_all_the_chance_there_is():
    phones = [("sil", 0.1), ("s", 0.1), ("iy", 0.1)]
    first, again, other = (synthesise(phones, seed=seed)[0].samples for seed in (3, 3, 4))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_vowels_have_their_formants():
    for phone in ("iy", "ae", "aa", "uw"):
        formants = PHONE_TARGETS[phone][0].formants
        assert formants is not None
        assert measured_formants(spoken(phone)[800:-800])[:2] == pytest.approx(formants[:2], rel=0.12)


def test_diphthongs_move():
    samples = spoken("ay", 0.4)
    assert measured_formants(samples[800:2400])[1] < 1400
    assert measured_formants(samples[-2400:-800])[1] > 1800


def test_pitch():
    for pitch_hz in (90.0, 210.0):
        audio, _ = synthesise([("aa", 0.5)], pitch_hz=pitch_hz)
        middle = audio.samples[3200:4800].astype(float)
        correlation = np.correlate(middle, middle, "full")[len(middle) - 1 :]
        shortest = RATE_HZ // 400
        period = shortest + np.argmax(correlation[shortest : RATE_HZ // 60])
        assert RATE_HZ / period == pytest.approx(pitch_hz, rel=0.03)


def test_voice_tells_twins_apart():
    for voiceless, voiced in TWINS:
        assert share_of_power(spoken(voiceless), 60, 300) < 0.2
        assert share_of_power(spoken(voiced), 60, 300) > 0.4


def test_stops_are_silent_then_burst():
    audio, timeline = synthesise([("aa", 0.2), ("k", 0.2), ("aa", 0.2)])
    start = round(timeline.spans[1].start_s * RATE_HZ)
    closure, burst = audio.samples[start + 400 : start + 1000], audio.samples[start + 1600 : start + 2400]
    assert level_db(closure) < -65
    assert level_db(burst) > -50


def test_moving_formants_do_not_click():
    audio, _ = synthesise([("aa", 0.15), ("w", 0.12), ("aa", 0.12), ("r", 0.12), ("iy", 0.15)])
    hertz, _, power = spectrogram(audio.samples[800:-800], RATE_HZ, nperseg=320)
    high, low = power[hertz > 5000].max(), power[hertz < 1000].max()
    assert 10 * np.log10(high / low) < -60


def test_no_two_phones_sound_the_same():
    names = sorted(set(PHONE_TARGETS) - {"sil", "sp"})

    def picture(phone: str, seed: int) -> NDArray[np.float64]:
        audio, _ = synthesise([("aa", 0.05), (phone, 0.15), ("aa", 0.05)], seed=seed)
        power = spectrogram(audio.samples.astype(float), RATE_HZ, nperseg=320, nfft=512)[2]
        return np.log(power[:256].reshape(32, 8, -1).mean(axis=1) + 1e-12).ravel()

    templates = np.array([picture(name, seed=0) for name in names])
    for name in names:
        distance = np.square(templates - picture(name, seed=1)).mean(axis=1)
        nearest, second = np.argsort(distance)[:2]
        assert names[nearest] == name
        assert distance[second] > 1.5 * distance[nearest], (name, names[second])


def test_it_says_what_is_wrong():
    for phones, options, message in (
        ([], {}, "at least one"),
        ([("aa", 0.1), ("AA", 0.1)], {}, "'AA'"),
        ([("aa", 0.0)], {}, "'aa' lasts 0.0 s"),
        ([("aa", float("nan"))], {}, "'aa' lasts nan s"),
        ([("aa", 0.1)], {"pitch_hz": 10.0}, "pitch is 10.0 Hz"),
        ([("aa", 0.1)], {"rate_hz": 8000}, "8000 Hz"),
    ):
        with pytest.raises(InputError, match=message):
            synthesise(phones, **options)  # type: ignore[arg-type]
