"""``LipSync`` around the audio output of LiveKit agents: sound is unchanged, motion is sent in time with it."""

from __future__ import annotations

import asyncio
import json
from collections import deque
from collections.abc import AsyncIterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("livekit.agents", exc_type=ImportError)

from livekit import rtc
from livekit.agents import Agent, AgentSession
from livekit.agents.types import USERDATA_TIMED_TRANSCRIPT
from livekit.agents.voice.io import AudioOutput, AudioOutputCapabilities, TimedString

from agents import CLOSED_S, MAMA_S, Client, in_no_time, make_vowel, read_speech
from lipmotion import LiveFrame
from lipmotion.errors import InputError
from lipmotion.live.livekit import LipSync


def frames_of(sound: np.ndarray, sizes: list[int], rate_hz: int = 16_000) -> list[rtc.AudioFrame]:
    frames: list[rtc.AudioFrame] = []
    place = 0
    while place < len(sound):
        piece = sound[place : place + sizes[len(frames) % len(sizes)]]
        frames.append(rtc.AudioFrame(piece.tobytes(), rate_hz, sound.shape[1], len(piece)))
        place += len(piece)
    return frames


async def speak(output: AudioOutput, frames: list[rtc.AudioFrame]) -> None:
    for frame in frames:
        await output.capture_frame(frame)
    output.flush()


class Loudspeaker(AudioOutput):
    """A sink that plays in the time of the loop, and notes when which sound is heard."""

    def __init__(self) -> None:
        super().__init__(label="Loudspeaker", capabilities=AudioOutputCapabilities(pause=True))
        self.heard: list[tuple[float, rtc.AudioFrame]] = []
        self._coming: deque[rtc.AudioFrame] = deque()
        self._ended, self._interrupted, self._going = False, False, asyncio.Event()
        self._going.set()
        self._playing: asyncio.Task[None] | None = None

    async def capture_frame(self, frame: rtc.AudioFrame) -> None:
        if self._playing is not None and self._ended:
            await self._playing
        await super().capture_frame(frame)
        self._coming.append(frame)
        if self._playing is None or self._playing.done():
            self._ended = self._interrupted = False
            self._playing = asyncio.create_task(self._play())

    def flush(self) -> None:
        super().flush()
        self._ended = True

    def clear_buffer(self) -> None:
        self._coming.clear()
        self._interrupted = True

    def pause(self) -> None:
        self._going.clear()

    def resume(self) -> None:
        self._going.set()

    async def _play(self) -> None:
        position_s, clock = 0.0, asyncio.get_running_loop()
        self.on_playback_started(created_at=0.0)
        while self._coming or not self._ended:
            await self._going.wait()
            if not self._coming:
                await asyncio.sleep(0.001)
                continue
            frame = self._coming.popleft()
            self.heard.append((clock.time(), frame))
            await asyncio.sleep(frame.duration)
            position_s += frame.duration
        self.on_playback_finished(playback_position=position_s, interrupted=self._interrupted)


class Viewer(Client):
    """Notes when motion comes, and what of it is to be shown now."""

    def __init__(self) -> None:
        super().__init__()
        self.came: list[tuple[float, bool, list[LiveFrame]]] = []

    def take(self, frames: list[LiveFrame], now: bool) -> None:
        now_s = asyncio.get_running_loop().time()
        self.receive([{"time_s": frame.time_s, "came_s": now_s, "opening": frame["opening"]} for frame in frames])
        self.came.append((now_s, now, frames))

    def rests(self) -> list[tuple[float, list[LiveFrame]]]:
        """Return when frames of rest came in the midst of speech, and which."""
        rests = [(time_s, frames) for time_s, now, frames in self.came if now and time_s > 1.0 and len(frames) == 5]
        return [each for each in rests if each[1][-1]["viseme_sil"] > 0.999 and each[1][-1]["opening"] < 0.005]


def bytes_of(frames: list[rtc.AudioFrame]) -> bytes:
    return b"".join(bytes(frame.data) for frame in frames)


@pytest.mark.parametrize(("rate_hz", "channels", "sizes"), [(16_000, 1, [1_600]), (24_000, 2, [24_000, 11, 4_800])])
@in_no_time
async def test_sound_is_unchanged_and_motion_is_in_time(rate_hz: int, channels: int, sizes: list[int]) -> None:
    viewer, sink = Viewer(), Loudspeaker()
    lips = LipSync(sink, on_frames=viewer.take)
    speech = read_speech(rate_hz, channels)
    spoken = frames_of(speech[: 2 * rate_hz + 77], sizes, rate_hz), frames_of(speech[:rate_hz], sizes, rate_hz)
    for utterance in spoken:
        await speak(lips, utterance)
        event = await lips.wait_for_playout()
        assert not event.interrupted
        assert event.playback_position == pytest.approx(sum(frame.duration for frame in utterance))
        await asyncio.sleep(0.5)
    assert [id(frame) for _, frame in sink.heard] == [id(frame) for utterance in spoken for frame in utterance]
    sound_s = 0.0
    for heard_s, frame in sink.heard:
        assert viewer.covers(sound_s, sound_s + frame.duration)
        for motion in viewer.frames:
            if sound_s - 1e-6 <= motion["time_s"] < sound_s + frame.duration - 1e-6:
                assert -0.21 < motion["came_s"] - (heard_s + motion["time_s"] - sound_s) < 0.01
        sound_s += frame.duration
    assert [frames[0].time_s for _, now, frames in viewer.came if now] == pytest.approx([0, 2 + 77 / rate_hz])
    await lips.aclose()


