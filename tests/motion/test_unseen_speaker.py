from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from lipmotion import Request, load_model
from lipmotion.motion import articulation
from lipmotion.motion.articulation import ARTICULATORS, UnseenSpeaker
from lipmotion.motion.closure import REACH_S, find_closable_ranges
from lipmotion.motion.network_steps import hear_articulators
from lipmotion.motion.space import MotionSpace, fit_reduced_motion
from lipmotion.pipeline.analysis.speech_analysis import analyse
from lipmotion.pipeline.model import with_prior
from lipmotion.stats.curves import with_dynamics
from lipmotion.testing import examples, timeline
from lipmotion.types import Constraints, Generation, Pin, Span, Speech, Timeline, Unit
from lipmotion.units import VOWELS

WELCOME = Path(__file__).parent.parent.parent / "examples" / "welcome.flac"
SHUT_OPENING = 0.015  # eye distances; people do not say a vowel through lips that are so close
CONFIDENCES = (0.0, 0.25, 0.5, 0.75, 1.0)


@pytest.fixture(scope="module")
def welcome() -> Speech:
    return analyse(load_model(), Request(WELCOME, recogniser="fast"))


@pytest.fixture
def no_distortion_is_low(monkeypatch: pytest.MonkeyPatch) -> None:
    """Phones can be relied on as far as words confirm them, however clear the sound is."""
    monkeypatch.setattr("lipmotion.motion.frame_labels.DISTORTIONS", (-2.0, -1.0))


def generated(speech: Speech, *pins: Pin) -> Generation:
    model = load_model()
    return model.engine.generate(model.learned, speech, Constraints(pins))


def shut_share(generation: Generation) -> float:
    opening = generation.motion["opening"]
    vowels = [opening[int(s.start_s * 100) : int(s.end_s * 100)] for s in generation.units if s.label.phone in VOWELS]
    return float((np.concatenate(vowels) < SHUT_OPENING).mean())


def changed(step: str, speaker: UnseenSpeaker, frames: slice, *arguments: np.ndarray) -> np.ndarray:
    """What a step makes of means of 0 in some frames; precisions stay."""
    means = np.zeros((speaker.frames, 3, len(speaker.prior.centre)))
    statistics = getattr(speaker, step)(lambda chosen: (means[chosen], means[chosen] + 1), *arguments)
    made, precisions = statistics(frames)
    np.testing.assert_array_equal(precisions, np.ones_like(made))
    return made


@pytest.mark.parametrize(("voice", "change"), [(0.0, 1.0), (0.75, 0.5), (1.0, 0.0)])
def test_long_vowels_are_more_open_short_ones_and_consonants_less(voice: float, change: float) -> None:
    prior = load_model().learned.motion.prior
    seconds = np.cumsum([0, 0.5, 0.5, 0.5, 0.04, 0.46, articulation.VOWEL_S, 0.4]).tolist()
    phones = ("t", "aa", "t", "aa", "t", "aa", "t")
    units = Timeline(tuple(Span(*edges, Unit(phone)) for edges, phone in zip(pairwise(seconds), phones, strict=True)))
    made = changed("raise_contrast", UnseenSpeaker(prior, units, 250, 1.0, voice), slice(20, 240))
    opening = made[:, 0, 0] / prior.matrix[0, 0]
    assert opening[75 - 20] == pytest.approx(change * articulation.OPENING_BY_DURATION * np.log(5), rel=0.01)
    assert opening[[5, 215]] == pytest.approx(-change * articulation.CONSONANT_CLOSING, rel=0.01)
    shortest = articulation.OPENING_BY_DURATION * np.log(0.04 / articulation.VOWEL_S)
    assert change * shortest <= opening[152 - 20] <= -change * articulation.CONSONANT_CLOSING


@pytest.mark.parametrize(("voice", "share"), [(0.0, 0.5), (0.5, 0.5), (1.0, 0.0)])
@pytest.mark.parametrize(("phone", "least", "most"), [("aa", 0.8, 1.3), ("b", -0.2, 0.1), ("m", -0.2, 0.1)])
def test_voices_not_known_to_training_open_before_they_speak_but_for_closed_lips(voice, share, phone, least, most):
    prior = load_model().learned.motion.prior
    units = Timeline((Span(0.0, 1.5, Unit("sil")), Span(1.5, 1.8, Unit(phone)), Span(1.8, 2.5, Unit("sil"))))
    made = changed("open_before_speech", UnseenSpeaker(prior, units, 250, 0.5, voice), slice(10, 250))
    wider = articulation.BREATH_RISE / 2 * prior.matrix[[0, 2]].sum(axis=0)
    assert made[120 - 10, 0] == pytest.approx(share * (prior.centre + wider), rel=1e-2)
    assert share * least <= made[145 - 10, 0, 0] / prior.centre[0] <= share * most
    assert np.abs(made[[10, 60, 170, 230], 0]).max() < 1e-3


