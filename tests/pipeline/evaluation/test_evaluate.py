import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

from lipmotion import Corpus, Model, Selection, compare
from lipmotion import evaluate as evaluated
from lipmotion.engines import Engine
from lipmotion.errors import AlignmentError, CorpusError, InputError
from lipmotion.measures import curves
from lipmotion.pipeline.generation import generate_for
from lipmotion.speech.recognition.recogniser import open_recogniser
from lipmotion.speech.sound.speaker_similarity import rate_knowledge
from lipmotion.types import WEIGHT, Channel, Generation, Motion, Speech, StateTrace, Track, Utterance
from lipmotion.units import Lexicon
from lipmotion_lab.evaluation import held_out as held_out_module
from lipmotion_lab.evaluation.evaluate import _was_trained_on, measure_clips
from lipmotion_lab.evaluation.held_out import AUDIO_ONLY, ComparedClip, load_held_out, make_speech
from lipmotion_lab.evaluation.table import format_figures
from meshes.speech import motion
from pipeline import made
from pipeline.made import corpus_of
from testing.toy import toy_motion, toy_sentences

evaluate = partial(evaluated, recogniser="own")  # the toy's voice is that of its model
CONDITIONS = ["audio only", "with transcript"]
FIGURES = "channels acc amse leading lag_ms opening_acc_95 closures closures_p_b_m silence".split()


@dataclass(frozen=True, eq=False)
class Medium(Engine[Mapping[float, Motion]]):
    """Knows the motion of every recording by the recording's length, which has one passage."""

    config: Any
    name: ClassVar[str] = "medium"

    def generate(self, model: Mapping[float, Motion], speech: Speech, _constraints: object = None) -> Generation:
        motion = model[speech.features.duration_s]
        frames = np.zeros(len(motion.values), np.intp)
        return Generation(motion, np.zeros_like(motion.values), speech.units, StateTrace(("known",), frames))

    def fit(self, examples: object, monitor: object) -> Any: ...
    def to_arrays(self, model: object) -> Any: ...
    def from_arrays(self, arrays: object) -> Any: ...


class Shut(Medium):
    """Never opens the mouth but where it is not pinned."""

    def generate(self, model: Mapping[float, Motion], speech: Speech, _constraints: object = None) -> Generation:
        result = super().generate(model, speech)
        return replace(result, motion=replace(result.motion, values=result.motion.values * (0.0, 1.0, 1.0)))

    def without_closures(self) -> Medium:
        return Medium(self.config)


@pytest.fixture(scope="module", autouse=True)
def _whole() -> Iterator[None]:
    """The medium knows recordings, not passages."""

    def whole(person: Any, engine: Any, model: Any, speech: Speech) -> Generation:
        return generate_for(person, engine, model, replace(speech, parts=None))

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(held_out_module, "generate_for", whole)
        yield


@pytest.fixture(scope="module")
def known() -> dict[float, Motion]:
    """The true motion of the toy sentences at 100 Hz."""
    return {sentence.audio.duration_s: toy_motion(sentence.units, 100.0) for sentence in toy_sentences(12)}


def test_a_voice_is_as_well_known_as_in_animation(toy_model, toy_corpus):
    """Whatever engine recognises nothing itself generates the motion of strangers as such."""
    heard = []
    for less_similar in (0.0, 3.0, 20.0):
        own = replace(toy_model.phones, typical_fit=toy_model.phones.typical_fit + less_similar, speaker=None)
        recogniser = open_recogniser(own, "own")
        recordings = load_held_out(toy_corpus, recogniser, selection=Selection(split="val"), lexicon=Lexicon())
        speeches = make_speech(recordings, AUDIO_ONLY, Medium(None), {})
        heard.append([speech.voice for speech in speeches])
        known = [rate_knowledge(own, made.read_sound(each.audio)) for each in recordings.utterances]
        assert heard[-1] == pytest.approx(known)
    similar, less, least = np.array(heard)
    assert similar.max() == 1 > less.max() > least.max() == 0
    assert (similar >= less).all()


