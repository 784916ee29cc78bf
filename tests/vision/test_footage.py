import sys
from dataclasses import replace
from itertools import repeat
from pathlib import Path

import numpy as np
import pytest

from children import run_child
from lipmotion.errors import InputError
from lipmotion.types import Motion, Track
from lipmotion_faces.tracking import track as video_scan
from lipmotion_faces.tracking.frames import WHOLE, VideoSpan
from lipmotion_faces.tracking.steadying import REGISTERED_NOISE_PX, register_maps, steady_maps
from lipmotion_faces.tracking.track import track
from vision.scripted import COLUMN, face
from vision.variants import write_frames

OPENINGS = 0.1 + 0.05 * np.sin(np.arange(20) / 3)
MOVES = np.stack([0.5 * np.arange(20), np.sin(np.arange(20) / 4), np.zeros(20)], axis=1)
FACES = [face(opening) + move for opening, move in zip(OPENINGS, MOVES, strict=True)]
JUMP_PX = 90  # more than a face of 60 px between the eyes moves from frame to frame


def levels(frames) -> list[int]:
    """Which picture of the file each frame is: picture n of ``write_video`` is a flat grey of 10 n."""
    return [round(float(frame.mean()) / 10) for frame in frames]


def eyes_in_frames(footage) -> np.ndarray:
    """Where the maps put the middle between the eyes [shape=(T, 2)]."""
    return footage.face_to_image[:, :, 2]


def test_it_tracks_as_track_does(write_video, scripted):
    path = write_video(ticks=range(20))
    scripted(FACES)
    footage = video_scan.track_footage(path, crops=True)
    scripted(FACES)
    expected = track(path)
    np.testing.assert_array_equal(footage.track.motion.values, expected.motion.values)
    np.testing.assert_array_equal(footage.track.crops, expected.crops)
    assert footage.track.notes == expected.notes
    assert (footage.size, footage.rate_hz, len(footage), footage.cuts) == ((48, 64), 25.0, 20, ())


def test_maps_of_frames_without_a_face_are_interpolated(write_video, scripted):
    scripted([None if n in (0, 8, 19) else one for n, one in enumerate(FACES)])
    footage = video_scan.track_footage(write_video(ticks=range(20)))
    eyes = eyes_in_frames(footage)
    assert np.flatnonzero(~footage.track.seen).tolist() == [0, 8, 19]
    np.testing.assert_allclose(eyes[8] - eyes[1], (MOVES[8] - MOVES[1])[:2], atol=0.02)
    np.testing.assert_array_equal(footage.face_to_image[[0, 19]], footage.face_to_image[[1, 18]])


def test_maps_do_not_run_over_a_cut(write_video, scripted):
    rows = np.linspace(0, 255, 96).astype(np.uint8)
    picture = np.tile(rows[:, None, None], (1, 320, 3))  # the face looks the same after the jump: the same person
    ticks = [n for n in range(20) if n not in (9, 14)]
    moved = [one + (n >= 10) * np.array([JUMP_PX, 0, 0]) for n, one in enumerate(FACES)]
    asked = sorted([*ticks, 10])  # the mesh that has lost the face, and the next one
    scripted([moved[n] + (60, 30, 0) for n in asked])
    footage = video_scan.track_footage(write_video(ticks=ticks, size=(320, 96), picture=picture))
    assert footage.cuts == (10,)
    eyes = eyes_in_frames(footage)[:, 0]
    np.testing.assert_allclose(eyes[9], eyes[8], atol=1e-9)
    np.testing.assert_allclose(eyes[10:] - eyes[8], JUMP_PX + MOVES[10:, 0] - MOVES[8, 0], atol=1e-6)


@pytest.mark.parametrize("dropped", [(), (6, 13), (7, 8, 9)])
def test_frames_come_in_their_constant_order(write_video, scripted, dropped):
    ticks = [n for n in range(20) if n not in dropped]
    scripted([FACES[n] for n in ticks])
    footage = video_scan.track_footage(write_video(ticks=ticks))
    shown = [ticks[index] for index in levels(video_scan.decode_footage(footage))]
    assert len(shown) == len(footage) == 20
    assert [shown[n] for n in ticks] == ticks
    distance = np.abs(np.array(shown) - np.arange(20))
    assert distance.max() == {(): 0, (6, 13): 1, (7, 8, 9): 2}[dropped]


