import tracemalloc
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion.hmm.loudness import DECIBEL, MIN_FRAMES, average_power, find_spoken_frames
from lipmotion.speech.features import mfcc
from lipmotion.speech.sound import analysed_audio, pauses, voice_activity
from lipmotion.types import Audio
from lipmotion_faces.appearance.person import measure_levels_at
from lipmotion_faces.corpus.long_videos import find_quietest
from speech.made_voices import RATE_HZ, hiss, spoken
from testing.toy import toy_sentences

QUIET_ENERGY, CLOSURE_ENERGY, LOUD_ENERGY = -8.0, -5.0, 2.0
Samples = NDArray[np.float32]


def energy(frames: int, *sounds: tuple[int, int]) -> np.ndarray:
    """Return a quiet recording with syllables of 0.38 s."""
    values = np.full(frames, QUIET_ENERGY, np.float32)
    for first, end in sounds:
        values[first:end] = np.where(np.arange(frames) % 50 // 12 == 2, CLOSURE_ENERGY, LOUD_ENERGY)[first:end]
    return values


def test_sound_has_its_stretch_with_a_margin_that_ends_with_the_recording() -> None:
    (found,) = voice_activity.find_sound(energy(1000, (300, 500)))
    assert found == pytest.approx((300 - voice_activity.MARGIN_FRAMES, 500 + voice_activity.MARGIN_FRAMES), abs=5)
    assert voice_activity.find_sound(energy(400, (10, 200), (230, 390))) == [voice_activity.Stretch(0, 400)]


def test_short_pauses_do_not_part_sound_and_clicks_and_constant_energy_are_none() -> None:
    assert len(voice_activity.find_sound(energy(1000, (200, 300), (380, 500)))) == 1
    assert len(voice_activity.find_sound(energy(1000, (200, 300), (600, 700)))) == 2
    assert not voice_activity.find_sound(energy(1000, (300, 300 + MIN_FRAMES // 3), (600, 602)))
    assert not voice_activity.find_sound(np.full(500, -11.5, np.float32))


def test_a_long_stretch_is_cut_where_it_is_quietest() -> None:
    values = energy(5000, (400, 4600))
    values[1000:1030] = QUIET_ENERGY
    first, second, *_ = voice_activity.find_sound(values)
    assert 1000 <= first.end <= 1030
    assert second.first == first.end


def test_stretches_are_in_order_bounded_and_hold_all_sound() -> None:
    for seed in range(0, 30, 5):
        draw = np.random.default_rng(seed)
        frames = int(draw.integers(2, 9000))
        starts = np.sort(draw.integers(0, frames, draw.integers(1, 30)))
        sounds = [(int(start), int(start + draw.integers(1, 900))) for start in starts]
        values = energy(frames, *sounds) + draw.normal(0, 0.1, frames).astype(np.float32)
        found = voice_activity.find_sound(values)
        assert all(0 <= stretch.first < stretch.end <= frames for stretch in found)
        assert all(stretch.end - stretch.first <= voice_activity.LONGEST_FRAMES for stretch in found)
        assert all(before.end <= after.first for before, after in pairwise(found))
        inside = np.zeros(frames, bool)
        for stretch in found:
            inside[slice(*stretch)] = True
        loud = np.zeros(frames, bool)
        for first, end in sounds:
            loud[first:end] = True
        middle = np.convolve(loud, np.ones(41), "same") > 40  # all around it is sound
        assert inside[middle].all()


def louder(samples: Samples, decibels: float) -> Samples:
    return (samples * 10 ** (decibels / 20)).astype(np.float32)


def passages(*parts: Samples) -> list[voice_activity.Stretch]:
    """Return the passages of sounds that follow one another."""
    return voice_activity.find_passages(mfcc.log_energy(np.concatenate(parts)))


def moved(found: list[voice_activity.Stretch], frames: int) -> list[voice_activity.Stretch]:
    return [voice_activity.Stretch(first + frames, end + frames) for first, end in found]


def test_a_noise_as_loud_as_the_room_may_be_its_margin_and_nothing_more() -> None:
    (found,) = moved(passages(hiss(5, 25), spoken(0), hiss(5, 25)), -500)
    sound = np.flatnonzero(find_spoken_frames(mfcc.log_energy(spoken(0))))
    assert sound[0] - voice_activity.PASSAGE_MARGIN - 2 <= found.first <= sound[0] - 10
    assert sound[-1] + 10 <= found.end <= sound[-1] + voice_activity.PASSAGE_MARGIN + 3


def test_a_pause_within_a_line_does_not_divide_it() -> None:
    samples = spoken(0)
    half = len(samples) // mfcc.HOP // 2 * mfcc.HOP
    assert len(passages(samples[:half], hiss(0.4, 0), samples[half:])) == 1


@pytest.mark.parametrize("gap_s", [0.3, 0.5, 1, 5])
@pytest.mark.parametrize("decibels", [0, -30])
def test_lines_are_passages_of_their_own_whatever_their_levels(gap_s: float, decibels: float) -> None:
    """The room of a line 30 dB softer is more than 80 dB beneath the other: its margins hold nothing, or all of it."""
    one, other = spoken(1), spoken(0)
    place = len(one) // mfcc.HOP + round(100 * gap_s)
    (first_alone,), (second_alone,) = passages(one, hiss(9, 0)), passages(other)
    first, second = passages(one, hiss(gap_s, 0), louder(other, decibels))
    assert first == first_alone
    (second,) = moved([second], -place)
    if decibels:
        sound = np.flatnonzero(find_spoken_frames(mfcc.log_energy(other)))
        assert second_alone.first <= second.first <= sound[0] + 3
        assert sound[-1] - 3 <= second.end <= second_alone.end
    else:
        assert second == second_alone
    soft, loud = passages(louder(one, decibels), hiss(gap_s, 0), other)
    assert moved([loud], -place) == [second_alone]
    assert soft.first >= first_alone.first
    assert soft.end <= first_alone.end


def test_a_voice_that_turns_away_is_heard_to_its_end() -> None:
    """Syllables of a quarter of a second that fall by 20 dB, from the middle on softer, before and after a room."""
    syllables = np.tile(np.linspace(0, -20, 25), 24) - np.repeat([0, 22], 300)
    decibels = np.pad(syllables, 200, constant_values=-55)
    loud, soft = voice_activity.find_passages((decibels * DECIBEL).astype(np.float32))
    assert 470 < loud.end < 530
    assert soft.end > 780


def test_every_line_of_a_stem_of_ten_minutes_is_a_passage() -> None:
    energies = [mfcc.log_energy(spoken(number)) for number in range(12)]
    loudest = max(float(values.max()) for values in energies)
    stem = np.full(60_000, loudest + np.log(mfcc.DYNAMIC_RANGE), np.float32)
    starts = [300 + 4900 * number for number in range(12)]
    for start, values in zip(starts, energies, strict=True):
        stem[start : start + len(values)] = values
    found = voice_activity.find_passages(stem)
    assert len(found) == len(starts)
    for (first, end), start, values in zip(found, starts, energies, strict=True):
        sound = start + np.flatnonzero(find_spoken_frames(values))
        assert start <= first <= sound[0]
        assert sound[-1] < end <= start + len(values)


SECONDS = np.arange(5 * RATE_HZ) / RATE_HZ
CLICK = np.where(np.arange(len(SECONDS)) == 40_000, 0.9, 0.0)
DRAWN = np.random.default_rng(0).normal(size=len(SECONDS))


NO_VOICE = {
    "zeros": 0 * SECONDS, "click": CLICK, "click in noise": CLICK + 1e-4 * DRAWN, "noise": 0.1 * DRAWN,
    "clap": 0.5 * DRAWN * ((SECONDS > 2) & (SECONDS < 2.05)), "tone": 0.3 * np.sin(2 * np.pi * 440 * SECONDS),
    "hum": 0.05 * np.sin(2 * np.pi * 50 * SECONDS),
}  # fmt: skip


@pytest.mark.parametrize("sound", NO_VOICE)
@pytest.mark.parametrize("units", [None, 0, 25])
def test_what_is_no_voice_is_no_passage(sound: str, units: float | None) -> None:
    around = hiss(5, units) if units is not None else hiss(0, 0)
    samples = np.concatenate([around, NO_VOICE[sound].astype(np.float32), around])
    assert passages(samples) == []
    assert not analysed_audio.AnalysedAudio(samples, RATE_HZ).passages


def level_passage(samples: Samples) -> Samples:
    """Return a passage at the level of all passages."""
    gain = voice_activity.find_passage_gain(mfcc.log_energy(samples))
    return voice_activity.apply_gain(samples, np.arange(len(gain)), gain)


def loudness_db(samples: Samples, seconds: slice) -> float:
    """Return the level of the loudest quarter of a second in some seconds of a recording."""
    level = average_power(mfcc.log_energy(samples)) - np.log(mfcc.WINDOW)
    return float(level[100 * seconds.start : 100 * seconds.stop].max() / DECIBEL)


@pytest.mark.parametrize("decibels", [0, -40])
def test_a_passage_has_one_gain_and_the_level_of_all(decibels: float) -> None:
    samples = louder(spoken(0), decibels)
    levelled = level_passage(samples)
    heard = np.abs(samples) > np.abs(samples).max() / 100
    assert np.ptp(levelled[heard] / samples[heard]) < 1e-3 * np.mean(levelled[heard] / samples[heard])
    assert loudness_db(levelled, slice(0, 9)) == pytest.approx(20 * np.log10(voice_activity.SAME_LEVEL), abs=0.1)


def test_a_voice_that_becomes_softer_is_raised() -> None:
    """It falls by 28 dB within two seconds."""
    samples = np.concatenate([spoken(number)[40 * mfcc.HOP : 240 * mfcc.HOP] for number in range(4)])
    fall_db = np.interp(np.arange(len(samples)) / RATE_HZ, [2, 4], [0, 28])
    falling = (samples * 10 ** (-fall_db / 20)).astype(np.float32)
    levelled = level_passage(falling)
    start, last = slice(0, 2), slice(5, 7)
    assert loudness_db(levelled, start) == pytest.approx(20 * np.log10(voice_activity.SAME_LEVEL), abs=0.1)
    assert loudness_db(falling, start) - loudness_db(falling, last) > 24
    assert loudness_db(levelled, start) - loudness_db(levelled, last) < 14


def test_a_tone_that_covers_a_word_is_found_and_no_voice_is_one() -> None:
    sentence = toy_sentences(3)[0]
    samples, tone = sentence.audio.samples.copy(), slice(16_000, 22_400)
    assert [analysed_audio.analysed(each.audio).tones for each in toy_sentences(12)] == [[]] * 12
    samples[tone] = np.float32(0.3) * np.sin(2 * np.pi * 1000 * np.arange(6400) / 16_000).astype(np.float32)
    audio = analysed_audio.AnalysedAudio(samples, 16_000)
    ((first, end),) = audio.tones
    assert abs(first - 100) <= 8
    assert 120 < end <= 142
    level = audio.log_energy
    assert level[110:120].max() < level[:100].max() - 5  # as silent as a room, in what recognisers get


def test_noise_stands_in_the_gaps_of_a_noise_gate() -> None:
    """Beside digital silence all speech would look alike, and every voice like that of the training."""
    samples = toy_sentences(3)[0].audio.samples.copy()
    assert voice_activity.fill_gaps(samples, mfcc.log_energy(samples)) is samples
    samples[16_000:20_000] = 0
    filled = voice_activity.fill_gaps(samples, mfcc.log_energy(samples))
    assert np.array_equal(filled[:15_800], samples[:15_800])
    assert np.array_equal(filled[20_200:], samples[20_200:])
    loud = average_power(mfcc.log_energy(samples)).max()
    drop = (loud - mfcc.log_energy(filled)[104:122]) / DECIBEL
    assert drop.min() > 30
    assert drop.max() < 36


@pytest.mark.long
def test_hours_of_silence_are_searched_for_tones_block_by_block() -> None:
    samples = np.zeros(4 * 60 * 16_000, np.float32)
    energy = mfcc.log_energy(samples)
    tracemalloc.start()
    tones, (_, most) = voice_activity.find_tones(samples, energy), tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert (tones, most < 6 * samples.nbytes) == ([], True)


def loud_in(spans: list[tuple[float, float]], duration_s: float, *, gain: float = 0.1, noise: float = 1e-3) -> Audio:
    """Return noise that is loud in some spans."""
    draw = np.random.default_rng(0)
    samples = noise * draw.normal(size=round(duration_s * RATE_HZ))
    for start_s, end_s in spans:
        part = slice(round(start_s * RATE_HZ), round(end_s * RATE_HZ))
        samples[part] += gain * draw.normal(size=len(samples[part]))
    return Audio(samples.astype(np.float32), RATE_HZ)


SPANS = [(0.5, 1.5), (2.0, 3.2), (4.0, 4.6)]


def test_levels_are_those_of_the_sound():
    sine = np.sin(2 * np.pi * 440 * np.arange(RATE_HZ) / RATE_HZ).astype(np.float32)
    levels = pauses.measure_levels_db(Audio(0.1 * sine, RATE_HZ))
    assert levels.shape == (100,)
    assert levels[10:-10] == pytest.approx(-23.0, abs=0.3)  # 20 dB below full scale, 3 for a sine
    assert pauses.measure_levels_db(Audio(np.zeros(RATE_HZ, np.float32), RATE_HZ)).tolist() == [-100.0] * 100


def test_spans_between_pauses_are_not_divided_by_short_dips_and_clicks_are_none():
    np.testing.assert_allclose(pauses.list_spans(pauses.measure_levels_db(loud_in(SPANS, 5.0))), SPANS, atol=0.04)
    found = pauses.list_spans(pauses.measure_levels_db(loud_in([(0.5, 1.0), (1.12, 1.5), (2.5, 2.53)], 4.0)))
    np.testing.assert_allclose(found, [(0.5, 1.5)], atol=0.04)


def test_loudness_may_change_in_an_hour():
    loud, soft = loud_in(SPANS, 60.0, gain=0.2, noise=1e-2), loud_in(SPANS, 60.0, gain=0.004, noise=1e-4)
    both = Audio(np.concatenate([loud.samples, soft.samples]), RATE_HZ)
    found = pauses.list_spans(pauses.measure_levels_db(both))
    expected = [*SPANS, *((start_s + 60, end_s + 60) for start_s, end_s in SPANS)]
    np.testing.assert_allclose([span for span in found if span[0] % 60 < 5], expected, atol=0.05)


def test_the_quietest_place():
    levels = pauses.measure_levels_db(loud_in([(0.0, 1.0), (1.1, 2.0)], 2.0))
    assert find_quietest(levels, 0.5, 1.8) == pytest.approx(1.05, abs=0.06)
    assert find_quietest(levels, 1.0, 1.0) == pytest.approx(1.0)


def test_levels_at_any_time_also_of_less_than_a_step():
    sound = loud_in(SPANS, 5.0)
    levels, times_s = pauses.measure_levels_db(sound), np.array([-1.0, 0.005, 1.005, 1.01, 99.0])
    found = measure_levels_at(sound, times_s)
    assert found == pytest.approx([levels[0], levels[0], levels[100], levels[100:102].mean(), levels[-1]])
    for samples in (0, 159):
        found = measure_levels_at(Audio(np.ones(samples, np.float32), RATE_HZ), np.arange(3.0))
        assert found == pytest.approx([pauses.QUIETEST_DB] * 3)