@pytest.mark.parametrize(("voice", "left"), [(0.0, 0.0), (0.75, 0.5), (1.0, 1.0)])
def test_the_width_of_unknown_voices_moves_fast_where_lips_are_round_alone(voice: float, left: float) -> None:
    prior = load_model().learned.motion.prior
    units = Timeline((Span(0.0, 1.0, Unit("s")), Span(1.0, 2.0, Unit("w")), Span(2.0, 3.0, Unit("s"))))
    means = np.zeros((300, 3, len(prior.centre)))
    means[:, :, 1] = (np.arange(300) % 2)[:, None]
    speaker = UnseenSpeaker(prior, units, 300, 1.0, voice)
    made, _ = speaker.slow_width(lambda chosen: (means[chosen], means[chosen] + 1), 1)(slice(20, 280))
    fast = np.abs(np.diff(made[:, :, 1], axis=0))
    assert fast[[30, 230]] == pytest.approx(left, abs=0.01)
    assert fast[130] == pytest.approx(1)
    assert not made[:, :, [0, 2]].any()


def test_a_model_of_few_phones_opens_no_mouth_before_speech() -> None:
    prior, units = load_model().learned.prior, timeline(("p", "aa"), 0.2)
    few = replace(prior, contexts=dict.fromkeys(list(prior.contexts)[:10], 1))
    speakers = [UnseenSpeaker(each, units, 250, 1.0, 0.8) for each in (prior, few)]
    known, half_known = (np.abs(changed("open_before_speech", each, slice(250))).max() for each in speakers)
    assert half_known == pytest.approx(known * 10 / 5000)


@pytest.mark.parametrize("confidence", CONFIDENCES)
@pytest.mark.usefixtures("no_distortion_is_low")
def test_vowels_are_open_at_any_confidence(welcome: Speech, confidence: float) -> None:
    assert welcome.voice < 0.5
    assert shut_share(generated(replace(welcome, confidence=confidence))) <= 0.03


@pytest.mark.long
@pytest.mark.parametrize("confidence", CONFIDENCES)
@pytest.mark.usefixtures("no_distortion_is_low")
def test_vowels_of_other_talkers_are_open(recordings: Path, confidence: float) -> None:
    for clip in sorted((recordings / "grid-others").glob("*.mpg")):
        speech = analyse(load_model(), Request(clip, recogniser="fast"))
        assert shut_share(generated(replace(speech, confidence=confidence))) <= 0.03, clip.stem


def test_movements_are_those_of_typical_talkers_about_the_same_rest(welcome: Speech) -> None:
    known, unknown = (generated(replace(welcome, voice=voice, confidence=1.0)) for voice in (1.0, 0.0))
    own, typical = known.motion["opening"], unknown.motion["opening"]
    assert np.percentile(own, 98) < 0.18
    assert 0.2 < np.percentile(typical, 98) < 0.3
    assert (np.abs(typical[-10:] - own[-10:]) < 0.04).all()  # lips part a little in a quiet pause
    for frames in find_closable_ranges(unknown.units, len(typical), reach_s=articulation.choose_closing_reach(0.0)):
        assert typical[frames].min() <= load_model().learned.closure.closed + 1e-9
    ratio = np.sqrt(unknown.variance[:, 0] / np.maximum(known.variance[:, 0], 1e-12))
    assert 1.2 < np.median(ratio) < 2


@pytest.mark.parametrize("silent", [False, True])
def test_in_a_quiet_pause_lips_follow_what_is_heard_but_not_in_digital_silence(welcome: Speech, silent: bool) -> None:
    values, units = welcome.features.values.copy(), (*welcome.units.between(0, 3), Span(3, 5.6, Unit("sil")))
    values[-100:] = -100 if silent else values[-100:]
    features = replace(welcome.features, values=values)
    unknown = replace(welcome, voice=0.0, units=Timeline(units), features=features)
    heard, still = (generated(replace(unknown, range_db=each)).motion["opening"] for each in (60.0, 0.0))
    assert (np.abs(heard - still)[-10:].max() < 1e-3) == silent


def test_a_known_voice_whose_phones_are_given_is_moved_by_its_model_alone(welcome: Speech) -> None:
    assert hear_articulators(replace(welcome, voice=1.0, units_known=True)) is None
    assert hear_articulators(replace(welcome, encoding=None)) is None
    assert hear_articulators(welcome).shape == (len(welcome.features.values), len(ARTICULATORS))


