import struct
from typing import Any

import numpy as np

from robustness.case import Bench, case
from speech.sounds import tone, write_constant_flac, write_pictures, write_sound, write_stamped

GROUP = "recordings"
NO_RECORDING = ("not a readable recording", "give an audio or video file")
NO_SPEECH = ("no speech found in the recording: the mouth rests; give a recording in which something is said",)
CUT = ("cut short: it states 3", "s of sound and holds")
CONTAINERS: dict[str, tuple[str, dict[float, Any]]] = {
    "wav": ("pcm_s16le", {0.6: (0, *CUT), 0.004: (3, "holds", "required at least 100 ms")}),
    "flac": ("flac", {0.6: (0, *CUT), 0.01: (3, *NO_RECORDING)}),
    "mp3": ("libmp3lame", {0.6: (0, *CUT)}),
    "ogg": ("libopus", {0.6: (0, *NO_SPEECH)}),
    "mp4": ("aac", {0.6: (3, *NO_RECORDING)}),
    "mkv": ("aac", {0.6: (0, *CUT)}),
}


def _cut(suffix: str, codec: str, share: float) -> None:
    code, *messages = CONTAINERS[suffix][1][share]

    @case(GROUP, f"{suffix} cut off at {share:.1%}", code, *messages)
    def _(bench: Bench) -> list[object]:
        rate_hz = 48_000 if codec == "libopus" else 16_000
        path = write_sound(bench.folder / f"a.{suffix}", tone(rate_hz, 3.0), rate_hz, codec)
        content = path.read_bytes()
        path.write_bytes(content[: int(share * len(content))])
        return bench.animate(path)


for _suffix, (_codec, _cuts) in CONTAINERS.items():
    for _share in _cuts:
        _cut(_suffix, _codec, _share)
case(GROUP, "a header only", 3, "holds 0 ms of sound", "required at least 100 ms")(
    lambda bench: bench.animate(bench.sound(np.zeros(0, np.int16)))
)


@case(GROUP, "a header that promises more than there is", 0)
def _(bench: Bench) -> list[object]:
    content = bytearray(bench.speech.read_bytes())
    content[4:8], content[40:44] = struct.pack("<I", 2**31), struct.pack("<I", 2**31 - 36)
    return bench.animate(bench.file("a.wav", bytes(content)))


@case(GROUP, "infinite samples", 3, "not finite", "export the recording again")
def _(bench: Bench) -> list[object]:
    samples = bench.samples()
    samples[8000:8010] = -np.inf
    return bench.animate(bench.sound(samples))


case(GROUP, "samples a million times full scale", 3, "full scale 1, found a peak of")(
    lambda bench: bench.animate(bench.sound(bench.samples() * np.float32(1e8)))
)


for _name, _rate_hz, _code, _messages in [
    ("1 Hz", 1, 3, ("sampled at 1 Hz, required 4000 to 1000000",)),
    ("384 kHz", 384_000, 0, ()),
]:

    @case(GROUP, f"sampled at {_name}", _code, *_messages)
    def _(bench: Bench, rate_hz: int = _rate_hz) -> list[object]:
        samples = np.repeat(bench.samples(), 24) if rate_hz == 384_000 else bench.samples()
        return bench.animate(bench.sound(samples, rate_hz))


case(GROUP, "64 channels", 0)(lambda bench: bench.animate(bench.sound(np.tile(bench.samples()[:, None], (1, 64)))))


for _name, _samples in {
    "clipped": lambda samples: np.clip(samples * 50, -1, 1),
    "digital silence": lambda samples: 0 * samples,
    "white noise": lambda samples: np.random.default_rng(0).normal(0, 0.1, len(samples)).astype(np.float32),
    "all but inaudible": lambda samples: samples * np.float32(1e-12),
}.items():

    @case(GROUP, _name, 0, *(NO_SPEECH if _name in ("digital silence", "white noise") else ()))
    def _(bench: Bench, change=_samples) -> list[object]:
        return bench.animate(bench.sound(change(bench.samples())))


@case(GROUP, "an mp3 named .wav", 0, *NO_SPEECH)
def _(bench: Bench) -> list[object]:
    path = write_sound(bench.folder / "a.mp3", tone(16_000), 16_000, "libmp3lame")
    return bench.animate(path.rename(bench.folder / "a.wav"))


case(GROUP, "random bytes", 3, *NO_RECORDING)(
    lambda bench: bench.animate(bench.file("a.wav", np.random.default_rng(1).bytes(5000)))
)


case(GROUP, "a video without sound", 3, "has no sound track")(
    lambda bench: bench.animate(write_pictures(bench.folder / "a.mp4"))
)


case(GROUP, "time stamps that alternate", 3, "beside 8.0 s of sound, at most 760 s are bridged; export the recording")(
    lambda bench: bench.animate(write_stamped(bench.folder / "a.mkv", [598.0 * (n % 2) + n / 50 for n in range(400)]))
)
case(GROUP, "a day of sound in 164 KB", 3, "bytes of sound last 664 s, required at most 661 s (20 bytes a second)")(
    lambda bench: bench.animate(write_constant_flac(bench.folder / "a.flac", 80_000))
)


for _name, _content in {
    "a VobSub index": "# VobSub index file, v7\ntimestamp: 00:00:00:000, filepos: 000000000\n",
    "an HLS playlist": "#EXTM3U\n#EXT-X-TARGETDURATION:2\n#EXTINF:2,\na.sub\n#EXT-X-ENDLIST\n",
    "a session description": "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=x\nc=IN IP4 127.0.0.1\nt=0 0\nm=audio 5004 RTP/AVP 0\n",
}.items():

    @case(GROUP, _name, 3, "required a recording; it stands for the file: fetch the file itself")
    def _(bench: Bench, content: str = _content) -> list[object]:
        write_sound(bench.folder / "a.mpg", tone(48_000), 48_000, "mp2", video=True).rename(bench.folder / "a.sub")
        return bench.animate(bench.file("a.idx", content).rename(bench.folder / "a.m3u8"))