@pytest.fixture(scope="module")
def figures(toy_model: Model, toy_corpus: Corpus) -> dict[str, Any]:
    return evaluated(toy_model, toy_corpus)


@pytest.fixture(scope="module")
def perfect(toy_model: Model, toy_corpus: Corpus, known: dict[float, Motion]) -> dict[str, Any]:
    return evaluate(replace(toy_model, engine=Medium(None), learned=known), toy_corpus)


def held_out(corpus: Corpus) -> list[Utterance]:
    return [corpus.utterance(name) for name in corpus.names("test")]


def test_all_figures_are_there(figures):
    assert (figures["split"], figures["clips"]) == ("test", 2)
    assert list(figures["conditions"]) == CONDITIONS
    for condition in figures["conditions"].values():
        assert list(condition) == [*FIGURES, "unpinned"]
        for some in (condition, condition["unpinned"]):
            assert list(some)[: len(FIGURES)] == FIGURES
            assert list(some["channels"]) == ["opening", "width", "outer"]
            for row in some["channels"].values():
                assert list(row) == ["acc", "acc_per_clip", "nrmse", "global_variance", "jerk"]
    assert json.loads(json.dumps(figures)) is not None
    for name, condition in figures["conditions"].items():  # the toy model is good on sentences it has not seen
        assert name in format_figures(figures)
        assert condition["acc"] > 0.9
        for row in condition["channels"].values():
            assert 0.9 < row["acc"] <= 1
            assert row["nrmse"] < 0.5
            assert 0.6 < row["global_variance"] < 1.2
        low, high = condition["opening_acc_95"]
        assert low - 1e-9 <= condition["channels"]["opening"]["acc"] <= high + 1e-9
        assert abs(condition["lag_ms"]) < 20
        assert condition["closures_p_b_m"]["recall"] == 1
        assert condition["silence"]["generated"]["mean"] < 0.01


def test_a_perfect_model_has_perfect_figures(perfect):
    for condition in perfect["conditions"].values():
        assert list(condition) == FIGURES  # an engine that pins nothing has no other figures
        wanted = {"acc": 1, "acc_per_clip": 1, "nrmse": 0, "global_variance": 1, "jerk": 1}
        assert all(row == pytest.approx(wanted, abs=1e-4) for row in condition["channels"].values())
        assert condition["opening_acc_95"] == pytest.approx((1, 1), abs=1e-6)
        assert (condition["acc"], condition["amse"]) == pytest.approx((1, 0), abs=1e-6)
        assert condition["lag_ms"] == pytest.approx(0, abs=0.5)
        closures = condition["closures"]
        assert (closures["score"], closures["precision"], closures["timing_ms"]) == (1, 1, 0)
        assert closures["original"] == closures["generated"] > 4
        lips = condition["closures_p_b_m"]
        assert (lips["recall"], lips["false_per_minute"]) == (1, lips["original_per_minute"])
        assert condition["silence"]["generated"] == pytest.approx(condition["silence"]["original"], abs=1e-6)


def test_figures_without_pins_are_those_of_the_engine_without_them(toy_model, toy_corpus, known, perfect):
    figures = evaluate(replace(toy_model, engine=Shut(None), learned=known), toy_corpus)
    for name, condition in figures["conditions"].items():
        assert condition["unpinned"] == perfect["conditions"][name]
        assert condition["closures"]["generated"] == 0
        assert condition["unpinned"]["closures"]["generated"] > 4
    assert "without pins" in format_figures(figures)
    assert "pin" not in format_figures(perfect)


def test_a_late_model_is_late(toy_model, toy_corpus, known):
    for late in (-8, 4):
        shifted = {length: replace(m, values=np.roll(m.values, late, axis=0)) for length, m in known.items()}
        figures = evaluate(replace(toy_model, engine=Medium(None), learned=shifted), toy_corpus)["conditions"]
        assert figures["audio only"]["lag_ms"] == pytest.approx(10 * late, abs=8)
        assert figures["audio only"]["closures"]["timing_ms"] == pytest.approx(10 * late, abs=20)


