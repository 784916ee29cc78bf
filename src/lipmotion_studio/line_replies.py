"""What is replied to requests for one line (docs/extend/studio.md)."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace
from typing import Any
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray
from starlette.requests import Request
from starlette.responses import FileResponse, Response

from lipmotion.errors import InputError, shorten
from lipmotion.storage.files import temporary_folder
from lipmotion.storage.json_text import as_json
from lipmotion.types import Motion
from lipmotion_faces.outputs.shown_faces import ShownPerson
from lipmotion_studio.access import Access
from lipmotion_studio.asked import content_of, objects, seconds, stretch, text, texts, whole
from lipmotion_studio.desk import READY, WORKING
from lipmotion_studio.folder import RevisionError
from lipmotion_studio.line import OpenLine, transcript_step
from lipmotion_studio.studio import Studio
from lipmotion_studio.votes import Vote, tally
from lipmotion_studio.web.replies import FRESH, json_reply

MOST_STEPS = 1000
LONGEST_TRANSCRIPT = 100_000
LONGEST_NAMES = 20_000
BEGINNING = "bytes=0-"
NUMBERS = ("motion", "delivered", "deviation", "confidence")
Changed = dict[str, Any]


class LineReplies:
    """Replies to requests for one line; what a line does is done in its own thread."""

    def __init__(self, studio: Studio, access: Access) -> None:
        self._studio, self._access, self._desk = studio, access, studio.desk

    async def line(self, request: Request) -> Response:
        """The state of a line; it is opened, and understood if it is new."""
        number = self._number(request)
        if self._desk.opened(number).line is None:
            return self._waiting(number)
        return await self._state_after(number, lambda _: {})

    async def edits(self, request: Request) -> Response:
        """Edits to be made."""
        content = await content_of(request)
        steps, revision = texts(content, "steps", most=MOST_STEPS), whole(content, "revision")
        instead, number = whole(content, "instead", 0), self._number(request)
        said = self._studio.with_pronunciations(steps)
        return await self._state_after(number, lambda line: line.edited(revision, said, instead))

    async def undo(self, request: Request) -> Response:
        """Edits to be taken back."""
        return await self._stepped(request, OpenLine.undone)

    async def redo(self, request: Request) -> Response:
        """Edits to be made again."""
        return await self._stepped(request, OpenLine.redone)

    async def settle(self, request: Request) -> Response:
        """The whole motion to be made, after edits of a long line."""
        revision = whole(await content_of(request), "revision")
        return await self._state_after(self._number(request), lambda line: line.settle(revision))

    async def transcript(self, request: Request) -> Response:
        """Words of a line, or of a stretch of it."""
        content, number = await content_of(request), self._number(request)
        said = text(content, "text", longest=LONGEST_TRANSCRIPT)
        revision = whole(content, "revision")
        is_part = "start_s" in content or "end_s" in content
        if not is_part and self._studio.say(number, revision, said):
            return self._waiting(number)
        start_s, end_s = seconds(content, "start_s", 0.0), seconds(content, "end_s", 1e6)

        def changed(line: OpenLine) -> Changed:
            step = transcript_step(said, start_s, min(end_s, line.last_s))
            return line.edited(revision, self._studio.with_pronunciations([step]))

        return await self._state_after(number, changed)

    async def sound(self, request: Request) -> Response:
        """The sound as it is played."""
        number = self._number(request)
        path = await self._desk.beside(lambda: self._studio.played(number))
        return FileResponse(path, media_type="audio/wav", headers=FRESH)

    async def recorded(self, request: Request) -> Response:
        """The real video, as browsers play it."""
        number = self._number(request)
        if request.headers.get("range", BEGINNING).startswith(BEGINNING):  # and not again for each part of it
            await self._desk.beside(lambda: self._studio.folder.checked_sound(self._studio.folder.line(number)))
        path, kind = await self._desk.beside(lambda: self._studio.played_video(number))
        return FileResponse(path, media_type=kind, headers=FRESH)

    async def vote(self, request: Request) -> Response:
        """Which of two motions somebody found better."""
        number, content = self._number(request), await content_of(request)
        revision, shown = whole(content, "revision"), [text(side, "by", "") for side in objects(content, "shown")]
        better = None if content.get("better") is None else whole(content, "better", most=1)

        def found() -> dict[str, Any]:
            with self._studio.folder.changing(number, revision) as line:
                vote = Vote(line.name, tuple(self._studio.side(number, by) for by in shown), better)
                return tally(self._studio.folder.add_vote(vote), vote)

        return json_reply(await self._desk.beside(found))

    async def keep(self, request: Request) -> Response:
        """The edits as they are, to be kept as a version."""
        revision, number = whole(await content_of(request), "revision"), self._number(request)

        def kept(line: OpenLine) -> Changed:
            with self._studio.folder.changing(number, revision) as now:
                version = now.with_version(line.file.edits.sentences)
                self._studio.folder.change_line(number, lambda _: version)
            return {}

        return await self._state_after(number, kept)

    async def forget(self, request: Request) -> Response:
        """A version that is kept no longer."""
        content, number = await content_of(request), self._number(request)
        revision, name = whole(content, "revision"), text(content, "version")

        def forgotten(_: OpenLine) -> Changed:
            with self._studio.folder.changing(number, revision) as now:
                left = now.without_version(name)
                self._studio.folder.change_line(number, lambda _: left)
            return {}

        return await self._state_after(number, forgotten)

    async def back(self, request: Request) -> Response:
        """A version to go back to; the edits as they are become one, too."""
        content, number = await content_of(request), self._number(request)
        revision, name = whole(content, "revision"), text(content, "version")
        return await self._state_after(number, lambda line: line.back_to(revision, name))

    async def restore(self, request: Request) -> Response:
        """The last good copy of edits that are damaged."""
        revision, number = whole(await content_of(request), "revision"), self._number(request)
        self._studio.restore(number, revision)
        return self._waiting(number)

    async def motion(self, request: Request) -> Response:
        """Numbers of the motion."""
        query = request.query_params
        of = text(query, "of", "motion")
        if of not in NUMBERS:
            raise InputError(f"of is {of!r}, required one of: {', '.join(NUMBERS)}")
        names = text(query, "names", longest=LONGEST_NAMES).split(",") if "names" in query else None
        by, number = text(query, "by", ""), self._number(request)

        def found(line: OpenLine) -> Response:
            motion = self._studio.line_as(number, line, by).numbers("variance" if of == "deviation" else of)
            if names is not None:
                motion = _only(motion, [name for name in names if name in motion.names] if by else names)
            frames = stretch(query, motion.rate_hz, len(motion.values))
            values = motion.values[frames]
            if of == "deviation":
                values = np.sqrt(np.maximum(values, 0))
            return _numbers(replace(motion, values=values), frames.start, {})

        return await self._desk.at(number, found)

    async def weights(self, request: Request) -> Response:
        """The weights of a face's morph targets."""
        query = request.query_params
        name, by, number = text(query, "face", "head"), text(query, "by", ""), self._number(request)

        def found(given: OpenLine) -> Response:
            line = self._studio.line_as(number, given, by)
            delivered = line.numbers("delivered")
            frames = stretch(query, delivered.rate_hz, len(delivered.values))
            is_part = frames.stop - frames.start < len(delivered.values)
            motion = line.weights(self._studio.faces.shown(name), frames if is_part else None)
            mesh = self._studio.faces.mesh_name(name, delivered)
            return _numbers(motion, frames.start, {"x-lipmotion-mesh": quote(mesh)})

        return await self._desk.at(number, found)

    async def picture(self, request: Request) -> Response:
        """A picture of a drawn face."""
        query = request.query_params
        time_s, shown = seconds(query, "time"), self._studio.drawn(text(query, "face", "woman"))
        by, number = text(query, "by", ""), self._number(request)

        def found(line: OpenLine) -> bytes:
            return as_png(self._studio.line_as(number, line, by).picture(time_s, shown))

        return Response(await self._desk.at(number, found), media_type="image/png", headers=FRESH)

    async def video(self, request: Request) -> Response:
        """A video of a stretch."""
        content = await content_of(request)
        start_s, end_s = seconds(content, "start_s"), seconds(content, "end_s")
        name, by, number = text(content, "face", "woman"), text(content, "by", ""), self._number(request)

        def found(given: OpenLine) -> bytes:
            self._studio.folder.checked_sound(self._studio.folder.line(number))
            shown = self._studio.faces.shown(name)
            line = self._studio.line_as(number, given, by, name)
            with temporary_folder() as folder:
                path = folder / "stretch.mp4"
                if isinstance(shown, ShownPerson):
                    line.write_film(path, start_s, end_s, shown)
                else:
                    line.write_video(path, start_s, end_s, self._studio.drawn(name))
                return path.read_bytes()

        return Response(await self._desk.at(number, found), media_type="video/mp4", headers=FRESH)

    async def why(self, request: Request) -> Response:
        """What determined a frame."""
        time_s = seconds(request.query_params, "time")
        return await self._json(request, lambda line: line.why(time_s))

    async def doubts(self, request: Request) -> Response:
        """The phones, the least sure first."""
        return await self._json(request, OpenLine.doubts)

    def _number(self, request: Request) -> int:
        """Return the number of a line. Raises HTTPException: there is none of that number."""
        return self._studio.number(str(request.path_params["number"]))

    async def _json(self, request: Request, found: Callable[[OpenLine], Any]) -> Response:
        return json_reply(await self._desk.at(self._number(request), found))

    async def _stepped(self, request: Request, step: Callable[[OpenLine, int, int], Changed]) -> Response:
        """Return the state of a line after so many of its edits were taken back, or made again."""
        content = await content_of(request)
        revision, count = whole(content, "revision"), whole(content, "count", 1, least=1)
        return await self._state_after(self._number(request), lambda line: step(line, revision, count))

    async def _state_after(self, number: int, do: Callable[[OpenLine], Changed]) -> Response:
        """Return the state of a line after something was done, and what that returns."""

        def done(line: OpenLine) -> Response:
            try:
                changed, status = do(line), 200
            except RevisionError as error:
                changed, status = {"error": str(error)}, 409
            state = {"media": self._media(number)} | line.state()
            with self._studio.folder.lock:
                state |= self._studio.line_document(number) | {"revision": line.revision}
            state["transcript"] = state["transcript"] or line.transcript
            return json_reply({**changed, "state": state} if status == 409 else state | changed, status)

        return await self._desk.at(number, done)

    def _waiting(self, number: int) -> Response:
        """Return what is said of a line that is not ready."""
        document = self._studio.line_document(number) | {"media": self._media(number)}
        if document["status"] == READY:  # since it was looked up: its state comes with the next request
            document["status"] = WORKING
        return json_reply(document)

    def _media(self, number: int) -> dict[str, Any]:
        video = self._studio.video_of(number)
        parts = {"sound": "sound.wav"} | ({"video": "recorded"} if video else {})
        addresses = {name: self._access.with_key(f"/api/lines/{number}/{path}") for name, path in parts.items()}
        return addresses | ({"sound_begins_s": video[1]} if video else {})


def _only(motion: Motion, names: list[str]) -> Motion:
    """Return some channels of a motion, in the order of their names. Raises InputError: it has none of a name."""
    for name in names:
        if name not in motion.names:
            raise InputError(f"names: there is no {shorten(repr(name))}, required some of: {', '.join(motion.names)}")
    columns = list(map(motion.column, names))
    channels = tuple(motion.channels[column] for column in columns)
    return replace(motion, values=motion.values[:, columns], channels=channels)


def as_png(picture: NDArray[np.uint8]) -> bytes:
    """Return a picture [shape=(H, W, 3)] as PNG."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(picture)).save(file, format="PNG", compress_level=3)
    return file.getvalue()


def _numbers(motion: Motion, first: int, more: dict[str, str]) -> Response:
    headers = {
        "x-lipmotion-names": as_json(list(motion.names), ensure_ascii=True),
        "x-lipmotion-rate": f"{motion.rate_hz:g}",
        "x-lipmotion-first": str(first),
    }
    content = np.ascontiguousarray(motion.values, "<f4").tobytes()
    return Response(content, headers=FRESH | headers | more, media_type="application/octet-stream")
