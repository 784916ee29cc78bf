"""The studio as a web application: a page, and what it asks for (docs/extend/studio.md); an ASGI application.

No part of an address and no text of a request is used as a path of a file: recordings, faces and files of the page are
looked up by number or name among those that there are, and what is dropped gets a name of the server's.
"""

from __future__ import annotations

from functools import partial
from importlib.resources import files

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from lipmotion_studio.folder import RevisionError
from lipmotion_studio.page_replies import ProjectReplies, RecordingReplies
from lipmotion_studio.recording import OpenRecording
from lipmotion_studio.requests import Access
from lipmotion_studio.studio import Studio
from lipmotion_studio.web.listening import read_page
from lipmotion_studio.web.replies import ERRORS, FRESH, HEADERS, Guard, SecurityHeaders, reply_failed

FIRST = "studio.html"
"""The page itself, whose address is empty."""
PAGE_POLICY = HEADERS["content-security-policy"] + (
    "; img-src 'self' blob: data:; media-src 'self' blob:; worker-src 'self' blob:; connect-src 'self' blob:"
)
"""Pictures, sounds and textures of models become objects of the page, whose addresses begin with ``blob:``."""


def create_application(studio: Studio, access: Access) -> Starlette:
    """Return the application; access: the token, and the addresses that the server has."""
    recordings, project = RecordingReplies(studio, access), ProjectReplies(studio)
    page = dict(read_page(files("lipmotion_studio") / "page"))

    async def packaged(request: Request) -> Response:
        file = page.get(request.path_params.get("name", "") or FIRST)
        if file is None:
            raise HTTPException(404, "no such page")
        return Response(file[0], headers=FRESH | {"content-type": file[1]})

    post = partial(Route, methods=["POST"])
    one = "/api/lines/{number}"
    routes = [
        Route("/api/project", project.project),
        Route("/api/progress", project.progress),
        post("/api/understand", project.understand),
        post("/api/lines", project.dropped),
        Route(one, recordings.recording),
        post(f"{one}/edits", recordings.edits),
        post(f"{one}/undo", recordings.stepping(OpenRecording.undo)),
        post(f"{one}/redo", recordings.stepping(OpenRecording.redo)),
        post(f"{one}/settle", recordings.settle),
        post(f"{one}/transcript", recordings.transcript),
        post(f"{one}/restore", recordings.restore),
        post(f"{one}/versions", recordings.keep),
        post(f"{one}/versions/forget", recordings.forget),
        post(f"{one}/versions/back", recordings.back),
        post(f"{one}/mark", project.mark),
        post(f"{one}/remove", project.remove),
        post(f"{one}/export", project.export_one),
        post(f"{one}/video", recordings.video),
        Route(f"{one}/sound.wav", recordings.sound),
        Route(f"{one}/recorded", recordings.recorded),
        post(f"{one}/votes", recordings.vote),
        Route(f"{one}/motion", recordings.motion),
        Route(f"{one}/weights", recordings.weights),
        Route(f"{one}/picture", recordings.picture),
        Route(f"{one}/why", recordings.why),
        Route(f"{one}/doubts", recordings.doubts),
        post("/api/export", project.export_all),
        Route("/api/faces/{name}.glb", project.mesh),
        Route("/api/lexicon", project.pronunciations),
        post("/api/lexicon", project.pronounce),
        Route("/api/training", project.training),
        post("/api/training", project.begin_training),
        post("/api/training/stop", project.training_after(studio.trainer.stop)),
        post("/api/training/again", project.training_after(studio.trainer.retry, 201)),
        post("/api/training/restore", project.training_after(studio.trainer.restore)),
        post("/api/voice", project.voice),
        Route("/", packaged),
        Route("/{name:path}", packaged),
    ]
    application = Starlette(routes=routes, exception_handlers=ERRORS | {RevisionError: partial(reply_failed, 409)})
    application.add_middleware(Guard, refusal=access.refusal)
    application.add_middleware(SecurityHeaders, headers=HEADERS | {"content-security-policy": PAGE_POLICY})
    return application
