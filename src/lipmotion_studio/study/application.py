"""The study as a web application: a page, its videos, and the answers; an ASGI application of Starlette."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Collection, Hashable, Mapping
from functools import lru_cache, partial
from importlib.resources import files
from ipaddress import ip_address
from pathlib import Path
from socket import gethostname
from typing import Any
from urllib.parse import urlsplit

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from lipmotion.errors import InputError
from lipmotion.types.values import items, members, number, text, whole
from lipmotion_studio.study.answers import HIGHEST_MOS, MOS, PAIRED, POSSIBLE, is_possible
from lipmotion_studio.study.manifest import VIDEOS, Study, StudyTrial, list_questions, order_trials
from lipmotion_studio.study.settings import POINTS, QUESTIONS, SCALES
from lipmotion_studio.study.store import AnswerSheet, StudyStore, name_rater
from lipmotion_studio.web.listening import read_page
from lipmotion_studio.web.replies import ERRORS, FRESH, Guard, SecurityHeaders, read_json, refuse_foreign, reply_json


class RateLimit:
    """Limits the requests of each asker: a number a second, and some more at once.

    Of askers whose allowance is full again nothing is kept: the memory is bounded by ``burst / rate_hz`` seconds of
    requests, and askers are few.
    """

    def __init__(self, rate_hz: float, burst: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._rate_hz, self._burst, self._clock = rate_hz, burst, clock
        self._full_at_s: dict[Hashable, float] = {}
        self._sweep_at = 1024

    def allows(self, asker: Hashable = "") -> bool:
        """Return whether one more request is allowed, and count it if it is."""
        now_s = self._clock()
        full_at_s = max(self._full_at_s.get(asker, now_s), now_s) + 1 / self._rate_hz
        if full_at_s - now_s > self._burst / self._rate_hz + 1e-9:
            return False
        self._full_at_s[asker] = full_at_s
        if len(self._full_at_s) > self._sweep_at:
            self._full_at_s = {who: at_s for who, at_s in self._full_at_s.items() if at_s > now_s}
            self._sweep_at = 2 * len(self._full_at_s) + 1024
        return True


SHARE_PLAYED = 0.9
"""Least time of a trial, as a share of the time that its videos last: clocks of browsers and files differ."""
LONGEST_S, MAX_PLAYS = 86_400.0, 1000
_MEMBERS = {
    "trial": whole(0, 1 << 31),
    "values": items(text(100)),
    "plays": items(whole(1, MAX_PLAYS)),
    "seconds": number(0, LONGEST_S),
}
_SHEET = members(_MEMBERS, _MEMBERS, alone=True)


def check_sheet(study: Study, trials: list[StudyTrial], rater: int, content: Any) -> AnswerSheet:
    """Return the answers that a page sent.

    trials  : in the order of this rater
    content : what the JSON text held: ``trial``, its number; ``values``, an answer to each question; ``plays``, how
              often each video was played to its end; ``seconds``, from the start of the trial to the answer
    Raises InputError: something else, an impossible value, or not all videos were played to their ends.
    """
    sheet = _SHEET(content)
    if sheet["trial"] >= len(trials):
        raise InputError(f"no such trial, required 0 to {len(trials) - 1}")
    trial, seconds = trials[sheet["trial"]], sheet["seconds"]
    if len(sheet["plays"]) != len(trial.videos):
        raise InputError(f"required the plays of {len(trial.videos)} videos")
    lasts_s = sum(video.seconds for video in study.list_shown(trial))
    if seconds < SHARE_PLAYED * lasts_s:
        raise InputError(f"{seconds:.1f} s for videos of {lasts_s:.1f} s; play all of them to their ends")
    answers, count = sheet["values"], len(list_questions(study, trial))
    if len(answers) != count:
        raise InputError(f"required {count} answers")
    if not all(is_possible(study.kind, value) for value in answers):
        raise InputError(f"an answer that is not possible, required {POSSIBLE[study.kind]}")
    values = tuple(answers if study.kind == PAIRED else (str(int(value)) for value in answers))
    return AnswerSheet(rater, sheet["trial"], values, seconds, sum(sheet["plays"]))


FIRST = "study.html"  # the page itself, whose address is empty
ANSWER_HZ, ANSWER_BURST = 5.0, 60  # requests a second of one rater: nobody judges videos faster
JOIN_HZ, JOIN_BURST = 5.0, 200  # new raters a second, of all addresses together: a class that begins at once fits in
WELL_KEPT = {"cache-control": "private, max-age=86400, immutable"}


def create_application(
    study: Study, videos: Mapping[str, Path], store: StudyStore, names: Collection[str] = ()
) -> Starlette:
    """Return the application.

    names  : by which raters reach the server, besides addresses of numbers and the names of this machine
    Requests by other names and of other sites' pages are refused; addresses of numbers are not: no site can fake one.
    """
    machine = gethostname().lower()
    known = {"localhost", machine, f"{machine}.local", *(name.lower().partition(":")[0] for name in names)}

    def is_own(host: str) -> bool:
        try:
            name = urlsplit(f"//{host}").hostname or ""
            return name in known or bool(ip_address(name))
        except ValueError:  # neither a known name nor an address of numbers
            return False

    replies = _Replies(study, store)
    page = dict(read_page(files("lipmotion_studio.study") / "page"))

    async def send_packaged(request: Request) -> Response:
        content, kind = page[request.url.path.removeprefix("/") or FIRST]
        return Response(content, headers=FRESH | {"content-type": kind})

    async def send_video(request: Request) -> Response:
        path = videos.get(request.path_params["name"])
        if path is None or not path.is_file():
            raise HTTPException(404, "no such video")
        return FileResponse(path, media_type="video/mp4", headers=WELL_KEPT)

    routes = [Route(f"/{name}".removesuffix(FIRST), send_packaged) for name in page]
    routes += [
        Route(f"/{VIDEOS}/{{name}}", send_video),
        Route("/api/study", replies.describe),
        Route("/api/raters", replies.join, methods=["POST"]),
        Route("/api/state", replies.send_state),
        Route("/api/answers", replies.answer, methods=["POST"]),
    ]
    application = Starlette(routes=routes, exception_handlers=ERRORS)
    application.add_middleware(Guard, refusal=lambda _, path, __, headers: refuse_foreign(path, headers, is_own, names))
    application.add_middleware(SecurityHeaders)
    return application


class _Replies:
    """Where raters join, get their trials, and hand in answers."""

    def __init__(self, study: Study, store: StudyStore) -> None:
        self._study, self._store = study, store
        self._answers = RateLimit(ANSWER_HZ, ANSWER_BURST)
        self._joins = RateLimit(JOIN_HZ, JOIN_BURST)
        self._trials = lru_cache(maxsize=1000)(partial(order_trials, study))

    async def describe(self, _: Request) -> Response:
        """Send what raters read before they begin; nothing of conditions."""
        study = self._study
        document = {"kind": study.kind, "title": study.title, "consent": study.consent.split("\n")}
        return reply_json(document | {"instructions": study.instructions.split("\n"), "asks": QUESTIONS[study.kind]})

    async def join(self, request: Request) -> Response:
        """Add a rater, who has agreed to take part."""
        if await read_json(request) != {"agrees": True}:
            raise InputError('required {"agrees": true}')
        if not self._joins.allows():
            raise HTTPException(429, "too many raters join at the same time; try again", {"retry-after": "2"})
        number, token = await asyncio.wrap_future(self._store.add_rater())
        return reply_json({"token": token, **self._describe_place(number, 0)}, 201)

    async def send_state(self, request: Request) -> Response:
        """Send the trial that a rater is at."""
        rater = self._find_rater(request)
        return reply_json(self._describe_place(rater, self._store.find_next_trial(rater)))

    async def answer(self, request: Request) -> Response:
        """Store the answers to the next trial, or again those to one that was answered; reply once they are stored."""
        rater = self._find_rater(request)
        sheet = check_sheet(self._study, self._trials(rater), rater, await read_json(request))
        following = self._store.find_next_trial(rater)
        if sheet.trial > following:
            raise HTTPException(409, f"trial {sheet.trial} comes after trial {following}")
        if sheet.trial == following:
            if not await asyncio.wrap_future(self._store.record(sheet)):
                raise HTTPException(401, "the rater has been forgotten")
            following += 1
        return reply_json({"stored": sheet.trial, **self._describe_place(rater, following)})

    def _find_rater(self, request: Request) -> int:
        """Return the rater of a request. Raises HTTPException: unknown, or too many requests."""
        scheme, _, token = request.headers.get("authorization", "").partition(" ")
        rater = self._store.find_rater(token) if scheme.lower() == "bearer" else None
        if rater is None:
            raise HTTPException(401, "this link is not known", {"www-authenticate": "Bearer"})
        if not self._answers.allows(rater):
            raise HTTPException(429, "too many requests; try again", {"retry-after": "2"})
        return rater

    def _describe_place(self, rater: int, number: int) -> dict[str, Any]:
        """Return what the page shows: a trial of a rater, and the videos of the one after it."""
        trials = self._trials(rater)
        place = {"rater": name_rater(rater), "trial": number, "trials": len(trials)}
        if number >= len(trials):
            return place
        study, trial = self._study, trials[number]
        videos, ahead = (
            [f"/{VIDEOS}/{video.file}" for each in some for video in study.list_shown(each)]
            for some in ([trial], trials[number + 1 : number + 2])
        )
        page: dict[str, Any] = {"practice": trial.practice, "note": trial.note, "videos": videos}
        if study.kind == MOS:
            names = [question for question, _, _ in list_questions(study, trial)]
            page["scales"] = [{"title": name.capitalize(), "asks": SCALES[name]} for name in names]
            page["points"] = POINTS[:HIGHEST_MOS]
        return place | page | {"ahead": ahead}