def test_frames_without_a_face_are_left_out(toy_model, toy_corpus, known, tmp_path):
    """What the tracker filled in where it saw nothing has no say."""
    damaged = []
    for utterance in held_out(toy_corpus):
        seen = np.arange(len(utterance.track.seen)) % 25 != 7
        values = np.where(seen[:, None], utterance.track.motion.values, 9.0)
        motion = replace(utterance.track.motion, values=values)
        damaged.append(replace(utterance, track=replace(utterance.track, motion=motion, seen=seen)))
    perfect = replace(toy_model, engine=Medium(None), learned=known)
    found = evaluate(perfect, corpus_of(tmp_path, damaged))["conditions"]["audio only"]
    assert (found["acc"], found["amse"]) == pytest.approx((1, 0), abs=1e-6)


@pytest.mark.long
def test_closed_is_closed_by_the_training_list(toy_model, toy_corpus, figures):
    openings = [toy_corpus.utterance(name).track.motion["opening"] for name in toy_corpus.names("train")]
    expected = pytest.approx(0.1 * np.percentile(np.concatenate(openings), 95), rel=1e-5)
    assert figures["closed_under"] == expected
    everything = evaluate(toy_model, toy_corpus, selection=Selection(None))
    assert (everything["split"], everything["clips"], everything["closed_under"]) == ("all", 12, expected)


def test_without_transcripts_there_is_audio_only_and_one_that_does_not_fit_is_named(toy_model, toy_corpus, tmp_path):
    first, second = held_out(toy_corpus)
    untold = corpus_of(tmp_path, [replace(first, words=None), second])
    figures = evaluate(toy_model, untold)
    assert list(figures["conditions"]) == ["audio only"]
    assert figures["without_words"] == 1
    wrong = corpus_of(tmp_path / "wrong", [first, replace(second, words=("five",) * 100)])
    with pytest.raises(AlignmentError, match=rf"{second.name}: .*too short.*correct its transcript, or leave it out"):
        evaluate(toy_model, wrong)


def test_a_model_on_its_own_training_list_is_named(toy_model, toy_corpus, figures):
    training = [toy_corpus.utterance(toy_corpus.names("train")[0])]
    another = replace(toy_model, about={**toy_model.about, "corpus": ["another"]})
    assert "seen_in_training" not in figures
    assert _was_trained_on(toy_model, training, "toy")
    all_of_it, of_ben = ({**toy_model.about, **other} for other in ({"split": "all"}, {"speakers": ["ben"]}))
    assert _was_trained_on(replace(toy_model, about=all_of_it), held_out(toy_corpus), "toy")
    assert _was_trained_on(replace(another, prior=toy_model), training, "toy")
    assert not _was_trained_on(another, training, "toy")
    assert not _was_trained_on(replace(toy_model, about=of_ben), training, "toy")
    assert evaluate(toy_model, toy_corpus, selection=Selection(names=[training[0].name]))["seen_in_training"] is True


def renamed(motion: Motion) -> Motion:
    """The same curves under other names, beside one that stands still and one that hardly moves."""
    time_s = motion.time_s[:, None]
    values = np.concatenate([motion.values, 0 * time_s + 0.3, 1e-6 * np.sin(time_s)], axis=1)
    return replace(motion, values=values, channels=tuple(map(Channel, ("jaw", "width", "pout", "brow", "noise"))))


def renamed_utterance(utterance: Utterance) -> Utterance:
    return replace(utterance, track=replace(utterance.track, motion=renamed(utterance.track.motion)))


def test_other_channels_than_lip_distances(toy_model, toy_corpus, known, tmp_path):
    """Every channel that moves is compared, and what only an opening can tell is left out."""
    faces = corpus_of(tmp_path, [renamed_utterance(u) for u in held_out(toy_corpus)])
    other = replace(toy_model, engine=Medium(None), learned={key: renamed(m) for key, m in known.items()})
    figures = evaluate(other, faces)
    assert figures["closed_under"] is None
    assert figures["still_channels"] == ["brow", "noise"]
    for condition in figures["conditions"].values():
        assert list(condition) == FIGURES[:5]
        assert list(condition["channels"]) == ["jaw", "width", "pout"]
        assert condition["acc"] == pytest.approx(1, abs=1e-6)
        assert condition["leading"] in ("jaw", "pout")
        assert condition["lag_ms"] == pytest.approx(0, abs=0.5)
    json.dumps(figures, allow_nan=False)
    assert "left out, for they do not move: brow, noise" in format_figures(figures)