def test_a_part_and_frames_in_any_order_are_the_same_as_in_the_whole(write_video, scripted):
    ticks = [n for n in range(20) if n not in (5, 12, 13)]
    scripted([FACES[n] for n in ticks])
    footage = video_scan.track_footage(write_video(ticks=ticks))
    order = [*range(20), *range(18, -1, -1), 3, 17]
    shown = levels(video_scan.decode_footage(footage))
    for max_bytes in (0, 20 * 48 * 64 * 3):
        groups = video_scan.open_footage(footage, max_bytes)
        assert levels(groups.decode(n) for n in order) == [shown[n] for n in order]
        assert groups.nbytes <= max(max_bytes, 2 * 48 * 64 * 3)
    for start, stop in ((0, 20), (0, 1), (7, 7), (12, 17), (19, None), (3, None)):
        assert levels(video_scan.decode_footage(footage, start, stop)) == shown[start:stop]
    scripted(FACES[5:15])
    footage = video_scan.track_footage(write_video(ticks=range(20)), VideoSpan(0.2, 0.6))
    assert levels(video_scan.decode_footage(footage, 4, 8)) == list(range(9, 13))
    for start, stop in ((-1, 5), (6, 5), (0, 11), (11, None)):
        with pytest.raises(InputError, match=rf"frames {start} to {stop or 10} of .*, required within 0 to 10"):
            video_scan.decode_footage(footage, start, stop)


def test_a_video_that_was_exchanged_is_noticed_and_one_that_became_shorter_shows_its_last_picture(
    write_video, scripted
):
    scripted(FACES)
    footage = video_scan.track_footage(write_video(ticks=range(20)))
    other = write_video("other.mp4", ticks=range(20), size=(32, 32))
    with pytest.raises(InputError, match="a picture is not 64 × 48 as when it was tracked"):
        list(video_scan.decode_footage(replace(footage, path=other)))
    shorter = replace(footage, path=write_video("shorter.mp4", ticks=range(15)))
    assert levels(video_scan.decode_footage(shorter)) == [*range(15), *([14] * 5)]
    with pytest.raises(InputError, match=r"no picture from 0\.72 s on"):
        list(video_scan.decode_footage(shorter, 18))


def test_untracked_frames_hold_the_last_picture(write_video):
    """At a constant rate; where pictures were dropped, the one before is shown again."""
    for dropped in ((), (3,), (7, 8, 9), (19,)):
        ticks = [n for n in range(20) if n not in dropped]
        frames, rate_hz = video_scan.read_video_frames(write_video(ticks=ticks))
        assert rate_hz == 25.0
        wanted = [sum(tick <= n for tick in ticks) - 1 for n in range(ticks[-1] + 1)]
        assert levels(frames) == wanted


def scenes(path: Path, cuts: list[int], count: int = 120) -> Path:
    """Write a video of patterns that change at some frames."""
    draw = np.random.default_rng(0)
    pictures, picture = [], None
    for n in range(count):
        if picture is None or n in cuts:
            picture = np.kron(draw.integers(0, 255, (6, 8, 3)), np.ones((16, 16, 1))).astype(np.uint8)
        pictures.append(np.clip(picture.astype(int) + n % 3, 0, 255).astype(np.uint8))
    return write_frames(path, pictures)


def test_times_and_cuts(tmp_path, scripted):
    scripted(repeat(None))
    shares: list[float] = []
    found = video_scan.scan_video(scenes(tmp_path / "a.mp4", [30, 77], 260), shares.append)
    np.testing.assert_allclose(found.times_s, np.arange(260) / 25, atol=1e-6)
    np.testing.assert_allclose(found.cuts_s, [1.2, 77 / 25], atol=1e-6)
    assert found.rate_hz == 25
    assert found.end_s == pytest.approx(10.4)
    assert shares == [pytest.approx(0.96, abs=0.01)]


def test_the_person_matters_only_where_there_are_others(tmp_path, scripted):
    """After a cut, somebody else is where the face was."""
    for cuts, is_alone in (([], True), ([100], False)):
        scripted(repeat(FACES[0]))
        found = video_scan.scan_video(scenes(tmp_path / "a.mp4", cuts, 260))
        assert (found.person == ()) == is_alone


def test_a_video_that_is_cut_short_is_told(tmp_path, scripted):
    scripted(repeat(None))
    content = write_frames(tmp_path / "a.mkv", [np.full((48, 64, 3), n, np.uint8) for n in range(120)]).read_bytes()
    assert video_scan.scan_video(tmp_path / "a.mkv").damage == ()
    (tmp_path / "a.mkv").write_bytes(content[: round(0.6 * len(content))])
    assert video_scan.scan_video(tmp_path / "a.mkv").damage[-1].startswith("cut short: pictures up to ")


