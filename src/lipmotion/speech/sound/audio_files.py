"""Sound read from files: any common container, or the sound track of a video, to one channel at 16 kHz."""

from __future__ import annotations

import logging
import mmap
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.storage.sources import check_source, is_text, list_video, open_media, read_duration
from lipmotion.types import SPEECH_RATE_HZ, Audio

HOLE_S = 0.04
"""A frame this much later than the end of the one before leaves a hole; time stamps are rounded to 1 ms or better."""
LONGEST_HOLE_S = 600.0  # a hole longer than this means that the time stamps are wrong
MAX_SILENCE_RATIO = 20.0
"""All holes together may last as long as the longest one allowed, and this many times the sound: a codec that sends
nothing in pauses still sends 20 ms of every 400. More silence than that is no recording, but would fill the memory."""
MIN_BYTES_PER_S = 20.0
"""Bytes of the file that every second takes at least, not counting as long as the longest hole allowed: no codec for
speech needs less than 56, digital silence in FLAC 27. A small file must not fill the memory with sound."""
LOWEST_HZ, HIGHEST_HZ = 4000, 1_000_000
"""Lowest and highest sampling rate: below, speech is not intelligible; no recorder samples at a higher one."""
MAX_CHANNELS = 64
AGAIN = "export the recording again"
UNTIMED = ("aac", "ac3", "avi", "eac3", "loas", "mp3", "wav")
DELAYS = {"aac": 1024, "ac3": 256, "eac3": 256, "mp2": 481, "mp3": 1105}
"""Samples by which encoder and decoder delay sound (AAC at least; MP3 by LAME and FFmpeg), which such formats keep."""
PIECE_BYTES = 1 << 20  # sound is collected in pieces of this size, and without digital silence
LOG = logging.getLogger("lipmotion")
SHORTEST_S = 0.1  # shorter recordings hold no sentence; the features need 25 ms around every frame
CANCELLED_SHARE = 0.2
"""The mean of channels must have this share of the energy of unlike ones; else they cancel one another."""
USABLE_SHARE = 0.5  # a damaged recording is refused when less than this share of its sound can be decoded
MIN_HOLES_S = 0.005  # holes that last less together are not mentioned: they would be rounded to 0
CUT_SHORT_SHARE, ROUNDED_S, STATED = 0.9, 0.5, ("flac", "aiff", "mov,mp4,m4a,3gp,3g2,mj2")
"""A recording is called cut short when it holds less than this share of the duration that it states, or so many seconds
less in a format that states it exactly."""
HEADS = {"aiff": 8, "asf": 0, "caf": 0, "flv": 0, "mov,mp4,m4a,3gp,3g2,mj2": 4, "tta": 0}
"""Formats of which FFmpeg reads the first of several joined files, and where eight bytes begin that all heads share."""
GUESSED = ("aac", "ac3", "amr", "dts", "eac3")  # formats without a length, at which FFmpeg guesses by the first packets
PCM, FLOAT, EXTENSIBLE = 1, 3, 0xFFFE
"""Forms of samples in a WAVE file; the last one says its form, and how many bits are valid, in a longer header."""
UNKNOWN_SIZES = range(0x7FFF0000, 0x1_0000_0000)
"""Sizes in bytes with which programs begin a WAVE file whose end they do not know, besides 0."""


def check_sound_format(name: str, rate_hz: int, channels: int) -> None:
    """Raise InputError for a sampling rate or channels that no recorder has: a wrong header could fill the memory."""
    if not LOWEST_HZ <= rate_hz <= HIGHEST_HZ:
        raise InputError(f"{name}: sampled at {rate_hz} Hz, required {LOWEST_HZ} to {HIGHEST_HZ}; {AGAIN}")
    if not 1 <= channels <= MAX_CHANNELS:
        raise InputError(f"{name}: has {channels} channels, required 1 to {MAX_CHANNELS}; {AGAIN}")


