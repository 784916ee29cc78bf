import sys
from pathlib import Path

import numpy as np
import pytest

from children import run_child
from lipmotion.errors import InputError
from lipmotion_faces.tracking.frames import VideoSpan
from lipmotion_faces.tracking.track import CHANNELS, measure_motion, track
from lipmotion_faces.tracking.trackers import JAW_POINTS, LIP_POINTS
from vision.scripted import COLUMN, face

OPENINGS = 0.1 + 0.05 * np.sin(np.arange(20) / 3)


def test_channels_are_named_and_ordered():
    names = [channel.name for channel in CHANNELS]
    assert names[:6] == ["opening", "width", "outer", "x_61", "y_61", "z_61"]
    assert names[-1] == f"z_{JAW_POINTS[-1]}"
    assert len(names) == 3 + 3 * (len(LIP_POINTS) + len(JAW_POINTS)) == len(set(names))
    assert {channel.unit for channel in CHANNELS} == {"eye_distance"}


def test_distances_are_measured_in_the_image_plane():
    points = np.stack([face(0.2)])
    points[0, COLUMN[14], 2] += 100  # depth has no part in them
    width = np.linalg.norm(points[0, COLUMN[61], :2] - points[0, COLUMN[291], :2]) / 60
    assert measure_motion(points)[0, :2] == pytest.approx([0.2, width])


def test_every_frame_is_measured(write_video, scripted):
    scripted([face(opening) for opening in OPENINGS])
    result = track(write_video(ticks=range(20)), crops=False)
    np.testing.assert_allclose(result.motion["opening"], OPENINGS, atol=1e-9)
    assert result.motion.rate_hz == 25
    assert result.seen.all()
    assert result.crops is None


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


def test_a_small_face_is_noted(write_video, scripted):
    scripted([0.4 * face(opening) for opening in OPENINGS])
    notes = track(write_video(ticks=range(20)), crops=False).notes
    assert notes == ("the face is small: 24 px between the eyes, 35 give a good track; film closer",)


def test_dropped_frames_are_put_in_their_place(write_video, scripted):
    ticks = [n for n in range(20) if n not in (6, 13)]
    scripted([face(OPENINGS[n]) for n in ticks])
    result = track(write_video(ticks=ticks), crops=False)
    np.testing.assert_allclose(result.motion["opening"], OPENINGS, atol=2e-3)
    np.testing.assert_allclose(result.motion["opening"][ticks], OPENINGS[ticks], atol=1e-9)
    assert np.flatnonzero(~result.seen).tolist() == [6, 13]


def test_too_few_faces_are_refused_with_counts(write_video, scripted):
    scripted([face(0.1) if n < 15 else None for n in range(20)])
    with pytest.raises(InputError, match=r"no face in 5 of 20 frames; required: a face in at least 80%"):
        track(write_video(ticks=range(20)), crops=False)


def test_broken_time_stamps_are_refused(write_video, scripted):
    scripted([face(0.1)] * 20)
    with pytest.raises(InputError, match=r"20 frames span 40\.\d s.*constant frame rate"):
        track(write_video("clip.mkv", ticks=[*range(19), 1000]), crops=False)


@pytest.mark.parametrize(("step", "rate", "told"), [(1000, 25, "0.025"), (1, 4000, "4000")])
def test_no_lips_are_seen_at_such_a_rate(write_video, scripted, step, rate, told):
    scripted([face(0.1)] * 20)
    with pytest.raises(InputError, match=rf"{told} pictures a second, required 1 to 1000; export the video again"):
        track(write_video("clip.mp4", ticks=range(0, 20 * step, step), rate=rate), crops=False)


@pytest.mark.video
def test_unseen_frames_show_the_nearest_mouth(write_video, scripted):
    pytest.importorskip("cv2")
    unseen = [0, 1, 9, 19]
    scripted([None if n in unseen else face(0.1) for n in range(20)])
    result = track(write_video(ticks=range(20)))
    assert result.crops is not None
    assert result.crops.shape == (20, 56, 72, 3)
    shown = result.crops.mean(axis=(1, 2, 3))  # frame n is a flat grey of 10 n
    np.testing.assert_allclose(shown, [20, 20, *range(20, 90, 10), 80, *range(100, 190, 10), 180], atol=3)


@pytest.mark.video
@pytest.mark.recordings
class TestRealRecordings:
    @pytest.fixture(autouse=True)
    def _packages(self):
        pytest.importorskip("mediapipe")

    def test_a_clip_is_tracked_the_same_twice(self, recordings: Path):
        path = recordings / "grid-s1" / "clips" / "brwa3s.mkv"
        first, second = track(path), track(path)
        assert first.motion.values.shape == (75, len(CHANNELS))
        assert first.motion.rate_hz == 25
        assert first.seen.all()
        np.testing.assert_array_equal(first.motion.values, second.motion.values)
        np.testing.assert_array_equal(first.crops, second.crops)
        assert first.motion["opening"][:10].max() < 0.02  # silence
        assert 0.1 < first.motion["opening"].max() < 0.3
        assert 0.4 < first.motion["width"].mean() < 0.7

    def test_two_encodings_of_a_clip_agree(self, recordings: Path):
        one = track(recordings / "grid-s1" / "clips" / "bbal8p.mkv", crops=False).motion
        two = track(recordings / "grid-s1" / "original" / "bbal8p.mpg", crops=False).motion
        for name, least in (("opening", 0.98), ("width", 0.9), ("y_17", 0.98), ("y_152", 0.95)):
            assert np.corrcoef(one[name], two[name])[0, 1] > least

    def test_nothing_is_printed(self, recordings: Path):
        path = recordings / "grid-s1" / "clips" / "brwa3s.mkv"
        code = f"from pathlib import Path; from lipmotion_faces.tracking.track import track; track(Path({str(path)!r}))"
        done = run_child([sys.executable, "-c", code], check=True)
        assert (done.stdout, done.stderr) == ("", "")