def test_a_model_that_stands_on_another_gets_the_same_of_it_whoever_speaks(welcome: Speech) -> None:
    """Training and use would differ, if the other model knew the voice in one of them only."""
    known, unknown = (with_prior(load_model(), replace(welcome, voice=voice)).prior for voice in (1.0, 0.2))
    np.testing.assert_allclose(known.articulators, unknown.articulators)


@pytest.mark.parametrize(
    ("voice", "reliability", "share"), [(0.0, 0.0, 0.65), (0.0, 1.0, 0.35), (0.5, 0.0, 0.325), (1.0, 0.0, 0.0)]
)
def test_motion_follows_the_sound_in_speech_the_less_phones_are_relied_on(voice, reliability, share):
    prior = load_model().learned.motion.prior
    units = Timeline((Span(0.0, 1.0, Unit("sil")), Span(1.0, 2.0, Unit("aa")), Span(2.0, 3.0, Unit("sil"))))
    heard = np.tile(np.eye(len(ARTICULATORS))[0], (300, 1))
    for range_db, pause in ((0.0, 0), (25.0, 0), (30.0, 1)):  # in pauses it does where these are quiet
        speaker = UnseenSpeaker(prior, units, 300, reliability, voice, range_db)
        made = changed("follow_sound", speaker, slice(10, 300), heard)
        assert made[150 - 10, 0] == pytest.approx(share * (prior.centre + prior.matrix[0]), rel=1e-3)
        assert np.abs(made[[10, 280]] - pause * made[140]).max() < 1e-3


def test_doubtful_closures_are_confirmed_by_the_sound() -> None:
    prior, units = load_model().learned.motion.prior, timeline(("p", "aa"), 0.2)
    heard = np.zeros((100, len(ARTICULATORS)))
    heard[:20, 0] = -1
    ranges = [slice(5, 15), slice(50, 60)]
    assert UnseenSpeaker(prior, units, 100, 1.0, 0.0).confirm_closures(ranges, heard) == ranges
    assert UnseenSpeaker(prior, units, 100, 0.2, 0.0).confirm_closures(ranges, heard) == ranges[:1]


def test_pins_are_in_delivered_units(welcome: Speech) -> None:
    pinned = generated(replace(welcome, voice=0.0), Pin(1.0, "opening", 0.31), Pin(1.4, "width", 0.52))
    assert pinned.motion["opening"][100] == pytest.approx(0.31, abs=1e-12)
    assert pinned.motion["width"][140] == pytest.approx(0.52, abs=1e-12)
    assert pinned.variance[100, 0] == pytest.approx(0, abs=1e-15)


def test_the_range_grows_with_what_is_not_known() -> None:
    learned = load_model().learned
    factors = [articulation.widen_range(learned.prior, learned.space, voice, 1.0) for voice in (1.0, 0.7, 0.3, 0.0)]
    assert factors[0] == pytest.approx(1)
    assert np.diff(factors).min() > 0
    doubtful = articulation.widen_range(learned.prior, learned.space, 0.0, 0.0)
    assert 1 < doubtful < factors[-1]  # the general network, which moves as far as people do, has more of it
    weights = tuple(replace(channel, unit="weight") for channel in learned.space.channels)
    other = MotionSpace(weights, learned.space.direct, learned.space.points)
    assert articulation.widen_range(learned.prior, other, 0.0, 1.0) == pytest.approx(1)


def test_lips_close_within_the_phones_of_unknown_voices() -> None:
    assert articulation.choose_closing_reach(1.0) == pytest.approx(REACH_S)
    assert articulation.choose_closing_reach(0.0) == pytest.approx(-articulation.INSET_S)
    for duration_s in (0.02, 0.1):
        span = timeline(("b",), duration_s)[1]
        (frames,) = find_closable_ranges(timeline(("b",), duration_s), 200, reach_s=-articulation.INSET_S)
        assert span.start_s - 1e-9 <= frames.start / 100 <= (frames.stop - 1) / 100 <= span.end_s + 1e-9


@pytest.mark.long
def test_the_models_own_voice_is_known(recordings: Path) -> None:
    names = (recordings / "grid-s1" / "val.txt").read_text().split()[:3]
    clips = [recordings / "grid-s1" / "clips" / f"{name}.mkv" for name in names]
    assert [analyse(load_model(), Request(clip)).voice for clip in clips] == pytest.approx([1, 1, 1])


OPENING, WIDTH = ARTICULATORS.index("opening"), ARTICULATORS.index("width")


def middle(phone: str, articulator: int) -> float:
    units = timeline(("t", phone, "t"), 0.3)
    frame = int((units[2].start_s + units[2].end_s) * 50)
    return float(articulation.trace_articulators(units, 230)[frame, articulator])


