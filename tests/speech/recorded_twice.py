"""One scene as two machines record it: a camera in the room, and a recorder at the mouth that began at another time."""

import numpy as np

from lipmotion.types import Audio

RATE_HZ = 16_000
ROOM_S, DECAY_S, ROOM_LEVEL = 0.25, 0.35, 0.04


def clap(chance: np.random.Generator) -> np.ndarray:
    """Return noise that decays within a few milliseconds."""
    count = int(0.03 * RATE_HZ)
    return 0.7 * chance.normal(size=count) * np.exp(-np.arange(count) / (0.003 * RATE_HZ))


def beep(hertz: float = 1000.0, seconds: float = 0.25) -> np.ndarray:
    """Return a tone, as recorders and slates make it."""
    return 0.3 * np.sin(2 * np.pi * hertz * np.arange(int(seconds * RATE_HZ)) / RATE_HZ)


def room(chance: np.random.Generator) -> np.ndarray:
    """Return the response of a room: what arrives straight, and as much energy again in echoes."""
    count = int(ROOM_S * RATE_HZ)
    echoes = ROOM_LEVEL * chance.normal(size=count) * np.exp(-6.9 * np.arange(count) / (DECAY_S * RATE_HZ))
    echoes[: RATE_HZ // 500] = 0
    echoes[0] = 1
    return echoes


def recorded_twice(
    scene: np.ndarray, chance: np.random.Generator, camera_cut: int, recorder_before: int, noise_db: float = 20.0
) -> tuple[Audio, Audio, float]:
    """Return what camera and recorder have of a scene, and by how many seconds the recorder's is late.

    camera_cut      : samples of the scene that the camera misses at its beginning
    recorder_before : samples that the recorder runs before the scene begins
    noise_db        : level of the scene above the noise, in the camera
    """
    far = 0.3 * np.convolve(scene, room(chance))[camera_cut : len(scene)]
    far = far + 10 ** (-noise_db / 20) * np.sqrt(np.mean(far**2)) * chance.normal(size=len(far))
    near = np.concatenate([np.zeros(recorder_before), scene])
    near = near + 1e-3 * chance.normal(size=len(near))
    late_s = (recorder_before + camera_cut) / RATE_HZ
    return Audio(far.astype(np.float32), RATE_HZ), Audio(near.astype(np.float32), RATE_HZ), late_s


def speech_like(chance: np.random.Generator, seconds: float) -> np.ndarray:
    """Return noise in syllables and pauses, with the spectrum of a voice in rough."""
    count = int(seconds * RATE_HZ)
    voice = np.convolve(chance.normal(size=count), np.exp(-np.arange(40) / 8.0), "same")
    edges = np.cumsum(chance.uniform(0.06, 0.3, int(seconds * 12)))
    syllables = np.interp(np.arange(count) / RATE_HZ, edges, chance.uniform(0, 1, len(edges)) ** 2)
    return 0.03 * voice * syllables
