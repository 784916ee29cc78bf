"""Recordings and their acoustic features."""

import tempfile
from pathlib import Path

import numpy as np

from fuzz.inputs import Files, Good
from fuzz.plausible import LONGEST_S, require
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.sound.audio_files import read_audio
from speech.sounds import tone, write_sound

SECONDS = 0.6
CODECS = {
    **{"wav": "pcm_s16le", "float.wav": "pcm_f32le", "law.wav": "pcm_alaw", "flac": "flac", "mp3": "libmp3lame"},
    **{"ogg": "libopus", "mp4": "aac", "mkv": "aac", "aiff": "pcm_s16be", "caf": "pcm_s16be", "avi": "pcm_s16le"},
    **{"ts": "aac", "webm": "libopus", "au": "pcm_s16be", "mka": "flac"},
}
TEXTS = {
    "list.m3u8": "#EXTM3U\n#EXT-X-TARGETDURATION:9\n#EXTINF:9,\na.wav\n#EXT-X-ENDLIST\n",
    "list.txt": "ffconcat version 1.0\nfile a.wav\nduration 1\n",
    "a.idx": "# VobSub index file, v7 (do not modify this line!)\nsize: 720x576\nid: en, index: 0\n"
    "timestamp: 00:00:01:000, filepos: 000000000\n",
    "a.srt": "1\n00:00:01,000 --> 00:00:02,000\nhello\n",
}


def seeds(_: Good) -> list[Files]:
    """Return a tone in many containers, with video, with a gap; and texts that FFmpeg accepts as recordings."""
    found: list[Files] = []
    with tempfile.TemporaryDirectory() as folder:
        for name, codec in CODECS.items():
            rate_hz = 48_000 if codec == "libopus" else 16_000
            path = write_sound(Path(folder) / f"a.{name}", tone(rate_hz, SECONDS), rate_hz, codec)
            found.append({path.name: path.read_bytes()})
        for name in ("video.mp4", "video.mkv"):
            path = write_sound(Path(folder) / name, tone(16_000, SECONDS, 2), 16_000, "aac", video=True, start_s=0.1)
            found.append({path.name: path.read_bytes()})
        path = write_sound(Path(folder) / "hole.mka", tone(16_000, 2.0), 16_000, "flac", hole_s=(0.5, 1.0))
        found.append({path.name: path.read_bytes()})
    return found + [{name: text.encode()} for name, text in TEXTS.items()]


def read(folder: Path, _: Good) -> None:
    """Read a recording; compute its features."""
    (path,) = folder.iterdir()
    audio = read_audio(path)
    require(bool(np.isfinite(audio.samples).all()), "samples that are not finite")
    require(audio.duration_s <= LONGEST_S, "hours of sound")
    require(bool(np.isfinite(analysed(audio).mfcc().values).all()), "features that are not finite")
