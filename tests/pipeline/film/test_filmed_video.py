from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import av
import numpy as np
import pytest

from lipmotion import FilmedFace, Outputs, Request, animate, write
from lipmotion.errors import ExportError, InputError, ModelFormatError
from lipmotion.pipeline.outputs.output import OutputSettings
from lipmotion.types import Audio, Channel, Motion, Span, Timeline, Track, Unit
from lipmotion_faces.film import background
from lipmotion_faces.film.filmed_video import find_other_person, is_person_of, make_film, predict_codes, write_film
from lipmotion_faces.filmed.renderer import AS_PRINTED, Background, Stitcher
from lipmotion_faces.outputs.shown_faces import shown_face
from lipmotion_faces.tracking.frames import WHOLE
from lipmotion_faces.tracking.track import Footage
from lipmotion_faces.video.synthetic_mark import SOURCE_TYPE
from pipeline.film.toy_footage import ToyVideo, footage_of, install, write_video
from speech.sounds import tone, write_sound
from testing.toy import ToySentence, toy_motion, toy_sentences
from testing.toy_face import FRAME_HEIGHT, FRAME_WIDTH, SCALE, toy_chin_px, toy_places

MIDDLE = (slice(150, 230), slice(70, 154))  # rows and columns of the background in which the mouth is


@pytest.fixture(scope="module")
def motion(toy_sentence: ToySentence) -> Motion:
    return toy_motion(toy_sentence.units, 100.0)


@pytest.fixture(scope="module")
def brief(motion: Motion) -> Motion:
    """The beginning of the sentence: 0.8 s, in which the mouth opens."""
    return Motion(motion.values[40:120], 100.0, motion.channels)


def dark(frames: list[np.ndarray]) -> np.ndarray:
    """Return how many pixels of the mouth are dark: how far it is open [shape=(T,)]."""
    return np.array([(frame[MIDDLE] < 90).all(axis=2).sum() for frame in frames])


def pictures(path: Path) -> tuple[list[np.ndarray], Any, dict[str, str]]:
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
        return frames, stream.average_rate, dict(container.metadata)


@pytest.mark.long
def test_any_rate(filmed_face, motion):
    for fps in (None, 12.5, 30.0):
        film = make_film(filmed_face, motion, fps=fps)
        frames = list(film.frames)
        assert film.rate_hz == pytest.approx(fps or 25.0)
        assert len(frames) == int((len(motion.values) - 1) / 100 * film.rate_hz + 1e-9) + 1
        assert {(frame.shape, str(frame.dtype)) for frame in frames} == {((FRAME_HEIGHT, FRAME_WIDTH, 3), "uint8")}
        opening = motion.at(np.arange(len(frames)) / film.rate_hz)[:, 0]
        assert np.corrcoef(dark(frames), opening)[0, 1] > 0.85
    for fps in (0.0, -25.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match=r"the frame rate is .*, required more than 0"):
            make_film(filmed_face, motion, fps=fps)


