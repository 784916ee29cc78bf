import json
from dataclasses import replace
from hashlib import sha256
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lipmotion import Delivery, Edits, Model, Request, Session, SessionPictures, Staging, animate, load_model, write
from lipmotion.articulation.curve_edits import GAIN_EDGE_S, LOCK_EDGE_S
from lipmotion.engines import Engine
from lipmotion.errors import InputError
from lipmotion.pipeline import session as session_module
from lipmotion.pipeline.edit_files import EditFile, create_edit_file, read_edits, write_edits
from lipmotion.pipeline.edits import STEPS, MoodStep, parse_step
from lipmotion.pipeline.generation import GRID_S, MARGIN_S
from lipmotion.pipeline.outputs.curve_sets import make_curves
from lipmotion.pipeline.outputs.output import measure_prosody
from lipmotion.types import Audio, Constraints, Generation, Outlook, Span, Speech, Timeline, Unit
from lipmotion.units import group_words
from lipmotion_faces.outputs.drawn_video import deliver_to_face, load_track
from lipmotion_faces.registry import stage_face
from pipeline.made import performed, write_sound
from testing.toy import ToySentence

SENTENCES = json.loads(Path(__file__).with_name("sentences.json").read_text(encoding="utf-8"))


@pytest.fixture
def request_(toy_sentence: ToySentence) -> Request:
    return Request(toy_sentence.audio, " ".join(toy_sentence.words))


@pytest.fixture
def session(request_: Request, toy_model: Model) -> Session:
    return Session(request_, model=toy_model)


def phones(units: Timeline[Unit]) -> list[str]:
    return [span.label.phone for span in units]


def edited(*sentences: str) -> Edits:
    return Edits().then(*sentences)


def test_a_session_gives_what_one_pass_gives(session, request_, toy_model):
    """Whatever was asked for before; with phones edited in a session, or given."""
    place = phones(session.units()).index("iy") + 1
    edits = edited(f"phone {place} is aa", "pin opening 0.05 at 1.0")
    session.generate(edited("remove phone 3"))
    first, second = session.generate(edits), animate(request_, model=toy_model, edits=edits)
    assert first.units[place - 1].label.phone == second.units[place - 1].label.phone == "aa"
    assert np.array_equal(first.motion.values, second.motion.values)
    assert np.array_equal(first.variance, second.variance)
    known = replace(request_, transcript=None, units=session.units(edits))
    again = animate(known, model=toy_model, edits=edited("pin opening 0.05 at 1.0"))
    assert again.motion.values == pytest.approx(first.motion.values, abs=1e-6)
    assert np.array_equal(session.generate().motion.values, animate(request_, model=toy_model).motion.values)


class Counting:
    """An engine that notes the seconds of each motion that it makes."""

    def __init__(self, engine: Engine) -> None:
        self.engine, self.made_s = engine, list[float]()

    def __getattr__(self, name: str) -> Any:
        return getattr(self.engine, name)

    def generate(self, model: Any, speech: Speech, constraints: Constraints | None = None) -> Generation:
        if {span.label.phone for span in speech.units} - {"sil"}:  # else it is asked for the mouth at rest
            self.made_s.append(speech.features.duration_s)
        return self.engine.generate(model, speech, constraints)


@pytest.fixture
def counting(toy_model: Model) -> Model:
    return replace(toy_model, engine=Counting(toy_model.engine))


@pytest.fixture
def counted(request_: Request, counting: Model) -> Session:
    return Session(request_, model=counting)


def test_only_what_changed_is_computed_again(counted, counting):
    first, made_s = counted.generate(), counting.engine.made_s
    assert len(made_s) == 1
    units = counted.units()
    counted.generate(edited("phone 3 is p"))
    counted.generate(edited("phone 3 is p", "pin jawOpen 0.2 at 1.0"))  # a curve: no new motion
    counted.deliver(edited("phone 3 is p", "set intensity 1.5"))
    assert counted.generate() is first  # undone
    assert counted.units() is units
    assert len(made_s) == 2


