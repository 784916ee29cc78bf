"""A LiveKit agent whose face moves: it greets whoever comes into the room.

python examples/live/livekit_agent.py dev      # with LIVEKIT_URL, LIVEKIT_API_KEY and LIVEKIT_API_SECRET
python examples/live/livekit_agent.py dev video
python examples/live/livekit_agent.py offline  # no room: prints how far the jaw is open

Add ``stt=``, ``llm=`` and ``tts=`` of your choice to ``AgentSession``: the rest stays as it is.
"""

import asyncio
import sys
from pathlib import Path

from livekit import rtc
from livekit.agents import Agent, AgentSession, JobContext, WorkerOptions, cli
from livekit.agents.voice.avatar import AudioSegmentEnd, AvatarRunner, QueueAudioOutput

from lipmotion.live.livekit import LipSync
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion_agents.livekit_video import AvatarVideo

SPEECH = Path(__file__).parent.parent / "welcome.flac"


async def recording():
    """Yield a recording as a text-to-speech service would."""
    audio = read_audio(SPEECH)
    samples = (audio.samples * 32_767).astype("<i2")
    for start in range(0, len(samples), 3_200):
        piece = samples[start : start + 3_200]
        yield rtc.AudioFrame(piece.tobytes(), audio.rate_hz, 1, len(piece))


async def talk(ctx: JobContext):
    """Greet in a room; motion goes to all in it."""
    session = AgentSession()
    await session.start(Agent(instructions="Greet."), room=ctx.room)
    session.output.audio = LipSync(session.output.audio, room=ctx.room)
    await session.say("Welcome.", audio=recording())


async def talk_as_video(ctx: JobContext):
    """Greet in a room, as a drawn face."""
    session, video, sound = AgentSession(), AvatarVideo("portrait"), QueueAudioOutput(sample_rate=24_000)
    runner = AvatarRunner(ctx.room, audio_recv=sound, video_gen=video, options=video.options)
    await runner.start()
    session.output.audio = sound
    await session.start(Agent(instructions="Greet."), room=ctx.room)
    await session.say("Welcome.", audio=recording())


async def talk_offline():
    """Greet nobody."""

    def show(frames, now):  # noqa: ARG001 (whether the first frame is to be shown at once)
        for frame in frames:
            print(f"{frame.time_s:6.2f} s", "#" * round(60 * frame["jawOpen"]))

    async def play():
        async for sound in sink:
            if isinstance(sound, AudioSegmentEnd):
                sink.notify_playback_finished(1.0, interrupted=False)
            else:
                await asyncio.sleep(sound.duration)

    session, sink = AgentSession(), QueueAudioOutput(sample_rate=16_000)
    playing = asyncio.create_task(play())
    await session.start(Agent(instructions="Greet."))
    session.output.audio = LipSync(sink, on_frames=show)
    await session.say("Welcome.", audio=recording())
    playing.cancel()
    await session.aclose()


if __name__ == "__main__":
    if "offline" in sys.argv:
        asyncio.run(talk_offline())
    else:
        as_video = sys.argv[-1] == "video" and sys.argv.pop()
        cli.run_app(WorkerOptions(entrypoint_fnc=talk_as_video if as_video else talk))