def test_distances_are_measured_in_the_image_plane():
    points = np.stack([face(0.2)])
    points[0, COLUMN[14], 2] += 100  # depth has no part in them
    width = np.linalg.norm(points[0, COLUMN[61], :2] - points[0, COLUMN[291], :2]) / 60
    assert video_scan.measure_motion(points)[0, :2] == pytest.approx([0.2, width])


def test_frames_without_a_face_are_marked_and_interpolated(write_video, scripted):
    unseen = [0, 1, 9, 19]
    scripted([None if n in unseen else face(opening) for n, opening in enumerate(OPENINGS)])
    result = track(write_video(ticks=range(20)), crops=False)
    assert np.flatnonzero(~result.seen).tolist() == unseen
    opening = result.motion["opening"]
    np.testing.assert_allclose(opening[[0, 1, 19]], OPENINGS[[2, 2, 18]], atol=1e-9)
    assert opening[9] == pytest.approx(OPENINGS[9], abs=2e-3)
    assert np.isfinite(result.motion.values).all()


def test_a_part_of_a_video_begins_at_zero(write_video, scripted):
    scripted([face(OPENINGS[n]) for n in range(5, 15)])
    result = track(write_video(ticks=range(20)), crops=False, span=VideoSpan(0.2, 0.6))
    np.testing.assert_allclose(result.motion["opening"], OPENINGS[5:15], atol=1e-9)
    assert result.seen.all()
    scripted([])
    with pytest.raises(InputError, match=r"no picture from 5\.00 to 6\.00 s"):
        track(write_video(ticks=range(20)), span=VideoSpan(5.0, 6.0))


def test_too_few_faces_and_broken_time_stamps_are_refused(write_video, scripted):
    scripted([face(0.1) if n < 15 else None for n in range(20)])
    with pytest.raises(InputError, match=r"no face in 5 of 20 frames; required: a face in at least 80%"):
        track(write_video(ticks=range(20)), crops=False)
    scripted([face(0.1)] * 20)
    with pytest.raises(InputError, match=r"20 frames span 40\.\d s.*constant frame rate"):
        track(write_video("clip.mkv", ticks=[*range(19), 1000]), crops=False)


@pytest.mark.parametrize(("step", "rate", "told"), [(1000, 25, "0.025"), (1, 4000, "4000")])
def test_no_lips_are_seen_at_such_a_rate(write_video, scripted, step, rate, told):
    scripted([face(0.1)] * 20)
    with pytest.raises(InputError, match=rf"{told} pictures a second, required 1 to 1000; export the video again"):
        track(write_video("clip.mp4", ticks=range(0, 20 * step, step), rate=rate), crops=False)


@pytest.mark.video
@pytest.mark.recordings
class TestRealRecordings:
    @pytest.fixture(autouse=True)
    def _packages(self):
        pytest.importorskip("mediapipe")

    def test_a_clip_is_tracked_the_same_twice(self, recordings: Path):
        path = recordings / "grid-s1" / "clips" / "brwa3s.mkv"
        first, second = track(path), track(path)
        assert first.motion.values.shape == (75, len(video_scan.CHANNELS))
        assert first.motion.rate_hz == 25
        assert first.seen.all()
        np.testing.assert_array_equal(first.motion.values, second.motion.values)
        np.testing.assert_array_equal(first.crops, second.crops)
        assert first.motion["opening"][:10].max() < 0.02  # silence
        assert 0.1 < first.motion["opening"].max() < 0.3
        assert 0.4 < first.motion["width"].mean() < 0.7

    def test_nothing_is_printed(self, recordings: Path):
        path = recordings / "grid-s1" / "clips" / "brwa3s.mkv"
        code = f"from pathlib import Path; from lipmotion_faces.tracking.track import track; track(Path({str(path)!r}))"
        done = run_child([sys.executable, "-c", code], check=True)
        assert (done.stdout, done.stderr) == ("", "")


STILL = np.array([[0.8, 0, 100], [0, 0.8, 60]])
MOUTH = np.array([0.0, 76.0, 1.0])
RATE_HZ = 25.0


def at(places) -> np.ndarray:
    """Maps of a face at some places, px [shape=(T, 2, 3)]."""
    maps = np.repeat(STILL[None], len(places), axis=0)
    maps[:, :, 2] += places
    return maps