def test_edits_of_phones(session):
    plain = session.units()
    third = plain[2]
    moved = session.units(edited(f"phone 3 ends {third.end_s - 0.02:.3f}"))
    assert moved[2].end_s == moved[3].start_s == pytest.approx(third.end_s - 0.02)
    assert phones(moved) == phones(plain)
    assert moved[2].label.confidence is None
    gone = session.units(edited("remove phone 3"))
    assert phones(gone) == [*phones(plain)[:2], *phones(plain)[3:]]
    assert gone[1].end_s == third.end_s
    middle_s = (third.start_s + third.end_s) / 2
    more = session.units(edited(f"insert m from {third.start_s:.3f} to {middle_s:.3f}"))
    assert phones(more) == [*phones(plain)[:2], "m", *phones(plain)[2:]]
    numbered = session.units(edited("remove phone 3", "phone 3 is b"))  # numbers are those after the edits before
    assert numbered[2].label.phone == "b"
    assert all(a.end_s == pytest.approx(b.start_s) for a, b in zip(more.spans, more.spans[1:], strict=False))
    many = edited(*(f"phone {2 + n % 3} is {'pbm'[n % 3]}" for n in range(1200)))  # no deeper than one
    assert phones(session.units(many))[1:4] == ["p", "b", "m"]


def test_another_word_is_aligned_where_it_was(session):
    word = next(span.label.word for span in session.units() if span.label.word)
    plain = [span for span in session.units() if span.label.word == word]
    found = [span for span in session.units(edited("word 1 is mama")) if span.label.word == "mama"]
    assert phones(Timeline(tuple(found)))[0] == "m"
    spans = session.units(edited("word 1 is mama"))
    before = [span for span in session.units() if span.end_s <= plain[0].start_s + 1e-9]
    assert list(spans)[: len(before)] == before
    assert spans[len(before)].start_s == plain[0].start_s
    with pytest.raises(InputError, match="there is no word 99, required 1 to"):
        session.units(edited("word 99 is mama"))


def test_a_phone_is_split_and_words_are_said_otherwise(session):
    plain = session.units()
    third = plain[2]
    middle_s = round((third.start_s + third.end_s) / 2, 3)
    split = session.units(edited(f"split phone 3 at {middle_s}", "phone 4 is m"))
    assert phones(split) == [*phones(plain)[:3], "m", *phones(plain)[3:]]
    assert split[2].end_s == split[3].start_s == middle_s
    with pytest.raises(InputError, match=r"required .* between the phones beside it"):
        session.units(edited(f"split phone 3 at {third.start_s}"))
    word = next(span.label.word for span in plain if span.label.word)
    said = session.units(edited(f"word 1 is {word} said m aa m"))
    assert [span.label.phone for span in said if span.label.word == word][:3] == ["m", "aa", "m"]
    last_s = plain[-1].end_s
    other = session.units(edited(f"say mama mama from 0 to {last_s:.3f}"))
    assert {span.label.word for span in other} - {""} == {"mama"}
    assert other[0].start_s == 0
    assert other[-1].end_s == pytest.approx(last_s, abs=1e-3)
    spelt = session.units(edited(f"say mama from 0 to {last_s:.3f} with mama b ow b"))
    assert [span.label.phone for span in spelt if span.label.word] == ["b", "ow", "b"]


def test_what_is_drawn_and_held_is_so_and_the_rest_joins_smoothly(session):
    plain = session.generate()
    found = session.generate(edited("draw opening 0.1 0.2 0.1 from 0.8 to 1.0", "draw jawOpen 0 1 from 1.5 to 1.6"))
    assert found.motion["opening"][[80, 90, 100]] == pytest.approx([0.1, 0.2, 0.1])
    change = found.motion["opening"] - plain.motion["opening"]
    assert np.abs(np.diff(change[60:81])).max() < 0.5 * np.abs(change[80]) + 0.01  # no jump
    assert not change[:69].any()
    arkit = make_curves(found.motion, found.units, "arkit", edits=found.curve_edits)["jawOpen"]
    assert arkit[[150, 160]] == pytest.approx([0, 1])
    held = session.generate(edited("hold from 0.8 to 1.0")).motion.selected(plain.motion.names).values
    assert np.allclose(held[80:101], np.broadcast_to(plain.motion.values[80], held[80:101].shape), atol=1e-6)
    assert np.array_equal(held[:75], plain.motion.values[:75])
    with pytest.raises(InputError, match="required 0 to 1"):
        session.generate(edited("draw jawOpen 0 1.2 from 1.5 to 1.6"))
    with pytest.raises(InputError, match="cannot draw 'jaw'"):
        session.generate(edited("draw jaw 0 1 from 1.5 to 1.6"))


