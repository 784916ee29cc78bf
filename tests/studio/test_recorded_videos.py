from pathlib import Path

import av
import numpy as np
import pytest

from lipmotion.speech.sound.audio_files import read_audio
from lipmotion_studio.studio import MP4, find_media_type, find_real_video, find_sound_start, write_playable
from pipeline.made import write_sound
from testing.toy import ToySentence, write_film

LATE_S = 0.3


@pytest.fixture(scope="module")
def video(toy_sentence: ToySentence, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("videos") / "line.mp4"
    pictures = (np.full((32, 48, 3), 40 + 5 * number, np.uint8) for number in range(25))
    write_film(path, pictures, toy_sentence.audio)
    return path


def test_sound_that_begins_with_the_video_is_in_step(video, toy_speech):
    assert find_sound_start(video, video) == find_sound_start(video, toy_speech) == 0


def test_a_later_sound_is_found_in_the_video(video, toy_speech, tmp_path):
    late = shifted(video, tmp_path / "late.mp4", sound_s=LATE_S)
    assert find_sound_start(late, late) == 0  # the readers have silence before it
    assert find_sound_start(late, toy_speech) == pytest.approx(LATE_S, abs=0.03)  # and the silence of the encoder
    with_silence = tmp_path / "with silence.wav"
    write_sound(with_silence, read_audio(late))
    assert find_sound_start(late, with_silence) == 0


def test_what_begins_later_than_0_is_written_anew(video, tmp_path):
    assert find_media_type(video) == MP4
    later = shifted(video, tmp_path / "later.mp4", all_s=1.0)
    assert find_real_video(later) == later
    assert find_media_type(later) is None
    write_playable(later, later, tmp_path / "playable.mp4")
    assert find_media_type(tmp_path / "playable.mp4") == MP4


def shifted(video: Path, path: Path, *, sound_s: float = 0.0, all_s: float = 0.0) -> Path:
    """Write a video with its sound so much later, or all of it [s]; return where."""
    with av.open(str(video)) as source, av.open(str(path), "w") as target:
        streams = {stream.index: target.add_stream_from_template(stream) for stream in source.streams}
        for packet in source.demux():
            if packet.dts is None:
                continue
            late = round((all_s + (sound_s if packet.stream.type == "audio" else 0.0)) / packet.time_base)
            packet.pts, packet.dts, packet.stream = packet.pts + late, packet.dts + late, streams[packet.stream.index]
            target.mux(packet)
    return path
