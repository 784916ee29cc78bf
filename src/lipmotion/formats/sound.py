"""``.wav``, ``.flac``, ``.ogg``: one channel of sound as a file."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

from lipmotion.errors import ExportError
from lipmotion.storage.files import atomic_file
from lipmotion.types import Audio, to_sixteen_bits

SOUND_CODECS: dict[str, tuple[str, str, int | None]] = {
    ".wav": ("wav", "pcm_s16le", None),
    ".flac": ("flac", "flac", None),
    ".ogg": ("ogg", "libopus", 48_000),
}
"""Container and codec of every suffix, and the only sampling rate that the codec has (None: it has any)."""
BLOCK = 1 << 16  # samples that are encoded at a time


def write_sound(path: Path, audio: Audio) -> None:
    """Write sound to a file in the format of its suffix, at its own rate; after a failure there is no partial file.

    ``.wav`` and ``.flac`` hold 16 bits a sample, ``.ogg`` is compressed (Opus at 48 kHz). Samples beyond full scale are
    clipped. What was read from 16 bits is written as it was.
    Raises ExportError: another suffix, no samples, or the file cannot be written.
    """
    if path.suffix.lower() not in SOUND_CODECS:
        raise ExportError(f"{path}: unknown format {path.suffix!r}; required one of: {' '.join(SOUND_CODECS)}")
    if not len(audio.samples):
        raise ExportError(f"{path}: the sound has no samples")
    with atomic_file(path) as temporary:
        import av

        container_name, codec, rate_hz = SOUND_CODECS[path.suffix.lower()]
        try:
            with av.open(str(temporary), "w", format=container_name) as container:
                stream = container.add_stream(codec, rate=rate_hz or audio.rate_hz, layout="mono")
                for start in range(0, len(audio.samples), BLOCK):
                    values = to_sixteen_bits(audio.samples[None, start : start + BLOCK])
                    part = av.AudioFrame.from_ndarray(values, format="s16", layout="mono")
                    part.rate, part.pts, part.time_base = audio.rate_hz, start, Fraction(1, audio.rate_hz)
                    container.mux(stream.encode(part))
                container.mux(stream.encode(None))
        except av.FFmpegError as error:
            if isinstance(error, OSError):  # a full disk
                raise
            raise ExportError(f"{path}: cannot be encoded: {error}") from error