@pytest.mark.long
def test_pins_hold_for_channels_and_curves(session, tmp_path):
    pins = ("pin opening 0.1 at 0.8", "pin jawOpen 0.7 at 1.2", "pin viseme_PP 0.4 at 1.5")
    edits = edited(*pins, "gain 1.5 from 0.5 to 1.0")
    found = session.generate(edits)
    assert found.motion["opening"][80] == pytest.approx(0.1, abs=1e-9)
    arkit = make_curves(found.motion, found.units, "arkit", edits=found.curve_edits)
    plain = make_curves(found.motion, found.units, "arkit")
    assert arkit["jawOpen"][120] == pytest.approx(0.7)
    assert np.array_equal(arkit["jawOpen"][:100], plain["jawOpen"][:100])  # bent within a tenth of a second alone
    write(found, tmp_path / "a.csv", curves="visemes")
    rows = np.genfromtxt(tmp_path / "a.csv", delimiter=",", names=True)
    assert rows["viseme_PP"][150] == pytest.approx(0.4)
    late = session.deliver(edits.then("set offset_ms 500"))
    arkit = make_curves(late.motion, late.units, "arkit", edits=late.curve_edits)
    assert arkit["jawOpen"][170] == pytest.approx(0.7)


def test_pins_that_are_close_together_all_hold(session):
    found = session.generate(edited("pin jawOpen 0.7 at 1.2", "pin jawOpen 0.2 at 1.25", "pin jawOpen 0.3 at 1.25"))
    curve = make_curves(found.motion, found.units, "arkit", edits=found.curve_edits)["jawOpen"]
    assert curve[[120, 125]] == pytest.approx([0.7, 0.3])  # of two at one time the last


def test_gains_make_movements_larger_for_a_time(session):
    plain, larger = session.generate(), session.generate(edited("gain 2 from 0.6 to 1.4"))
    span = slice(60, 141)
    assert np.ptp(larger.motion["opening"][span]) > 1.3 * np.ptp(plain.motion["opening"][span])
    edge = round(GAIN_EDGE_S * 100)
    assert np.array_equal(larger.motion.values[: 60 - edge], plain.motion.values[: 60 - edge])
    assert np.array_equal(larger.motion.values[141 + edge :], plain.motion.values[141 + edge :])
    wider = session.generate(edited("gain opening 3 from 0.6 to 1.4")).motion["opening"]
    assert wider.min() >= 0
    assert wider[span].max() > 2 * plain.motion["opening"][span].max()
    still = session.generate(edited("gain width 0 from 0.6 to 1.4"))
    assert np.ptp(still.motion["width"][span]) < 1e-9
    assert np.array_equal(still.motion["opening"], plain.motion["opening"])


def test_a_locked_span_stays_as_it_was(session):
    first = edited("pin opening 0.1 at 0.8", "lock from 0.6 to 1.0")
    later = first.then("gain 2 from 0.2 to 2.0", f"phone {len(session.units()) - 2} is aa")
    before, after = session.generate(edited("pin opening 0.1 at 0.8")), session.generate(later)
    was, now = (each.motion.selected(session.generate().motion.names).values for each in (before, after))
    assert np.array_equal(now[60:101], was[60:101])
    assert not np.allclose(now[120:160], was[120:160])
    jump = np.abs(np.diff(after.motion["opening"])).max()
    assert jump < 2 * np.abs(np.diff(session.generate(edited("gain 2 from 0.2 to 2.0")).motion["opening"])).max()
    assert LOCK_EDGE_S > 0
    number = next(n for n, span in enumerate(session.units(), 1) if span.start_s > 0.6)
    for refused in (f"phone {number} is p", "pin opening 0.2 at 0.7", "gain 2 from 0.7 to 0.8", "unpin opening at 0.8"):
        with pytest.raises(InputError, match=r"locked \('lock from 0.6 to 1.0'\); take the lock out first"):
            session.generate(first.then(refused))
    freed = session.generate(later.then("unlock from 0.6 to 1.0", "pin opening 0.2 at 0.7"))
    assert freed.motion["opening"][70] == pytest.approx(0.2)
    spoken = session.generate(edited("pin tongue 0.5 at 1.5")).motion["tongue"]  # a channel that is added later
    locked = session.generate(edited("lock from 0.6 to 1.0", "pin tongue 0.5 at 1.5")).motion["tongue"]
    assert np.allclose(locked, spoken)
    assert locked[150] == pytest.approx(0.5)


