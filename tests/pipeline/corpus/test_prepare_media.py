"""Videos as people have them, through ``prepare``: the motion is that of the plain clip, in time with the sound."""

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from lipmotion import Corpus, prepare

CLIP = "brwa3s"
COUNT = 75


def rewritten(source: Path, target: Path, kept: Sequence[int]) -> None:
    """Write some of a clip's pictures at their times, its sound as it is, subtitles that go on, and a cover."""
    with av.open(str(source)) as clip, av.open(str(target), "w") as container:
        copied = container.add_stream_from_template(clip.streams.audio[0], opaque=True)
        pictures = container.add_stream("libx264", rate=30, options={"crf": "8"})
        words = container.add_mux_stream("subrip")
        container.add_attachment("cover.jpg", "image/jpeg", b"\xff\xd8\xff\xe0 no picture")
        pictures.width, pictures.height, pictures.pix_fmt = 360, 288, "yuv420p"
        pictures.codec_context.time_base = Fraction(1, 25)
        for packet in clip.demux():
            for frame in packet.decode() if packet.stream.type == "video" else ():
                number = round(frame.time * 25)
                if number in kept:
                    picture = av.VideoFrame.from_ndarray(frame.to_ndarray(format="rgb24"), format="rgb24")
                    picture.pts, picture.time_base = number, Fraction(1, 25)
                    container.mux(pictures.encode(picture))
            if packet.stream.type == "audio" and packet.size:
                packet.stream = copied
                container.mux(packet)
        container.mux(pictures.encode())
        line = av.Packet(b"words that stay")
        line.stream, line.time_base, line.pts, line.dts, line.duration = words, Fraction(1, 1000), 2000, 2000, 9000
        container.mux(line)


@pytest.mark.video
@pytest.mark.recordings
def test_variable_frame_rate_with_subtitles_and_a_cover(recordings, tmp_path):
    pytest.importorskip("mediapipe")
    source = recordings / "grid-s1" / "clips" / f"{CLIP}.mkv"
    draw = np.random.default_rng(0)
    kept = [n for n in range(COUNT) if draw.random() > 0.3 or n in (0, COUNT - 1)]
    (tmp_path / "clips").mkdir()
    rewritten(source, tmp_path / "clips" / "varied.mkv", kept)
    (tmp_path / "clips" / "plain.mkv").write_bytes(source.read_bytes())
    prepare(tmp_path / "clips", tmp_path / "corpus", workers=1, crops=False)
    corpus = Corpus.open(tmp_path / "corpus")
    varied, plain = corpus.utterance("varied"), corpus.utterance("plain")
    assert varied.track.motion.rate_hz == pytest.approx(25)
    assert np.flatnonzero(~varied.track.seen).tolist() == sorted(set(range(COUNT)) - set(kept))
    seen = varied.track.seen
    opening, usual = (one.track.motion["opening"] for one in (varied, plain))
    assert np.corrcoef(opening[seen], usual[seen])[0, 1] > 0.99
    assert np.corrcoef(opening[:-1], usual[1:])[0, 1] < np.corrcoef(opening, usual)[0, 1]
    assert np.array_equal(varied.audio.samples, plain.audio.samples)
