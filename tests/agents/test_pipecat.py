"""``LipSync`` in Pipecat pipelines: sound is unchanged, motion comes before it, interruptions rest."""

from __future__ import annotations

import asyncio
import itertools
import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pipecat", exc_type=ImportError)

from pipecat.frames.frames import (
    Frame,
    InterruptionFrame,
    OutputAudioRawFrame,
    OutputTransportMessageFrame,
    OutputTransportMessageUrgentFrame,
    StartFrame,
    TextFrame,
    TTSAudioRawFrame,
    TTSStartedFrame,
    TTSStoppedFrame,
    TTSTextFrame,
)
from pipecat.pipeline.pipeline import Pipeline
from pipecat.tests.utils import SleepFrame, run_test
from pipecat.transports.base_output import BaseOutputTransport
from pipecat.transports.base_transport import TransportParams

from agents import CLOSED_S, MAMA_S, Client, in_no_time, make_vowel, read_speech
from lipmotion import LiveFrame
from lipmotion.live.pipecat import LipSync


def cut(sound: np.ndarray, sizes: list[int], rate_hz: int, context: str) -> list[Frame]:
    """Return an utterance as a service gives it, in pieces of some numbers of samples."""
    frames: list[Frame] = [TTSStartedFrame(context_id=context)]
    place, number = 0, 0
    while place < len(sound):
        piece = sound[place : place + sizes[number % len(sizes)]]
        frames.append(TTSAudioRawFrame(piece.tobytes(), rate_hz, sound.shape[1], context_id=context))
        place, number = place + len(piece), number + 1
    return [*frames, TTSStoppedFrame(context_id=context)]


def duration_s(frame: OutputAudioRawFrame) -> float:
    return len(frame.audio) / (2 * frame.num_channels * frame.sample_rate)


def data_of(frame: Frame) -> dict[str, Any]:
    assert isinstance(frame, OutputTransportMessageFrame)
    assert len(json.dumps(frame.message)) < 4096
    assert (frame.message["label"], frame.message["type"]) == ("rtvi-ai", "server-message")
    data: dict[str, Any] = frame.message["data"]
    assert data["type"] == "lipmotion"
    return data


def motion_of(frames: list[Any]) -> list[dict[str, Any]]:
    """Return the frames of motion in the messages before anything else."""
    messages = itertools.takewhile(lambda frame: isinstance(frame, OutputTransportMessageFrame), frames)
    return [frame for message in messages for frame in data_of(message)["frames"]]


def check_rest(frames: list[dict[str, Any]]) -> None:
    """The mouth is at rest after 100 ms."""
    assert len(frames) == 5
    assert frames[-1]["weights"].get("jawOpen", 0.0) < 0.02
    assert frames[-1]["weights"]["viseme_sil"] > 0.99


def check_conversation(frames: list[Frame]) -> None:
    """All motion of sound comes before it, nothing of it twice, and none of what was interrupted."""
    client, heard_s, context = Client(), 0.0, ""
    rest: list[dict[str, Any]] = []
    for number, (before, frame) in enumerate(zip([Frame(), *frames], frames, strict=False)):
        if isinstance(frame, OutputTransportMessageFrame):
            data = data_of(frame)
            client.receive(data["frames"])
            if isinstance(before, InterruptionFrame):
                rest = motion_of(frames[number:])[:5]
                check_rest(rest)
                assert data["now"]
                heard_s = rest[0]["time_s"] + 0.1
            elif data["frames"][0] not in rest:
                assert data["frames"][0]["time_s"] >= heard_s - 0.002
                context = data["context_id"]
        elif isinstance(frame, TTSAudioRawFrame):
            assert client.covers(heard_s, heard_s + duration_s(frame))
            assert frame.context_id == context
            heard_s += duration_s(frame)


@pytest.mark.parametrize(("rate_hz", "channels", "sizes"), [(16_000, 1, [640]), (24_000, 2, [24_000, 7, 1_001])])
@in_no_time
async def test_sound_is_unchanged_and_its_motion_comes_before_it(rate_hz: int, channels: int, sizes: list[int]) -> None:
    speech = read_speech(rate_hz, channels)
    sent = cut(speech[: 2 * rate_hz + 77], sizes, rate_hz, "first")
    sent.insert(3, TextFrame("hello"))
    sent += cut(speech[rate_hz : 2 * rate_hz], sizes, rate_hz, "second")
    down, _ = await run_test(LipSync(), frames_to_send=sent)
    passed = [frame for frame in down if not isinstance(frame, OutputTransportMessageFrame)]
    assert [id(frame) for frame in passed] == [id(frame) for frame in sent]
    check_conversation(list(down))
    opened = [
        frame["weights"].get("jawOpen", 0) for each in down if each not in passed for frame in data_of(each)["frames"]
    ]
    assert max(opened) > 0.2


@in_no_time
async def test_words_that_come_with_their_times_are_said() -> None:
    sent, words = cut(make_vowel(1.6), [4_000], 16_000, "a"), []
    for text, start_s in (("oh", 0.0), ("mama", MAMA_S[0]), ("oh", MAMA_S[1])):
        words.append(TTSTextFrame(text, "word", context_id="a"))
        words[-1].pts = round(1e6 + start_s * 1e9)
    for given in ([], words):
        down, _ = await run_test(LipSync(), frames_to_send=[*given, *sent])
        motion = motion_of([frame for frame in down if isinstance(frame, OutputTransportMessageFrame)])
        closed = {round(frame["time_s"], 2): frame["weights"].get("viseme_PP", 0) > 0.8 for frame in motion}
        assert [closed[time_s] for time_s in CLOSED_S] == [bool(given)] * 2


