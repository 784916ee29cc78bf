"""What is replied to requests for one recording, and for the project (docs/extend/studio.md)."""

from __future__ import annotations

import io
import math
from asyncio import to_thread
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import fields, replace
from functools import partial
from typing import Any
from urllib.parse import quote, unquote
from uuid import uuid4

import numpy as np
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, Response

from lipmotion.articulation.expression import is_mood
from lipmotion.errors import InputError, shorten
from lipmotion.storage.files import TEMPORARY, remove
from lipmotion.storage.json_text import as_json
from lipmotion.storage.locks import open_temporary
from lipmotion.types import Motion, values
from lipmotion.types.configuration import kind_of
from lipmotion.types.values import Schema, items, parse_number, parse_whole, require
from lipmotion.units import PHONES, split_words
from lipmotion_faces.outputs.shown_faces import ShownPerson
from lipmotion_studio.folder import RevisionError
from lipmotion_studio.meshes import HEAD, HEAD_OF_MOODS
from lipmotion_studio.project import APPROVED, MAX_RECORDINGS, find_preset
from lipmotion_studio.recording import OpenRecording, list_doubts
from lipmotion_studio.studio import Studio
from lipmotion_studio.trainer import MAX_LISTED
from lipmotion_studio.training import FACE, VOICE, VoiceOptions
from lipmotion_studio.web.replies import FRESH, read_json, reply_json, write_body
from lipmotion_studio.workspace import READY, WORKING

MAX_JSON_BYTES = 1 << 20
LATEST_S = 1e6
MAX_STEPS = 1000
MAX_TRANSCRIPT = 100_000
MAX_NAMES = 20_000
BEGINNING = "bytes=0-"
NUMBERS = ("motion", "delivered", "deviation", "confidence")
Changed = dict[str, Any]
Change = Callable[[OpenRecording, int], Changed]  # changes a recording at a revision; returns what moved
Handler = Callable[[Request], Awaitable[Response]]


async def read_content(request: Request) -> dict[str, Any]:
    """Return the object of JSON that a request brings. Raises HTTPException, InputError: it brings something else."""
    content = await read_json(request, MAX_JSON_BYTES)
    if not isinstance(content, dict):
        raise InputError("required an object of JSON")
    return content


def take(content: Mapping[str, Any], name: str, default: Any, schema: Schema) -> Any:
    """Return a member of a request, checked. Raises InputError: there is none, and no default; or another one."""
    return require(schema, content.get(name, default), name)


def _number_or_text(read: Callable[[str], Any], schema: Schema) -> Schema:
    """Return the schema of a number that may also be a text, as in addresses, which ``read`` turns into the number."""
    return lambda value: schema(read(value) if isinstance(value, str) else value)


def take_int(
    content: Mapping[str, Any], name: str, default: int | None = None, *, low: int = 0, high: int = 1 << 31
) -> int:
    """Return a whole number of a request, also from its text in an address. Raises as ``take``."""
    schema = _number_or_text(partial(parse_whole, what=f"{name} is"), values.whole(low, high))
    return int(take(content, name, default, schema))


def take_time(content: Mapping[str, Any], name: str, default: float | None = None) -> float:
    """Return a time of a request in seconds, also from its text in an address. Raises as ``take``."""
    schema = _number_or_text(partial(parse_number, what=f"{name} is"), values.number(0, LATEST_S))
    return float(take(content, name, default, schema))


def take_stretch(content: Mapping[str, Any], rate_hz: float, frames: int) -> slice:
    """Return the frames from ``start_s`` to ``end_s`` of a request, or all. Raises InputError: no such times."""
    last_s = (frames - 1) / rate_hz
    start_s, end_s = take_time(content, "start_s", 0.0), min(take_time(content, "end_s", last_s), last_s)
    first, last = math.ceil(start_s * rate_hz - 1e-6), math.floor(end_s * rate_hz + 1e-6)
    if first > last:
        raise InputError(f"{start_s} to {end_s} s holds no frame, required a part of 0 to {last_s:.2f} s")
    return slice(first, last + 1)


def take_text(content: Mapping[str, Any], name: str, default: str | None = None, *, longest: int = 200) -> str:
    """Return a text of a request. Raises as ``take``."""
    return str(take(content, name, default, values.text(longest)))


def take_texts(content: Mapping[str, Any], name: str, *, most: int, longest: int = 2000) -> tuple[str, ...]:
    """Return a list of texts of a request. Raises as ``take``."""
    return tuple(take(content, name, None, items(values.text(longest), most=most)))