def trembling(size: float, count: int = 60) -> np.ndarray:
    return np.random.default_rng(3).normal(scale=size, size=(count, 2))


def spread(maps) -> float:
    return float(np.sqrt(np.square(np.diff(maps @ MOUTH, axis=0)).sum(axis=1).mean()))


def test_small_trembling_is_taken_away():
    maps = at(trembling(0.15))
    maps[:, :, :2] += np.random.default_rng(4).normal(scale=0.002, size=(60, 2, 2))
    assert spread(steady_maps(maps, RATE_HZ)) < 0.5 * spread(maps)


def test_a_quick_nod_stays():
    nod = np.zeros((60, 2))
    nod[30:36, 1] = [3, 9, 14, 14, 9, 3]
    moved = (steady_maps(at(nod), RATE_HZ) @ MOUTH)[:, 1]
    true = (at(nod) @ MOUTH)[:, 1]
    assert np.abs(moved - true).max() < 0.25
    assert np.abs(moved[[20, 45]] - true[[20, 45]]).max() < 0.01


def test_less_is_taken_away_where_less_is_noise():
    maps = at(trembling(0.3))
    tracked, registered = steady_maps(maps, RATE_HZ), steady_maps(maps, RATE_HZ, noise_px=REGISTERED_NOISE_PX)
    assert spread(tracked) < 0.8 * spread(registered) < 0.95 * spread(maps)


class TestRegistration:
    """A textured picture that moves by known fractions of a pixel, under maps that tremble."""

    @pytest.fixture(autouse=True)
    def _packages(self):
        pytest.importorskip("cv2")

    @pytest.fixture
    def scene(self, tmp_path):
        from cv2 import GaussianBlur
        from scipy.ndimage import shift

        def make(places, tremble, cuts=(), seen=None, contrast=4) -> video_scan.Footage:
            texture = GaussianBlur(np.random.default_rng(1).uniform(0, 255, (120, 170)), (0, 0), 2.0)
            texture = 128 + contrast * (texture - texture.mean())
            greys = (np.clip(shift(texture, place[::-1], mode="reflect"), 0, 255) for place in places)
            frames = [np.repeat(grey.astype(np.uint8)[..., None], 3, 2) for grey in greys]
            path = write_frames(tmp_path / "scene.mkv", frames, options={"qp": "0"})
            count = len(places)
            shown = np.ones(count, bool) if seen is None else seen
            track = Track(Motion(np.zeros((count, 0)), RATE_HZ, ()), shown)
            times_s = np.arange(count) / RATE_HZ
            maps = at(np.asarray(places) + tremble)
            return video_scan.Footage(path, WHOLE, track, maps, times_s, tuple(cuts), (120, 170), RATE_HZ)

        return make

    def test_trembling_of_the_tracker_is_corrected(self, scene):
        places = np.stack([3 * np.sin(np.arange(30) / 5), 2 * np.cos(np.arange(30) / 7)], axis=1)
        footage = scene(places, trembling(0.4, 30))
        wrong, right = (maps[:, :, 2] - at(places)[:, :, 2] for maps in (footage.face_to_image, register_maps(footage)))
        before, after = (np.sqrt(np.square(np.diff(error, axis=0)).mean()) for error in (wrong, right))
        assert before > 0.4
        assert after < 0.15 * before

    def test_steps_over_a_cut_and_of_unseen_frames_are_left_out(self, scene):
        places = np.zeros((30, 2))
        places[15:] = 6
        wrong = np.where(np.arange(30)[:, None] < 15, 0.0, -6.0)  # the tracker has not noticed that the face moved
        seen = np.ones(30, bool)
        noticed = register_maps(scene(places, wrong))
        assert np.abs(noticed - scene(places, wrong).face_to_image).max() > 2
        for footage in (
            scene(places, wrong, cuts=(15,)),
            replace(scene(places, wrong, seen=seen & (places[:, 0] < 1))),
        ):
            np.testing.assert_allclose(register_maps(footage), footage.face_to_image, atol=0.05)

    def test_what_an_unseen_frame_shows_moves_nothing(self, scene):
        """Somebody walks by, and the tracker's places are interpolated."""
        places, seen = np.zeros((30, 2)), np.ones(30, bool)
        places[12:17], seen[12:17] = 6, False
        footage = scene(places, -places, seen=seen)
        np.testing.assert_allclose(register_maps(footage), footage.face_to_image, atol=0.05)
