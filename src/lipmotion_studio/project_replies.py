"""What is replied to requests for the project: its recordings, voices and faces (docs/extend/studio.md)."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import fields
from typing import Any
from urllib.parse import unquote
from uuid import uuid4

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from lipmotion.errors import InputError
from lipmotion.storage.files import TEMPORARY, remove
from lipmotion.types import values
from lipmotion.types.configuration import kind_of
from lipmotion.types.values import items
from lipmotion.units import PHONES, split_words
from lipmotion_studio.presets import find_preset
from lipmotion_studio.project import APPROVED, MAX_RECORDINGS
from lipmotion_studio.requests import member, read_content, text, texts, whole
from lipmotion_studio.studio import Studio
from lipmotion_studio.trainer import MAX_LISTED
from lipmotion_studio.training import FACE, VOICE, VoiceOptions, check_options
from lipmotion_studio.web.replies import FRESH, json_reply, write_body

MAX_UPLOAD_BYTES = 1 << 29
UPLOAD_S = 600.0
"""How long a recording may take to arrive."""
MAX_WORD, MAX_PHONES = 60, 60
ALL = "all"
NUMBER = values.whole(0, 1 << 31)


class ProjectReplies:
    """Replies to requests for the project, its recordings together, and voices and faces that are made here."""

    def __init__(self, studio: Studio) -> None:
        self._studio, self._trainer, self._run_apart = studio, studio.trainer, studio.workspace.run_apart

    async def project(self, request: Request) -> Response:
        """The recordings, page by page, and what forms need."""
        query = request.query_params
        first, count = whole(query, "from", 0), whole(query, "count", 200, most=2000)
        chosen = {name: text(query, name, "") for name in ("order", "status", "mark")}
        document = await self._run_apart(lambda: self._studio.list_recordings(first, count, **chosen))
        return json_reply(document | {"largest_upload_bytes": MAX_UPLOAD_BYTES})

    async def progress(self, _: Request) -> Response:
        """What is at work."""
        return json_reply(self._studio.progress())

    async def understand(self, request: Request) -> Response:
        """Recordings that are to be analysed."""
        content = await read_content(request)
        known = self._studio.folder.project.lines
        numbers = list(known) if content.get("lines") == ALL else member(content, "lines", None, items(NUMBER))
        if not set(numbers) <= known.keys():
            raise HTTPException(404, "no such recording")
        return json_reply({"waiting": self._studio.workspace.queue(numbers)})

    async def dropped(self, request: Request) -> Response:
        """A recording that was dropped on the page, as body."""
        name = text(request.query_params, "name", longest=500)
        transcript = unquote(request.headers.get("x-lipmotion-transcript", ""), errors="replace")
        file = self._studio.folder.path / f"{TEMPORARY}{uuid4().hex}"
        try:
            with file.open("wb") as content:
                await write_body(request, content, MAX_UPLOAD_BYTES, UPLOAD_S)
            number = await self._run_apart(lambda: self._studio.folder.drop(name, file, transcript))
        finally:
            remove(file)
        self._studio.workspace.queue([number])
        return json_reply(self._studio.row(self._studio.folder.recording(number)), 201)

    async def mark(self, request: Request) -> Response:
        """A mark of a recording."""
        number, content = self._number(request), await read_content(request)
        mark, revision = text(content, "mark"), whole(content, "revision")
        return json_reply(await self._run_apart(lambda: self._studio.mark(number, revision, mark)))

    async def remove(self, request: Request) -> Response:
        """A recording that leaves the project; its files stay."""
        number, folder = self._number(request), self._studio.folder
        with folder.check_out(number, whole(await read_content(request), "revision")):
            folder.change(lambda project: project.without_recording(number))
            self._studio.workspace.forget(number)
        return json_reply({"removed": number})

    async def export_one(self, request: Request) -> Response:
        """Files of one recording."""
        number = self._number(request)
        return await self._export(await read_content(request), [number])

    async def export_all(self, request: Request) -> Response:
        """Files of the recordings that are approved, or of all."""
        content = await read_content(request)
        only = text(content, "only", APPROVED)
        if only not in (APPROVED, ALL):
            raise InputError(f"only is {only!r}, required {APPROVED} or {ALL}")
        recordings = self._studio.folder.project.lines.values()
        return await self._export(content, [each.number for each in recordings if only == ALL or each.mark == APPROVED])

    async def _export(self, content: dict[str, object], numbers: list[int]) -> Response:
        files = texts(content, "files", most=20, longest=40) if "files" in content else ()
        preset, face = find_preset(text(content, "preset", ""), files), text(content, "face", "")
        return json_reply(await self._run_apart(lambda: self._studio.export_several(numbers, preset, face)))

    async def mesh(self, request: Request) -> Response:
        """The ``.glb`` of a face."""
        name = str(request.path_params["name"])
        try:
            content = await self._run_apart(lambda: self._studio.faces.mesh(name))
        except InputError as error:
            raise HTTPException(404, str(error)) from error
        return Response(content, headers=FRESH, media_type="model/gltf-binary")

    async def pronunciations(self, request: Request) -> Response:
        """How a word is pronounced."""
        return self._reply_word(_word(request.query_params))

    async def pronounce(self, request: Request) -> Response:
        """A pronunciation that the project keeps."""
        content = await read_content(request)
        word, phones, revision = _word(content), texts(content, "phones", most=MAX_PHONES), whole(content, "revision")
        if not phones or not set(phones) <= set(PHONES):
            raise InputError(f"the phones of a word are some of: {' '.join(PHONES)}")
        await self._run_apart(lambda: self._studio.folder.add_pronunciation(word, phones, revision))
        return self._reply_word(word)

    def _reply_word(self, word: str) -> Response:
        with self._studio.folder.lock:
            lexicon, revision = self._studio.folder.lexicon(), self._studio.folder.word_revision(word)
        known = {"word": word, "known": lexicon.known(word), "own": word in lexicon.user}
        pronunciations = [list(phones) for phones in lexicon.pronunciations(word)]
        return json_reply(known | {"pronunciations": pronunciations, "revision": revision})

    async def training(self, _: Request) -> Response:
        """What is being made, or was made last; what can be made, and of what."""
        return await self._reply_training()

    async def begin_training(self, request: Request) -> Response:
        """A voice or a face that is to be made."""
        content = await read_content(request)
        kind, name = text(content, "kind"), text(content, "name", "")
        numbers = list(dict.fromkeys(member(content, "lines", [], items(NUMBER, most=MAX_RECORDINGS))))
        options = check_options(content.get("options", {}))
        await self._run_apart(lambda: self._trainer.begin(kind, name, numbers, options))
        return await self._reply_training(201)

    def training_after(self, act: Callable[[], None], status: int = 200) -> Callable[[Request], Awaitable[Response]]:
        """Return what replies once something was done: what is made was stopped, gone on with, or restored."""

        async def reply(request: Request) -> Response:
            await read_content(request)
            await self._run_apart(act)
            return await self._reply_training(status)

        return reply

    async def voice(self, request: Request) -> Response:
        """The voice that the project uses from now on."""
        content = await read_content(request)
        name, revision = text(content, "voice"), whole(content, "revision")
        path, voice = await self._run_apart(lambda: self._studio.load_voice(name))
        self._studio.use_voice(path, voice, revision)
        return await self._reply_training()

    async def _reply_training(self, status: int = 200) -> Response:
        return json_reply(await self._run_apart(self._training_document), status)

    def _training_document(self) -> dict[str, Any]:
        folder, trainer = self._studio.folder, self._trainer
        videos, used = trainer.videos(), folder.project.model
        options = []
        for each in fields(VoiceOptions):
            row = {"name": each.name, "kind": kind_of(each).__name__, "usual": each.default}
            options.append(row | {"choices": list(each.metadata["rule"].choices)})
        return {
            "job": trainer.document(),
            "damage": trainer.damage,
            "restorable": bool(trainer.damage) and trainer.is_restorable,
            "earlier": trainer.earlier(),
            "voices": [{"name": name, "used": path == used} for name, path in self._studio.voices().items()],
            "revision": folder.voice_revision,
            "faces": [path.relative_to(folder.path).as_posix() for path in trainer.files(FACE).values()],
            "videos": [{"id": v.number, "name": v.name, "duration_s": v.duration_s} for v in videos[:MAX_LISTED]],
            "count": len(videos),
            "recordings": folder.recordings.name if folder.recordings else "",
            "kinds": [VOICE, FACE],
            "options": options,
        }

    def _number(self, request: Request) -> int:
        return self._studio.number(str(request.path_params["number"]))


def _word(content: Mapping[str, Any]) -> str:
    """Return the word of a request as lexicons have it. Raises InputError: it is none, or several."""
    given = text(content, "word", longest=MAX_WORD)
    words = split_words(given)
    if len(words) != 1:
        raise InputError(f"{given!r} is {len(words)} words, required one")
    return words[0]