@pytest.mark.parametrize("curve", ["opening", "tongue"])
def test_a_pin_has_a_slope_and_can_be_taken_out(session, curve):
    pinned = edited(f"pin {curve} 0.2 at 1.0 slope -1.5", f"pin {curve} 0.1 at 1.5")
    motion = session.generate(pinned).motion[curve]
    assert motion[[99, 100, 101, 150]] == pytest.approx([0.215, 0.2, 0.185, 0.1])
    left = session.generate(pinned.then(f"unpin {curve} at 1.0")).motion
    assert np.array_equal(left.values, session.generate(edited(f"pin {curve} 0.1 at 1.5")).motion.values)


def test_a_lock_stays_where_a_pin_before_it_is_taken_out(session):
    """The pin brought a channel with it, which says where it decided."""
    first = ("pin width 0.08 at 0.8", "lock from 1.2 to 1.4")
    locked, freed = (session.generate(edited(*first, *later)).motion for later in ((), ("unpin width at 0.8",)))
    assert freed["width"][120:140] == pytest.approx(locked["width"][120:140], abs=1e-6)


def test_many_locks_take_the_motion_once_each(counted, counting):
    times = [(n / 10, n / 10 + 0.02) for n in range(12)]
    steps = [step for a, b in times for step in (f"pin opening 0.1 at {a}", f"lock from {a} to {b}")]
    counted.generate(edited(*steps))
    assert 12 <= len(counting.engine.made_s) <= 14  # of every pin once
    counted.generate(edited(*steps, "gain 1.5 from 1.5 to 1.6"))
    assert len(counting.engine.made_s) <= 15


def test_of_long_motion_less_is_kept(counted, counting, monkeypatch):
    monkeypatch.setattr(session_module, "MAX_CACHED_FRAMES", len(counted.generate().motion.values))
    counting.engine.made_s.clear()
    found = [counted.generate(edited(f"pin opening 0.1 at 0.{n}")) for n in (3, 5, 7)]
    assert counted.generate(edited("pin opening 0.1 at 0.5")) is found[1]
    assert len(counting.engine.made_s) == 3
    again = counted.generate(edited("pin opening 0.1 at 0.3"))
    assert (len(counting.engine.made_s), np.array_equal(again.motion.values, found[0].motion.values)) == (4, True)


def test_edits_of_another_recording_are_refused(session, toy_model, request_):
    file = EditFile(edited("phone 3 is p"), units=session.units())
    half = Audio(request_.recording.samples[:16_000], 16_000)  # type: ignore[union-attr]
    with pytest.raises(InputError, match=r"the recording lasts 1\.00 s, the edited one .* of another recording"):
        animate(Request(half), model=toy_model, edits=file)


@pytest.mark.parametrize(("sentence", "message"), SENTENCES["impossible"])
def test_edits_that_are_not_possible(session, sentence, message):
    with pytest.raises(InputError, match=message):
        session.generate(edited(sentence))


@pytest.mark.long
def test_single_pictures_are_those_of_the_video(session, request_):
    """Any frame, before and after an edit; what is not at that time is refused."""
    pictures = SessionPictures(session)
    for edits in (Edits(), edited("pin opening 0.2 at 1.0", "set size 64", "set background #40a0ff")):
        shown = performed(session.generate(edits), "portrait", sounded=True, staging=edits.staging())
        performance = replace(shown, sound=request_.recording)
        seen = deliver_to_face(performance.generation, Delivery(), 25.0)
        stage = stage_face("portrait", edits.staging(), measure_prosody(load_track(performance)))
        frames = dict(enumerate(islice(stage.render(seen.motion, seen.units, fps=25.0), 26)))
        for number in (25, 3):
            assert np.array_equal(pictures.draw(number / 25, edits), frames[number])
    with pytest.raises(InputError, match="9 s lies outside the video"):
        pictures.draw(9)


