"""Recordings of a project to files of edits: words and phones are found, and stand in the file from then on."""

from __future__ import annotations

from dataclasses import replace

from lipmotion.pipeline.analysis.read_request import read_request
from lipmotion.pipeline.edit_files import create_edit_file
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import Request
from lipmotion.pipeline.session import Session
from lipmotion.speech.features.analysed_audio import AnalysedAudio, analysed
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Monitor, silent_monitor
from lipmotion_studio.folder import ProjectFolder
from lipmotion_studio.line import OpenLine, rate_doubt
from lipmotion_studio.project import ProjectLine


def read_sound_of(folder: ProjectFolder, line: ProjectLine) -> AnalysedAudio:
    """Return the sound of a line. Raises InputError: it is not there, cannot be read, or is another one by now."""
    return analysed(read_audio(folder.checked_sound(line)))


def understand_line(
    folder: ProjectFolder, line: ProjectLine, model: Model, monitor: Monitor = silent_monitor
) -> AnalysedAudio:
    """Find words and phones of a line, and write them as its file of edits; return its sound.

    The project's lexicon is not named there: what it says of later words stands in the edits that say them.
    Its words: those that were given, else those of a file beside the recording; else they are recognised.
    Raises InputError, AlignmentError: the recording or its words are not usable. ExportError: it cannot be written.
    """
    audio, project = read_sound_of(folder, line), folder.project
    named = Request(
        folder.sound(line),
        model=folder.model_file,
        lexicon=folder.lexicon_file,
        language=project.language,
        recogniser=project.recogniser,
    )
    request = read_request(named, words_beside=not line.transcript)
    if line.transcript:
        request = replace(request, transcript=line.transcript)
    session = Session(request, model=model, monitor=monitor, audio=audio)
    file, generation = create_edit_file(replace(named, lexicon=None), session)
    digest = line.sha256 or file.sha256
    folder.checked_sound(replace(line, sha256=digest))  # and not another one meanwhile
    duration_s, doubt = audio.duration_s, rate_doubt(generation)
    with folder.lock:
        folder.line(line.number)  # it may have been removed meanwhile
        folder.write_edits(line, replace(file, sha256=digest))
        folder.change_line(
            line.number, lambda now: replace(now, duration_s=duration_s, doubt=doubt, sha256=digest), save=False
        )
    return audio


def open_line(folder: ProjectFolder, line: ProjectLine, model: Model, audio: AnalysedAudio | None = None) -> OpenLine:
    """Return a line that has been understood, open; the project is told its length and doubt, where it has neither.

    audio : its sound, where it has been read
    Raises InputError: its sound or its file of edits cannot be read, or belongs to another recording. ExportError: the
    project cannot be written.
    """
    file = folder.read_edits(line)
    audio = audio or read_sound_of(folder, replace(line, sha256=line.sha256 or file.sha256))
    file = folder.adopt(line, file)
    named = replace(file.named, recording=folder.sound(line), model=folder.model_file)
    opened = OpenLine(replace(file, named=named), folder, line.number, model, audio)
    if line.duration_s is None:  # it was understood by a studio that was killed before the project was written
        duration_s, doubt = audio.duration_s, rate_doubt(opened.generation)
        folder.change_line(line.number, lambda now: replace(now, duration_s=duration_s, doubt=doubt))
    return opened
