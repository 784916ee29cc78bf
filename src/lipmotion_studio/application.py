"""The studio as a web application: a page, and what it asks for (docs/extend/studio.md); an ASGI application.

No part of an address and no text of a request is used as a path of a file: recordings, faces and files of the page are
looked up by number or name among those that there are, and what is dropped gets a name of the server's.
"""

from __future__ import annotations

import hmac
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from importlib.resources import files
from urllib.parse import parse_qs

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from lipmotion_studio.folder import RevisionError
from lipmotion_studio.page_replies import ProjectReplies, RecordingReplies
from lipmotion_studio.studio import Studio
from lipmotion_studio.web.listening import read_page
from lipmotion_studio.web.replies import ERRORS, FRESH, HEADERS, Guard, SecurityHeaders, refuse_foreign, reply_failed

TOKEN_HEADER = "x-lipmotion-token"  # noqa: S105 # its name
API = "/api"
KEY_DIGITS = 32
FIRST = "studio.html"  # the page itself, whose address is empty
PAGE_POLICY = HEADERS["content-security-policy"] + (
    "; img-src 'self' blob: data:; media-src 'self' blob:; worker-src 'self' blob:; connect-src 'self' blob:"
)
"""Pictures, sounds and textures of models become objects of the page, whose addresses begin with ``blob:``."""


@dataclass(frozen=True)
class Access:
    """What a request must bring: the token of this run, and a host (name with port, lower case) of this server."""

    token: str
    hosts: frozenset[str]

    def make_key(self, path: str) -> str:
        """Return the key that allows to load one address: for elements of a page, which bring no headers."""
        return hmac.new(self.token.encode(), path.encode(), sha256).hexdigest()[:KEY_DIGITS]

    def find_refusal(self, method: str, path: str, query: bytes, headers: dict[str, str]) -> tuple[int, str] | None:
        """Return why a request is refused, with a status; None: it is not."""
        foreign = refuse_foreign(path, headers, self.hosts.__contains__)
        if foreign or (path != API and not path.startswith(f"{API}/")):
            return foreign
        if hmac.compare_digest(headers.get(TOKEN_HEADER, "").encode(), self.token.encode()):
            return None
        key = parse_qs(query.decode("latin-1")).get("key", [""])[0] if method in ("GET", "HEAD") else ""
        if hmac.compare_digest(key.encode(), self.make_key(path).encode()):
            return None
        return 401, "the token is missing, or that of an earlier run; open the address that lipmotion studio printed"


def create_application(studio: Studio, access: Access) -> Starlette:
    """Return the application; access: the token, and the addresses that the server has."""
    recordings, project = RecordingReplies(studio, access.make_key), ProjectReplies(studio)
    page = dict(read_page(files("lipmotion_studio") / "page"))

    async def send_packaged(request: Request) -> Response:
        file = page.get(request.path_params.get("name", "") or FIRST)
        if file is None:
            raise HTTPException(404, "no such page")
        return Response(file[0], headers=FRESH | {"content-type": file[1]})

    post = partial(Route, methods=["POST"])
    one = "/api/lines/{number}"
    routes = [
        Route("/api/project", project.list_recordings),
        Route("/api/progress", project.send_progress),
        post("/api/understand", project.analyse),
        post("/api/lines", project.receive_recording),
        Route(one, recordings.open_recording),
        *(post(f"{one}/{name}", handler) for name, handler in recordings.list_changes().items()),
        post(f"{one}/transcript", recordings.change_words),
        post(f"{one}/restore", recordings.restore),
        post(f"{one}/mark", project.mark),
        post(f"{one}/remove", project.remove),
        post(f"{one}/export", project.export_one),
        post(f"{one}/video", recordings.send_video),
        Route(f"{one}/sound.wav", recordings.send_sound),
        Route(f"{one}/recorded", recordings.send_recorded),
        Route(f"{one}/motion", recordings.send_motion),
        Route(f"{one}/weights", recordings.send_weights),
        Route(f"{one}/picture", recordings.send_picture),
        Route(f"{one}/why", recordings.explain),
        Route(f"{one}/doubts", recordings.list_doubts),
        post("/api/export", project.export_all),
        Route("/api/faces/{name}.glb", project.send_mesh),
        Route("/api/lexicon", project.list_pronunciations),
        post("/api/lexicon", project.pronounce),
        Route("/api/training", project.send_training),
        post("/api/training", project.begin_training),
        post("/api/training/stop", project.train_with(studio.trainer.stop)),
        post("/api/training/again", project.train_with(studio.trainer.retry, 201)),
        post("/api/voice", project.choose_voice),
        Route("/", send_packaged),
        Route("/{name:path}", send_packaged),
    ]
    application = Starlette(routes=routes, exception_handlers=ERRORS | {RevisionError: partial(reply_failed, 409)})
    application.add_middleware(Guard, refusal=access.find_refusal)
    application.add_middleware(SecurityHeaders, headers=HEADERS | {"content-security-policy": PAGE_POLICY})
    return application