def find_number(studio: Studio, request: Request) -> int:
    """Return the number of a recording in an address. Raises HTTPException: there is no such recording."""
    text = str(request.path_params["number"])
    number = int(text) if text.isascii() and text.isdecimal() and len(text) < 10 else 0
    if number not in studio.folder.project.lines:
        raise HTTPException(404, "no such recording")
    return number


class RecordingReplies:
    """Replies to requests for one recording; work on it is done in its own thread.

    make_key : returns the key that allows to load one address
    """

    def __init__(self, studio: Studio, make_key: Callable[[str], str]) -> None:
        self._studio, self._make_key, self._workspace = studio, make_key, studio.workspace
        self._find_number = partial(find_number, studio)

    async def open_recording(self, request: Request) -> Response:
        """Open a recording, analyse it if it is new, and reply its state."""
        number = self._find_number(request)
        if self._workspace.open(number).recording is None:
            return self._reply_waiting(number)
        return await self._reply_after(number, lambda _: {})

    def list_changes(self) -> dict[str, Handler]:
        """Return the handlers of changes of an open recording, by the last part of their addresses."""

        def handle(take_change: Callable[[dict[str, Any]], Change]) -> Handler:
            async def reply(request: Request) -> Response:
                number, content, revision = await self._read_change(request)
                change = take_change(content)
                return await self._reply_after(number, lambda recording: change(recording, revision))

            return reply

        def take_edits(content: dict[str, Any]) -> Change:
            steps, instead = take_texts(content, "steps", most=MAX_STEPS), take_int(content, "instead", 0)
            return partial(OpenRecording.edit, steps=self._studio.add_phones(steps), instead=instead)

        def take_count(step: Callable[..., Changed]) -> Callable[[dict[str, Any]], Change]:
            return lambda content: partial(step, count=take_int(content, "count", 1, low=1))

        def take_version(step: Callable[..., Changed]) -> Callable[[dict[str, Any]], Change]:
            return lambda content: partial(step, name=take_text(content, "version"))

        return {
            "edits": handle(take_edits),
            "undo": handle(take_count(OpenRecording.undo)),
            "redo": handle(take_count(OpenRecording.redo)),
            "settle": handle(lambda _: OpenRecording.settle),
            "versions": handle(lambda _: OpenRecording.keep_version),
            "versions/forget": handle(take_version(OpenRecording.forget_version)),
            "versions/back": handle(take_version(OpenRecording.restore_version)),
        }

    async def change_words(self, request: Request) -> Response:
        """Change the words of a recording, or of a stretch of it."""
        number, content, revision = await self._read_change(request)
        words = take_text(content, "text", longest=MAX_TRANSCRIPT)
        is_part = "start_s" in content or "end_s" in content
        if not is_part and self._studio.analyse_again(number, revision, words):
            return self._reply_waiting(number)
        start_s, end_s = take_time(content, "start_s", 0.0), take_time(content, "end_s", 1e6)

        def change(recording: OpenRecording) -> Changed:
            last_s = min(end_s, recording.generation.units[-1].end_s)
            step = f"say {' '.join(words.split())} from {start_s:.3f} to {last_s:.3f}"
            return recording.edit(revision, self._studio.add_phones([step]))

        return await self._reply_after(number, change)

    async def send_sound(self, request: Request) -> Response:
        """Send the sound as it is played."""
        number = self._find_number(request)
        path = await to_thread(self._studio.prepare_sound, number)
        return FileResponse(path, media_type="audio/wav", headers=FRESH)

    async def send_recorded(self, request: Request) -> Response:
        """Send the real video, as browsers play it."""
        number, folder = self._find_number(request), self._studio.folder
        if request.headers.get("range", BEGINNING).startswith(BEGINNING):  # and not again for each part of it
            await to_thread(folder.check_sound, folder.find_recording(number))
        path, kind = await to_thread(self._studio.prepare_video, number)
        return FileResponse(path, media_type=kind, headers=FRESH)

    async def restore(self, request: Request) -> Response:
        """Restore the last good copy of damaged edits."""
        number, _, revision = await self._read_change(request)
        with self._studio.folder.check_out(number, revision) as recording:
            self._studio.folder.restore_edits(recording)
            self._workspace.forget(number)
        self._workspace.open(number)
        return self._reply_waiting(number)

    async def send_motion(self, request: Request) -> Response:
        """Send numbers of the motion."""
        query = request.query_params
        of = take_text(query, "of", "motion")
        if of not in NUMBERS:
            raise InputError(f"of is {of!r}, required one of: {', '.join(NUMBERS)}")
        names = take_text(query, "names", longest=MAX_NAMES).split(",") if "names" in query else None
        by, number = take_text(query, "by", ""), self._find_number(request)

        def reply(recording: OpenRecording) -> Response:
            motion = self._studio.vary(number, recording, by).select_motion("variance" if of == "deviation" else of)
            if names is not None:
                chosen = [name for name in names if name in motion.names or not by]
                if unknown := [name for name in chosen if name not in motion.names]:
                    known = ", ".join(motion.names)
                    raise InputError(f"names: there is no {shorten(repr(unknown[0]))}, required some of: {known}")
                motion = motion.selected(chosen)
            frames = take_stretch(query, motion.rate_hz, len(motion.values))
            values = motion.values[frames]
            if of == "deviation":
                values = np.sqrt(np.maximum(values, 0))
            return _reply_numbers(replace(motion, values=values), frames.start, {})

        return await self._workspace.run(number, reply)

    async def send_weights(self, request: Request) -> Response:
        """Send the weights of a face's morph targets."""
        query = request.query_params
        name, by, number = take_text(query, "face", HEAD), take_text(query, "by", ""), self._find_number(request)

        def reply(opened: OpenRecording) -> Response:
            recording = self._studio.vary(number, opened, by)
            styled = recording.select_motion("delivered")
            frames = take_stretch(query, styled.rate_hz, len(styled.values))
            is_part = frames.stop - frames.start < len(styled.values)
            motion = recording.compute_weights(self._studio.faces.open_face(name), frames if is_part else None)
            mesh = HEAD_OF_MOODS if name == HEAD and any(map(is_mood, styled.names)) else name
            return _reply_numbers(motion, frames.start, {"x-lipmotion-mesh": quote(mesh)})

        return await self._workspace.run(number, reply)

    async def send_picture(self, request: Request) -> Response:
        """Send a picture of a drawn face, as PNG."""
        query = request.query_params
        time_s, face = take_time(query, "time"), self._studio.find_drawn_face(take_text(query, "face", "woman"))
        by, number = take_text(query, "by", ""), self._find_number(request)

        def draw(recording: OpenRecording) -> bytes:
            from PIL import Image

            picture, file = self._studio.vary(number, recording, by).draw(time_s, face), io.BytesIO()
            Image.fromarray(np.ascontiguousarray(picture)).save(file, format="PNG", compress_level=3)
            return file.getvalue()

        return Response(await self._workspace.run(number, draw), media_type="image/png", headers=FRESH)

    async def send_video(self, request: Request) -> Response:
        """Send a video of a stretch."""
        content = await read_content(request)
        start_s, end_s = take_time(content, "start_s"), take_time(content, "end_s")
        name, by, number = take_text(content, "face", "woman"), take_text(content, "by", ""), self._find_number(request)

        def write(opened: OpenRecording) -> bytes:
            self._studio.folder.check_sound(self._studio.folder.find_recording(number))
            face = self._studio.faces.open_face(name)
            recording = self._studio.vary(number, opened, by, name)
            with open_temporary() as folder:
                path = folder / "stretch.mp4"
                if isinstance(face, ShownPerson):
                    recording.write_film(path, start_s, end_s, face)
                else:
                    recording.write_video(path, start_s, end_s, self._studio.find_drawn_face(name))
                return path.read_bytes()

        return Response(await self._workspace.run(number, write), media_type="video/mp4", headers=FRESH)

    async def explain(self, request: Request) -> Response:
        """Explain what determined a frame."""
        time_s, number = take_time(request.query_params, "time"), self._find_number(request)
        return reply_json(await self._workspace.run(number, lambda recording: recording.explain(time_s)))

    async def list_doubts(self, request: Request) -> Response:
        """List the phones, the least sure first."""
        return reply_json(
            await self._workspace.run(self._find_number(request), lambda opened: list_doubts(opened.generation))
        )

    async def _read_change(self, request: Request) -> tuple[int, dict[str, Any], int]:
        """Return the recording that a request changes, its content, and the revision that its author saw."""
        content = await read_content(request)
        return self._find_number(request), content, take_int(content, "revision")

    async def _reply_after(self, number: int, do: Callable[[OpenRecording], Changed]) -> Response:
        """Do something to a recording; reply its state then, and what was returned."""

        def reply(recording: OpenRecording) -> Response:
            try:
                changed, status = do(recording), 200
            except RevisionError as error:
                changed, status = {"error": str(error)}, 409
            state = {"media": self._list_media(number)} | recording.describe()
            state["misfits"] = self._workspace.misfits.get(number, [])
            with self._studio.folder.lock:
                state |= self._studio.describe_recording(number) | {"revision": recording.revision}
            state["transcript"] = state["transcript"] or recording.transcript
            return reply_json({**changed, "state": state} if status == 409 else state | changed, status)

        return await self._workspace.run(number, reply)

    def _reply_waiting(self, number: int) -> Response:
        document = self._studio.describe_recording(number) | {"media": self._list_media(number)}
        if document["status"] == READY:  # since it was looked up: its state comes with the next request
            document["status"] = WORKING
        return reply_json(document)

    def _list_media(self, number: int) -> dict[str, Any]:
        video = self._studio.find_video(number)
        parts = {"sound": "sound.wav"} | ({"video": "recorded"} if video else {})
        paths = {name: f"/api/lines/{number}/{part}" for name, part in parts.items()}
        addresses = {name: f"{path}?key={self._make_key(path)}" for name, path in paths.items()}
        return addresses | ({"sound_begins_s": video[1]} if video else {})


