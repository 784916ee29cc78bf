"""Audio2Face-3D (NVIDIA's ``network.onnx`` of the regression kind): the first components of the face's skin.

Settings: ``folder``, that of the network. A picture hears 8,320 samples at 16 kHz about it, times 1.3; no emotion.
"""

import wave
from pathlib import Path

from jobs import run

RATE_HZ, WINDOW, FPS, STRENGTH, EMOTIONS, COMPONENTS, BATCH = 16_000, 8_320, 30, 1.3, 26, 20, 32


def begin(settings):
    """Return a function of a recording."""
    import numpy as np
    import onnxruntime

    path = Path(settings["folder"]) / "network.onnx"
    if not path.is_file():
        raise FileNotFoundError(path)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    network = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])

    def answer(recording):
        with wave.open(recording["sound"]) as sound:
            samples = np.frombuffer(sound.readframes(sound.getnframes()), "<i2") / 32768
            step = sound.getframerate() // RATE_HZ
        samples = samples[: len(samples) // step * step].reshape(-1, step).mean(axis=1)
        times = np.arange(int(len(samples) / RATE_HZ * FPS)) / FPS
        padded = np.pad(STRENGTH * samples, WINDOW // 2).astype(np.float32)
        pieces = np.stack([padded[int(time_s * RATE_HZ) :][:WINDOW] for time_s in times])[:, None]
        emotion = np.zeros((len(pieces), 1, EMOTIONS), np.float32)
        made = [
            network.run(None, {"input": pieces[n : n + BATCH], "emotion": emotion[n : n + BATCH]})[0]
            for n in range(0, len(pieces), BATCH)
        ]
        components = np.concatenate(made).reshape(len(pieces), -1)[:, :COMPONENTS]
        return times, {f"skin{n}": column for n, column in enumerate(components.T)}

    return answer


run(begin)
