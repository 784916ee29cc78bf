"""A Pipecat bot whose face moves. It runs as it is, offline: python examples/live/pipecat_agent.py

``Recording`` stands where your text-to-speech service stands, and ``Console`` where your transport does: replace both,
and put what answers (speech-to-text, a language model) before them. ``LipSync()`` stays as it is.
"""

import asyncio
from pathlib import Path

from pipecat.frames.frames import EndFrame, TTSAudioRawFrame, TTSSpeakFrame, TTSStartedFrame, TTSStoppedFrame
from pipecat.pipeline.pipeline import Pipeline
from pipecat.pipeline.worker import PipelineWorker
from pipecat.processors.frame_processor import FrameProcessor
from pipecat.transports.base_output import BaseOutputTransport
from pipecat.transports.base_transport import TransportParams
from pipecat.workers.runner import WorkerRunner

from lipmotion.live.pipecat import LipSync
from lipmotion.speech.sound.audio_files import read_audio

SPEECH = Path(__file__).parent.parent / "welcome.flac"


class Recording(FrameProcessor):
    """Says the same, whatever it is told to say."""

    async def process_frame(self, frame, direction):
        """Speak, or pass a frame on."""
        await super().process_frame(frame, direction)
        if not isinstance(frame, TTSSpeakFrame):
            await self.push_frame(frame, direction)
            return
        audio = read_audio(SPEECH)
        sound = (audio.samples * 32_767).astype("<i2").tobytes()
        await self.push_frame(TTSStartedFrame(context_id="1"))
        for start in range(0, len(sound), 6_400):
            await self.push_frame(TTSAudioRawFrame(sound[start : start + 6_400], audio.rate_hz, 1, context_id="1"))
        await self.push_frame(TTSStoppedFrame(context_id="1"))


class Console(BaseOutputTransport):
    """Plays nothing, and prints how far the jaw is open."""

    async def start(self, frame):
        """Begin."""
        await super().start(frame)
        await self.set_transport_ready(frame)

    async def send_message(self, frame):
        """Print what a page would be sent, among messages of Pipecat's own."""
        for each in frame.message.get("data", {}).get("frames", []):
            print(f"{each['time_s']:6.2f} s", "#" * round(60 * each["weights"].get("jawOpen", 0)))

    async def write_audio_frame(self, frame):
        """Take as long as the sound does."""
        await asyncio.sleep(frame.num_frames / frame.sample_rate)
        return True


async def main():
    """Say a sentence."""
    console = Console(TransportParams(audio_out_enabled=True, audio_out_sample_rate=16_000))
    worker = PipelineWorker(Pipeline([Recording(), LipSync(), console]))
    await worker.queue_frames([TTSSpeakFrame("Welcome."), EndFrame()])
    runner = WorkerRunner()
    await runner.add_workers(worker)
    await runner.run()


if __name__ == "__main__":
    asyncio.run(main())