class _TrackDecoder:
    """Decodes one track; ``channel`` None: to the mean of its channels. Energies do not count what is constant.

    The sound so far is in ``_pieces``, each with the number of samples before it. Digital silence, and that which fills
    holes, is left out until the end: memory that nobody writes to costs nothing.
    """

    def __init__(self, container: Any, rate_hz: int, channel: int | None) -> None:
        self._container = container
        self._name = container.name.removeprefix("file:")
        self._stream = stream = container.streams.audio[0]
        says = container.format.name == "mp3" and stream.start_time  # its first frame; the delay is left out then
        is_untimed = container.format.name in UNTIMED and not says
        self._delay = DELAYS.get(stream.codec_context.codec.canonical_name, 0) if is_untimed else 0
        self.rate_hz, self._channel = rate_hz, channel
        self._pieces = [(0, bytearray())]
        self._resampler: Any = None
        self._form: tuple[Any, ...] = ()
        self._layout: Any = None
        self._clock_s: float | None = None
        self._energies: NDArray[np.float64] | float = 0.0
        self._sums: NDArray[np.float64] | float = 0.0
        self.note = ""
        self.mean_energy = self.silence_s = self._sound_s = 0.0
        self.packets = self.damaged = self._size = self._count = self._cut = 0

    def decode(self) -> None:
        """Decode the track; can be called once."""
        import av

        for packet in self._demux():
            self.packets += packet.size > 0
            self._size += packet.size
            try:
                frames = packet.decode()
            except av.FFmpegError:
                self.damaged += 1
                continue
            for frame in frames:
                check_sound_format(self._name, frame.sample_rate, frame.layout.nb_channels)
                self._sound_s += frame.samples / frame.sample_rate
                self._check_length(self._sound_s)
                self._place(frame)
                form = (frame.format.name, frame.layout.name, frame.sample_rate)
                if self._resampler is None or form != self._form:  # tracks joined end to end may change
                    self._flush()
                    self._form, self._layout = form, self._layout or frame.layout.name
                    self._resampler = av.AudioResampler(format="flt", layout=self._layout, rate=self.rate_hz)
                frame.pts = None
                self._add(self._resampler.resample(frame))
        self._flush()
        self._check_silence()
        samples = np.zeros(self._count, np.float32)
        while self._pieces:  # each is freed when it is copied
            first, piece = self._pieces.pop()
            samples[first : first + len(piece) // 4] = np.frombuffer(piece, np.float32)
        kind, starts = self._container.format.name, self._stream.start_time
        has_own = self._stream.duration and kind != "asf"  # which states that of the longest of its tracks
        is_stated = (has_own or not self._container.streams.video) and kind not in GUESSED
        is_stated = is_stated and (kind != "mp3" or starts)  # a header that states the length begins after the delay
        stated_s = read_duration(self._container, self._stream) if is_stated else 0.0
        rounded_s = ROUNDED_S if kind in STATED else (1 - CUT_SHORT_SHARE) * stated_s
        if kind == "caf" and self._stream.codec_context.name.startswith("pcm"):
            stated_s, rounded_s = self._stream.frames / self._stream.rate, 0.0  # its duration is that of the file
        missing_s = stated_s - len(samples) / self.rate_hz
        self.samples = samples[self._cut :]
        with np.errstate(all="ignore"):  # samples that are not finite are refused later
            constant = np.square(self._sums) / max(self._count, 1)
            self.energies = np.atleast_1d(np.maximum(self._energies - constant, 0)).tolist()
            self.mean_energy -= float(np.mean(self._sums)) ** 2 / max(self._count, 1)
        self.missing_s = missing_s if missing_s > rounded_s else 0.0

    def _demux(self) -> Iterator[Any]:
        """Yield the packets; those of an MP3 without the tags, and pictures, between files that were joined."""
        tag_end = 0
        for packet in self._container.demux(self._stream):
            head = bytes(packet)[:10] if self._container.format.name == "mp3" else b""
            if head[:3] == b"ID3":
                tag_end = packet.pos + sum(byte << 7 * (9 - at) for at, byte in enumerate(head[6:], 6))
            if (packet.pos or 0) < tag_end or head[:8] == b"APETAGEX":
                self._clock_s = None
            else:
                yield packet

    def _place(self, frame: Any) -> None:
        """Note a hole before a frame that starts later than the one before it ended."""
        if frame.pts is not None:
            time_s = float(frame.pts * frame.time_base)
            if self._clock_s is None:
                offset_s = time_s - (self._container.start_time or 0) / 1e6 if list_video(self._container) else 0.0
                offset_s -= self._delay / frame.sample_rate
                self._count += self._silence(max(offset_s, 0.0))
                self._cut = max(round(-offset_s * self.rate_hz), 0)
            elif time_s - self._clock_s > HOLE_S:
                self._flush()
                self.silence_s += time_s - self._clock_s
                self._count += self._silence(time_s - self._clock_s)
            if self._clock_s is None or abs(time_s - self._clock_s) > HOLE_S:
                self._clock_s = time_s
        if self._clock_s is not None:
            self._clock_s += frame.samples / frame.sample_rate

    def _silence(self, duration_s: float) -> int:
        """Return the number of samples of a hole's silence. Raises InputError: the hole is too long."""
        if duration_s > LONGEST_HOLE_S:
            what = f"{self._name}: the time stamps of its sound jump by {duration_s:.0f} s,"
            raise InputError(f"{what} at most {LONGEST_HOLE_S:.0f} s are bridged; {AGAIN}")
        return round(duration_s * self.rate_hz)

    def _check_silence(self) -> None:
        max_s = LONGEST_HOLE_S + MAX_SILENCE_RATIO * self._sound_s
        if self.silence_s > max_s:
            what = f"{self._name}: the time stamps of its sound leave holes of {self.silence_s:.0f} s beside"
            raise InputError(f"{what} {self._sound_s:.1f} s of sound, at most {max_s:.0f} s are bridged; {AGAIN}")
        self._check_length(self._sound_s + self.silence_s)

    def _check_length(self, length_s: float) -> None:
        max_s = LONGEST_HOLE_S + self._size / MIN_BYTES_PER_S
        if length_s > max_s:
            what = f"{self._name}: {self._size} bytes of sound last {length_s:.0f} s,"
            raise InputError(f"{what} required at most {max_s:.0f} s ({MIN_BYTES_PER_S:.0f} bytes a second); {AGAIN}")

    def _flush(self) -> None:
        if self._resampler is not None:
            self._add(self._resampler.resample(None))
        self._resampler = None

    def _add(self, frames: list[Any]) -> None:
        for frame in frames:
            # packed, not planar: PyAV reads beyond the planes of eight channels
            channels = frame.to_ndarray().reshape(frame.samples, -1)
            with np.errstate(all="ignore"):  # samples that are not finite are refused when all is decoded
                mean = channels.mean(axis=1)
                self._energies = self._energies + np.square(channels, dtype=np.float64).sum(axis=0)
                self._sums = self._sums + channels.sum(axis=0, dtype=np.float64)
                self.mean_energy += float(np.square(mean, dtype=np.float64).sum())
            chosen = mean if self._channel is None else channels[:, self._channel]
            if chosen.any():
                first, piece = self._pieces[-1]
                if first + len(piece) // 4 < self._count or len(piece) > PIECE_BYTES:
                    piece = bytearray()
                    self._pieces.append((self._count, piece))
                piece += np.ascontiguousarray(chosen).data
            self._count += len(chosen)


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
    sound, level = _decode(path, rate_hz, None), logging.WARNING if warn else logging.DEBUG
    count = len(sound.energies)
    if sound.mean_energy < CANCELLED_SHARE * sum(sound.energies) / max(count, 1) ** 2:
        loudest = int(np.argmax(sound.energies))
        what = "%s: its %d channels cancel one another in their mean; channel %d, the loudest, is used"
        LOG.log(level, what, path, count, loudest + 1)
        sound = _decode(path, rate_hz, loudest)
    if sound.note:
        LOG.log(level, "%s: %s", path, sound.note)
    damage = f"{sound.damaged} of {sound.packets} packets of sound cannot be decoded"
    if sound.damaged > (1 - USABLE_SHARE) * sound.packets:
        raise InputError(f"{path}: damaged: {damage}; required: at least half of them; {AGAIN}")
    if sound.damaged or sound.silence_s >= SHORTEST_S:
        holes = f"; holes of {sound.silence_s:.2f} s became silence" if sound.silence_s >= MIN_HOLES_S else ""
        LOG.log(level, "%s: damaged: %s%s", path, damage, holes)
    audio = Audio(sound.samples, rate_hz)
    if sound.missing_s >= SHORTEST_S:
        what = "%s: cut short: it states %.1f s of sound and holds %.1f s; the last %.1f s are missing"
        LOG.log(level, what, path, audio.duration_s + sound.missing_s, audio.duration_s, sound.missing_s)
    if audio.duration_s < SHORTEST_S:
        raise InputError(f"{path}: holds {audio.duration_s * 1000:.0f} ms of sound, required at least 100 ms")
    if not np.isfinite([audio.samples.min(), audio.samples.max()]).all():  # which needs no further array
        raise InputError(f"{path}: holds samples that are not finite (NaN or infinite); {AGAIN}")
    return audio


def _decode(path: Path, rate_hz: int, channel: int | None) -> _TrackDecoder:
    import av

    try:
        content, missing_s, note = _correct_wave(path)
        with open_media(path, content=content) as container:
            if not container.streams.audio:
                raise InputError(f"{path}: has no sound track; give a recording with sound")
            stream = container.streams.audio[0]
            if stream.codec_context is None:
                raise InputError(f"{path}: its sound is coded in an unknown way; export it as .wav or .flac")
            check_sound_format(str(path), stream.rate or 0, stream.channels or 0)
            if len(container.streams.audio) > 1:
                LOG.warning("%s: the first of %d sound tracks is used", path, len(container.streams.audio))
            if container.format.name == "ogg" and path.read_bytes().rpartition(b"OggS")[2][1:2] < b"\4":  # RFC 3533
                LOG.warning("%s: its last page is not marked as the last: it may be cut short", path)
            sound = _TrackDecoder(container, rate_hz, channel)
            sound.decode()
            sound.missing_s, sound.note = max(missing_s, sound.missing_s), note
            if (first := HEADS.get(container.format.name, -1)) >= 0:
                with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as whole:
                    if whole.find(whole[first : first + 8], first + 8) > 0:
                        sound.note = "other recordings are joined to its end, which are not read; give each by itself"
            return sound
    except (av.FFmpegError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        if is_text(path):
            what = "an audio or video file, whose words may be its transcript"
            raise InputError(f"{path}: is text, required a recording: {what}") from error
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: not a readable recording ({reason}); give an audio or video file") from error


class _Wave(mmap.mmap):
    """A WAVE file as it is read: from ``start`` on, where a header of ours is; the file itself stays as it is."""

    name = ""
    start = 0

    def seek(self, place: int, whence: int = 0) -> None:
        base = (self.start, super().tell(), len(self))[whence]
        super().seek(min(max(base + place, self.start), len(self)))

    def tell(self) -> int:
        return super().tell() - self.start


def _correct_wave(path: Path) -> tuple[_Wave | None, float, str]:
    """Return a WAVE file under a header for FFmpeg (None: its own will do), the seconds that it lacks, and a note.

    FFmpeg reads samples of as many bits as are valid, without the zeros that fill their container; it loses its way at
    a chunk of odd length that no byte follows, and reads one of several pieces of sound. Raises ValueError: RIFX.
    """
    with path.open("rb") as file:
        kind = file.read(4)
        if kind == b"RIFX":
            raise ValueError("a WAVE file with the high byte first (RIFX); export it as .wav or .flac")
        if kind not in {b"RIFF", b"RF64", b"BW64", b"riff"}:
            return None, 0.0, ""
        content = _Wave(file.fileno(), 0, access=mmap.ACCESS_COPY)
    form, body, size, rewritten, note = _find_wave_sound(content)
    if len(form) < 16:
        return None, 0.0, ""
    coding, channels, rate_hz, per_second, block, bits = struct.unpack_from("<HHIIHH", form)
    valid, missing = bits, 0 if size in UNKNOWN_SIZES else max(body + size - len(content), 0)
    size = min(size or len(content), len(content) - body)
    if coding == EXTENSIBLE:
        valid, coding = struct.unpack_from("<H4xH", form, 18) if len(form) >= 40 else (-1, PCM)
    min_frame = -(-bits // 8) * channels
    frame = block if block * rate_hz == per_second and block >= min_frame else min_frame
    missing_s = missing / max(frame * rate_hz if coding in {PCM, FLOAT} else per_second, 1)
    if not (channels and frame) or frame % channels:
        return None, missing_s, note
    if is_plain := coding in {PCM, FLOAT}:
        spans = np.frombuffer(content, np.uint8, size // frame * frame, body).reshape(-1, frame // channels)
        if bits and spans[:, : (frame - min_frame) // channels].any():  # no zeros fill a container
            note = f"its header states {frame} bytes a frame, and its samples fill {min_frame}: so many are read"
            frame = min_frame
        container = 8 * frame // channels
        form = struct.pack("<HHIIHH", coding, channels, rate_hz, frame * rate_hz, frame, container)
    if not rewritten and (not is_plain or ((bits, per_second) == (container, frame * rate_hz) and valid in {0, bits})):
        return None, missing_s, note
    lengths = [min(length, 0xFFFFFFFF) for length in (20 + len(form) + size, size)]
    header = struct.pack("<4sI8sI", b"RIFF", lengths[0], b"WAVEfmt ", len(form)) + form
    header += struct.pack("<4sI", b"data", lengths[1])
    content.start, content.name = body - len(header), str(path)
    content[content.start : body] = header
    content.seek(0)
    return content, missing_s, note


def _find_wave_sound(content: _Wave) -> tuple[bytes, int, int, bool, str]:
    """Return the form (empty: no sound), where the samples are, how many bytes, if FFmpeg misses some, and a note."""
    form, body, size, reached, pieces, rewritten = b"", 0, 0, 0, 0, False
    for name, place, length, unpadded in _iterate_wave_chunks(content):
        if name == b"fmt " and form not in (b"", content[place : place + length]):
            break  # another recording behind this one
        if name == b"fmt ":
            form = content[place : place + length]
        elif name == b"ds64":
            size = int.from_bytes(content[place + 8 : place + 16], "little")
            rewritten = not size  # what was recorded was not finished
        elif name == b"data" and not pieces:
            body, size, pieces, rewritten = place, size or length, 1, rewritten or unpadded
        elif name == b"data":
            length = min(length, len(content) - place)  # noqa: PLW2901
            content.move(body + size, place, length)
            size, pieces, rewritten = size + length, pieces + 1, True
        reached = place + length
    per_second = max(int.from_bytes(form[8:12], "little"), 1)
    more = len(content[reached : reached + PIECE_BYTES].strip(b"\0")) if size else 0
    note = f"its sound is in {pieces} pieces, which are joined" if pieces > 1 else ""
    if more > max(size * (1 - CUT_SHORT_SHARE), SHORTEST_S * per_second):
        what = f"its header states {size / per_second:.1f} s of sound, and more bytes follow than it names"
        note = f"{what}: they are not read; {AGAIN} if its end is missing"
    return form if pieces else b"", body, size, rewritten, note


def _iterate_wave_chunks(content: _Wave) -> Iterator[tuple[bytes, int, int, bool]]:
    """Yield the name of each chunk, where its content is, how long, and whether a chunk of odd length so far lacks the
    byte after it. What follows a piece of sound whose length is not stated has no chunks."""
    long = content[:4] == b"riff"  # Sony's Wave64: 16 bytes of a name, 8 of a length that counts itself
    head, body, size, unpadded = (24 if long else 8), (40 if long else 12), 0, False
    while True:
        place = body + size + (-size % 8 if long else size % 2)
        if not long and size % 2 and content[body + size : body + size + 4] in {b"fmt ", b"data", b"LIST", b"fact"}:
            place, unpadded = body + size, True
        if size < 0 or place + head > len(content):
            return
        body, name = place + head, content[place : place + 4]
        (size,) = struct.unpack_from("<16xQ" if long else "<4xI", content, place)
        size = (16 if long else 4) if name in {b"RIFF", b"riff"} else size - (24 if long else 0)  # another file
        if not all(31 < letter < 127 for letter in name):
            return
        yield name, body, size, unpadded
        if name == b"data" and not size:
            return
