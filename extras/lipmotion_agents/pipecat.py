"""Lip motion in a Pipecat pipeline: ``LipSyncProcessor``, between text to speech and ``transport.output()``."""

from __future__ import annotations

import asyncio
from collections import deque
from dataclasses import dataclass
from inspect import isawaitable
from typing import Any

from lipmotion.errors import MissingDependencyError
from lipmotion.live.face import LiveFrame
from lipmotion.pipeline.model import Model
from lipmotion_agents.conversation import LOOK_AHEAD_MS, REST_S, Conversation, OnFrames, Playout, list_messages

try:
    from pipecat.frames.frames import (
        ControlFrame,
        EndFrame,
        Frame,
        InterruptionFrame,
        OutputTransportMessageFrame,
        StopFrame,
        SystemFrame,
        TTSAudioRawFrame,
        TTSStoppedFrame,
        TTSTextFrame,
    )
    from pipecat.processors.frame_processor import FrameDirection, FrameProcessor
except ImportError as error:
    raise MissingDependencyError(f"Pipecat is not installed ({error}): pip install 'lipmotion[pipecat]'") from error


class LipSyncProcessor(FrameProcessor):
    """Sends lip motion with the sound that it belongs to.

    look_ahead_ms, model : of ``lipmotion.Stream``
    on_frames            : takes frames instead of the client, and whether the first is to be shown now; perhaps a
                           coroutine function
    Sound passes unchanged, after its motion: it waits until that is known, at most the look-ahead, and hardly at all
    where a service speaks faster than in real time. Motion goes as an ``OutputTransportMessageFrame``, which the
    transport sends when the sound before it was played. The message is RTVI's ``server-message``; its data::

        {"type": "lipmotion", "context_id": "…", "now": true,
         "frames": [{"time_s": 0.0, "weights": {"jawOpen": 0.12, "viseme_aa": 0.4}}, …]}

    Times are seconds of all sound of this processor. The frames take the place of all frames from the time of the first
    one on. ``now``: show the first one when the message comes, the others by their distance from it; so it is where
    sound begins after silence, and where it is interrupted: then the frames lead to rest, within 100 ms.
    """

    def __init__(
        self,
        *,
        look_ahead_ms: float = LOOK_AHEAD_MS,
        model: Model | None = None,
        on_frames: OnFrames | None = None,
        **options: Any,
    ) -> None:
        super().__init__(**options)
        self._conversation, self._playout = Conversation(look_ahead_ms, model), Playout()
        self._on_frames = on_frames
        self._held: deque[tuple[float, Frame]] = deque()  # what waits for motion up to a time
        self._known: deque[LiveFrame] = deque()  # the motion that waits for its sound
        self._sound: TTSAudioRawFrame | None = None  # the last one that came
        self._context: str | None = ""  # the utterance; "": none
        self._begins_s, self._begins_ns, self._word_ns = 0.0, 0, 0  # where it does; and the last word
        self._timer: asyncio.TimerHandle | None = None
        self._due_s = 0.0  # when what is held must go on

    async def process_frame(self, frame: Frame, direction: FrameDirection) -> None:
        """Pass a frame on, sound with its motion."""
        await super().process_frame(frame, direction)
        if isinstance(frame, InterruptionFrame):
            await self.pause_processing_frames()  # what comes next follows the frames of rest
            await self.push_frame(frame, direction)
            await self._interrupt()
            await self.resume_processing_frames()
        elif isinstance(frame, SystemFrame) or direction == FrameDirection.UPSTREAM:
            await self.push_frame(frame, direction)
        elif isinstance(frame, TTSAudioRawFrame):
            await self._hear(frame)
        elif isinstance(frame, _Overdue):
            if self._held and self._now_s() >= self._due_s:
                await self._finish()
        else:
            if isinstance(frame, TTSTextFrame) and frame.pts:
                await self._read(frame.text, frame.pts, frame.context_id)
            elif isinstance(frame, TTSStoppedFrame | EndFrame | StopFrame):
                await self._finish()
                self._context = ""
            self._held.append((self._conversation.sound_s, frame))
            await self._pass_on()

    async def cleanup(self) -> None:
        """Release what the processor holds."""
        self._stop_waiting()
        await super().cleanup()

    async def _begin(self, context: str | None) -> None:
        """Begin an utterance, unless it began: its words are timed from its first sound, or the last word before it."""
        if context != self._context:
            await self._finish()
            self._context, self._begins_s = context, self._conversation.sound_s
            self._begins_ns = max(self._word_ns, self.get_clock().get_time())

    async def _read(self, word: str, begin_ns: int, context: str | None) -> None:
        """Take a word; it ends where the next one begins."""
        await self._begin(context)
        self._begins_ns = min(self._begins_ns, begin_ns)  # the service's clock is a little ahead of ours
        self._word_ns = begin_ns
        self._conversation.add_words([(word, self._begins_s + (begin_ns - self._begins_ns) / 1e9, None)])

    async def _hear(self, sound: TTSAudioRawFrame) -> None:
        await self._begin(sound.context_id)
        self._sound = sound
        at_rest = self._playout.is_silent(self._now_s())
        frames = await self._conversation.push(sound.audio, sound.sample_rate, sound.num_channels, at_rest=at_rest)
        self._known.extend(frames)
        self._held.append((self._conversation.sound_s, sound))
        await self._pass_on()
        self._stop_waiting()
        if self._held:  # a service may stop to speak without a word, or speak slowly
            now_s = self._now_s()
            self._due_s = max(self._playout.until_s, now_s) + self._conversation.look_ahead_s
            self._timer = self.get_event_loop().call_later(self._due_s - now_s, self._wake)

    async def _pass_on(self) -> None:
        """Pass on what waits for no motion any more."""
        while self._held and self._held[0][0] <= self._conversation.known_s + 1e-6:
            end_s, frame = self._held.popleft()
            if isinstance(frame, TTSAudioRawFrame):
                frames = []
                while self._known and self._known[0].time_s < end_s - 1e-6:
                    frames.append(self._known.popleft())
                duration_s = len(frame.audio) / (2 * frame.num_channels * frame.sample_rate)
                begins = self._playout.pass_on(end_s, duration_s, self._now_s())
                self._playout.add(frames)
                await self._send(frames, begins, frame)
            await self.push_frame(frame)

    async def _finish(self) -> None:
        """Pass on all sound and its motion; the mouth rests after it."""
        self._stop_waiting()
        self._known.extend(self._conversation.finish())
        await self._pass_on()
        if self._known and self._sound is not None:
            frames = list(self._known)
            self._known.clear()
            self._playout.add(frames)
            await self._send(frames, False, self._sound)

    async def _interrupt(self) -> None:
        """Rest, unless what is said now is not to be interrupted."""
        if self._sound is None or not self._sound.interruptible:
            return
        self._stop_waiting()
        self._context, self._word_ns = "", 0
        kept = [frame for _, frame in self._held if not frame.interruptible]
        self._held.clear()
        self._known.clear()
        for frame in kept:
            await self.push_frame(frame)
        now_s = self._now_s()
        if not self._conversation.speaking and self._playout.is_silent(now_s):
            return
        frames = self._conversation.interrupt(self._playout.heard_s(now_s), self._playout.shown(now_s))
        self._playout = Playout()
        self._playout.pass_on(self._conversation.sound_s, REST_S, now_s)
        self._playout.add(frames)
        await self._send(frames, True, self._sound)

    async def _send(self, frames: list[LiveFrame], now: bool, sound: TTSAudioRawFrame) -> None:
        if self._on_frames is not None:
            result = self._on_frames(frames, now) if frames else None
            if isawaitable(result):
                await result
            return
        for data in list_messages(frames, now, context_id=sound.context_id):
            message = OutputTransportMessageFrame({"label": "rtvi-ai", "type": "server-message", "data": data})
            message.transport_destination, message.interruptible = sound.transport_destination, sound.interruptible
            await self.push_frame(message)

    def _now_s(self) -> float:
        return self.get_event_loop().time()

    def _wake(self) -> None:
        self.create_task(self.queue_frame(_Overdue()))

    def _stop_waiting(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


@dataclass
class _Overdue(ControlFrame):
    """Tells the processor, in the order of its frames, that sound has waited long enough."""
