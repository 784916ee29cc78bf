"""Sound read from files: any common container, or the sound track of a video, to one channel at 16 kHz."""

from __future__ import annotations

import logging
import mmap
import struct
from pathlib import Path

import numpy as np

from lipmotion.errors import InputError
from lipmotion.speech.sound.audio_decoding import DecodedAudio, check_sound_format, decode_audio
from lipmotion.storage.files import check_source
from lipmotion.storage.media import open_media
from lipmotion.storage.sources import is_text
from lipmotion.types import Audio

LOG = logging.getLogger("lipmotion")

SPEECH_RATE_HZ = 16_000
SHORTEST_S = 0.1
"""Shorter recordings hold no sentence; the features need 25 ms around every frame."""
CANCELLED_SHARE = 0.05
"""The mean of the channels must have this share of the loudest channel's energy; else they cancel one another."""
USABLE_SHARE = 0.5
"""A damaged recording is refused when less than this share of its sound can be decoded."""
LEAST_HOLES_S = 0.005
"""Holes that last less together are not mentioned: they would be rounded to 0."""
CUT_SHORT_SHARE = 0.9
"""A recording is called cut short when it holds less than this share of the duration that it states."""
PCM, FLOAT, EXTENSIBLE = 1, 3, 0xFFFE
"""Forms of samples in a WAVE file; the last one says its form, and how many bits are valid, in a longer header."""


def read_audio(path: Path, rate_hz: int = SPEECH_RATE_HZ, *, warn: bool = True) -> Audio:
    """Return the first sound track of a file, the mean of its channels.

    path    : audio or video file, anything FFmpeg decodes
    warn    : log warnings; False where the same file was read before, so that none is said twice
    Time 0 is the start of the container, so sound and picture of a video agree: a track that starts later
    is preceded by silence, one that starts earlier is cut. In a file without video it is the first sample.
    Holes in the sound (damage, lost packets) become silence, so that what follows keeps its time. Where the channels
    cancel one another, as with one of them inverted, the loudest is taken. Both are logged as warnings.
    Memory: the samples returned, and an eighth more.
    Raises InputError: no such file, empty, not a recording, no sound track, less than half of it decodable, too short,
    time stamps or a length that it cannot have, or samples not finite.
    """
    check_source(path, "recording")
    sound = _decoded(path, rate_hz, None)
    if sound.mean_energy < CANCELLED_SHARE * max(sound.energies, default=0.0):
        loudest = int(np.argmax(sound.energies))
        LOG.log(
            logging.WARNING if warn else logging.DEBUG,
            "%s: its %d channels cancel one another in their mean; channel %d, the loudest, is used",
            path,
            len(sound.energies),
            loudest + 1,
        )
        sound = _decoded(path, rate_hz, loudest)
    level = logging.WARNING if warn else logging.DEBUG
    held_s = len(sound.samples) / sound.rate_hz - sound.silence_s
    found = f"{sound.damaged} of {sound.packets} packets of sound cannot be decoded"
    if sound.damaged > (1 - USABLE_SHARE) * sound.packets:
        raise InputError(f"{path}: damaged: {found}; required: at least half of them; export the recording again")
    if sound.damaged or sound.silence_s >= SHORTEST_S:
        holes = f"; holes of {sound.silence_s:.2f} s became silence" if sound.silence_s >= LEAST_HOLES_S else ""
        LOG.log(level, "%s: damaged: %s%s", path, found, holes)
    if held_s < CUT_SHORT_SHARE * sound.stated_s:
        LOG.log(level, "%s: cut short: it states %.1f s of sound and holds %.1f s", path, sound.stated_s, held_s)
    return _checked(path, Audio(sound.samples, rate_hz))


