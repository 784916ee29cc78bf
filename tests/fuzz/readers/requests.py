"""Bodies and queries of requests to the studio and to a study, which reply with JSON that every program reads."""

import json
import tempfile
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import Any

from fuzz.inputs import Files, Good
from fuzz.plausible import good_model, refuse_constant, require, short_speech
from lipmotion_studio.application import TOKEN_HEADER
from lipmotion_studio.study.application import create_application
from lipmotion_studio.study.manifest import check_videos
from lipmotion_studio.study.store import StudyStore
from pipeline.made import write_sound
from studio.open_studio import HOST, TOKEN, open_studio
from study.asgi import Application, ask
from study.small_study import small_study

LINE = "/api/lines/1"
SIDES = [{"by": ""}, {"by": "version-1"}]
REQUESTS: dict[str, tuple[str, Any]] = {
    "edits": (f"{LINE}/edits", {"revision": 0, "steps": ["set intensity 1.2", "hold from 0.1 to 0.2"], "instead": 0}),
    "undo": (f"{LINE}/undo", {"revision": 0, "count": 1}),
    "transcript": (f"{LINE}/transcript", {"revision": 0, "text": "baby", "start_s": 0.1, "end_s": 0.6}),
    "versions": (f"{LINE}/versions", {"revision": 0}),
    "back": (f"{LINE}/versions/back", {"revision": 0, "version": "version-1", "name": "version-1"}),
    "mark": (f"{LINE}/mark", {"revision": 0, "mark": "redo"}),
    "votes": (f"{LINE}/votes", {"revision": 0, "shown": SIDES, "better": 1}),
    "understand": ("/api/understand", {"lines": [2, 3]}),
    "export": ("/api/export", {"only": "approved", "files": [".json"], "preset": "", "face": ""}),
    "lexicon": ("/api/lexicon", {"word": "zoe", "phones": ["z", "ow", "iy"]}),
    "training": ("/api/training", {"kind": "voice", "name": "a", "lines": [7], "options": {"unknown": 1}}),
    "voice": ("/api/voice", {"voice": "a"}),
    "answers": ("/api/answers", {"trial": 0, "values": ["first"], "plays": [1, 1], "seconds": 2.5}),
    "raters": ("/api/raters", {"agrees": True}),
    "motion": (f"{LINE}/motion", {"query": {"of": "motion", "start_s": "0.1", "end_s": "0.3", "names": "opening"}}),
    "why": (f"{LINE}/why", {"query": {"time": "0.2"}}),
    "project": ("/api/project", {"query": {"from": "0", "count": "20", "order": "name", "status": "", "mark": ""}}),
}


def seeds(_: Good) -> list[Files]:
    """Return a body of every request."""
    return [{f"{name}.json": json.dumps(content).encode()} for name, (_, content) in REQUESTS.items()]


def read(folder: Path, good: Good) -> None:
    """Send the body, or the query in it; no reply is that of a bug, and every one of JSON is JSON."""
    (path,) = folder.iterdir()
    address, usual = REQUESTS[path.stem]
    body: Any = path.read_bytes()
    if "query" in usual:
        try:
            query = json.loads(body)["query"].items()
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            return
        address, body = address + "?" + "&".join(f"{name}={value}" for name, value in query), None
        address = address.encode("utf-8", "replace").decode()
    studio, study, token = _applications(good)
    headers = {"host": HOST, TOKEN_HEADER: TOKEN} if path.stem not in ("answers", "raters") else {}
    application = studio if headers else study
    reply = ask(application, address, body, headers=headers, token="" if headers else token)
    require(reply.status < 500 or reply.status == 503, f"the status {reply.status}")
    if reply.headers.get("content-type", "").startswith("application/json"):
        json.loads(reply.body.decode("utf-8"), parse_constant=refuse_constant)


@cache
def _applications(good: Good) -> tuple[Application, Application, str]:
    """Return a studio with a line that is understood, a study, and the token of a rater, for this process."""
    usual, tempfile.tempdir = tempfile.tempdir, str(good.corpus.parent)
    try:
        place = Path(tempfile.mkdtemp(prefix="requests-"))
        write_sound(place / "line.wav", short_speech(good))
        opened = ExitStack().enter_context(open_studio(place / "line.wav", "baby", good_model(good), place / "work"))
    finally:
        tempfile.tempdir = usual
    opened.ready()
    study = small_study(place / "study")
    store = StudyStore(place / "study", create=True)
    application = create_application(study, check_videos(study, place / "study"), store)
    return opened.application, application, ask(application, "/api/raters", {"agrees": True}).content["token"]