def test_a_model_of_other_motion_is_refused(toy_model, toy_corpus, known, tmp_path):
    first, second = held_out(toy_corpus)
    faces = corpus_of(tmp_path, [renamed_utterance(first)])
    with pytest.raises(CorpusError, match="the model has no channels jaw, pout, which the corpus has"):
        evaluate(toy_model, faces)
    other = replace(toy_model, engine=Medium(None), learned={key: renamed(m) for key, m in known.items()})
    with pytest.raises(CorpusError, match="the model has no channels opening, outer"):
        evaluate(other, toy_corpus)
    faces.add(second)
    with pytest.raises(CorpusError, match="different motion channels"):
        evaluate(toy_model, faces)
    frozen = [renamed_utterance(u) for u in held_out(toy_corpus)]
    motions = [replace(u.track.motion, values=np.ones_like(u.track.motion.values)) for u in frozen]
    frozen = [replace(u, track=replace(u.track, motion=m)) for u, m in zip(frozen, motions, strict=True)]
    with pytest.raises(CorpusError, match="none of 5 motion channels moves in these 2 utterances"):
        evaluate(toy_model, corpus_of(tmp_path / "frozen", frozen))


def test_labelled_phones_are_the_reference(toy_model, toy_corpus, tmp_path):
    """Labels that call the p, b and m something else: then there is nothing to close in."""
    names = {"p": "t", "b": "d", "m": "n"}
    untold = [replace(u, words=None, phones=made.true_phones(u, names)) for u in held_out(toy_corpus)]
    figures = evaluate(toy_model, corpus_of(tmp_path, untold))
    assert list(figures["conditions"]) == CONDITIONS
    for condition in figures["conditions"].values():
        assert condition["closures_p_b_m"]["intervals"] == 0
        assert condition["closures_p_b_m"]["recall"] is None
    json.dumps(figures, allow_nan=False)
    assert "recall – of 0" in format_figures(figures)


def test_closings_elsewhere_are_counted_per_minute_of_other_speech():
    """Twenty seconds of speech, half of them m; the lips close once outside of it, originally never."""
    time_s = np.arange(500) / 25
    original, generated = np.ones((500, 1)), np.ones((500, 1))
    generated[400:404] = 0
    spoken = ((0.0, 10.0, "m"), (10.0, 20.0, "aa"))
    clip = ComparedClip(original, generated, time_s, spoken)
    recordings = SimpleNamespace(channels=("opening",), closed_under=0.1, eigenlips_channels=())
    lips = measure_clips([clip], recordings, 0)["closures_p_b_m"]  # type: ignore[arg-type]
    assert (lips["false_per_minute"], lips["original_per_minute"]) == pytest.approx((6, 0))


SPEECH = motion()


def weights(*names: str, frames: int = 60, rate_hz: float = 60.0) -> Motion:
    time_s = np.arange(frames) / rate_hz
    values = np.stack([0.5 + 0.4 * np.sin((3 + i) * time_s) for i in range(len(names))], axis=1)
    return Motion(values, rate_hz, tuple(Channel(name, WEIGHT) for name in names))


def moved(changed: Motion, channel: str, values: np.ndarray) -> Motion:
    every = np.array(changed.values, float)
    every[:, changed.column(channel)] = values
    return replace(changed, values=every)


