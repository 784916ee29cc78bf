import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from lipmotion.errors import ModelFormatError
from lipmotion.measures.curves import measure_modulation_distance
from lipmotion.motion import modulation_filter
from lipmotion.motion.modulation_filter import REACH, fit_modulation_filter
from lipmotion.storage.schema import format_errors
from lipmotion.testing import examples
from lipmotion.types import FRAME_RATE_HZ

RNG = np.random.default_rng(0)
RECORDED = [gaussian_filter1d(RNG.normal(size=(600, 2)), 1.0, axis=0) for _ in range(6)]
GENERATED = [gaussian_filter1d(clip, 1.5, axis=0) for clip in RECORDED]
FILTER = fit_modulation_filter(RECORDED, GENERATED)


def test_the_filtered_motion_has_the_spectrum_of_the_recorded_motion() -> None:
    filtered = [FILTER.apply(clip) for clip in GENERATED]
    before = measure_modulation_distance(GENERATED, RECORDED, FRAME_RATE_HZ)
    assert (measure_modulation_distance(filtered, RECORDED, FRAME_RATE_HZ) < 0.25 * before).all()
    assert fit_modulation_filter(RECORDED, RECORDED).apply(RECORDED[0]) == pytest.approx(RECORDED[0], abs=1e-9)


def test_each_dimension_has_its_own_filter_without_delay() -> None:
    impulse = np.zeros((101, 2))
    impulse[50] = 1
    answer = FILTER.apply(impulse)
    assert answer[50 - REACH : 51 + REACH] == pytest.approx(FILTER.taps)
    assert answer == pytest.approx(answer[::-1])
    half = fit_modulation_filter(RECORDED, [clip * (1, 0.5) for clip in RECORDED])
    assert half.apply(impulse)[:, 0] == pytest.approx(impulse[:, 0], abs=1e-9)
    assert half.taps[REACH, 1] > 1.2


def test_its_strength_is_between_nothing_and_all_of_it() -> None:
    plain, whole = GENERATED[0], FILTER.apply(GENERATED[0])
    for strength in (0, 0.5, 2):
        assert FILTER.scale_to(strength).apply(plain) == pytest.approx(plain + strength * (whole - plain))


def test_an_engine_learns_it_with_the_noise_of_its_examples_and_only_if_it_is_wanted() -> None:
    training = examples(12)
    values = [example.motion.values[:, :2] + 0.03 * RNG.normal(size=(len(example.valid), 2)) for example in training]
    smooth = [gaussian_filter1d(x, 2.0, axis=0) for x in values]
    noise = [still for x in values for still in (x[:28], x[-28:])]  # at rest, and 0.3 s away from speech
    noisy, freed = fit_modulation_filter(values, smooth), fit_modulation_filter(values, smooth, noise)
    found = modulation_filter.learn_filter(0.5, zip(values, smooth, strict=True), training, values)
    errors = [np.abs(found.taps - each.scale_to(0.5).taps).max() for each in (noisy, freed)]
    assert errors[1] < 0.1 * errors[0]
    assert modulation_filter.learn_filter(1.0, [], training, values).apply(values[0]) == pytest.approx(values[0])

    def unwanted():
        pytest.fail("motion is generated for a filter of no strength")
        yield

    assert modulation_filter.learn_filter(0.0, unwanted(), training, values) is None


def test_a_mouth_at_rest_stays_there() -> None:
    rest = np.full((60, 2), 0.3)
    assert FILTER.apply(rest) == pytest.approx(rest)
    speech = np.concatenate([rest, 0.3 + RECORDED[0][:50], rest])
    assert FILTER.apply(speech)[:30] == pytest.approx(speech[:30])


def test_held_frames_are_what_they_were_and_their_neighbours_lead_to_them() -> None:
    frames = [0, 200, 203, 599]
    free, held = FILTER.apply(GENERATED[0]), FILTER.apply(GENERATED[0], frames)
    pinned = FILTER.apply(GENERATED[0], (), [(frame, 1) for frame in frames])
    assert np.array_equal(pinned[:, 1], held[:, 1])
    assert np.array_equal(pinned[:, 0], free[:, 0])
    assert np.array_equal(held[frames], GENERATED[0][frames])
    far = np.abs(np.arange(600)[:, None] - frames).min(axis=1) >= modulation_filter.HOLD_FRAMES
    assert np.array_equal(held[far], free[far])
    assert (np.abs(held - GENERATED[0]) <= np.abs(free - GENERATED[0]) + 1e-12).all()


def test_noise_of_the_tracker_is_not_learned() -> None:
    tracked = [clip + 0.6 * RNG.normal(size=clip.shape) for clip in RECORDED]
    resting = [0.6 * RNG.normal(size=(200, 2)) for _ in range(6)]
    noisy, freed = fit_modulation_filter(tracked, GENERATED), fit_modulation_filter(tracked, GENERATED, resting)
    error = [np.abs(each.taps - FILTER.taps).max() for each in (noisy, freed)]
    assert error[1] < 0.5 * error[0]
    assert np.array_equal(fit_modulation_filter(tracked, GENERATED, [resting[0][:REACH]] * 100).taps, noisy.taps)


def test_what_never_moves_is_left_as_it_is() -> None:
    still = [np.zeros((100, 1))]
    assert np.isfinite(fit_modulation_filter(still, still).taps).all()
    assert fit_modulation_filter([RECORDED[0][:, :1]], still).apply(still[0]) == pytest.approx(still[0])


def test_it_is_stored() -> None:
    stored, nothing = (modulation_filter.filter_to_arrays(each) for each in (FILTER, None))
    assert np.array_equal(modulation_filter.filter_from_arrays(stored, 2).taps, FILTER.taps)
    assert modulation_filter.filter_from_arrays(nothing, 2) is None
    too_large = np.full_like(FILTER.taps, modulation_filter.MODULATION["modulation"].maximum + 1)
    damaged = [modulation_filter.ModulationFilter(taps) for taps in (FILTER.taps[:-1], FILTER.taps[:, :1], too_large)]
    for arrays, needed in ((nothing, True), *((modulation_filter.filter_to_arrays(each), False) for each in damaged)):
        with pytest.raises(ModelFormatError), format_errors("the model"):
            modulation_filter.filter_from_arrays(arrays, 2, needed=needed)