@in_no_time
async def test_motion_goes_to_the_room() -> None:
    packets: list[dict[str, Any]] = []

    async def publish_data(payload: str, *, topic: str) -> None:
        assert topic == "lipmotion"
        packets.append(json.loads(payload))

    lips = LipSync(Loudspeaker(), room=SimpleNamespace(local_participant=SimpleNamespace(publish_data=publish_data)))  # type: ignore[arg-type]
    await speak(lips, frames_of(read_speech()[:16_000], [3_200]))
    await lips.wait_for_playout()
    await asyncio.sleep(0.2)
    assert [packet["now"] for packet in packets] == [True] + [False] * (len(packets) - 1)
    assert sum(len(packet["frames"]) for packet in packets) == 55
    assert packets[-1]["frames"][-1]["weights"]["viseme_sil"] > 0.99
    with pytest.raises(InputError, match="where should motion go"):
        LipSync(Loudspeaker())


@in_no_time
async def test_words_that_come_with_their_times_are_said() -> None:
    words = [TimedString("mama ", start_time=MAMA_S[0]), TimedString("oh", start_time=MAMA_S[1], end_time=1.4)]
    for given in ([], words):
        viewer = Viewer()
        lips = LipSync(Loudspeaker(), on_frames=viewer.take)
        frames = frames_of(make_vowel(1.6), [4_000])
        frames[0].userdata[USERDATA_TIMED_TRANSCRIPT] = given
        await speak(lips, frames)
        await lips.wait_for_playout()
        closed = {round(frame.time_s, 2): frame["viseme_PP"] > 0.8 for _, _, came in viewer.came for frame in came}
        assert [closed[time_s] for time_s in CLOSED_S] == [bool(given)] * 2
        await lips.aclose()


@in_no_time
async def test_an_output_that_does_not_tell_when_it_is_heard_is_named(caplog: pytest.LogCaptureFixture) -> None:
    sink = Loudspeaker()
    sink.on_playback_started = lambda **_: None  # type: ignore[method-assign]
    lips = LipSync(sink, on_frames=lambda *_: None)
    await speak(lips, frames_of(read_speech()[:16_000], [1_600]))
    await lips.wait_for_playout()
    assert "on_playback_started" in caplog.text


@in_no_time
async def test_a_pause_rests_and_goes_on() -> None:
    viewer, sink = Viewer(), Loudspeaker()
    lips = LipSync(sink, on_frames=viewer.take)
    await speak(lips, frames_of(read_speech()[:48_000], [1_600]))
    await asyncio.sleep(1.05)
    lips.pause()
    await asyncio.sleep(3.0)
    (came_s, frames), *_ = viewer.rests()
    assert came_s == pytest.approx(1.05)
    assert viewer.came[-1][2] == frames
    lips.resume()
    await lips.wait_for_playout()
    await asyncio.sleep(0.2)
    assert viewer.frames[-1]["time_s"] == pytest.approx(3.08)
    assert np.abs(np.diff([frame["opening"] for frame in viewer.frames])).max() < 0.12


@pytest.mark.parametrize("seed", range(10))
@in_no_time
async def test_random_pieces_and_interruptions(seed: int) -> None:
    rng, speech, viewer, sink = np.random.default_rng(seed), read_speech(), Viewer(), Loudspeaker()
    lips = LipSync(sink, on_frames=viewer.take)
    clock = asyncio.get_running_loop()
    for _ in range(10):
        start = int(rng.integers(len(speech) - 8_000))
        frames = frames_of(speech[start : start + int(rng.integers(1, 8_000))], rng.integers(1, 6_000, 5).tolist())
        before, interrupted = len(sink.heard), rng.random() < 0.5
        for frame in frames[: rng.integers(1, len(frames) + 1) if interrupted else None]:
            await lips.capture_frame(frame)
            await asyncio.sleep(rng.choice([0.0, 0.0, frame.duration / 3]))
        if interrupted and rng.random() < 0.5:
            await asyncio.sleep(rng.random() * 0.2)
            lips.clear_buffer()
            lips.flush()
        else:
            lips.flush()
            if interrupted:
                await asyncio.sleep(rng.random() * 0.2)
                lips.clear_buffer()
        cleared_s = clock.time()
        await lips.wait_for_playout()
        await asyncio.sleep(rng.choice([0.0, 0.3]))
        if interrupted:  # nothing comes after the frames of rest, which come at once
            later = [frames for came_s, _, frames in viewer.came if came_s > cleared_s + 1e-3]
            assert not later
        else:
            assert bytes_of([frame for _, frame in sink.heard[before:]]) == bytes_of(frames)
    await asyncio.sleep(0.3)
    assert viewer.came[-1][2][-1]["viseme_sil"] > 0.99
    times = [frame["time_s"] for frame in viewer.frames]
    assert np.diff(times).max() < 0.0201
    await lips.aclose()


@in_no_time
async def test_a_session_speaks_with_it_and_is_interrupted() -> None:
    viewer, sink = Viewer(), Loudspeaker()
    session: AgentSession[None] = AgentSession()
    await session.start(Agent(instructions="Speak."))
    session.output.audio = LipSync(sink, on_frames=viewer.take)

    async def speech() -> AsyncIterator[rtc.AudioFrame]:
        for frame in frames_of(read_speech()[:48_000], [3_200]):
            yield frame

    await session.say("Welcome.", audio=speech())
    assert sum(frame.duration for _, frame in sink.heard) == pytest.approx(3.0)
    assert viewer.covers(0.0, 3.0)
    handle = session.say("Welcome.", audio=speech())
    await asyncio.sleep(1.5)
    assert not viewer.rests()
    handle.interrupt()
    await handle
    (_, frames), *_ = viewer.rests()
    assert 3.5 < frames[0].time_s < 4.6
    count = len(viewer.came)
    await asyncio.sleep(2.0)
    assert len(viewer.came) == count
    await session.aclose()
