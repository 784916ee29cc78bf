"""What is replied to requests for the project's own voices and faces (docs/extend/studio.md)."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import fields
from typing import Any

from starlette.requests import Request
from starlette.responses import Response

from lipmotion.types.configuration import kind_of
from lipmotion.types.values import items, whole
from lipmotion_studio import asked
from lipmotion_studio.asked import content_of, member, text
from lipmotion_studio.project import MAX_LINES
from lipmotion_studio.studio import Studio
from lipmotion_studio.trainer import MOST_LISTED
from lipmotion_studio.training import FACE, VOICE, VoiceOptions, check_options
from lipmotion_studio.web.replies import FRESH, JSONResponse


class TrainingReplies:
    """Replies to requests for voices and faces that are made here."""

    def __init__(self, studio: Studio) -> None:
        self._studio, self._desk, self._trainer = studio, studio.desk, studio.trainer

    async def training(self, _: Request) -> Response:
        """What is being made, or was made last; what can be made, and of what."""
        return await self._told()

    async def begin(self, request: Request) -> Response:
        """A voice or a face that is to be made."""
        content = await content_of(request)
        kind, name = text(content, "kind"), text(content, "name", "")
        lines = list(dict.fromkeys(member(content, "lines", [], items(whole(0, 1 << 31), most=MAX_LINES))))
        options = check_options(content.get("options", {}))
        await self._desk.beside(lambda: self._trainer.begin(kind, name, lines, options))
        return await self._told(201)

    def after(self, act: Callable[[], None], status: int = 200) -> Callable[[Request], Awaitable[Response]]:
        """Return what replies once something was done: what is made was stopped, gone on with, or restored."""

        async def replied(request: Request) -> Response:
            await content_of(request)
            await self._desk.beside(act)
            return await self._told(status)

        return replied

    async def voice(self, request: Request) -> Response:
        """The voice that the project uses from now on."""
        content = await content_of(request)
        name, revision = text(content, "voice"), asked.whole(content, "revision")
        path, voice = await self._desk.beside(lambda: self._studio.voice_model(name))
        self._studio.use_voice(path, voice, revision)
        return await self._told()

    async def _told(self, status: int = 200) -> Response:
        return JSONResponse(await self._desk.beside(self._document), status, FRESH)

    def _document(self) -> dict[str, Any]:
        project, trainer = self._studio.folder, self._trainer
        videos, used = trainer.videos(), project.project.model
        listed = [
            {"id": line.number, "name": line.name, "duration_s": line.duration_s} for line in videos[:MOST_LISTED]
        ]
        voices = [{"name": name, "used": path == used} for name, path in self._studio.voices().items()]
        return {
            "job": trainer.document(),
            "damage": trainer.damage,
            "restorable": bool(trainer.damage) and trainer.is_restorable,
            "earlier": trainer.earlier(),
            "voices": voices,
            "revision": project.voice_revision,
            "faces": [path.relative_to(project.path).as_posix() for path in trainer.made(FACE).values()],
            "videos": listed,
            "count": len(videos),
            "recordings": project.recordings.name if project.recordings else "",
            "kinds": [VOICE, FACE],
            "options": [_option(each) for each in fields(VoiceOptions)],
        }


def _option(each: Any) -> dict[str, Any]:
    choices = list(each.metadata["rule"].choices)
    return {"name": each.name, "kind": kind_of(each).__name__, "usual": each.default, "choices": choices}
