"""The studio as a web application: a page, and what it asks for (docs/extend/studio.md); an ASGI application.

No part of an address and no text of a request is used as a path of a file: lines, faces and files of the page are
looked up by number or name among those that there are, and what is dropped gets a name of the server's.
"""

from __future__ import annotations

from functools import partial

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from lipmotion_studio.access import Access
from lipmotion_studio.folder import RevisionError
from lipmotion_studio.line_replies import LineReplies
from lipmotion_studio.page_files import page_files
from lipmotion_studio.project_replies import ProjectReplies
from lipmotion_studio.studio import Studio
from lipmotion_studio.training_replies import TrainingReplies
from lipmotion_studio.web.replies import ERRORS, FRESH, HEADERS, Guard, SecurityHeaders, failed

PAGE_POLICY = HEADERS["content-security-policy"] + (
    "; img-src 'self' blob: data:; media-src 'self' blob:; worker-src 'self' blob:; connect-src 'self' blob:"
)
"""Pictures, sounds and textures of models become objects of the page, whose addresses begin with ``blob:``."""


def studio_application(studio: Studio, access: Access) -> Starlette:
    """Return the application.

    access : the token, and the addresses that the server has
    """
    lines, project, training = LineReplies(studio, access), ProjectReplies(studio), TrainingReplies(studio)
    page = page_files()

    async def packaged(request: Request) -> Response:
        found = page.get(request.path_params.get("name", ""))
        if found is None:
            raise HTTPException(404, "no such page")
        return Response(found.content, headers=FRESH | {"content-type": found.kind})

    post = partial(Route, methods=["POST"])
    one = "/api/lines/{number}"
    routes = [
        Route("/api/project", project.project),
        Route("/api/progress", project.progress),
        post("/api/understand", project.understand),
        post("/api/lines", project.dropped),
        Route(one, lines.line),
        post(f"{one}/edits", lines.edits),
        post(f"{one}/undo", lines.undo),
        post(f"{one}/redo", lines.redo),
        post(f"{one}/settle", lines.settle),
        post(f"{one}/transcript", lines.transcript),
        post(f"{one}/restore", lines.restore),
        post(f"{one}/versions", lines.keep),
        post(f"{one}/versions/forget", lines.forget),
        post(f"{one}/versions/back", lines.back),
        post(f"{one}/mark", project.mark),
        post(f"{one}/remove", project.remove),
        post(f"{one}/export", project.export_line),
        post(f"{one}/video", lines.video),
        Route(f"{one}/sound.wav", lines.sound),
        Route(f"{one}/recorded", lines.recorded),
        post(f"{one}/votes", lines.vote),
        Route(f"{one}/motion", lines.motion),
        Route(f"{one}/weights", lines.weights),
        Route(f"{one}/picture", lines.picture),
        Route(f"{one}/why", lines.why),
        Route(f"{one}/doubts", lines.doubts),
        post("/api/export", project.export_all),
        Route("/api/faces/{name}.glb", project.mesh),
        Route("/api/lexicon", project.pronunciations),
        post("/api/lexicon", project.pronounce),
        Route("/api/training", training.training),
        post("/api/training", training.begin),
        post("/api/training/stop", training.after(studio.trainer.stop)),
        post("/api/training/again", training.after(studio.trainer.again, 201)),
        post("/api/training/restore", training.after(studio.trainer.restore)),
        post("/api/voice", training.voice),
        Route("/", packaged),
        Route("/{name:path}", packaged),
    ]
    application = Starlette(routes=routes, exception_handlers=ERRORS | {RevisionError: partial(failed, 409)})
    application.add_middleware(Guard, refusal=access.refusal)
    application.add_middleware(SecurityHeaders, headers=HEADERS | {"content-security-policy": PAGE_POLICY})
    return application