def _decoded(path: Path, rate_hz: int, channel: int | None) -> DecodedAudio:
    import av

    try:
        with open_media(path, content=_corrected_wave(path)) as container:
            if not container.streams.audio:
                raise InputError(f"{path}: has no sound track; give a recording with sound")
            stream = container.streams.audio[0]
            if stream.codec_context is None:
                raise InputError(f"{path}: its sound is coded in an unknown way; export it as .wav or .flac")
            check_sound_format(str(path), stream.rate or 0, stream.channels or 0)
            if len(container.streams.audio) > 1:
                LOG.info("%s: the first of %d sound tracks is used", path, len(container.streams.audio))
            return decode_audio(container, rate_hz, channel)
    except (av.FFmpegError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        if is_text(path):
            told = f"is text, required a recording; give the recording first, its words with --transcript {path}"
            raise InputError(f"{path}: {told}") from error
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: not a readable recording ({reason}); give an audio or video file") from error


def _checked(path: Path, audio: Audio) -> Audio:
    if audio.duration_s < SHORTEST_S:
        raise InputError(f"{path}: holds {audio.duration_s * 1000:.0f} ms of sound, required at least 100 ms")
    if not np.isfinite([audio.samples.min(), audio.samples.max()]).all():  # which needs no further array
        raise InputError(f"{path}: holds samples that are not finite (NaN or infinite); export the recording again")
    return audio


class _Wave(mmap.mmap):
    """A WAVE file as it is read: from ``start`` on, where a header of ours is; the file itself stays as it is."""

    name = ""
    start = 0

    def seek(self, place: int, whence: int = 0) -> None:
        base = (self.start, super().tell(), len(self))[whence]
        super().seek(min(max(base + place, self.start), len(self)))

    def tell(self) -> int:
        return super().tell() - self.start


def _corrected_wave(path: Path) -> _Wave | None:
    """Return a WAVE file under a header that FFmpeg understands; None: its own is one, or it is no WAVE file.

    FFmpeg reads samples of as many bits as are valid, without the zeros that fill their container: 24 bits in 32 as 24,
    20 as another format, 17 as 24. It also loses its way at a chunk of odd length that no byte follows.
    Raises ValueError: numbers with the high byte first, which FFmpeg would read as the other ones.
    """
    with path.open("rb") as file:
        kind = file.read(4)
        if kind == b"RIFX":
            raise ValueError("a WAVE file with the high byte first (RIFX); export it as .wav or .flac")
        if kind not in {b"RIFF", b"RF64", b"BW64", b"riff"}:
            return None
        whole = _Wave(file.fileno(), 0, access=mmap.ACCESS_COPY)
    form, body, size, moved = _sound_of_wave(whole)
    if len(form) < 16:
        return None
    coding, channels, rate_hz, per_second, block, bits = struct.unpack_from("<HHIIHH", form)
    valid = bits
    if coding == EXTENSIBLE:
        whole_form = len(form) >= 40
        valid, coding = struct.unpack_from("<H4xH", form, 18) if whole_form else (-1, PCM)
    least = -(-bits // 8) * channels
    frame = block if block * rate_hz == per_second and block >= least else least
    if coding not in {PCM, FLOAT} or not channels or frame % channels:
        return None
    container = 8 * frame // channels
    if not moved and bits == container and valid in {0, container}:
        return None
    size = min(size or len(whole), len(whole) - body)
    header = struct.pack("<HHIIHH", coding, channels, rate_hz, frame * rate_hz, frame, container)
    lengths = [min(length, 0xFFFFFFFF) for length in (36 + size, size)]
    header = struct.pack("<4sI8sI16s4sI", b"RIFF", lengths[0], b"WAVEfmt ", 16, header, b"data", lengths[1])
    whole.start, whole.name = body - len(header), str(path)
    whole[whole.start : body] = header
    whole.seek(0)
    return whole


def _sound_of_wave(whole: _Wave) -> tuple[bytes, int, int, bool]:
    """Return the content of the chunk of the form, where the samples are, how many bytes of them, and whether a chunk
    of odd length lacks the byte after it. The form is empty where there is none, or there are no samples."""
    long = whole[:4] == b"riff"  # Sony's Wave64: 16 bytes of a name, 8 of a length that counts itself
    head, body, name, size = (24 if long else 8), (40 if long else 12), b"", 0
    form, stated, moved = b"", 0, False
    while name != b"data":
        place = body + size + (-size % 8 if long else size % 2)
        if not long and size % 2 and whole[body + size : body + size + 4] in {b"fmt ", b"data", b"LIST", b"fact"}:
            place, moved = body + size, True
        if size < 0 or place + head > len(whole):
            return b"", 0, 0, False
        body, name = place + head, whole[place : place + 4]
        (size,) = struct.unpack_from("<16xQ" if long else "<4xI", whole, place)
        size -= 24 if long else 0
        if name == b"fmt ":
            form = whole[body : body + size]
        elif name == b"ds64":
            stated = int.from_bytes(whole[body + 8 : body + 16], "little")
    return form, body, stated or size, moved