def _reply_numbers(motion: Motion, first: int, more: dict[str, str]) -> Response:
    headers = {
        "x-lipmotion-names": as_json(list(motion.names), ensure_ascii=True),
        "x-lipmotion-rate": f"{motion.rate_hz:g}",
        "x-lipmotion-first": str(first),
    }
    content = np.ascontiguousarray(motion.values, "<f4").tobytes()
    return Response(content, headers=FRESH | headers | more, media_type="application/octet-stream")


MAX_UPLOAD_BYTES = 1 << 29
UPLOAD_S = 600.0  # how long a recording may take to arrive
MAX_WORD, MAX_PHONES = 60, 60
ALL = "all"
NUMBER = values.whole(0, 1 << 31)


class ProjectReplies:
    """Replies to requests for the project, its recordings together, and voices and faces that are made here."""

    def __init__(self, studio: Studio) -> None:
        self._studio, self._trainer, self._find_number = studio, studio.trainer, partial(find_number, studio)

    async def list_recordings(self, request: Request) -> Response:
        """List the recordings, page by page, and what forms need."""
        query = request.query_params
        first, count = take_int(query, "from", 0), take_int(query, "count", 200, high=2000)
        document = await to_thread(self._studio.list_recordings, first, count)
        return reply_json(document | {"largest_upload_bytes": MAX_UPLOAD_BYTES})

    async def send_progress(self, _: Request) -> Response:
        """Tell what is at work."""
        return reply_json(self._studio.describe_progress())

    async def analyse(self, request: Request) -> Response:
        """Queue recordings for analysis."""
        content = await read_content(request)
        known = self._studio.folder.project.lines
        numbers = list(known) if content.get("lines") == ALL else take(content, "lines", None, items(NUMBER))
        if not set(numbers) <= known.keys():
            raise HTTPException(404, "no such recording")
        return reply_json({"waiting": self._studio.workspace.queue(numbers)})

    async def receive_recording(self, request: Request) -> Response:
        """Add a recording that was dropped on the page: the body."""
        name = take_text(request.query_params, "name", longest=500)
        transcript = unquote(request.headers.get("x-lipmotion-transcript", ""), errors="replace")
        file = self._studio.folder.path / f"{TEMPORARY}{uuid4().hex}"
        try:
            with file.open("wb") as content:
                await write_body(request, content, MAX_UPLOAD_BYTES, UPLOAD_S)
            number = await to_thread(self._studio.folder.drop, name, file, transcript)
        finally:
            remove(file)
        self._studio.workspace.queue([number])
        return reply_json(self._studio.describe_row(self._studio.folder.find_recording(number)), 201)

    async def mark(self, request: Request) -> Response:
        """Mark a recording."""
        number, content = self._find_number(request), await read_content(request)
        mark, revision = take_text(content, "mark"), take_int(content, "revision")
        return reply_json(await to_thread(self._studio.mark, number, revision, mark))

    async def remove(self, request: Request) -> Response:
        """Remove a recording from the project; its files stay."""
        number, folder = self._find_number(request), self._studio.folder
        with folder.check_out(number, take_int(await read_content(request), "revision")):
            folder.change(
                lambda now: replace(now, lines={key: each for key, each in now.lines.items() if key != number})
            )
            self._studio.workspace.forget(number)
        return reply_json({"removed": number})

    async def export_one(self, request: Request) -> Response:
        """Export files of one recording."""
        number = self._find_number(request)
        return await self._export(await read_content(request), [number])

    async def export_all(self, request: Request) -> Response:
        """Export files of the approved recordings, or of all."""
        content = await read_content(request)
        only = take_text(content, "only", APPROVED)
        if only not in (APPROVED, ALL):
            raise InputError(f"only is {only!r}, required {APPROVED} or {ALL}")
        recordings = self._studio.folder.project.lines.values()
        return await self._export(content, [each.number for each in recordings if only == ALL or each.mark == APPROVED])

    async def _export(self, content: dict[str, object], numbers: list[int]) -> Response:
        files = take_texts(content, "files", most=20, longest=40) if "files" in content else ()
        preset, face = find_preset(take_text(content, "preset", ""), files), take_text(content, "face", "")
        return reply_json(await to_thread(self._studio.export_several, numbers, preset, face))

    async def send_mesh(self, request: Request) -> Response:
        """Send the ``.glb`` of a face."""
        name = str(request.path_params["name"])
        try:
            content = await to_thread(self._studio.faces.load_mesh, name)
        except InputError as error:
            raise HTTPException(404, str(error)) from error
        return Response(content, headers=FRESH, media_type="model/gltf-binary")

    async def list_pronunciations(self, request: Request) -> Response:
        """List the pronunciations of a word."""
        return self._reply_word(_take_word(request.query_params))

    async def pronounce(self, request: Request) -> Response:
        """Store a pronunciation in the project."""
        content = await read_content(request)
        word, phones = _take_word(content), take_texts(content, "phones", most=MAX_PHONES)
        revision = take_int(content, "revision")
        if not phones or not set(phones) <= set(PHONES):
            raise InputError(f"the phones of a word are some of: {' '.join(PHONES)}")
        await to_thread(self._studio.folder.add_pronunciation, word, phones, revision)
        return self._reply_word(word)

    def _reply_word(self, word: str) -> Response:
        with self._studio.folder.lock:
            lexicon, revision = self._studio.folder.load_lexicon(), self._studio.folder.compute_word_revision(word)
        known = {"word": word, "known": lexicon.known(word), "own": word in lexicon.user}
        pronunciations = [list(phones) for phones in lexicon.pronunciations(word)]
        return reply_json(known | {"pronunciations": pronunciations, "revision": revision})

    async def begin_training(self, request: Request) -> Response:
        """Begin to make a voice or a face."""
        content = await read_content(request)
        kind, name = take_text(content, "kind"), take_text(content, "name", "")
        numbers = list(dict.fromkeys(take(content, "lines", [], items(NUMBER, most=MAX_RECORDINGS))))
        if not isinstance(options := content.get("options", {}), Mapping):
            raise InputError("options is no object of names and values")
        parsed = VoiceOptions.parsed(options)
        await to_thread(self._trainer.begin, kind, name, numbers, parsed)
        return await self.send_training(request, 201)

    def train_with(self, act: Callable[[], None], status: int = 200) -> Handler:
        """Return a handler that stops or continues what is being made."""

        async def reply(request: Request) -> Response:
            await read_content(request)
            await to_thread(act)
            return await self.send_training(request, status)

        return reply

    async def choose_voice(self, request: Request) -> Response:
        """Change the voice that the project uses."""
        content = await read_content(request)
        name, revision = take_text(content, "voice"), take_int(content, "revision")
        path, voice = await to_thread(self._studio.load_voice, name)
        self._studio.use_voice(path, voice, revision)
        return await self.send_training(request)

    async def send_training(self, _: Request, status: int = 200) -> Response:
        """Tell what is being made, or was made last; what can be made, and of what."""
        folder, trainer = self._studio.folder, self._trainer

        def describe() -> dict[str, Any]:
            videos, used = trainer.list_videos(), folder.project.model
            options = [
                {"name": each.name, "kind": kind_of(each).__name__, "usual": each.default}
                | {"choices": list(each.metadata["rule"].choices)}
                for each in fields(VoiceOptions)
            ]
            return {
                "job": trainer.describe() or None,
                "voices": [{"name": name, "used": path == used} for name, path in self._studio.list_voices().items()],
                "revision": folder.voice_revision,
                "faces": [path.relative_to(folder.path).as_posix() for path in trainer.list_files(FACE).values()],
                "videos": [{"id": v.number, "name": v.name, "duration_s": v.duration_s} for v in videos[:MAX_LISTED]],
                "count": len(videos),
                "recordings": folder.recordings.name if folder.recordings else "",
                "kinds": [VOICE, FACE],
                "options": options,
            }

        return reply_json(await to_thread(describe), status)


def _take_word(content: Mapping[str, Any]) -> str:
    """Return the word of a request as lexicons have it. Raises InputError: it is none, or several."""
    text = take_text(content, "word", longest=MAX_WORD)
    words = split_words(text)
    if len(words) != 1:
        raise InputError(f"{text!r} is {len(words)} words, required one")
    return words[0]
