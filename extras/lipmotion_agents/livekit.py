"""Lip motion in a LiveKit agent: ``LipSyncOutput``, around the audio output of a session."""

from __future__ import annotations

import asyncio
import json
import logging
from collections import deque
from inspect import isawaitable
from typing import TYPE_CHECKING

from lipmotion.errors import InputError, MissingDependencyError
from lipmotion.live.face import LiveFrame
from lipmotion.live.stream import REST_STEPS
from lipmotion.pipeline.model import Model
from lipmotion_agents.conversation import (
    FRAMES_IN_MESSAGE,
    LOOK_AHEAD_MS,
    REST_S,
    Conversation,
    OnFrames,
    Playout,
    blend,
    list_messages,
)

try:
    from livekit.agents.types import USERDATA_TIMED_TRANSCRIPT
    from livekit.agents.utils import is_given
    from livekit.agents.voice.io import AudioOutput, AudioOutputCapabilities, TimedString
except ImportError as error:
    raise MissingDependencyError(
        f"livekit-agents is not installed ({error}): pip install 'lipmotion[livekit]'"
    ) from error
if TYPE_CHECKING:
    from livekit import rtc

LOG = logging.getLogger("lipmotion")
TOPIC = "lipmotion"
LEAD_S = 0.1
"""Motion is sent so long before its sound is heard."""
DISCARDED_S = 0.2
"""A pause discards what the room's audio source holds, which is this much while there is more to say."""