TIMES = 12  # how often the sentence is said in the long recording
UNSEEN = 0.01  # most by which the opening may be off until the whole is made, in eye distances: 0.6 mm


@pytest.fixture(scope="module")
def long_request(toy_sentence: ToySentence, toy_model: Model) -> Request:
    units = Session(Request(toy_sentence.audio, " ".join(toy_sentence.words)), model=toy_model).units()
    each_s = toy_sentence.audio.duration_s
    spans = [span for n in range(TIMES) for span in units.shifted(n * each_s)]
    sound = Audio(np.tile(toy_sentence.audio.samples, TIMES), toy_sentence.audio.rate_hz)
    spans[-1] = replace(spans[-1], end_s=sound.duration_s)
    return Request(sound, units=Timeline(tuple(spans)))


def parse_number(units: Timeline[Unit], phone: str, after_s: float) -> int:
    return next(n for n, span in enumerate(units, 1) if span.label.phone == phone and span.start_s > after_s)


@pytest.mark.long
def test_around_an_edit_the_motion_is_that_of_the_whole(long_request, toy_model, counting):
    """At the first phone, in the middle, at the last one, of a pause, with pins; one edit after another."""
    session, other = Session(long_request, model=counting), Session(long_request, model=toy_model)
    units, lasts_s = session.units(), long_request.recording.duration_s  # type: ignore[union-attr]
    before = session.generate().motion
    middle, edits = parse_number(units, "iy", lasts_s / 2), Edits()
    silent = parse_number(units, "sil", lasts_s / 4)
    for sentence in (
        f"phone {middle} is p",
        f"phone {middle} ends {units[middle - 1].end_s + 0.02:.3f}",
        "phone 2 is aa",
        f"phone {len(units) - 1} is m",
        f"remove phone {silent}",
        f"pin opening 0.31 at {lasts_s / 3:.2f}",
        f"pin jawOpen 0.6 at {lasts_s / 5:.2f}",
    ):
        edits = edits.then(sentence)
        counting.engine.made_s.clear()
        with session.sketching():
            sketch = session.generate(edits)
        assert sum(counting.engine.made_s) <= 2 * (2 * MARGIN_S + 2 * GRID_S + 5) < lasts_s, sentence
        whole = other.generate(edits)
        assert [span.label.phone for span in sketch.units] == [span.label.phone for span in whole.units]
        assert np.abs(sketch.motion["opening"] - whole.motion["opening"]).max() < UNSEEN, sentence
        assert sketch.motion["opening"].min() >= 0
    after = session.generate(edits)  # without sketching: the same as if nothing had been there before
    assert after.motion.values == pytest.approx(whole.motion.values, abs=1e-6)
    assert np.abs(after.motion["opening"] - before["opening"]).max() > 0.1
    with session.sketching(), pytest.raises(InputError, match="9999"):
        session.generate(edits.then("pin opening 0.1 at 9999"))


def test_every_kind_of_edit_is_a_sentence():
    steps = [parse_step(sentence) for sentence in SENTENCES["sentences"]]
    assert {step.form for step in steps} == set(STEPS)
    assert [*map(str, steps)] == SENTENCES["sentences"]
    assert [parse_step(str(step)[:1].upper() + str(step)[1:]) for step in steps] == steps


@pytest.mark.parametrize(("sentence", "message"), SENTENCES["no edit"])
def test_sentences_that_state_no_edit(sentence, message):
    with pytest.raises(InputError, match=message):
        parse_step(sentence)


