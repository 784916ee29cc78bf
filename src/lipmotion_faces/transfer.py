"""Transfer onto another face: ``map_onto(model, person) → map``, from footage of the person."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import ceil
from pathlib import Path
from zipfile import is_zipfile

import numpy as np

from lipmotion.corpora import Corpus
from lipmotion.errors import AlignmentError, InputError
from lipmotion.kernels.compiler import limit_threads
from lipmotion.motion.closure import OPENING
from lipmotion.motion.frame_labels import mark_distant
from lipmotion.motion.space import resample_track
from lipmotion.motion.speaker_estimation import estimate_gains, estimate_rest_poses, measure_person
from lipmotion.motion.speaker_maps import MAX_GAIN, VISEME_NAMES, SpeakerMap
from lipmotion.pipeline.analysis.read_request import read_recording
from lipmotion.pipeline.analysis.speech_analysis import analyse
from lipmotion.pipeline.generation import find_speaker_map, generate_for
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.request import Onto, Request
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.stats.pca import choose_evenly
from lipmotion.storage.sources import check_source
from lipmotion.types import FRAME_RATE_HZ, Audio, Channel, Example, Motion, Track
from lipmotion_faces.filmed.face import SUFFIX, FilmedFace, load_face
from lipmotion_faces.tracking.frames import VideoSpan
from lipmotion_faces.tracking.track import track

MAX_FOOTAGE_S = 60.0  # seconds of footage that are used: the first of a video, utterances spread evenly over a corpus
MIN_SPEECH_S = 0.5  # fewest seconds of speech, with the face measured, of which a map is made
REST_PRIOR_S = 0.5
"""Seconds of silence that count as much as the assumption that the map of speech is right in silence, too."""


@limit_threads()
def map_onto(
    model: Model,
    onto: Onto,
    *,
    speaker: str = "",
    onto_speaker: str = "",
    recogniser: str = "auto",
    speech: Request | None = None,
) -> SpeakerMap:
    """Return the map from the motion that a model generates to that of another person; ``Request.onto`` takes it.

    model        : whose motion is mapped
    onto         : the person: a video, a prepared corpus, another model, or a filmed face
    speaker      : whose motion is mapped, of the people whom ``model`` was trained on; empty: the mean person
    onto_speaker : onto whose motion, where a corpus or another model has several people
    recogniser   : how the person's recordings without a transcript are recognised, as of ``Request``; best the
                   one of the speech that is animated, for motion of doubtful phones is smaller
    speech       : another model's person is measured in this speech; not used for videos and corpora
    The model generates motion for the person's own recordings, and the person's motion is measured in the same frames,
    so that both say the same. Transcripts are not needed; those of a corpus are used.
    Raises InputError: no face, too little speech, other channels than those of the model, or no such speaker.
    Raises CorpusError, ModelFormatError, MissingDependencyError: as the corpus, the model file and tracking.

    >>> import lipmotion
    >>> person = lipmotion.map_onto(lipmotion.load_model(), "person.mp4")  # doctest: +SKIP
    >>> lipmotion.animate(lipmotion.Request("speech.wav", onto=person))  # doctest: +SKIP
    """
    if isinstance(onto, SpeakerMap):
        return onto
    person = find_speaker_map(model.speakers, speaker)
    opened, where = _open(onto)
    source, target = [], []
    for name, request, measured in _list_takes(opened, where, onto_speaker, speech):
        recognised = replace(request, recogniser=recogniser)
        try:
            analysed = analyse(model, recognised)
        except AlignmentError:  # its transcript cannot be aligned
            analysed = analyse(model, replace(recognised, transcript=None))
        generated = generate_for(person, model.engine, model.learned, analysed).motion
        if isinstance(measured, Track):
            motion, valid = resample_track(measured, len(analysed.features.values))
        else:
            same = analyse(measured, Request(read_recording(recognised), units=analysed.units))
            of_speaker = find_speaker_map(measured.speakers, onto_speaker)
            motion = generate_for(of_speaker, measured.engine, measured.learned, same).motion
            valid = np.ones(len(motion.values), bool)
        source.append(Example(name, analysed, generated, valid))
        target.append(Example(name, analysed, _match_channels(motion, generated.channels, where), valid))
    spoken_s = count_speech_s(target)
    if spoken_s < MIN_SPEECH_S:
        raise InputError(
            f"{where}: {spoken_s:.2f} s of speech with a measured face, required {MIN_SPEECH_S} s or more; give a "
            "recording in which the person speaks, with sound"
        )
    return fit_transfer_map(source, target)


_Opened = Corpus | Model | FilmedFace | Path


def _open(onto: str | Path | Corpus | Model | FilmedFace) -> tuple[_Opened, str]:
    """Return the corpus, the model, or the path of the video; and its name for messages."""
    if isinstance(onto, Corpus):
        return onto, str(onto.path)
    if isinstance(onto, Model):
        return onto, "the model"
    if isinstance(onto, FilmedFace):
        return onto, "the face"
    path = Path(onto)
    if path.is_dir():
        return Corpus.open(path), str(path)
    check_source(path, "video, face or model")
    if path.suffix.lower() == SUFFIX:
        return load_face(path), str(path)
    return (load_model(path) if is_zipfile(path) else path), str(path)


def _list_takes(
    opened: _Opened, where: str, speaker: str, speech: Request | None
) -> Iterator[tuple[str, Request, Track | Model]]:
    """Yield recordings of a person: name, request, and the tracked motion, or the model that generates it."""
    if isinstance(opened, Model):
        if speech is None:
            raise InputError("the person of a model is measured in some speech; give a request (speech=...)")
        yield where, replace(speech, speaker="", onto=None), opened
    elif isinstance(opened, FilmedFace):
        for number, take in enumerate(opened.takes):
            yield f"take {number + 1}", Request(take.sound), Track(take.motion, take.seen)
    elif isinstance(opened, Corpus):
        known = [name for name in opened.speakers if name]
        if (speaker and speaker not in known) or (not speaker and len(opened.speakers) > 1):
            problem = f"no speaker {speaker!r}" if speaker else f"{len(opened.speakers)} speakers"
            raise InputError(f"{where}: {problem}, required one of: {', '.join(known)}; name it (--onto-speaker)")
        speakers = [speaker] if speaker else []
        names = opened.names("train", speakers) or opened.names(None, speakers)
        if not names:
            raise InputError(f"{where}: the corpus is empty; prepare recordings of the person")
        mean_s = sum(seconds for _, seconds in opened.speakers.values()) / max(len(opened), 1)
        for index in choose_evenly(ceil(MAX_FOOTAGE_S / max(mean_s, 1e-3)), len(names)):
            utterance = opened.utterance(names[index])
            words = " ".join(utterance.words) if utterance.words else None
            yield utterance.name, Request(utterance.audio, words, units=utterance.phones), utterance.track
    else:
        if speaker:
            raise InputError(f"{where}: a video has no speaker {speaker!r} by name; leave the name out")
        audio = read_audio(opened)
        first = Audio(audio.samples[: round(MAX_FOOTAGE_S * audio.rate_hz)], audio.rate_hz)
        yield where, Request(first), track(opened, crops=False, span=VideoSpan(0.0, MAX_FOOTAGE_S))


def fit_transfer_map(source: Sequence[Example], target: Sequence[Example]) -> SpeakerMap:
    """Return the map from the motion of a source person to that of a target person, fitted in the same speech.

    source : generated motion of the source, for the speech of the target
    target : measured motion of the target; the same channels
    - Closed lips map onto closed lips. The median pose of all other channels in speech maps onto the target's.
    - The range in speech (5th to 95th percentile) maps onto the target's; points share one gain for each axis, so that
      the face keeps the shape of the target. With S seconds of speech the logarithm of a gain counts S / (S + 2), and
      gains lie between 1 / ``MAX_GAIN`` and ``MAX_GAIN``: a short recording gives place and shape alone.
    - In silence away from speech the rest pose maps onto the target's. With S seconds of such silence that counts
      S / (S + 0.5): people rest with closed lips in one pause and with parted lips in the next.
    The map has no habits (``SpeakerMap.habits`` is 0).
    Source of the task: Minnis & Breen 2000, §7. Alternatives that were measured: docs/results/selection.md.
    """
    channels = source[0].motion.channels
    names = [channel.name for channel in channels]
    column = names.index(OPENING) if OPENING in names else None
    people = [measure_person(examples, column) for examples in (source, target)]
    gains, rests = estimate_gains(people, channels, float(np.sqrt(MAX_GAIN))), estimate_rest_poses(people)
    gain = gains[1] / gains[0]
    offset = people[1].spoken - gain * people[0].spoken
    closed = people[0].closed
    if column is not None:
        offset[column] = people[1].closed - gain[column] * closed
    rest = people[1].rest_s / (people[1].rest_s + REST_PRIOR_S) * (rests[1] - offset - gain * rests[0])
    habits = np.zeros((len(VISEME_NAMES), len(channels)))
    return SpeakerMap(channels, gain, offset, rest, habits, (closed, closed + 1))


def count_speech_s(examples: Sequence[Example]) -> float:
    """Return the seconds of speech in which the motion of some examples was measured."""
    spoken = (each.valid & ~mark_distant(each.speech.units, len(each.valid), 0.0) for each in examples)
    return sum(int(frames.sum()) for frames in spoken) / FRAME_RATE_HZ


def _match_channels(motion: Motion, channels: Sequence[Channel], where: str) -> Motion:
    """Return motion in the channels of a model. Raises InputError, which names the recording: a channel is missing."""
    missing = [channel for channel in channels if channel not in motion.channels]
    if missing:
        first, share = missing[0], f"{len(missing)} of {len(channels)} channels of the model"
        what = f"{where}: its motion lacks {share}, as {first.name!r} in the unit {first.unit!r};"
        raise InputError(f"{what} give recordings with all of them (lipmotion info), or another model")
    columns = [motion.channels.index(channel) for channel in channels]
    return Motion(np.asarray(motion.values)[:, columns], motion.rate_hz, tuple(channels))
