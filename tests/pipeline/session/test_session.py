from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from threading import Barrier

import numpy as np
import pytest

from lipmotion import Delivery, Edits, Model, Session, animate, write
from lipmotion.articulation.curve_edits import GAIN_EDGE_S, LOCK_EDGE_S
from lipmotion.errors import InputError
from lipmotion.pipeline import session as session_module
from lipmotion.pipeline.edit_files import EditFile
from lipmotion.pipeline.generation import generate_motion
from lipmotion.pipeline.outputs.curve_sets import make_curves
from lipmotion.pipeline.outputs.deliver import deliver_to_face
from lipmotion.pipeline.outputs.output import OutputSettings, Performance, measure_prosody
from lipmotion.pipeline.request import Request
from lipmotion.types import Audio, Timeline, Unit
from lipmotion_faces.outputs.drawn_video import sound_track
from lipmotion_faces.outputs.session_pictures import SessionPictures
from lipmotion_faces.outputs.shown_faces import shown_face
from lipmotion_faces.registry import stage_face
from testing.toy import ToySentence


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
    for found in (session.generate(edits), animate(request_, model=toy_model, edits=edits)):
        assert found.units[place - 1].label.phone == "aa"
        assert np.array_equal(found.motion.values, session.generate(edits).motion.values)
        assert np.array_equal(found.variance, session.generate(edits).variance)
    given = replace(request_, transcript=None, units=session.units(edits))
    assert animate(given, model=toy_model, edits=edited("pin opening 0.05 at 1.0")).motion.values == pytest.approx(
        session.generate(edits).motion.values, abs=1e-6
    )
    assert np.array_equal(session.generate().motion.values, animate(request_, model=toy_model).motion.values)


def test_only_what_changed_is_computed_again(session, monkeypatch):
    calls: list[str] = []
    for name in ("analyse_speech", "generate_motion"):
        plain = getattr(session_module, name)

        def counted(*given: object, name: str = name, plain: object = plain, **more: object) -> object:
            calls.append(name)
            return plain(*given, **more)  # type: ignore[operator]

        monkeypatch.setattr(session_module, name, counted)
    first = session.generate()
    session.generate(edited("phone 3 is p"))
    session.generate(edited("phone 3 is p", "pin jawOpen 0.2 at 1.0"))  # a curve: no new motion
    session.deliver(edited("phone 3 is p", "set intensity 1.5"))
    assert session.generate() is first  # undone
    assert calls == ["analyse_speech", "generate_motion", "generate_motion"]


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
    with pytest.raises(InputError, match="required a time at least"):
        session.units(edited(f"split phone 3 at {third.start_s}"))
    word = next(span.label.word for span in plain if span.label.word)
    said = session.units(edited(f"word 1 is {word} said m aa m"))
    assert [span.label.phone for span in said if span.label.word == word][:3] == ["m", "aa", "m"]
    last_s = plain[-1].end_s
    other = session.units(edited(f"say mama mama from 0 to {last_s:.3f}"))
    assert {span.label.word for span in other} - {""} == {"mama"}
    assert other[0].start_s == 0
    assert other[-1].end_s == pytest.approx(last_s, abs=1e-3)


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


def test_a_thousand_edits_of_phones_are_no_deeper_than_one(session):
    edits = Edits().then(*(f"phone {2 + n % 3} is {'pbm'[n % 3]}" for n in range(1200)))
    assert phones(session.units(edits))[1:4] == ["p", "b", "m"]


def test_pins_hold_for_channels_and_curves(session, tmp_path):
    edits = edited(
        "pin opening 0.1 at 0.8", "pin jawOpen 0.7 at 1.2", "gain 1.5 from 0.5 to 1.0", "pin viseme_PP 0.4 at 1.5"
    )
    found = session.generate(edits)
    assert found.motion["opening"][80] == pytest.approx(0.1, abs=1e-9)
    arkit = make_curves(found.motion, found.units, "arkit", edits=found.curve_edits)
    plain = make_curves(found.motion, found.units, "arkit")
    assert arkit["jawOpen"][120] == pytest.approx(0.7)
    assert np.array_equal(arkit["jawOpen"][:100], plain["jawOpen"][:100])  # bent within a tenth of a second alone
    write(found, tmp_path / "a.csv", curves="visemes")
    rows = np.genfromtxt(tmp_path / "a.csv", delimiter=",", names=True)
    assert rows["viseme_PP"][150] == pytest.approx(0.4)
    later = session.deliver(edits.then("set offset_ms 500"))
    assert make_curves(later.motion, later.units, "arkit", edits=later.curve_edits)["jawOpen"][170] == pytest.approx(
        0.7
    )


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


@pytest.mark.parametrize("curve", ["opening", "tongue"])
def test_a_pin_has_a_slope_and_can_be_taken_out(session, curve):
    pinned = edited(f"pin {curve} 0.2 at 1.0 slope -1.5", f"pin {curve} 0.1 at 1.5")
    motion = session.generate(pinned).motion[curve]
    assert motion[[99, 100, 101, 150]] == pytest.approx([0.215, 0.2, 0.185, 0.1])
    left = session.generate(pinned.then(f"unpin {curve} at 1.0")).motion
    assert np.array_equal(left.values, session.generate(edited(f"pin {curve} 0.1 at 1.5")).motion.values)


