from __future__ import annotations

from itertools import pairwise

import pytest

from lipmotion.articulation.cue_sheets import cue_frame_count, lay_out_cues, start_s

RATES = [1, 10, 12, 15, 23.976, 24, 25, 29.97, 30, 48, 50, 59.94, 60]


def test_times_in_hundredths_lead_back_to_their_frames() -> None:
    """Also where the time is rounded, as the Blender add-ons do."""
    for fps in RATES:
        times_s = [start_s(frame, fps) for frame in range(2_000)]
        assert [int(fps * float(f"{time_s:.2f}")) for time_s in times_s] == list(range(2_000))
        assert fps >= 50 or [round(fps * time_s) for time_s in times_s] == list(range(2_000))
        assert all(before < after for before, after in pairwise(times_s))
        assert max(time_s - frame / fps for frame, time_s in enumerate(times_s)) < 0.0201


def test_the_last_frame_begins_before_the_end() -> None:
    for fps in RATES:
        for duration_s in [0.0, 0.004, 0.01, 0.04, 0.0417, 0.05, 0.5, 1.0, 2.975, 3.0, 10.009, 60.0]:
            frames = cue_frame_count(duration_s, fps)
            sheet = lay_out_cues([(frame, "BC"[frame % 2]) for frame in range(frames)], duration_s, fps, "ABCDEF")
            assert duration_s - 0.01 < sheet.duration_s <= duration_s
            assert frames == pytest.approx(duration_s * fps, abs=1.7)
            assert all(cue.start_s < cue.end_s for cue in sheet.cues) or duration_s < 0.01


def test_no_segments_are_rest() -> None:
    for drawn, rest in (("ABCDEFX", "X"), ("ABCDEF", "A")):
        (cue,) = lay_out_cues([], 0.0, 24, drawn).cues
        assert (cue.start_s, cue.end_s, cue.label) == (0.0, 0.0, rest)


def test_a_time_in_whole_hundredths_is_not_rounded_up() -> None:
    for fps, hundredths in ((25, 4), (50, 2), (20, 5)):
        exact = {frame: frame * hundredths / 100 for frame in range(200)}
        kept = {frame: time_s for frame, time_s in exact.items() if int(fps * time_s) == frame}
        assert len(kept) > 150
        assert [start_s(frame, fps) for frame in kept] == pytest.approx(list(kept.values()))
