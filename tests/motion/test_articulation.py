from dataclasses import replace

import numpy as np
import pytest

from lipmotion.motion import articulation
from lipmotion.motion.space import fit_reduced_motion
from lipmotion.stats.curves import with_dynamics
from lipmotion.testing.examples import examples, timeline

OPENING, WIDTH = articulation.ARTICULATORS.index("opening"), articulation.ARTICULATORS.index("width")


def middle(phone: str, articulator: int) -> float:
    """The articulator in the middle of a long phone between others."""
    units = timeline(("t", phone, "t"), 0.3)
    curve = articulation.trace_articulators(units, 230)
    span = units[2]
    return float(curve[int((span.start_s + span.end_s) * 50), articulator])


def test_open_vowels_are_open_closures_closed_and_rounded_sounds_narrow() -> None:
    assert min(middle(phone, OPENING) for phone in ("aa", "ae", "ay")) > 0.5
    assert max(middle(phone, OPENING) for phone in ("p", "b", "m", "f", "v")) < -0.4
    assert max(middle(phone, WIDTH) for phone in ("uw", "ow", "w", "ao")) < -0.5 < middle("iy", WIDTH)
    assert (
        "oy" not in articulation.read_articulation_table()
    )  # a phone without a row borrows that of the most similar one
    assert middle("oy", OPENING) == pytest.approx(middle("ao", OPENING))


@pytest.fixture(scope="module")
def prior() -> articulation.ArticulationPrior:
    """The table in the range of the synthetic speaker."""
    some = examples()
    space, values = fit_reduced_motion(some, 3)
    found = articulation.fit_articulation_prior(space, values, some)
    assert found is not None
    return found


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
    paused = (replace(span, label=replace(span.label, phone="sp")) for span in units if span.label.phone == "sil")
    first, last = paused
    assert (
        articulation.count_contexts([units, replace(units, spans=(first, *units.spans[1:-1], last))])["sil", "t", "aa"]
        == 2
    )


def test_it_is_the_same_after_serialisation(prior: articulation.ArticulationPrior) -> None:
    again = articulation.articulation_from_arrays(articulation.articulation_to_arrays(prior), len(prior.centre))
    assert again.contexts == prior.contexts
    np.testing.assert_allclose(again.matrix, prior.matrix)
    assert articulation.articulation_from_arrays({}, 5) is None


def test_motion_without_an_opening_has_no_table() -> None:
    some = examples(3)
    for number, one in enumerate(some):
        motion = replace(one.motion, values=one.motion.values[:, 1:], channels=one.motion.channels[1:])
        some[number] = replace(one, motion=motion)
    space, values = fit_reduced_motion(some, 3)
    assert articulation.fit_articulation_prior(space, values, some) is None
