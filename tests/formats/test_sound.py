from pathlib import Path

import av
import numpy as np
import pytest

from lipmotion.errors import ExportError
from lipmotion.formats.sound import write_sound
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.sound.resampling import at_speech_rate
from lipmotion.types import Audio, from_sixteen_bits

RATE_HZ = 22_050


def tone(duration_s: float = 2.0, level: float = 0.5) -> Audio:
    count = round(duration_s * RATE_HZ)
    return Audio((level * np.sin(np.arange(count) * 0.1)).astype(np.float32), RATE_HZ)


@pytest.mark.parametrize("rate_hz", [16_000, 22_050, 44_100])
def test_sixteen_bits_come_back_as_they_were_and_are_read_so(tmp_path: Path, rate_hz: int) -> None:
    values = np.resize(np.array([-32_768, -32_767, -1, 0, 1, 20_000, 32_766, 32_767], np.int16), 70_000)
    sound = Audio(from_sixteen_bits(values), rate_hz)
    for name in ("a.wav", "a.flac"):
        write_sound(tmp_path / name, sound)
        assert np.array_equal(read_audio(tmp_path / name, rate_hz).samples, sound.samples)
        assert np.array_equal(read_audio(tmp_path / name).samples, at_speech_rate(sound).samples)


@pytest.mark.parametrize(("name", "level"), [("a.wav", 0.5), ("a.FLAC", 0.5), ("a.wav", 2.0)])
def test_samples_survive_and_too_loud_ones_are_clipped(tmp_path: Path, name: str, level: float) -> None:
    write_sound(tmp_path / name, tone(level=level))
    read = read_audio(tmp_path / name, RATE_HZ)
    np.testing.assert_allclose(read.samples, np.clip(tone(level=level).samples, -1, 1), atol=1e-4)
    with av.open(str(tmp_path / name)) as container:
        assert container.streams.audio[0].rate == RATE_HZ


def test_a_compressed_sound_is_as_long_and_as_loud(tmp_path: Path) -> None:
    write_sound(tmp_path / "a.ogg", tone())
    read = read_audio(tmp_path / "a.ogg", RATE_HZ)
    assert read.duration_s == pytest.approx(2.0, abs=0.03)
    assert np.abs(read.samples[RATE_HZ // 2 : RATE_HZ]).max() == pytest.approx(0.5, abs=0.05)


def test_errors_leave_nothing(tmp_path: Path) -> None:
    for name, audio, message in (
        ("a.mp3", tone(), "unknown format '.mp3'; required one of: .wav .flac .ogg"),
        ("a.wav", Audio(np.zeros(0, np.float32), RATE_HZ), "the sound has no samples"),
        ("no/a.wav", tone(), "the folder .* does not exist"),
    ):
        with pytest.raises(ExportError, match=message):
            write_sound(tmp_path / name, audio)
        assert list(tmp_path.iterdir()) == []
