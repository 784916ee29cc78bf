"""Reader of VOCASET: sounds in one folder, and in another a mesh for each sixtieth of a second."""

from __future__ import annotations

from pathlib import Path

from lipmotion.corpora.folder import gathered
from lipmotion.corpora.labels import labels_beside
from lipmotion.corpora.source_recordings import MotionFile, RecordingFolder, SourceRecording
from lipmotion.errors import InputError

KIND = "VOCASET meshes"
MESHES, SOUNDS = "unposedcleaneddata", "audio"
RATE_HZ = 60.0
RIGHTS = {
    "licence": "research, as agreed with its owners",
    "attribution": "VOCASET (Cudeiro, Bolkart, Laidlaw, Ranjan, Black 2019)",
}


def read_vocaset(directory: Path) -> RecordingFolder | None:
    """Return the recordings of a folder with the two folders of VOCASET, or None if it does not have them.

    ``audio/PERSON/sentence01.wav`` is the sound of ``unposedcleaneddata/PERSON/sentence01/*.ply``; labels lie beside
    the sound. The motion file is the first mesh.
    """
    meshes, sounds = directory / MESHES, directory / SOUNDS
    if not (meshes.is_dir() and sounds.is_dir()):
        return None

    def recording_of(name: str, sound: Path) -> SourceRecording:
        speaker, sentence = sound.parent.name, meshes / sound.parent.name / sound.stem
        first = min(sentence.glob("*.ply"), default=None)
        if first is None:
            raise InputError(f"{sentence}: no meshes (.ply) of {sound}; unpack them, or remove the sound")
        labels = labels_beside(sound)
        return SourceRecording(
            name,
            sound,
            labels.words,
            rights=RIGHTS,
            speaker=speaker,
            phones=labels.phones,
            motion_file=MotionFile(first, RATE_HZ),
        )

    by_name = {f"{sound.parent.name}-{sound.stem}": [sound] for sound in sorted(sounds.glob("*/*.wav"))}
    return gathered(KIND, by_name, recording_of, directory)
