from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from lipmotion.types import Motion, Track
from lipmotion_faces.film import background
from lipmotion_faces.film.background import (
    HEAD_PX,
    BackgroundSequence,
    best_background,
    chin_px,
    open_background,
    open_stored_background,
)
from lipmotion_faces.filmed.face import FilmedFace
from lipmotion_faces.filmed.renderer import Background
from lipmotion_faces.tracking.footage import Footage
from lipmotion_faces.tracking.frames import WHOLE
from pipeline.film.toy_footage import ToyVideo, footage_of, install, write_video
from testing.toy import toy_sentences
from testing.toy_face import SCALE, toy_chin_px, toy_frames, toy_places


@pytest.fixture(scope="module")
def sequence(filmed_face: FilmedFace) -> BackgroundSequence:
    return open_stored_background(filmed_face.background)


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> ToyVideo:
    return write_video(tmp_path_factory.mktemp("background") / "a.mp4", toy_sentences(3)[0])


def numbers(sequence: BackgroundSequence, shown: list[Background]) -> list[int]:
    """Return which frames of the footage were shown, by the place of the face."""
    places = sequence.face_to_frame.reshape(len(sequence.chin_px), -1)
    return [int(np.abs(places - each.face_to_frame.ravel()).sum(axis=1).argmin()) for each in shown]


def test_short_speech_shows_the_beginning(sequence):
    for count in (1, 50):
        shown = list(sequence.frames(count, 25.0))
        assert numbers(sequence, shown) == list(range(count))
        assert [each.chin_px for each in shown] == pytest.approx(sequence.chin_px[:count])


def test_any_length(sequence):
    """It goes on without a jump: neither the picture nor the place of the face."""
    count = 130
    shown = list(sequence.frames(count, 25.0))
    assert len(shown) == count
    steps = [np.abs(a.frame.astype(int) - b.frame).mean() for a, b in pairwise(shown)]
    assert max(steps) < 8
    moves = [np.abs(a.face_to_frame - b.face_to_frame).max() for a, b in pairwise(shown)]
    assert max(moves) < 3
    assert len({each.frame.tobytes() for each in shown}) > 25


def test_heads_lie_upon_one_another_where_a_frame_fades(sequence):
    """A head in two places is shown once, between them, and not twice."""
    (first,) = sequence.frames(1, 25.0)
    moved, place = np.roll(first.frame, (4, 6), axis=(0, 1)), first.face_to_frame.copy()
    place[:, 2] += (6, 4)
    half = background.mix_frames(first, replace(first, frame=moved, face_to_frame=place), 0.5)
    assert half.face_to_frame == pytest.approx((first.face_to_frame + place) / 2)
    x, y = half.face_to_frame[:, 2].round().astype(int)
    face = slice(y - 20, y + 20), slice(x - 30, x + 30)
    wanted = np.roll(first.frame, (2, 3), axis=(0, 1)).astype(int)[face]
    faded = ((first.frame.astype(int) + moved) / 2)[face]
    assert np.abs(half.frame[face] - wanted).mean() < 0.25 * np.abs(faded - wanted).mean()


def test_any_rate(sequence):
    for rate_hz, frames in ((29.97, 58), (60.0, 60), (12.5, 24)):
        shown = numbers(sequence, list(sequence.frames(frames, rate_hz)))
        assert len(shown) == frames
        assert np.abs(np.array(shown) - np.arange(frames) / rate_hz * 25).max() <= 0.5 + 1e-6


def test_frames_are_those_that_were_filmed(sequence, filmed_face):
    (first,) = sequence.frames(1, 25.0)
    motion = filmed_face.takes[0].motion
    drawn = next(toy_frames(motion, toy_places(len(motion.values))))
    assert np.abs(first.frame.astype(int) - drawn).mean() < 2


def test_the_face_box_holds_the_head_in_every_frame(sequence):
    left, top, right, bottom = sequence.face_box
    for place in sequence.face_to_frame:
        for x in HEAD_PX[::2]:
            for y in HEAD_PX[1::2]:
                across, down = place @ [x, y, 1]
                assert left - 1e-9 <= across <= right + 1e-9
                assert top - 1e-9 <= down <= bottom + 1e-9
    assert right - left < (HEAD_PX[2] - HEAD_PX[0]) * SCALE + 20


