"""What is replied to requests for one recording (docs/extend/studio.md)."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace
from typing import Any
from urllib.parse import quote

import numpy as np
from starlette.requests import Request
from starlette.responses import FileResponse, Response

from lipmotion.errors import InputError, shorten
from lipmotion.storage.files import temporary_folder
from lipmotion.storage.json_text import as_json
from lipmotion.types import Motion
from lipmotion_faces.outputs.shown_faces import ShownPerson
from lipmotion_studio.folder import RevisionError
from lipmotion_studio.project import ProjectRecording
from lipmotion_studio.recording import OpenRecording
from lipmotion_studio.requests import Access, objects, read_content, seconds, stretch, text, texts, whole
from lipmotion_studio.studio import Studio
from lipmotion_studio.votes import Vote, tally
from lipmotion_studio.web.replies import FRESH, json_reply
from lipmotion_studio.workspace import READY, WORKING

MAX_STEPS = 1000
MAX_TRANSCRIPT = 100_000
MAX_NAMES = 20_000
BEGINNING = "bytes=0-"
NUMBERS = ("motion", "delivered", "deviation", "confidence")
Changed = dict[str, Any]


class RecordingReplies:
    """Replies to requests for one recording; what it does is done in its own thread."""

    def __init__(self, studio: Studio, access: Access) -> None:
        self._studio, self._access, self._workspace = studio, access, studio.workspace

    async def recording(self, request: Request) -> Response:
        """The state of a recording; it is opened, and analysed if it is new."""
        number = self._number(request)
        if self._workspace.open(number).recording is None:
            return self._waiting(number)
        return await self._state_after(number, lambda _: {})

    async def edits(self, request: Request) -> Response:
        """Edits to be made."""
        number, content, revision = await self._change(request)
        steps, instead = texts(content, "steps", most=MAX_STEPS), whole(content, "instead", 0)
        commands = self._studio.add_phones(steps)
        return await self._state_after(number, lambda recording: recording.edit(revision, commands, instead))

    async def undo(self, request: Request) -> Response:
        """Edits to be taken back."""
        return await self._step(request, OpenRecording.undo)

    async def redo(self, request: Request) -> Response:
        """Edits to be made again."""
        return await self._step(request, OpenRecording.redo)

    async def settle(self, request: Request) -> Response:
        """The full motion to be made, after edits of a long recording."""
        number, _, revision = await self._change(request)
        return await self._state_after(number, lambda recording: recording.settle(revision))

    async def transcript(self, request: Request) -> Response:
        """Words of a recording, or of a stretch of it."""
        number, content, revision = await self._change(request)
        words = text(content, "text", longest=MAX_TRANSCRIPT)
        is_part = "start_s" in content or "end_s" in content
        if not is_part and self._studio.analyse_again(number, revision, words):
            return self._waiting(number)
        start_s, end_s = seconds(content, "start_s", 0.0), seconds(content, "end_s", 1e6)

        def change(recording: OpenRecording) -> Changed:
            last_s = min(end_s, recording.last_s)
            step = f"say {' '.join(words.split())} from {start_s:.3f} to {last_s:.3f}"
            return recording.edit(revision, self._studio.add_phones([step]))

        return await self._state_after(number, change)

    async def sound(self, request: Request) -> Response:
        """The sound as it is played."""
        number = self._number(request)
        path = await self._workspace.run_apart(lambda: self._studio.prepare_sound(number))
        return FileResponse(path, media_type="audio/wav", headers=FRESH)

    async def recorded(self, request: Request) -> Response:
        """The real video, as browsers play it."""
        number, folder = self._number(request), self._studio.folder
        if request.headers.get("range", BEGINNING).startswith(BEGINNING):  # and not again for each part of it
            await self._workspace.run_apart(lambda: folder.check_sound(folder.recording(number)))
        path, kind = await self._workspace.run_apart(lambda: self._studio.prepare_video(number))
        return FileResponse(path, media_type=kind, headers=FRESH)

    async def vote(self, request: Request) -> Response:
        """Which of two motions somebody found better."""
        number, content, revision = await self._change(request)
        shown = [text(side, "by", "") for side in objects(content, "shown")]
        better = None if content.get("better") is None else whole(content, "better", most=1)

        def add() -> dict[str, Any]:
            with self._studio.folder.check_out(number, revision) as recording:
                vote = Vote(recording.name, tuple(self._studio.side(number, by) for by in shown), better)
                return tally(self._studio.folder.add_vote(vote), vote)

        return json_reply(await self._workspace.run_apart(add))

    async def keep(self, request: Request) -> Response:
        """The edits as they are, to be kept as a version."""
        number, _, revision = await self._change(request)
        return await self._change_versions(
            number, revision, lambda now, recording: now.with_version(recording.file.edits.sentences)
        )

    async def forget(self, request: Request) -> Response:
        """A version that is kept no longer."""
        number, content, revision = await self._change(request)
        name = text(content, "version")
        return await self._change_versions(number, revision, lambda now, _: now.without_version(name))

    async def back(self, request: Request) -> Response:
        """A version to go back to; the edits as they are become one, too."""
        number, content, revision = await self._change(request)
        name = text(content, "version")
        return await self._state_after(number, lambda recording: recording.restore_version(revision, name))

    async def restore(self, request: Request) -> Response:
        """The last good copy of edits that are damaged."""
        number, _, revision = await self._change(request)
        with self._studio.folder.check_out(number, revision) as recording:
            self._studio.folder.restore_edits(recording)
            self._workspace.forget(number)
        self._workspace.open(number)
        return self._waiting(number)

    async def motion(self, request: Request) -> Response:
        """Numbers of the motion."""
        query = request.query_params
        of = text(query, "of", "motion")
        if of not in NUMBERS:
            raise InputError(f"of is {of!r}, required one of: {', '.join(NUMBERS)}")
        names = text(query, "names", longest=MAX_NAMES).split(",") if "names" in query else None
        by, number = text(query, "by", ""), self._number(request)

        def reply(recording: OpenRecording) -> Response:
            motion = self._studio.vary(number, recording, by).numbers("variance" if of == "deviation" else of)
            if names is not None:
                motion = _choose_channels(motion, [name for name in names if name in motion.names] if by else names)
            frames = stretch(query, motion.rate_hz, len(motion.values))
            values = motion.values[frames]
            if of == "deviation":
                values = np.sqrt(np.maximum(values, 0))
            return _numbers_reply(replace(motion, values=values), frames.start, {})

        return await self._workspace.run(number, reply)

    async def weights(self, request: Request) -> Response:
        """The weights of a face's morph targets."""
        query = request.query_params
        name, by, number = text(query, "face", "head"), text(query, "by", ""), self._number(request)

        def reply(opened: OpenRecording) -> Response:
            recording = self._studio.vary(number, opened, by)
            styled = recording.numbers("delivered")
            frames = stretch(query, styled.rate_hz, len(styled.values))
            is_part = frames.stop - frames.start < len(styled.values)
            motion = recording.weights(self._studio.faces.shown(name), frames if is_part else None)
            mesh = self._studio.faces.mesh_name(name, styled)
            return _numbers_reply(motion, frames.start, {"x-lipmotion-mesh": quote(mesh)})

        return await self._workspace.run(number, reply)

    async def picture(self, request: Request) -> Response:
        """A picture of a drawn face, as PNG."""
        query = request.query_params
        time_s, face = seconds(query, "time"), self._studio.drawn_face(text(query, "face", "woman"))
        by, number = text(query, "by", ""), self._number(request)

        def draw(recording: OpenRecording) -> bytes:
            from PIL import Image

            picture, file = self._studio.vary(number, recording, by).picture(time_s, face), io.BytesIO()
            Image.fromarray(np.ascontiguousarray(picture)).save(file, format="PNG", compress_level=3)
            return file.getvalue()

        return Response(await self._workspace.run(number, draw), media_type="image/png", headers=FRESH)

    async def video(self, request: Request) -> Response:
        """A video of a stretch."""
        content = await read_content(request)
        start_s, end_s = seconds(content, "start_s"), seconds(content, "end_s")
        name, by, number = text(content, "face", "woman"), text(content, "by", ""), self._number(request)

        def write(opened: OpenRecording) -> bytes:
            self._studio.folder.check_sound(self._studio.folder.recording(number))
            face = self._studio.faces.shown(name)
            recording = self._studio.vary(number, opened, by, name)
            with temporary_folder() as folder:
                path = folder / "stretch.mp4"
                if isinstance(face, ShownPerson):
                    recording.write_film(path, start_s, end_s, face)
                else:
                    recording.write_video(path, start_s, end_s, self._studio.drawn_face(name))
                return path.read_bytes()

        return Response(await self._workspace.run(number, write), media_type="video/mp4", headers=FRESH)

    async def why(self, request: Request) -> Response:
        """What determined a frame."""
        time_s, number = seconds(request.query_params, "time"), self._number(request)
        return json_reply(await self._workspace.run(number, lambda recording: recording.why(time_s)))

    async def doubts(self, request: Request) -> Response:
        """The phones, the least sure first."""
        return json_reply(await self._workspace.run(self._number(request), OpenRecording.doubts))

    def _number(self, request: Request) -> int:
        """Return the number of a recording. Raises HTTPException: there is none of that number."""
        return self._studio.number(str(request.path_params["number"]))

    async def _change(self, request: Request) -> tuple[int, dict[str, Any], int]:
        """Return the recording of a change, what it brings, and the revision that its author saw."""
        content = await read_content(request)
        return self._number(request), content, whole(content, "revision")

    async def _step(self, request: Request, step: Callable[[OpenRecording, int, int], Changed]) -> Response:
        """Return the state of a recording after so many of its edits were taken back, or made again."""
        number, content, revision = await self._change(request)
        count = whole(content, "count", 1, least=1)
        return await self._state_after(number, lambda recording: step(recording, revision, count))

    async def _change_versions(
        self, number: int, revision: int, changed: Callable[[ProjectRecording, OpenRecording], ProjectRecording]
    ) -> Response:
        def change(recording: OpenRecording) -> Changed:
            with self._studio.folder.check_out(number, revision) as now:
                other = changed(now, recording)
                self._studio.folder.change_recording(number, lambda _: other)
            return {}

        return await self._state_after(number, change)

    async def _state_after(self, number: int, do: Callable[[OpenRecording], Changed]) -> Response:
        """Return the state of a recording after something was done, and what that returns."""

        def reply(recording: OpenRecording) -> Response:
            try:
                changed, status = do(recording), 200
            except RevisionError as error:
                changed, status = {"error": str(error)}, 409
            state = {"media": self._media(number)} | recording.state()
            with self._studio.folder.lock:
                state |= self._studio.recording_document(number) | {"revision": recording.revision}
            state["transcript"] = state["transcript"] or recording.transcript
            return json_reply({**changed, "state": state} if status == 409 else state | changed, status)

        return await self._workspace.run(number, reply)

    def _waiting(self, number: int) -> Response:
        """Return the reply for a recording that is not ready."""
        document = self._studio.recording_document(number) | {"media": self._media(number)}
        if document["status"] == READY:  # since it was looked up: its state comes with the next request
            document["status"] = WORKING
        return json_reply(document)

    def _media(self, number: int) -> dict[str, Any]:
        video = self._studio.find_video(number)
        parts = {"sound": "sound.wav"} | ({"video": "recorded"} if video else {})
        addresses = {name: self._access.with_key(f"/api/lines/{number}/{path}") for name, path in parts.items()}
        return addresses | ({"sound_begins_s": video[1]} if video else {})


def _choose_channels(motion: Motion, names: list[str]) -> Motion:
    """Return some channels of a motion, in the order of their names. Raises InputError: it has none of a name."""
    for name in names:
        if name not in motion.names:
            raise InputError(f"names: there is no {shorten(repr(name))}, required some of: {', '.join(motion.names)}")
    return motion.selected(names)


def _numbers_reply(motion: Motion, first: int, more: dict[str, str]) -> Response:
    headers = {
        "x-lipmotion-names": as_json(list(motion.names), ensure_ascii=True),
        "x-lipmotion-rate": f"{motion.rate_hz:g}",
        "x-lipmotion-first": str(first),
    }
    content = np.ascontiguousarray(motion.values, "<f4").tobytes()
    return Response(content, headers=FRESH | headers | more, media_type="application/octet-stream")