class LipSyncOutput(AudioOutput):
    """Sends lip motion in time with the sound of ``session.output.audio``, in whose place it stands.

    next_in_chain        : takes the sound, unchanged, and calls ``on_playback_started``, as outputs of LiveKit do
    room                 : to whose participants motion goes, as data packets of topic ``lipmotion``
    on_frames            : takes frames instead, and whether the first is to be shown now; perhaps a coroutine function
    look_ahead_ms, model : of ``lipmotion.Stream``
    Sound waits until its motion is known: at most the look-ahead, when an utterance begins. Motion goes 0.1 s before
    its sound is heard. A packet is an object of JSON::

        {"type": "lipmotion", "now": true,
         "frames": [{"time_s": 0.0, "weights": {"jawOpen": 0.12, "viseme_aa": 0.4}}, …]}

    Times are seconds of all sound of this output. The frames take the place of all frames from the time of the first
    one on. ``now``: show the first one when the packet comes, the others by their distance from it; so it is where
    sound begins or goes on, and where it is interrupted or paused: then the frames lead to rest, within 100 ms.
    Raises InputError: neither or both of ``room`` and ``on_frames``.
    """

    def __init__(
        self,
        next_in_chain: AudioOutput | None,
        *,
        room: rtc.Room | None = None,
        on_frames: OnFrames | None = None,
        look_ahead_ms: float = LOOK_AHEAD_MS,
        model: Model | None = None,
    ) -> None:
        if next_in_chain is None:
            raise InputError("there is no audio output yet; start the session first")
        if (room is None) == (on_frames is None):
            raise InputError("where should motion go? give LipSyncOutput either a room or on_frames")
        pause = AudioOutputCapabilities(pause=True)
        super().__init__(label="LipSync", next_in_chain=next_in_chain, capabilities=pause)
        self._sink: AudioOutput = self.next_in_chain or next_in_chain
        self._room, self._on_frames = room, on_frames
        self._conversation, self._playout = Conversation(look_ahead_ms, model), Playout()
        self._held: deque[tuple[float, rtc.AudioFrame]] = deque()  # sound that waits for motion up to a time
        self._known: deque[LiveFrame] = deque()  # motion that was not sent yet
        self._now = True  # the next frame is to be shown when it comes
        self._open = self._void = False  # an utterance is coming; the rest of it is not heard
        self._begins_s = 0.0  # where it does
        self._given_s, self._passed = 0.0, False  # of it the sink was given so much; and took some
        self._started = False  # the sink said that it is heard
        self._paused_s: float | None = None
        self._ending: asyncio.Task[None] | None = None
        self._sending: asyncio.Task[None] | None = None

    @property
    def sample_rate(self) -> int | None:
        """The rate that the sink requires; None: any."""
        return self._sink.sample_rate

    async def capture_frame(self, frame: rtc.AudioFrame) -> None:
        """Take sound of the utterance."""
        if self._ending is not None:
            await asyncio.wait({self._ending})
        await super().capture_frame(frame)
        if not self._open:
            self._open, self._void, self._given_s, self._passed, self._started = True, False, 0.0, False, False
            self._begins_s = self._conversation.sound_s
        if self._void:
            return
        self._conversation.add_words(self._read_words(frame))
        at_rest = self._playout.is_silent(self._clock_s())
        sound = bytes(frame.data)
        self._add(await self._conversation.push(sound, frame.sample_rate, frame.num_channels, at_rest=at_rest))
        if not self._void:
            self._held.append((self._conversation.sound_s, frame))
            await self._pass_on()

    def flush(self) -> None:
        """End the utterance."""
        super().flush()
        if not self._open:
            self._sink.flush()
            return
        self._open = False
        self._add(self._conversation.finish())
        if self._held:
            self._ending = asyncio.create_task(self._end())
        else:
            self._close()

    def clear_buffer(self) -> None:
        """Forget what is not heard yet, and rest."""
        self._void = True
        self._held.clear()
        self._known.clear()
        now_s = self._clock_s()
        if self._conversation.speaking or not self._playout.is_silent(now_s):
            shown = self._playout.shown(now_s) if self._paused_s is None else None
            frames = self._conversation.interrupt(self._playout.heard_s(now_s), shown)
            self._playout = Playout()
            self._playout.pass_on(self._conversation.sound_s, REST_S, now_s)
            self._playout.add(frames)
            self._send_motion(frames)
        self._sink.clear_buffer()

    def pause(self) -> None:
        """Rest until ``resume``."""
        super().pause()
        if self._paused_s is not None:
            return
        now_s = self._paused_s = self._clock_s()
        if not self._playout.is_silent(now_s):
            self._send_motion(self._conversation.rest(self._playout.heard_s(now_s), self._playout.shown(now_s)))

    def resume(self) -> None:
        """Go on where the sound does."""
        super().resume()
        if self._paused_s is None:
            return
        paused_s, self._paused_s = self._paused_s, None
        now_s = self._clock_s()
        self._playout.until_s += now_s - paused_s - min(DISCARDED_S, max(self._playout.until_s - paused_s, 0.0))
        coming = [frame for frame in self._known if frame.time_s >= self._playout.heard_s(now_s)]
        start, self._now = self._conversation.rest(0.0, None)[-1], True
        self._known = deque(blend(coming[:REST_STEPS], start) + coming[REST_STEPS:])
        self._send_motion()

    def on_playback_started(self, *, created_at: float) -> None:
        """Send motion from now on: the utterance is heard."""
        super().on_playback_started(created_at=created_at)
        self._playout.until_s, self._started = self._clock_s() + self._given_s, True
        self._send_motion()

    def on_playback_finished(
        self, *, playback_position: float, interrupted: bool, synchronized_transcript: str | None = None
    ) -> None:
        """Pass on that the utterance is over."""
        if self._passed and not self._started and not interrupted:
            LOG.warning("no lip motion was sent: the audio output does not call on_playback_started")
        super().on_playback_finished(
            playback_position=playback_position,
            interrupted=interrupted,
            synchronized_transcript=synchronized_transcript,
        )

    async def aclose(self) -> None:
        """End the tasks."""
        for task in (self._ending, self._sending):
            if task is not None:
                task.cancel()
                await asyncio.wait({task})

    def _read_words(self, frame: rtc.AudioFrame) -> list[tuple[str, float, float | None]]:
        """Return the words that a service sends with the sound, if it does."""
        return [
            (
                word,
                self._begins_s + word.start_time,
                self._begins_s + word.end_time if is_given(word.end_time) else None,
            )
            for word in frame.userdata.get(USERDATA_TIMED_TRANSCRIPT, ())
            if isinstance(word, TimedString) and is_given(word.start_time)
        ]

    def _add(self, frames: list[LiveFrame]) -> None:
        """Take motion that is known now, in the place of what was to be shown from then on."""
        while frames and self._known and self._known[-1].time_s >= frames[0].time_s:
            self._known.pop()
        self._known.extend(frames)
        self._playout.add(frames)
        self._send_motion()

    async def _pass_on(self) -> None:
        """Give the sink the sound whose motion is known."""
        while self._held and self._held[0][0] <= self._conversation.known_s + 1e-6:
            end_s, frame = self._held.popleft()
            self._now |= self._playout.pass_on(end_s, frame.duration, self._clock_s())
            self._given_s += frame.duration
            await self._sink.capture_frame(frame)
            self._passed = True

    async def _end(self) -> None:
        """Give the sink the rest of the utterance."""
        try:
            await self._pass_on()
        finally:
            self._close()

    def _close(self) -> None:
        self._sink.flush()
        if not self._passed:  # then the sink does not say that this utterance is over
            self.on_playback_finished(playback_position=0.0, interrupted=True)

    def _send_motion(self, frames: list[LiveFrame] | None = None) -> None:
        """Send frames at once, and then what is known, when it is due."""
        if self._sending is not None and not self._sending.done():
            if not frames:
                return
            self._sending.cancel()
        elif not frames and not self._started:
            return
        self._sending = asyncio.create_task(self._send_due(frames or []))

    async def _send_due(self, frames: list[LiveFrame]) -> None:
        if frames:
            await self._send(frames, True)
        while self._known and self._started and self._paused_s is None:
            heard_s = self._playout.heard_s(self._clock_s())
            early_s = self._known[0].time_s - LEAD_S - heard_s
            if early_s > 0.001:
                await asyncio.sleep(early_s)
                continue
            due = [frame for frame in self._known if frame.time_s < heard_s + 2 * LEAD_S][:FRAMES_IN_MESSAGE]
            now, self._now = self._now, False
            for _ in due:
                self._known.popleft()
            await self._send(due, now)

    async def _send(self, frames: list[LiveFrame], now: bool) -> None:
        try:
            if self._on_frames is not None:
                result = self._on_frames(frames, now)
                if isawaitable(result):
                    await result
            elif self._room is not None:
                for message in list_messages(frames, now):
                    await self._room.local_participant.publish_data(
                        json.dumps(message, separators=(",", ":")), topic=TOPIC
                    )
        except Exception as error:  # the sound goes on
            LOG.warning("lip motion was not sent: %s", error)

    def _clock_s(self) -> float:
        """Return the time, which stands still in a pause."""
        return self._paused_s if self._paused_s is not None else asyncio.get_running_loop().time()