def test_a_larger_mouth_in_the_same_place(sequence):
    middle = np.array([0.0, 76.0, 1.0])
    larger = sequence.enlarge(1.3)
    for old, new in zip(sequence.face_to_frame, larger.face_to_frame, strict=True):
        assert new @ middle == pytest.approx(old @ middle)
        assert new[:, :2] == pytest.approx(1.3 * old[:, :2])
    assert np.array_equal(larger.chin_px, sequence.chin_px)


def test_the_chin_is_where_the_tracker_sees_it(video):
    found, drawn = chin_px(footage_of(video)), toy_chin_px(video.motion)
    assert np.abs(found - drawn).max() < 4  # it is smoothed over about a frame
    assert np.corrcoef(found, drawn)[0, 1] > 0.95


def test_a_video_as_a_background(video, monkeypatch):
    install(monkeypatch, {video.path: video}, {})
    opened = open_background(video.path)
    count = len(opened.chin_px)
    assert count == len(video.motion.values)
    assert opened.usable.all()
    assert numbers(opened, list(opened.frames(count, 25.0))) == list(range(count))
    assert len(list(opened.frames(2 * count, 25.0))) == 2 * count
    assert opened.face_to_frame[:, :, 2] == pytest.approx(toy_places(count)[:, :, 2], abs=1.0)


@pytest.mark.long
def test_the_best_background_is_one_part(video, monkeypatch):
    """Of at most some seconds, without cuts, in which the face is seen."""
    monkeypatch.setattr(background, "register_maps", lambda footage: footage.face_to_image)
    monkeypatch.setattr(background, "MOST_BACKGROUND_S", 1.0)
    monkeypatch.setattr(background, "MOST_PART_S", 1.0)
    best = best_background([footage_of(video)])
    assert 20 <= len(best.video) <= 25
    assert len(best.video) == len(best.chin_px) == len(best.face_to_frame)
    seen = np.arange(len(video.motion.values)) < 25
    early = best_background([footage_of(video, seen=seen)])
    assert early.chin_px == pytest.approx(chin_px(footage_of(video))[: len(early.chin_px)])


def test_frames_of_odd_sizes_are_cut(sequence):
    """H.264 with half the colours takes even sizes only."""

    class OddGroups:
        def frame(self, _: int) -> np.ndarray:
            return np.zeros((101, 75, 3), np.uint8)

    odd = BackgroundSequence(OddGroups, 25.0, sequence.face_to_frame, sequence.chin_px, sequence.usable)  # type: ignore[arg-type]
    assert {each.frame.shape for each in odd.frames(3, 25.0)} == {(100, 74, 3)}


def without(sequence: BackgroundSequence, unseen: Iterable[int], **more: object) -> BackgroundSequence:
    usable = np.ones(len(sequence.chin_px), bool)
    usable[list(unseen)] = False
    return replace(sequence, usable=usable, **more)  # type: ignore[arg-type]


def shown(sequence: BackgroundSequence, count: int) -> list[int]:
    return [int(number) for number in sequence.order(sequence.groups(), count).first]


@pytest.mark.parametrize("count", [5, 80])
def test_frames_without_a_face_are_not_shown(sequence, count):
    """Also where there are as many frames as are wanted."""
    gap = range(4, 12)
    found = shown(without(sequence, gap), count)
    assert len(found) == count
    assert not set(found) & set(gap)
    assert all(each.has_face for each in without(sequence, gap).frames(count, 25.0))


def test_no_cut_is_shown(sequence):
    found = shown(replace(sequence, cuts=(10,)), 30)
    steps = set(pairwise(found))
    assert not steps & {(9, 10), (10, 9)}


def test_the_video_of_the_speech_keeps_its_time(sequence):
    """Its frames are in order, with gaps and cuts; sound that is a little longer changes nothing."""
    total = len(sequence.chin_px)
    speech = without(sequence, range(10, 20), in_time=True, cuts=(30,))
    assert shown(speech, total) == list(range(total))
    assert shown(speech, total + 2) == [*range(total), total - 1, total - 1]
    seen = [each.has_face for each in speech.frames(total, 25.0)]
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
