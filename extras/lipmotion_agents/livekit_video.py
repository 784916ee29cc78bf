"""A face as the video of a LiveKit agent: ``AvatarVideo``, for ``livekit.agents.voice.avatar.AvatarRunner``."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, MissingDependencyError
from lipmotion.live.face import WEIGHT_NAMES, LiveFrame
from lipmotion.live.idling import Idling
from lipmotion.meshes.model.mesh import ANGLES
from lipmotion.pipeline.model import Model, load_model
from lipmotion.types import Channel, Motion, Timeline
from lipmotion.types.motion import RADIAN, WEIGHT
from lipmotion_agents.conversation import LOOK_AHEAD_MS, Conversation
from lipmotion_faces.base import DrawsSingly, Face, Staging
from lipmotion_faces.registry import make_face, stage_face

try:
    from livekit import rtc
    from livekit.agents.utils.audio import AudioByteStream
    from livekit.agents.voice.avatar import AudioSegmentEnd, AvatarOptions, VideoGenerator
except ImportError as error:
    raise MissingDependencyError(
        f"livekit-agents is not installed ({error}): pip install 'lipmotion[livekit]'"
    ) from error

FPS = 25
PICTURES_WAITING = 3
"""The runner shows a picture when those before it were shown, and gives sound to the room at once: so sound waits."""
PICTURES_AHEAD = 100
TURNING_PICTURES = 10
"""In so many pictures eyes and head go over from what they do in silence to what they do with speech, and back."""
Item = tuple[int, LiveFrame, "rtc.AudioFrame | AudioSegmentEnd | None"]


class AvatarVideo(VideoGenerator):
    """Pictures of a face that speaks, 25 a second, in step with the sound.

    face                       : a drawn one, or its name: portrait (woman), man, cartoon, head
    size                       : height of the pictures
    sample_rate                : of the sound, Hz
    look_ahead_ms, model, seed : of ``lipmotion.Stream``
    Eyes, brows and head move with the speech, and in silence. An interruption rests within 120 ms.
    Raises InputError: no such face, or one that does not draw single pictures.
    """

    def __init__(
        self,
        face: str | Face = "portrait",
        *,
        size: int = 480,
        sample_rate: int = 24_000,
        look_ahead_ms: float = LOOK_AHEAD_MS,
        model: Model | None = None,
        seed: int | None = 0,
    ) -> None:
        model = model or load_model()
        self._conversation, self._idling = Conversation(look_ahead_ms, model, seed), Idling(seed or 0)
        still = Staging(size=size, blinks=False, gaze=False, brows=False, head=False)
        drawn = stage_face(make_face(face) if isinstance(face, str) else face, still)
        if not isinstance(drawn, DrawsSingly):
            raise InputError(
                f"the face {type(drawn).__name__!r} does not draw single pictures; choose portrait or head"
            )
        self._face: DrawsSingly = drawn
        self._rest = self._shown = self._conversation.rest(0.0, None)[0]
        living = [name for name in self._rest.weights if name not in WEIGHT_NAMES]
        channels = [Channel(name, RADIAN if name in ANGLES else WEIGHT) for name in living]
        self._channels = (*model.learned.space.channels, *channels)
        self._living, self._pictures, self._speech = living, 0, 0.0  # the share of speech in what eyes and head do
        self._sound = AudioByteStream(sample_rate, 1, sample_rate // FPS)
        self._sample_rate = sample_rate
        self._chunks: deque[rtc.AudioFrame] = deque()  # sound that waits for its motion
        self._known: deque[LiveFrame] = deque()
        self._given_s = 0.0  # where the sound ends whose pictures are waiting
        self._number = 0  # of the interruption
        self._waiting: asyncio.Queue[Item] = asyncio.Queue(PICTURES_AHEAD)
        self._delayed: deque[rtc.AudioFrame | AudioSegmentEnd | None] = deque([None] * PICTURES_WAITING)
        self._height, self._width = self._draw(self._rest, [0.0] * len(living)).shape[:2]

    @property
    def options(self) -> AvatarOptions:
        """What the ``AvatarRunner`` needs to know."""
        return AvatarOptions(self._width, self._height, FPS, self._sample_rate, 1)

    async def push_audio(self, frame: rtc.AudioFrame | AudioSegmentEnd) -> None:
        """Take sound of an utterance, or its end; wait while 4 s of pictures are ahead."""
        number = self._number
        if isinstance(frame, AudioSegmentEnd):
            self._chunks.extend(self._sound.flush())
            self._known.extend(self._conversation.finish())
        else:
            self._chunks.extend(self._sound.push(bytes(frame.data)))
            sound = bytes(frame.data)
            self._known.extend(
                await self._conversation.push(sound, frame.sample_rate, frame.num_channels, at_rest=True)
            )
        while self._number == number and self._chunks:
            end_s = self._given_s + self._chunks[0].duration
            if end_s > self._conversation.known_s + 1e-6:
                return
            chunk, pose = self._chunks.popleft(), self._known[0]
            while self._known and self._known[0].time_s < end_s - 1e-6:
                self._known.popleft()
            self._given_s = end_s
            await self._waiting.put((number, pose, chunk))
        if self._number == number and isinstance(frame, AudioSegmentEnd):
            rest = list(self._known)[::2]
            self._known.clear()
            await self._waiting.put((number, rest[0] if rest else self._rest, frame))
            for pose in rest[1:]:
                await self._waiting.put((number, pose, None))

    def clear_buffer(self) -> None:
        """Forget the sound that is not heard yet, and rest."""
        if self._waiting.empty() and not self._conversation.speaking and self._delayed.count(None) == PICTURES_WAITING:
            return
        self._number += 1
        self._sound.clear()
        self._chunks.clear()
        self._known.clear()
        while not self._waiting.empty():
            self._waiting.get_nowait()
        self._delayed = deque([None] * PICTURES_WAITING)
        rest = self._conversation.interrupt(self._shown.time_s, self._shown)
        self._given_s = self._conversation.sound_s
        for pose in rest[::2]:
            self._waiting.put_nowait((self._number, pose, None))

    async def __aiter__(self) -> AsyncIterator[rtc.VideoFrame | rtc.AudioFrame | AudioSegmentEnd]:
        """Yield a picture, and the sound that is heard with it, if any."""
        while True:
            sound: rtc.AudioFrame | AudioSegmentEnd | None = None
            silent = self._waiting.empty()
            if not silent:
                number, pose, sound = self._waiting.get_nowait()
                if number != self._number:
                    continue
                self._shown = pose
            picture = await asyncio.to_thread(self._draw, self._shown, self._move_beside(silent))
            number = self._number
            yield rtc.VideoFrame(self._width, self._height, rtc.VideoBufferType.RGB24, picture.tobytes())
            if number == self._number:
                self._delayed.append(sound)
                heard = self._delayed.popleft()
                if heard is not None:
                    yield heard

    def _move_beside(self, silent: bool) -> list[float]:
        """Return eyes, brows and head of the next picture."""
        self._pictures += 1
        self._speech = min(max(self._speech + (-1 if silent else 1) / TURNING_PICTURES, 0.0), 1.0)
        idle = self._idling.step(self._pictures / FPS, 0.0, False)
        return [idle[name] + self._speech * (self._shown.weights[name] - idle[name]) for name in self._living]

    def _draw(self, pose: LiveFrame, beside: list[float]) -> NDArray[np.uint8]:
        # faces measure the mouth at rest in the motion itself: so it begins with rest
        rows = [[*frame.motion, *beside] for frame in (self._rest, pose)]
        motion = Motion(np.array(rows), float(FPS), self._channels)
        return self._face.draw(motion, Timeline(()), fps=FPS).draw(1)
