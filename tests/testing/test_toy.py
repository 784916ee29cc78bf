import numpy as np
import pytest

from lipmotion_faces.tracking.track import track
from testing.toy import LIPS_TOUCH, toy_motion, toy_sentences, write_toy_recordings

FPS = 25.0


@pytest.mark.parametrize("rate_hz", [25.0, 30.0, 100.0])
def test_the_mouth_is_shut_in_silence_and_touches_in_p_b_m(rate_hz):
    for sentence in toy_sentences(12):
        motion = toy_motion(sentence.units, rate_hz)
        first, last = sentence.units.spans[0].end_s, sentence.units.spans[-1].start_s
        quiet = (motion.time_s < first - 0.1) | (motion.time_s > last + 0.1)
        assert quiet.sum() > 0.5 * rate_hz
        assert (motion["opening"][quiet] == 0).all()
        for span in sentence.units:
            inside = (motion.time_s >= span.start_s) & (motion.time_s < span.end_s)
            if span.label.phone in LIPS_TOUCH:
                assert motion["opening"][inside].min() == 0
            elif span.label.phone == "aa":
                assert motion["opening"][inside].max() > 0.2


@pytest.mark.long
@pytest.mark.video
def test_toy_faces_can_be_tracked(tmp_path):
    pytest.importorskip("mediapipe")
    for path, sentence in zip(write_toy_recordings(tmp_path, sentences=3), toy_sentences(3), strict=True):
        tracked, known = track(path, crops=False), toy_motion(sentence.units, FPS)["opening"]
        opening = tracked.motion["opening"]
        assert tracked.seen.all()
        assert np.corrcoef(opening, known)[0, 1] > 0.9
        assert np.median(opening[known == 0]) < 0.3 * np.percentile(opening, 95)