def test_figures_are_those_of_the_measures():
    late = replace(SPEECH, values=0.5 * np.roll(SPEECH.values, 3, axis=0))
    (pair,) = compare(SPEECH, late)["others"]
    columns = [SPEECH.column(name) for name in pair["channels"]]
    sides = ([late.values[:, columns]], [SPEECH.values[:, columns]])
    for name, of in (
        ("acc", curves.correlate_pooled),
        ("variance", curves.measure_variance_ratio),
        ("jerk", curves.measure_jerk_ratio),
        ("nrmse", curves.measure_nrmse),
    ):
        assert [row[name] for row in pair["channels"].values()] == pytest.approx(of(*sides)), name
    assert pair["channels"]["opening"]["lag_ms"] == pytest.approx(3000 / SPEECH.rate_hz, abs=10)
    assert pair["acc"] == pytest.approx(np.mean(curves.correlate_pooled(*sides)))


def test_points_are_compared_in_millimetres():
    shifted = moved(SPEECH, "x_13", SPEECH["x_13"] + 0.1)
    points = compare(SPEECH, shifted)["others"][0]["points"]
    assert points["lip_vertex_error_mm"] == pytest.approx(9)
    assert points["landmark_distance_mm"] == pytest.approx(9 / points["points"])
    assert points["upper_face_deviation_mm"] is None


def test_rates_and_lengths_are_brought_together_and_said():
    half = Motion(SPEECH.values[: len(SPEECH.values) // 2], SPEECH.rate_hz, SPEECH.channels).resampled(25.0)
    (pair,) = compare(SPEECH, half)["others"]
    assert pair["rate_hz"] == 25.0
    assert pair["frames"] == len(half.values)
    assert pair["channels"]["opening"]["acc"] == pytest.approx(1)
    assert f"the reference is resampled from {SPEECH.rate_hz:g} to 25 frames a second" in pair["notes"][0]
    assert pair["notes"][1].endswith("s are compared")


def test_frames_that_one_does_not_see_are_left_out():
    values = np.array(SPEECH.values)
    values[10:15] = 100
    seen = np.ones(len(values), bool)
    seen[10:15] = False
    (pair,) = compare(SPEECH, Track(replace(SPEECH, values=values), seen))["others"]
    assert pair["channels"]["opening"]["rmse"] == pytest.approx(0, abs=1e-12)
    assert pair["frames"] == len(values) - 5
    assert pair["notes"] == [f"5 of {len(values)} frames are left out: the face was not measured"]


def test_blendshapes_are_found_however_they_are_spelt():
    reference = weights("jawOpen", "browInnerUp", "mouthClose")
    other = weights("Face.JawOpen", "brow_inner_up")
    (pair,) = compare(reference, other)["others"]
    assert list(pair["channels"]) == ["jawOpen", "browInnerUp"]
    assert "mouthClose" in pair["notes"][0]
    still = moved(other, "brow_inner_up", np.full(60, 0.2))
    upper = compare(reference, still)["others"][0]["upper_face"]
    moving = np.array(reference.values[:, 1:2, None], float)
    wanted = curves.measure_upper_face([np.zeros((60, 1, 1))], [moving], np.zeros((1, 1)))
    assert upper == {"curves": 1, "deviation": pytest.approx(wanted)}
    assert wanted > 0.05


def test_what_does_not_move_is_named():
    flat = moved(weights("jawOpen", "mouthClose"), "mouthClose", np.zeros(60))
    (pair,) = compare(flat, flat)["others"]
    assert pair["notes"] == ["left out, for they do not move in the reference: mouthClose"]
    assert list(pair["channels"]) == ["jawOpen"]
    assert compare(*[moved(flat, "jawOpen", np.zeros(60))] * 2)["others"][0]["acc"] is None


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (Motion(np.zeros((60, 1)), 60.0, (Channel("jawOpen"),)), r"it has jawOpen \(eye_distance\), required one of"),
        (weights("jawOpen", frames=0), "motion 1: the motion has no frames"),
        (moved(weights("jawOpen"), "jawOpen", np.full(60, np.nan)), "values that are not finite"),
        ("a.bvh", "cannot read motion from '.bvh'; use one of .json"),
    ],
)
def test_what_cannot_be_compared(other, words):
    with pytest.raises(InputError, match=words):
        compare(weights("jawOpen"), other)
    with pytest.raises(InputError, match="give another motion file or video"):
        compare(SPEECH)
