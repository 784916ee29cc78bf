"""Videos from which no corpus can be prepared."""

from fractions import Fraction
from typing import Any

import av
import numpy as np

from robustness.case import Bench, case
from speech.sounds import tone

GROUP = "videos"
NONE = "none of 1 recordings is usable; the first, a:"


def _video(bench: Bench, size: tuple[int, int], packets: list[bytes], every: int = 1) -> None:
    """Write packets of uncompressed pictures, one in ``every`` 40 ms, and a second of sound."""
    with av.open(str(bench.folder / "a.mkv"), "w") as container:
        stream: Any = container.add_stream("rawvideo", rate=25)
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        sound: Any = container.add_stream("pcm_s16le", rate=16_000, layout="mono")
        for number, content in enumerate(packets):
            packet = av.Packet(content)
            packet.stream, packet.time_base = stream, Fraction(1, 25)
            packet.pts = packet.dts = every * number
            container.mux(packet)
        samples = np.round(tone(16_000) * 32_767).astype("<i2")
        part = av.AudioFrame.from_ndarray(samples, format="s16", layout="mono")
        part.rate, part.pts, part.time_base = 16_000, 0, Fraction(1, 16_000)
        container.mux(sound.encode(part))
        container.mux(sound.encode(None))


def _pictures(name: str, size: tuple[int, int], packets: list[bytes], *messages: str) -> None:
    @case(GROUP, name, 4, NONE, *messages)
    def _(bench: Bench) -> list[object]:
        _video(bench, size, packets)
        return ["corpus", "prepare", bench.folder, "-o", "corpus"]


GREY = bytes([128]) * (64 * 64 * 3 // 2)
_pictures("only grey pictures", (64, 64), [GREY] * 25, "no face in 25 of 25 frames; required: a face in at least 80%")
_pictures("one picture", (64, 64), [GREY], "no face in 1 of 1 frames; required: a face in at least 80%")
_pictures("pictures of one pixel", (1, 1), [bytes(3)] * 25, "pictures of 1 × 1 pixels, required 16 to 8192; scale")
_pictures("pictures of 16,000 × 16,000", (16_000, 16_000), [GREY], "pictures of no size, or of more than 9437184")
_pictures(
    "pictures that are cut off", (64, 64), [GREY[:100]] * 25, "no picture that can be decoded; export the video again"
)


@case(GROUP, "pictures minutes apart", 4, NONE, "0.01 pictures a second, required 1 to 1000; export the video again")
def _(bench: Bench) -> list[object]:
    _video(bench, (64, 64), [GREY] * 25, every=2500)
    return ["corpus", "prepare", bench.folder, "-o", "corpus"]