def test_delivery_and_staging_are_set_where_nothing_else_is_asked_for():
    edits = Edits().then("set intensity 1.2", "set stepped true", "set size 360", "set intensity 1.3")
    assert edits.delivery() == Delivery(intensity=1.3, stepped=True)
    assert edits.delivery(Delivery(intensity=2.0)).intensity == 2.0
    assert edits.staging() == Staging(size=360)
    edits = Edits().then("mood sad at 2.0", "mood happy:0.7 at 1.0", "mood angry at 2.0")
    assert edits.delivery().mood == "happy:0.7 at 1, angry at 2"
    assert edits.delivery(Delivery(mood="tired")).mood == "tired at 0, happy:0.7 at 1, angry at 2"
    assert Edits().then("set mood tense:0.5").delivery().mood == "tense:0.5"


def test_what_is_written_is_read_again(tmp_path):
    path = tmp_path / "a.edits.json"
    spans = (Span(0.0, 0.3, Unit("sil")), Span(0.3, 1 / 3 + 0.1, Unit("p", "sil-p+l", 'pl"ease', confidence=0.25)))
    outlook = Outlook("words", 0.5, None, 30.5, ("a \\ transcript",))
    named = Request(tmp_path / "in" / "a b.wav", pauses="natural")
    file = EditFile(Edits().then(*SENTENCES["sentences"]), named, Timeline(spans), outlook, sha256="ab")
    write_edits(file, path)
    found = read_edits(path)
    assert (found.edits, found.units, found.outlook) == (file.edits, file.units, file.outlook)
    assert (found.named, found.sha256) == (file.named, "ab")


@pytest.mark.parametrize(("text", "message"), SENTENCES["refused_files"])
def test_files_that_are_refused(tmp_path, text, message):
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_edits(path)


def test_a_file_holds_the_moods_of_tags(toy_sentence, toy_model_file, tmp_path):
    words, recording = toy_sentence.words, tmp_path / "a.wav"
    write_sound(recording, toy_sentence.audio)
    tagged = f"[happy:0.5] {words[0]} [angry] {' '.join(words[1:])}"
    file = create_edit_file(Request(recording, tagged, model=toy_model_file))[0]
    first, second = (step for step in file.edits.steps if isinstance(step, MoodStep))
    assert (str(first), second.mood) == ("mood happy:0.5 at 0.0", "angry")
    spoken = [span for span in group_words(file.units or Timeline(())) if span.label]
    assert second.time_s == pytest.approx(spoken[1].start_s)


def test_a_file_replays_what_was_recognised(toy_speech, toy_model_file, tmp_path):
    """The phones in the file are the base: the motion is that of the session in which they were edited."""
    asked = Request(toy_speech, recogniser="own", model=toy_model_file)
    path, edits = tmp_path / "a.json", Edits().then("phone 3 is p", "pin jawOpen 0.2 at 1.0")
    write_edits(replace(create_edit_file(asked)[0], edits=edits), path)
    read = read_edits(path)
    plain = animate(Request(toy_speech, recogniser="own"), model=load_model(toy_model_file), edits=edits)
    replayed = read.session().generate(read.edits)
    assert np.array_equal(replayed.motion.values, plain.motion.values)
    assert (replayed.units, replayed.outlook, replayed.curve_edits) == (plain.units, plain.outlook, plain.curve_edits)


def test_edits_of_another_sound_are_refused(toy_speech, toy_model_file, tmp_path):
    """Of the same length, and wherever it lies; without a digest, as in earlier files, they are taken."""
    sound, path = tmp_path / "a.wav", tmp_path / "a.edits.json"
    sound.write_bytes(toy_speech.read_bytes())
    file = create_edit_file(Request(sound, recogniser="own", model=toy_model_file))[0]
    write_edits(file, path)
    assert read_edits(path).sha256 == sha256(toy_speech.read_bytes()).hexdigest()
    other = tmp_path / "other.wav"
    other.write_bytes(sound.read_bytes()[:-2] + b"\0\1")
    model = load_model(toy_model_file)
    phones = [span.label.phone for span in file.units or ()]
    assert [span.label.phone for span in animate(toy_speech, model=model, edits=path).units] == phones
    with pytest.raises(InputError, match="another recording"):
        animate(other, model=model, edits=path)
    other.replace(sound)
    with pytest.raises(InputError, match="another recording"):
        read_edits(path).session()
    unknown = replace(file, sha256="")
    assert [span.label.phone for span in animate(sound, model=model, edits=unknown).units] == phones