@in_no_time
async def test_a_callback_takes_frames_instead_of_the_client() -> None:
    taken: list[tuple[LiveFrame, bool]] = []

    async def take(frames: list[LiveFrame], now: bool) -> None:
        taken.extend((frame, now and not number) for number, frame in enumerate(frames))

    sent = cut(read_speech()[:16_000], [4_000], 16_000, "a")
    down, _ = await run_test(LipSync(on_frames=take), frames_to_send=sent)
    assert list(down) == sent
    assert [frame.number for frame, _ in taken] == list(range(55))  # 100 ms of rest follow
    assert [number for number, (_, now) in enumerate(taken) if now] == [0]


@in_no_time
async def test_sound_waits_no_longer_than_the_look_ahead_where_a_service_stops_without_a_word() -> None:
    taken: list[LiveFrame] = []
    sent = cut(read_speech()[:16_000], [4_000], 16_000, "a")[:-1]

    def service() -> Iterator[Frame]:
        yield from sent
        while len(taken) < 55:
            yield SleepFrame(sleep=0.05)
        yield TTSStoppedFrame(context_id="a")

    def take(frames: list[LiveFrame], now: bool) -> None:  # noqa: ARG001
        taken.extend(frames)

    down, _ = await run_test(LipSync(on_frames=take), frames_to_send=service())  # type: ignore[arg-type]
    assert list(down[:-1]) == sent


@pytest.mark.parametrize("seed", range(10))
@in_no_time
async def test_random_pieces_and_interruptions(seed: int) -> None:
    rng, speech, lips = np.random.default_rng(seed), read_speech(), LipSync()
    sent: list[Frame] = []
    for number in range(10):
        start = int(rng.integers(len(speech) - 8_000))
        sizes = rng.integers(1, 6_000, 5).tolist()
        said = cut(speech[start : start + int(rng.integers(1, 8_000))], sizes, 16_000, str(number))
        if rng.random() < 0.5:
            said = [*said[: rng.integers(1, len(said))], SleepFrame(sleep=0.001), InterruptionFrame()]
        pause = [SleepFrame(sleep=float(rng.choice([0.01, 0.3, 2.0])))] if rng.random() < 0.6 else []
        sent += [*said, *pause]
    down, _ = await run_test(lips, frames_to_send=sent)
    check_conversation(list(down))
    kept = [id(frame) for frame in down if not isinstance(frame, OutputTransportMessageFrame)]
    assert kept == [id(frame) for frame in sent if id(frame) in set(kept)]
    interrupted = [number for number, frame in enumerate(sent) if isinstance(frame, InterruptionFrame)]
    last = interrupted[-1] if interrupted else 0
    assert {id(frame) for frame in sent[last:] if not isinstance(frame, SleepFrame)} <= set(kept)


class Recorder(BaseOutputTransport):
    """A transport that plays in the time of the loop, and notes what it sends."""

    def __init__(self) -> None:
        super().__init__(TransportParams(audio_out_enabled=True, audio_out_sample_rate=16_000))
        self.sent: list[Any] = []

    async def start(self, frame: StartFrame) -> None:
        await super().start(frame)
        await self.set_transport_ready(frame)

    async def send_message(self, frame: OutputTransportMessageFrame | OutputTransportMessageUrgentFrame) -> None:
        self.sent.append(frame)

    async def write_audio_frame(self, frame: OutputAudioRawFrame) -> bool:
        self.sent.append(frame)
        await asyncio.sleep(duration_s(frame))
        return True


@in_no_time
async def test_a_transport_sends_motion_before_its_sound_and_drops_it_when_interrupted() -> None:
    transport = Recorder()
    sent = cut(read_speech()[:48_000], [16_000], 16_000, "a")

    def conversation() -> Iterator[Frame]:
        yield from sent
        yield SleepFrame(sleep=1.5)
        yield InterruptionFrame()
        yield SleepFrame(sleep=1.0)
        yield from sent

    await run_test(Pipeline([LipSync(), transport]), frames_to_send=conversation())  # type: ignore[arg-type]
    client, heard_s, rested = Client(), 0.0, False
    for number, frame in enumerate(transport.sent):
        if not isinstance(frame, OutputTransportMessageFrame):
            assert rested or client.covers(heard_s, heard_s + duration_s(frame))
            heard_s += duration_s(frame)
            continue
        data = data_of(frame)
        if data["now"] and heard_s and not rested:
            check_rest(motion_of(transport.sent[number:])[:5])
            assert data["frames"][0]["time_s"] == pytest.approx(heard_s, abs=0.05)
            assert 1.4 < heard_s < 1.6
            rested, heard_s, client = True, data["frames"][0]["time_s"], Client()
        client.receive(data["frames"])
    assert rested
    assert client.frames[-1]["time_s"] == pytest.approx(client.frames[0]["time_s"] + 3.2 - 0.02, abs=0.005)