def test_open_vowels_are_open_closures_closed_and_rounded_sounds_narrow() -> None:
    assert min(middle(phone, OPENING) for phone in ("aa", "ae", "ay")) > 0.5
    assert max(middle(phone, OPENING) for phone in ("p", "b", "m", "f", "v")) < -0.4
    assert max(middle(phone, WIDTH) for phone in ("uw", "ow", "w", "ao")) < -0.5 < middle("iy", WIDTH)
    assert "oy" not in articulation.read_articulation_table()  # a phone without a row borrows that of the most similar
    assert middle("oy", OPENING) == pytest.approx(middle("ao", OPENING))


@pytest.fixture(scope="module")
def prior() -> articulation.ArticulationPrior:
    some = examples()
    space, values = fit_reduced_motion(some, 3)
    return articulation.fit_articulation_prior(space, values, some)  # type: ignore[return-value]


def test_the_table_is_in_the_speakers_own_range(prior: articulation.ArticulationPrior) -> None:
    spoken = np.concatenate([one.motion.values[60:-60, :2] for one in examples()])
    assert prior.matrix[OPENING, 0] == pytest.approx(np.sqrt(spoken[:, 0].std() * 0.054), rel=0.1)
    assert prior.centre[0] == pytest.approx(np.median(spoken[:, 0]), rel=0.1)
    assert prior.matrix[WIDTH, 0] == 0


def test_contexts_of_the_training_are_known_and_others_are_not(prior: articulation.ArticulationPrior) -> None:
    seen = examples()[0].speech.units
    frames = len(examples()[0].valid)
    unseen = timeline(("hh", "oy", "zh", "ng", "uh"), 0.2)
    assert prior.familiarity(seen, frames)[60:-60].min() > 0.45
    assert prior.familiarity(unseen, 220)[70:-70].max() < 0.1
    assert prior.familiarity(timeline((), 0.2), 400)[150:250].min() > 0.99  # rest is always known


def test_unknown_contexts_follow_the_table_and_unreliable_phones_do_not(prior: articulation.ArticulationPrior) -> None:
    units, frames = timeline(("hh", "ao", "zh", "ng", "uh"), 0.2), 220
    own = np.ones((frames, 3, len(prior.centre)))

    def statistics(chosen: slice) -> tuple[np.ndarray, np.ndarray]:
        return own[chosen].copy(), own[chosen].copy()

    followed, precisions = prior.blend(statistics, units, frames, 1.0)(slice(0, frames))
    moved = articulation.GAIN * articulation.trace_articulators(units, frames) @ prior.matrix
    table = with_dynamics(prior.centre + moved)
    share = (followed - own)[100, 0] / (table - own)[100, 0]
    np.testing.assert_allclose(share, share[0])
    assert 0.7 < share[0] < 0.9
    np.testing.assert_allclose(precisions, own)
    ignored, _ = prior.blend(statistics, units, frames, 0.0)(slice(0, frames))
    np.testing.assert_allclose(ignored, own)
    beside = replace(prior, known_voice_share=0.3)
    unknown_voice, _ = beside.blend(statistics, units, frames, 1.0, voice=0.0)(slice(0, frames))
    np.testing.assert_allclose(unknown_voice, followed)
    known_voice, _ = beside.blend(statistics, units, frames, 1.0)(slice(0, frames))
    less = (known_voice - own)[100, 0] / (table - own)[100, 0]
    np.testing.assert_allclose(less / (1 - less), 0.3 * share / (1 - share))


def test_ranges_of_frames_have_the_dynamics_of_the_whole() -> None:
    values = np.random.default_rng(0).standard_normal((30, 2))
    whole = with_dynamics(values)
    for frames in (slice(0, 30), slice(0, 7), slice(7, 20), slice(20, 30), slice(None)):
        np.testing.assert_allclose(articulation.slice_dynamics(values, frames), whole[frames])


def test_contexts_are_counted_with_pauses_as_silence() -> None:
    units = timeline(("t", "aa"))
    first, *spoken, last = units
    first, last = (replace(span, label=replace(span.label, phone="sp")) for span in (first, last))
    prior = articulation.ArticulationPrior(np.zeros(1), np.zeros((8, 1)), {("sil", "t", "aa"): 9})
    paused, silent = (prior.familiarity(each, 200) for each in (Timeline((first, *spoken, last)), units))
    np.testing.assert_array_equal(paused, silent)


def test_motion_without_an_opening_has_no_table() -> None:
    some = examples(3)
    less = (replace(one.motion, values=one.motion.values[:, 1:], channels=one.motion.channels[1:]) for one in some)
    some = [replace(one, motion=motion) for one, motion in zip(some, less, strict=True)]
    space, values = fit_reduced_motion(some, 3)
    assert articulation.fit_articulation_prior(space, values, some) is None