def test_the_jaw_follows_what_it_is_told(filmed_face, brief, toy_sentence):
    closed = Motion(np.tile([[0.0, 0.55, 0.22]], (len(brief.values), 1)), 100.0, brief.channels)
    sound = Audio(toy_sentence.audio.samples[16_000 * 4 // 10 :], 16_000)
    films = {
        jaw: np.stack(list(make_film(filmed_face, closed, sound=sound, options=Outputs(jaw=jaw)).frames)).astype("i2")
        for jaw in ("motion", "energy", "none")
    }
    below = (slice(None), slice(212, 240), slice(90, 134))  # the chin
    assert np.abs(films["motion"][below] - films["energy"][below]).mean() > 0.3
    assert np.abs(films["motion"][below] - films["none"][below]).mean() > 0.3
    shown = np.stack([each.copy() for each in filmed_face.background.video.decode(range(20))])
    assert np.array_equal(films["none"][:20][:, 225:], shown[:, 225:])  # the background's own jaw
    with pytest.raises(InputError, match="a jaw that follows the energy needs the sound; give the recording"):
        make_film(filmed_face, brief, options=Outputs(jaw="energy"))


def test_lips_close_in_p_b_and_m(filmed_face):
    """Also where the motion leaves them apart."""
    parted = toy_motion(Timeline((Span(0.0, 0.8, Unit("ax")),)), 100.0)
    said = Timeline((Span(0.0, 0.3, Unit("ax")), Span(0.3, 0.42, Unit("b")), Span(0.42, 0.8, Unit("ax"))))
    closed, apart = (dark(list(make_film(filmed_face, parted, units=units).frames)) for units in (said, None))
    assert closed[8:10].min() == 0
    assert min(apart[8:10].min(), closed[4]) > 20


def test_the_refinement_as_printed(filmed_face, brief):
    """Eqs. 14-16 of Xie & Liu 2007, colour by colour, of the mean of three pictures."""
    codes = predict_codes(filmed_face, brief, Timeline(()), 5, 25.0)
    options = replace(AS_PRINTED, noise=False)
    made = np.stack(list(Stitcher(filmed_face.appearance, options).draw_mouths(codes))).astype(float)
    space, mouths = filmed_face.appearance.mouth, filmed_face.appearance.mouths
    wanted = np.stack([codes.mouth[max(n - 1, 0) : n + 2].mean(axis=0) for n in (1, 2, 3)])
    known, kept = space.project(mouths), mouths - space.expand(space.project(mouths))
    for row, values in enumerate(wanted):
        for colour, (own, candidates) in enumerate(zip(np.split(values, 3), np.split(known, 3, axis=1), strict=True)):
            nearest = np.linalg.norm(candidates - own, axis=1).argmin()
            detailed = space.expand(values[None])[0, ..., colour] + kept[nearest, ..., colour]
            assert np.abs(made[row + 1, ..., colour] - np.clip(detailed, 0, 255)).max() < 2


@pytest.mark.long
def test_the_mark(filmed_face, brief, tmp_path):
    path, sound = tmp_path / "a.mp4", Audio(np.zeros(16_000 * 8 // 10, np.float32), 16_000)
    plain = np.stack(list(make_film(filmed_face, brief).frames))[::10].astype("i4")
    for mark in ("metadata", "visible", "none"):
        options: dict[str, Any] = {} if mark == "metadata" else {"mark": mark}  # it is the default
        write_film(path, make_film(filmed_face, brief), sound, **options)
        frames, _, tags = pictures(path)
        assert tags.get("comment", "").startswith("synthetic:") == (mark != "none")
        assert (SOURCE_TYPE.encode() in path.read_bytes()) == (mark != "none")
        corners = np.abs(np.stack(frames)[::10].astype(int) - plain)[:, -40:]
        assert (corners.max() > 60) == (mark == "visible")


def test_motion_that_the_face_cannot_show(filmed_face, motion):
    blendshapes = Motion(motion.values, 100.0, tuple(Channel(name, "weight") for name in ("jawOpen", "a", "b")))
    with pytest.raises(InputError, match=r"no channel 'opening' \(3 of the 3 that this face needs are missing\)"):
        make_film(filmed_face, blendshapes)
    broken = motion.values.copy()
    broken[48:53, 1] = np.nan
    with pytest.raises(InputError, match="not finite"):
        make_film(filmed_face, Motion(broken, 100.0, motion.channels))


def test_options_of_filmed_faces_alone(tmp_path, toy_speech):
    drawn = shown_face("portrait")
    video = tmp_path / "a.mp4"
    video.touch()
    for options, words in (
        (Outputs(background=video), "a background"),
        (Outputs(overlay="inset"), "an overlay"),
        (Outputs(jaw="energy"), "another jaw"),
        (Outputs(refinement="paper"), "another refinement"),
        (Outputs(mark="visible"), "a visible mark"),
    ):
        with pytest.raises(InputError, match=rf"{words} is for filmed faces; give one: --face FILE\.face"):
            drawn.check(OutputSettings(drawn, toy_speech, outputs=options))
    for unmarked in ("metadata", "none"):
        drawn.check(OutputSettings(drawn, toy_speech, outputs=Outputs(mark=unmarked)))  # a drawn face needs no mark


def test_an_inset_on_the_video_of_the_speech(filmed_face, motion, tmp_path):
    """The video is shorter than the speech: as many frames as there are of both."""
    video = write_sound(tmp_path / "a.mkv", tone(16_000, 2.0), 16_000, "flac", video=True)
    film = make_film(filmed_face, motion, speech=video, options=Outputs(overlay="inset"))
    frames = np.stack(list(film.frames))
    assert frames.shape == (25, 48, 64, 3)
    assert film.rate_hz == pytest.approx(25.0)
    left, top, right, bottom = film.covered
    assert 0 < left < right <= 64  # the inset
    assert 0 < top < bottom <= 48
    assert np.ptp(frames[:, :20, :30]) == 0  # the video itself, flat and grey
    assert np.ptp(frames[0, -19:, -24:]) > 60


@pytest.mark.long
def test_eigenlips_become_the_person(filmed_face, pictured_model, toy_sentence, tmp_path):
    """A model of mouth pictures drives the mouth by its pictures, and the jaw by points where it has them."""
    request = Request(toy_sentence.audio, units=toy_sentence.units)
    result = animate(request, model=pictured_model)
    eigenlips = pictured_model.eigenlips
    names = {channel.name for channel in eigenlips.channels}
    assert names < set(result.motion.names)
    frames = list(make_film(filmed_face, result.motion, model=pictured_model).frames)
    opening = toy_motion(toy_sentence.units, 25.0)["opening"][: len(frames)]
    assert np.corrcoef(dark(frames)[: len(opening)], opening)[0, 1] > 0.7
    only = [n for n, name in enumerate(result.motion.names) if name in names]
    alone = Motion(result.motion.values[:, only], 100.0, tuple(result.motion.channels[n] for n in only))
    again = list(make_film(filmed_face, alone, model=pictured_model).frames)
    assert np.corrcoef(dark(again), dark(frames))[0, 1] > 0.9
    with pytest.raises(InputError, match="no channel 'opening'"):
        make_film(filmed_face, alone)
    write(result, tmp_path / "a.mp4", speech=toy_sentence.audio, model=pictured_model, face=filmed_face)
    assert len(pictures(tmp_path / "a.mp4")[0]) == len(frames)


@pytest.mark.long
def test_another_persons_motion_is_mapped_onto_the_face(toy_model, filmed_face, toy_sentence):
    """The person of the face opens the mouth half as far, and says the same."""
    halved = [replace(take.motion, values=take.motion.values * [0.5, 1, 0.5]) for take in filmed_face.takes]
    takes = tuple(replace(take, motion=motion) for take, motion in zip(filmed_face.takes, halved, strict=True))
    other = replace(filmed_face, about=filmed_face.about | {"corpus": ["someone/else"]}, takes=takes)
    requests = [Request(toy_sentence.audio, units=toy_sentence.units, onto=onto) for onto in (None, other)]
    own, mapped = (animate(each, model=toy_model).motion for each in requests)
    ratio = np.percentile(mapped["opening"], 95) / np.percentile(own["opening"], 95)
    assert 0.35 < ratio < 0.75
    assert np.corrcoef(own["opening"], mapped["opening"])[0, 1] > 0.95
    mute = replace(other, takes=())
    with pytest.raises(InputError, match=r"the face: 0\.00 s of speech with a measured face, required 0\.5 s or more"):
        animate(Request(toy_sentence.audio, onto=mute), model=toy_model)


def test_writing_is_whole_or_not_at_all(filmed_face, motion, toy_sentence, tmp_path):
    (tmp_path / "a.mp4").write_text("older")
    with pytest.raises(ExportError):
        write_film(tmp_path / "a.mp4", make_film(filmed_face, motion), Audio(np.zeros(0, np.float32), 16_000))
    damaged = replace(filmed_face.background.video, data=_spoiled(filmed_face.background.video.data))
    face = replace(filmed_face, background=replace(filmed_face.background, video=damaged))
    with pytest.raises(ModelFormatError):
        write_film(tmp_path / "a.mp4", make_film(face, motion), toy_sentence.audio)
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("a.mp4", "older")]


def _spoiled(data: np.ndarray) -> np.ndarray:
    """Return a stream whose frames begin as they should, and hold zeros from the middle on."""
    changed = data.copy()
    starts = np.flatnonzero((data[:-3] == 0) & (data[1:-2] == 0) & (data[2:-1] == 1))
    keep = np.zeros(len(data), bool)
    for start in starts:
        keep[max(0, start - 1) : start + 6] = True
    changed[~keep & (np.arange(len(data)) > len(data) // 2)] = 77
    return changed


@pytest.mark.long
def test_a_mouth_over_the_speakers_own_is_larger_and_has_no_jaw(filmed_face, brief, video, monkeypatch):
    install(monkeypatch, {video.path: video}, {})
    film = make_film(filmed_face, brief, speech=video.path, fps=50.0, options=Outputs(overlay="mouth"))
    own = background.open_background(video.path)
    assert film.rate_hz == pytest.approx(25.0)
    assert film.covered == pytest.approx(own.enlarge(1.3).face_box)
    for frame, filmed in zip(film.frames, own.decode(film.count, 25.0), strict=True):
        assert np.array_equal(frame[225:], filmed.frame[225:])  # the speaker's own jaw


def model_of(*speakers: str, corpus: str = "filmed/many") -> Any:
    return SimpleNamespace(about={"corpus": [corpus], "speakers": list(speakers)}, visual="points")


def face_of(face: FilmedFace, speaker: str) -> FilmedFace:
    return replace(face, about={"corpus": ["filmed/many"], "speaker": speaker})


def test_the_person_of_one_corpus(filmed_face):
    for people, speaker, filmed, same in (
        ((), "", "anna", True),  # a corpus without names has one person
        (("anna",), "", "anna", True),
        (("anna",), "", "", True),
        (("ben",), "", "anna", False),
        (("anna", "ben"), "anna", "anna", True),
        (("anna", "ben"), "ben", "anna", False),
        (("anna", "ben"), "", "anna", False),  # the mean person
    ):
        face = face_of(filmed_face, filmed)
        assert is_person_of(model_of(*people), face, speaker) == same
        assert not is_person_of(model_of(*people, corpus="filmed/other"), face, speaker)


def test_without_speech_nothing_is_mapped(filmed_face, caplog):
    face = face_of(filmed_face, "anna")
    assert find_other_person(model_of("ben"), replace(face, takes=())) is None
    assert "built from footage without sound" in caplog.text
    assert find_other_person(model_of("ben"), face) is face
    assert find_other_person(model_of("anna"), face) is None
    assert shown_face(face).find_other_person(model_of("ben")) is face
    assert shown_face("portrait").find_other_person(model_of("ben")) is None


def test_mouth_pictures_cannot_be_mapped_onto_another_person(filmed_face):
    pictured = SimpleNamespace(about={"corpus": ["filmed/many"], "speakers": ["ben"]}, visual="eigenlips")
    assert is_person_of(pictured, face_of(filmed_face, "ben"))  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"mouth pictures of the person of filmed/many, the face is that of another"):
        is_person_of(pictured, face_of(filmed_face, "anna"))  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def sequence(filmed_face: FilmedFace) -> background.BackgroundSequence:
    return background.open_stored_background(filmed_face.background)


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> ToyVideo:
    return write_video(tmp_path_factory.mktemp("background") / "a.mp4", toy_sentences(3)[0])


def numbers(sequence: background.BackgroundSequence, shown: list[Background]) -> list[int]:
    """Return which frames of the footage were shown, by the place of the face."""
    places = sequence.face_to_frame.reshape(len(sequence.chin_px), -1)
    return [int(np.abs(places - each.face_to_frame.ravel()).sum(axis=1).argmin()) for each in shown]


def test_short_speech_shows_the_beginning(sequence):
    for count in (1, 50):
        shown = list(sequence.decode(count, 25.0))
        assert numbers(sequence, shown) == list(range(count))
        assert [each.chin_px for each in shown] == pytest.approx(sequence.chin_px[:count])


def test_any_length(sequence):
    """It goes on without a jump: neither the picture nor the place of the face."""
    shown = list(sequence.decode(130, 25.0))
    assert len(shown) == 130
    steps = [np.abs(a.frame.astype(int) - b.frame).mean() for a, b in pairwise(shown)]
    assert max(steps) < 8
    moves = [np.abs(a.face_to_frame - b.face_to_frame).max() for a, b in pairwise(shown)]
    assert max(moves) < 3
    assert len({each.frame.tobytes() for each in shown}) > 25


def test_a_background_at_any_rate(sequence):
    for rate_hz, frames in ((29.97, 58), (60.0, 60), (12.5, 24)):
        shown = numbers(sequence, list(sequence.decode(frames, rate_hz)))
        assert len(shown) == frames
        assert np.abs(np.array(shown) - np.arange(frames) / rate_hz * 25).max() <= 0.5 + 1e-6


def test_heads_lie_upon_one_another_where_a_frame_fades(sequence):
    """A head in two places is shown once, between them, and not twice."""
    (first,) = sequence.decode(1, 25.0)
    moved, place = np.roll(first.frame, (4, 6), axis=(0, 1)), first.face_to_frame.copy()
    place[:, 2] += (6, 4)
    half = background.mix_frames(first, replace(first, frame=moved, face_to_frame=place), 0.5)
    assert half.face_to_frame == pytest.approx((first.face_to_frame + place) / 2)
    x, y = half.face_to_frame[:, 2].round().astype(int)
    face = slice(y - 20, y + 20), slice(x - 30, x + 30)
    wanted = np.roll(first.frame, (2, 3), axis=(0, 1)).astype(int)[face]
    faded = ((first.frame.astype(int) + moved) / 2)[face]
    assert np.abs(half.frame[face] - wanted).mean() < 0.25 * np.abs(faded - wanted).mean()


def test_the_face_box_holds_the_head_in_every_frame(sequence):
    left, top, right, bottom = sequence.face_box
    for place in sequence.face_to_frame:
        for x in background.HEAD_PX[::2]:
            for y in background.HEAD_PX[1::2]:
                across, down = place @ [x, y, 1]
                assert left - 1e-9 <= across <= right + 1e-9
                assert top - 1e-9 <= down <= bottom + 1e-9
    assert right - left < (background.HEAD_PX[2] - background.HEAD_PX[0]) * SCALE + 20


def test_a_video_as_a_background(video, monkeypatch):
    found, drawn = background.find_chin(footage_of(video)), toy_chin_px(video.motion)
    assert np.abs(found - drawn).max() < 4  # it is smoothed over about a frame
    assert np.corrcoef(found, drawn)[0, 1] > 0.95
    install(monkeypatch, {video.path: video}, {})
    opened = background.open_background(video.path)
    count = len(opened.chin_px)
    assert count == len(video.motion.values)
    assert opened.usable.all()
    assert numbers(opened, list(opened.decode(count, 25.0))) == list(range(count))
    assert len(list(opened.decode(2 * count, 25.0))) == 2 * count
    assert opened.face_to_frame[:, :, 2] == pytest.approx(toy_places(count)[:, :, 2], abs=1.0)


def test_frames_of_odd_sizes_are_cut(sequence):
    """H.264 with half the colours takes even sizes only."""

    class OddGroups:
        def decode(self, _: int) -> np.ndarray:
            return np.zeros((101, 75, 3), np.uint8)

    odd = background.BackgroundSequence(OddGroups, 25.0, sequence.face_to_frame, sequence.chin_px, sequence.usable)  # type: ignore[arg-type]
    assert {each.frame.shape for each in odd.decode(3, 25.0)} == {(100, 74, 3)}


def without(
    sequence: background.BackgroundSequence, unseen: Iterable[int], **more: object
) -> background.BackgroundSequence:
    usable = np.ones(len(sequence.chin_px), bool)
    usable[list(unseen)] = False
    return replace(sequence, usable=usable, **more)  # type: ignore[arg-type]


def shown(sequence: background.BackgroundSequence, count: int) -> list[int]:
    return [int(number) for number in sequence.find_order(sequence.groups(), count).first]


@pytest.mark.parametrize("count", [5, 80])
def test_frames_without_a_face_are_not_shown(sequence, count):
    """Also where there are as many frames as are wanted."""
    gap = range(4, 12)
    found = shown(without(sequence, gap), count)
    assert len(found) == count
    assert not set(found) & set(gap)
    assert all(each.has_face for each in without(sequence, gap).decode(count, 25.0))


def test_no_cut_is_shown(sequence):
    found = shown(replace(sequence, cuts=(10,)), 30)
    assert not {*pairwise(found)} & {(9, 10), (10, 9)}


def test_the_video_of_the_speech_keeps_its_time(sequence):
    """Its frames are in order, with gaps and cuts; sound that is a little longer changes nothing."""
    total = len(sequence.chin_px)
    speech = without(sequence, range(10, 20), in_time=True, cuts=(30,))
    assert shown(speech, total) == list(range(total))
    assert shown(speech, total + 2) == [*range(total), total - 1, total - 1]
    seen = [each.has_face for each in speech.decode(total, 25.0)]
    assert [n for n, face in enumerate(seen) if not face] == list(range(10, 20))


def footage(seen: np.ndarray, rate_hz: float = 25.0, cuts: tuple[int, ...] = ()) -> Footage:
    count = len(seen)
    track = Track(Motion(np.zeros((count, 0)), rate_hz, ()), seen)
    maps, times_s = np.zeros((count, 2, 3)), np.arange(count) / rate_hz
    return Footage(None, WHOLE, track, maps, times_s, cuts, (2, 2), rate_hz)  # type: ignore[arg-type]


def test_parts_show_the_face_without_a_cut():
    seen = np.ones(1000, bool)
    seen[100:110] = False  # 0.4 s
    seen[300] = False  # one picture was dropped
    seen[-2:] = False
    parts = [(start, stop) for _, start, stop in background.divide_footage(footage(seen, cuts=(500,)))]
    assert parts == [(0, 100), (110, 305), (305, 500), (500, 749), (749, 998)]


def test_short_parts_are_compared_only_if_there_are_no_others():
    seen = np.ones(400, bool)
    seen[np.r_[50:60, 110:120, 260:270]] = False
    for frames, expected in ((seen, [(120, 260), (270, 400)]), (seen[:170], [(0, 50), (60, 110), (120, 170)])):
        assert [part[1:] for part in background.choose_parts([footage(frames)])] == expected


def test_parts_are_of_one_size():
    """That of most of the footage."""
    small, large = footage(np.ones(100, bool)), replace(footage(np.ones(160, bool)), size=(4, 4))
    assert [part[0] for part in background.choose_parts([small, large, small])] == [small, small]
