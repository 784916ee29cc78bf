from __future__ import annotations

import shutil
import wave
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.speech.sound.audio_files import SPEECH_RATE_HZ, read_audio
from lipmotion.types import Audio
from speech.sounds import LEVEL, ONSET_S, tone, write_pictures, write_sound


def onset_s(audio: Audio) -> float:
    """Return when the tone begins."""
    return float(np.flatnonzero(np.abs(audio.samples) > LEVEL / 3)[0]) / audio.rate_hz


def level(audio: Audio, at_s: float) -> float:
    """Return the amplitude of the tone in 0.2 s."""
    part = audio.samples[round(at_s * audio.rate_hz) :][: audio.rate_hz // 5]
    return float(np.sqrt(2 * np.square(part).mean()))


def test_sixteen_bits_at_16_khz_come_back_exactly(tmp_path: Path) -> None:
    given = np.random.default_rng(0).integers(-32768, 32768, 16_000).astype(np.int16)
    with wave.open(str(tmp_path / "a.wav"), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(16_000)
        file.writeframes(given.astype("<i2").tobytes())
    assert np.array_equal(read_audio(tmp_path / "a.wav").samples, given / np.float32(32768))


def test_channels_are_averaged(tmp_path: Path) -> None:
    stereo = tone(44_100, channels=2) * np.array([[1.0], [0.5]], np.float32)
    audio = read_audio(write_sound(tmp_path / "a.mp4", stereo, 44_100, "aac"))
    assert level(audio, 0.6) == pytest.approx(0.75 * LEVEL, rel=0.05)


def test_another_rate_can_be_asked_for(tmp_path: Path) -> None:
    audio = read_audio(write_sound(tmp_path / "a.wav", tone(16_000), 16_000, "pcm_s16le"), 48_000)
    assert (audio.rate_hz, len(audio.samples)) == (48_000, pytest.approx(48_000, abs=100))
    assert onset_s(audio) == pytest.approx(ONSET_S, abs=0.002)


def test_time_0_is_where_the_pictures_begin(tmp_path: Path) -> None:
    for name, start_s in (("a.mp4", 0.0), ("a.mp4", 0.4), ("a.mkv", 0.4), ("a.ts", 0.4)):
        audio = read_audio(write_sound(tmp_path / name, tone(44_100), 44_100, "aac", start_s=start_s, video=True))
        assert onset_s(audio) == pytest.approx(start_s + ONSET_S, abs=0.003)
        assert audio.duration_s == pytest.approx(start_s + 1, abs=0.05)
        assert np.abs(audio.samples[: round((start_s + 0.2) * 16_000)]).max(initial=0) < 0.01


def test_the_content_decides_not_the_name(tmp_path: Path) -> None:
    write_sound(tmp_path / "a.flac", tone(16_000), 16_000, "flac")
    for name in ("sound", "sound.txt", "Ton ü 音.wav"):
        shutil.copy(tmp_path / "a.flac", tmp_path / name)
        assert read_audio(tmp_path / name).duration_s == 1


def silence(path: Path, duration_s: float, value: float = 0.0) -> Path:
    samples = np.full((1, round(16_000 * duration_s)), value, np.float32)
    return write_sound(path, samples, 16_000, "pcm_f32le")


WRONG: list[tuple[Callable[[Path], object], str]] = [
    (lambda path: path.with_suffix(".mp3").touch(), r"a.wav: no such file"),
    (lambda path: path.touch(), r"a.wav: the file is empty; give a recording"),
    (lambda path: path.mkdir(), r"a.wav: is a folder; give one recording"),
    (lambda path: path.write_text("words, not sound\n" * 50), "is text, required a recording"),
    (lambda path: path.write_bytes(b"RIFF\x24\0\0\0WAVEfmt "), r"a.wav: "),
    (lambda path: write_pictures(path.with_suffix(".mp4")).rename(path), r"has no sound track; give a recording"),
    (lambda path: silence(path, 0.09), r"holds 90 ms of sound, required at least 100 ms"),
    (lambda path: silence(path, 1, float("nan")), r"samples that are not finite \(NaN or infinite\)"),
    (lambda path: silence(path, 1, float("inf")), r"samples that are not finite"),
]


def test_it_says_what_is_wrong(tmp_path: Path) -> None:
    for number, (make, message) in enumerate(WRONG):
        path = tmp_path / str(number) / "a.wav"
        path.parent.mkdir()
        make(path)
        with pytest.raises(InputError, match=message):
            read_audio(path)


def test_a_recording_cut_short_is_shorter_or_refused(tmp_path: Path) -> None:
    for name, codec in (("a.flac", "flac"), ("a.mp3", "libmp3lame"), ("a.m4a", "aac")):
        content = write_sound(tmp_path / name, tone(16_000), 16_000, codec).read_bytes()
        for share in (0.01, 0.6):
            (tmp_path / name).write_bytes(content[: round(share * len(content))])
            with suppress(InputError):  # any other error would be a traceback
                assert read_audio(tmp_path / name).duration_s < 1.1


@pytest.mark.recordings
def test_real_recordings_of_many_kinds(recordings: Path) -> None:
    folder = recordings / "speech-open"
    files = [path for path in sorted(folder.iterdir()) if path.suffix in (".wav", ".flac", ".mp3", ".ogg", ".opus")]
    assert files
    for path in files:
        audio = read_audio(path)
        assert audio.rate_hz == SPEECH_RATE_HZ
        assert 0.001 < np.abs(audio.samples).max() < 2


@pytest.mark.recordings
def test_two_encodings_of_a_real_clip_agree_in_time(recordings: Path) -> None:
    one, two = (
        read_audio(recordings / "grid-s1" / name).samples for name in ("original/bbal8p.mpg", "clips/bbal8p.mkv")
    )
    count = min(len(one), len(two))
    spectrum = np.fft.rfft(one[:count], 2 * count) * np.conj(np.fft.rfft(two[:count], 2 * count))
    shift = int(np.argmax(np.fft.irfft(spectrum)))
    assert min(shift, 2 * count - shift) <= 0.005 * SPEECH_RATE_HZ
