"""What is replied to requests for the project and for several lines (docs/extend/studio.md)."""

from __future__ import annotations

from urllib.parse import unquote

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from lipmotion.errors import InputError
from lipmotion.types import values
from lipmotion.types.values import items
from lipmotion.units import PHONES
from lipmotion_studio.asked import content_of, member, text, texts, whole
from lipmotion_studio.presets import preset_of
from lipmotion_studio.project import APPROVED
from lipmotion_studio.studio import Studio
from lipmotion_studio.web.replies import FRESH, JSONResponse, write_body

LARGEST_UPLOAD_BYTES = 1 << 29
UPLOAD_S = 600.0
"""How long a recording may take to arrive."""
LONGEST_WORD, MOST_PHONES = 60, 60
ALL = "all"


class ProjectReplies:
    """Replies to requests for the project and its lines together."""

    def __init__(self, studio: Studio) -> None:
        self._studio, self._desk = studio, studio.desk

    async def project(self, request: Request) -> Response:
        """The lines, page by page, and what forms need."""
        query = request.query_params
        first, count = whole(query, "from", 0), whole(query, "count", 200, most=2000)
        chosen = {name: text(query, name, "") for name in ("order", "status", "mark")}
        found = await self._desk.beside(lambda: self._studio.listed(first, count, **chosen))
        return JSONResponse(found | {"largest_upload_bytes": LARGEST_UPLOAD_BYTES}, headers=FRESH)

    async def progress(self, _: Request) -> Response:
        """What is at work."""
        return JSONResponse(self._studio.progress(), headers=FRESH)

    async def understand(self, request: Request) -> Response:
        """Lines that are to be understood."""
        content = await content_of(request)
        lines = None if content.get("lines") == ALL else member(content, "lines", None, items(values.whole(0, 1 << 31)))
        return JSONResponse({"waiting": self._studio.understand(lines)}, headers=FRESH)

    async def dropped(self, request: Request) -> Response:
        """A recording that was dropped on the page, as body."""
        name = text(request.query_params, "name", longest=500)
        said = unquote(request.headers.get("x-lipmotion-transcript", ""), errors="replace")
        with self._studio.arriving() as file:
            with file.open("wb") as content:
                await write_body(request, content, LARGEST_UPLOAD_BYTES, UPLOAD_S)
            number = await self._desk.beside(lambda: self._studio.folder.drop(name, file, said))
        self._desk.queue([number])
        return JSONResponse(self._studio.row(self._studio.folder.line(number)), 201, headers=FRESH)

    async def mark(self, request: Request) -> Response:
        """A mark of a line."""
        number, content = self._number(request), await content_of(request)
        mark, revision = text(content, "mark"), whole(content, "revision")
        row = await self._desk.beside(lambda: self._studio.mark(number, revision, mark))
        return JSONResponse(row, headers=FRESH)

    async def remove(self, request: Request) -> Response:
        """A line that leaves the project."""
        number = self._number(request)
        self._studio.remove(number, whole(await content_of(request), "revision"))
        return JSONResponse({"removed": number}, headers=FRESH)

    async def export_line(self, request: Request) -> Response:
        """Files of one line."""
        number = self._number(request)
        return await self._exported(await content_of(request), [number])

    async def export_all(self, request: Request) -> Response:
        """Files of the lines that are approved, or of all."""
        content = await content_of(request)
        only = text(content, "only", APPROVED)
        if only not in (APPROVED, ALL):
            raise InputError(f"only is {only!r}, required {APPROVED} or {ALL}")
        lines = self._studio.folder.project.lines.values()
        return await self._exported(content, [line.number for line in lines if only == ALL or line.mark == APPROVED])

    async def _exported(self, content: dict[str, object], numbers: list[int]) -> Response:
        files = texts(content, "files", most=20, longest=40) if "files" in content else ()
        preset, face = preset_of(text(content, "preset", ""), files), text(content, "face", "")
        found = await self._desk.beside(lambda: self._studio.export_several(numbers, preset, face))
        return JSONResponse(found, headers=FRESH)

    async def mesh(self, request: Request) -> Response:
        """The ``.glb`` of a face."""
        name = str(request.path_params["name"])
        try:
            content = await self._desk.beside(lambda: self._studio.faces.mesh(name))
        except InputError as error:
            raise HTTPException(404, str(error)) from error
        return Response(content, headers=FRESH, media_type="model/gltf-binary")

    async def pronunciations(self, request: Request) -> Response:
        """How a word is pronounced."""
        return self._pronounced(_word(text(request.query_params, "word", longest=LONGEST_WORD)))

    async def pronounce(self, request: Request) -> Response:
        """A pronunciation that the project keeps."""
        content = await content_of(request)
        word, phones = _word(text(content, "word", longest=LONGEST_WORD)), texts(content, "phones", most=MOST_PHONES)
        revision = whole(content, "revision")
        unknown = [phone for phone in phones if phone not in PHONES]
        if unknown or not phones:
            raise InputError(f"the phones of a word are some of: {' '.join(PHONES)}")
        await self._desk.beside(lambda: self._studio.folder.add_pronunciation(word, phones, revision))
        return self._pronounced(word)

    def _pronounced(self, word: str) -> Response:
        with self._studio.folder.lock:
            lexicon, revision = self._studio.folder.lexicon(), self._studio.folder.word_revision(word)
        known = {"word": word, "known": lexicon.known(word), "own": word in lexicon.user}
        found = [list(phones) for phones in lexicon.pronunciations(word)]
        return JSONResponse(known | {"pronunciations": found, "revision": revision}, headers=FRESH)

    def _number(self, request: Request) -> int:
        return self._studio.number(str(request.path_params["number"]))


def _word(given: str) -> str:
    """Return a word as lexicons have it. Raises InputError: it is none, or several."""
    from lipmotion.units import split_words

    words = split_words(given)
    if len(words) != 1:
        raise InputError(f"{given!r} is {len(words)} words, required one")
    return words[0]
