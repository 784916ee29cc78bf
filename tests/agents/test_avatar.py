"""A face as the video of a LiveKit agent: in step with its sound, at rest when interrupted, with the real runner."""

from __future__ import annotations

import asyncio
import itertools
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("livekit.agents", exc_type=ImportError)

from livekit import rtc
from livekit.agents.voice.avatar import AudioSegmentEnd, AvatarRunner, QueueAudioOutput

from agents import in_no_time, read_speech, run
from agents.test_livekit import bytes_of, frames_of, speak
from lipmotion import Stream
from lipmotion_agents.livekit_video import PICTURES_WAITING, AvatarVideo


def picture_of(frame: rtc.VideoFrame) -> np.ndarray:
    return np.frombuffer(frame.data, np.uint8).reshape(frame.height, frame.width, 3).astype(float)


async def read(video: AvatarVideo, pictures: int) -> list[Any]:
    """Return what comes with some pictures."""
    items: list[Any] = []
    async for item in video:
        items.append(item)
        pictures -= isinstance(item, rtc.VideoFrame)
        if pictures < 0:
            return items[:-1]
    return items


@in_no_time
async def test_pictures_are_in_step_with_the_sound() -> None:
    video, sound = AvatarVideo("cartoon", size=96, sample_rate=16_000, seed=None), read_speech()[8_000:31_000]
    for frame in frames_of(sound, [1_600, 77]):
        await video.push_audio(frame)
    await video.push_audio(AudioSegmentEnd())
    items = await read(video, 40)
    kinds = [type(item) for item in items]
    assert kinds[: PICTURES_WAITING + 2] == [rtc.VideoFrame] * (PICTURES_WAITING + 1) + [rtc.AudioFrame]
    chunks = [item for item in items if isinstance(item, rtc.AudioFrame)]
    assert bytes_of(chunks) == sound.tobytes()
    assert {chunk.duration for chunk in chunks[:-1]} == {0.04}
    assert kinds.count(AudioSegmentEnd) == 1
    assert kinds.index(AudioSegmentEnd) > items.index(chunks[-1])

    pictures = [picture_of(item) for item in items if isinstance(item, rtc.VideoFrame)]
    changed = [np.abs(picture - pictures[-1]).mean() for picture in pictures]
    stream = Stream(look_ahead_ms=320)
    frames = stream.push(sound) + stream.flush()
    opening = [frame["opening"] for frame in frames[::2]]
    assert np.corrcoef(changed[: len(opening)], opening)[0, 1] > 0.8
    assert changed[len(opening) + 3 :] == [0.0] * (40 - len(opening) - 3)


@in_no_time
async def test_an_interruption_rests_and_its_sound_is_forgotten() -> None:
    video = AvatarVideo("cartoon", size=96, sample_rate=16_000, seed=None)
    (resting,) = [picture_of(item) for item in await read(video, 1)]
    for frame in frames_of(read_speech()[8_000:24_000], [1_600]):
        await video.push_audio(frame)
    await read(video, 15)
    video.clear_buffer()
    items = await read(video, 10)
    assert {type(item) for item in items} == {rtc.VideoFrame}
    assert np.array_equal(picture_of(items[3]), resting)
    sound = read_speech()[8_000:16_000]
    for frame in frames_of(sound, [1_600]):
        await video.push_audio(frame)
    await video.push_audio(AudioSegmentEnd())
    items = await read(video, 20)
    assert bytes_of([item for item in items if isinstance(item, rtc.AudioFrame)]) == sound.tobytes()


@in_no_time
async def test_eyes_and_head_move_in_silence() -> None:
    pictures = [picture_of(item) for item in await read(AvatarVideo("cartoon", size=96, sample_rate=16_000), 40)]
    assert sum(not np.array_equal(*pair) for pair in itertools.pairwise(pictures)) > 20


def test_the_runner_publishes_it() -> None:
    async def subscribed() -> None:
        return None

    async def publish_track(track: Any, options: Any) -> Any:
        return SimpleNamespace(wait_for_subscription=subscribed, track=track, options=options)

    async def work() -> None:
        video, output = AvatarVideo("cartoon", size=96, sample_rate=16_000), QueueAudioOutput(sample_rate=16_000)
        room = SimpleNamespace(
            on=lambda *_: None,
            off=lambda *_: None,
            isconnected=lambda: True,
            local_participant=SimpleNamespace(publish_track=publish_track),
        )
        runner = AvatarRunner(room, audio_recv=output, video_gen=video, options=video.options)  # type: ignore[arg-type]
        await runner.start()
        await speak(output, frames_of(read_speech()[8_000:16_000], [1_600]))
        event = await output.wait_for_playout()
        assert (event.interrupted, event.playback_position) == (False, pytest.approx(0.5))
        for frame in frames_of(read_speech()[8_000:24_000], [1_600]):
            await output.capture_frame(frame)
        await asyncio.sleep(0.3)
        output.flush()
        output.clear_buffer()
        event = await output.wait_for_playout()
        assert event.interrupted
        assert event.playback_position < 1.0
        await runner.aclose()

    run(work(), real_time=True)
