"""Agreement of lips and sound in a video: ``lip_sync(footage, network) → SyncConfidence``."""

from __future__ import annotations

from lipmotion.errors import InputError
from lipmotion.kernels.threads import one_thread
from lipmotion.measures.sync_confidence import REACH, SyncConfidence, sync_confidence
from lipmotion.measures.sync_network import PICTURE_PX, PICTURE_RATE_HZ, SyncNetwork
from lipmotion.speech.features.framed_cepstra import framed_cepstra
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.vision.face_pictures import face_pictures
from lipmotion.vision.footage import Footage


@one_thread()
def lip_sync(footage: Footage, network: SyncNetwork) -> SyncConfidence:
    """Return how well the lips in a tracked video agree with its sound.

    Cost: the video is decoded once more; about 1 s for each second of it.
    Raises InputError: no sound, or pictures or sound of hardly 0.8 s or less.
    """
    sounds = network.sound_vectors(framed_cepstra(read_audio(footage.path)))
    faces = network.face_vectors(face_pictures(footage, PICTURE_RATE_HZ, PICTURE_PX))
    count = min(len(faces), len(sounds))
    if count <= REACH:
        raise InputError(
            f"{footage.path}: pictures and sound for {count} comparisons of lips and sound, required {REACH + 1} or "
            "more; give a second or more"
        )
    return sync_confidence(faces, sounds)