def test_a_locked_span_keeps_channels_that_are_added_later(session):
    spoken = session.generate(edited("pin tongue 0.5 at 1.5"))
    locked = session.generate(edited("lock from 0.6 to 1.0", "pin tongue 0.5 at 1.5"))
    assert np.allclose(locked.motion["tongue"], spoken.motion["tongue"])
    assert locked.motion["tongue"][150] == pytest.approx(0.5)


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """One entry for every motion that a session makes from now on."""
    made: list[int] = []
    monkeypatch.setattr(session_module, "generate_motion", lambda *given: made.append(1) or generate_motion(*given))
    return made


def test_many_locks_take_the_motion_once_each(session, made):
    steps = [
        each for n in range(12) for each in (f"pin opening 0.1 at {n / 10}", f"lock from {n / 10} to {n / 10 + 0.02}")
    ]
    session.generate(edited(*steps))
    assert 12 <= len(made) <= 14  # of every pin once
    session.generate(edited(*steps, "gain 1.5 from 1.5 to 1.6"))
    assert len(made) <= 15


def test_of_long_motion_less_is_kept(session, made, monkeypatch):
    monkeypatch.setattr(session_module, "MAX_CACHED_FRAMES", len(session.generate().motion.values))
    found = [session.generate(edited(f"pin opening 0.1 at 0.{n}")) for n in (3, 5, 7)]
    assert session.generate(edited("pin opening 0.1 at 0.5")) is found[1]
    assert len(made) == 4
    again = session.generate(edited("pin opening 0.1 at 0.3"))
    assert (len(made), np.array_equal(again.motion.values, found[0].motion.values)) == (5, True)


def test_edits_of_another_recording_are_refused(session, toy_model, request_):
    file = EditFile(edited("phone 3 is p"), units=session.units())
    half = Audio(request_.recording.samples[:16_000], 16_000)  # type: ignore[union-attr]
    with pytest.raises(InputError, match=r"the recording lasts 1\.00 s, the edited one .* of another recording"):
        animate(Request(half), model=toy_model, edits=file)


@pytest.mark.parametrize(
    ("sentence", "message"),
    [
        ("phone 99 is p", "there is no phone 99, required 1 to"),
        ("phone 2 is xx", "unknown phone 'xx'"),
        ("phone 1 begins 0.1", "the first phone begins with the recording"),
        ("phone 2 ends 99", "required .* between the phones beside it"),
        ("insert p from 2 to 1", r"required at least 0\.01 s within"),
        ("pin jaw 0.1 at 0.5", "cannot pin 'jaw'"),
        ("pin jawOpen 0.1 at 99", "outside the recording"),
        ("pin jawOpen 5 at 1", "sets jawOpen to 5.0, required 0 to 1"),
        ("pin jawopen 0.1 at 1", r"'jawopen' \(is it jawOpen\?\)"),
        ("gain 2 from 0 to 99", "required times from 0 to"),
        ("unlock from 1.0 to 2.0", "locked is nothing"),
        ("unpin opening at 1.0", "pinned is nothing"),
        ("gain lips 2 from 0 to 1", "cannot change 'lips'"),
    ],
)
def test_edits_that_are_not_possible(session, sentence, message):
    with pytest.raises(InputError, match=message):
        session.generate(edited(sentence))


def test_single_pictures_are_those_of_the_video(session, request_):
    """Any frame, before and after an edit; what is not at that time is refused."""
    pictures = SessionPictures(session)
    for edits in (Edits(), edited("pin opening 0.2 at 1.0", "set size 64", "set background #40a0ff")):
        performance = Performance(
            session.generate(edits),
            OutputSettings(shown_face("portrait"), None, sounded=True, staging=edits.staging()),
            sound=request_.recording,  # type: ignore[arg-type]
        )
        seen, prosody = (
            deliver_to_face(performance.generation, Delivery(), 25.0),
            measure_prosody(sound_track(performance)),
        )
        frames = list(stage_face("portrait", edits.staging(), prosody).render(seen.motion, seen.units, fps=25.0))
        for number in (25, 3):
            assert np.array_equal(pictures.picture(number / 25, edits), frames[number])
    with pytest.raises(InputError, match="9 s lies outside the video"):
        pictures.picture(9)


def test_sessions_in_two_threads_do_not_disturb_each_other(toy_model, toy_sentence):
    """Each alone and both at once give the same bits; the matrix products of one do not change those of the other."""
    requests = [Request(toy_sentence.audio, " ".join(toy_sentence.words)), Request(toy_sentence.audio)]
    edits = [edited("phone 3 is p"), edited("pin opening 0.05 at 1.0")]
    alone = [
        Session(request, model=toy_model).generate(edit).motion.values
        for request, edit in zip(requests, edits, strict=True)
    ]
    both = Barrier(2)

    def work(number: int) -> list[np.ndarray]:
        both.wait(60)
        return [Session(requests[number], model=toy_model).generate(edits[number]).motion.values for _ in range(3)]

    with ThreadPoolExecutor(2) as pool:
        for number, found in enumerate(pool.map(work, range(2))):
            assert all(np.array_equal(values, alone[number]) for values in found)


@pytest.mark.long
def test_what_comes_next_is_prepared_while_processes_work(request_, toy_model, monkeypatch):
    prepared: list[object] = []
    monkeypatch.setattr(session_module, "prepare_search", prepared.append)
    session = Session(request_, model=toy_model, workers=2, background=lambda: prepared.append("face"))
    assert list(session._work(abs, [-1, -2, -3])) == [1, 2, 3]
    assert prepared == [session.request, "face"]
