"""Serving of a study over HTTP."""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import closing
from pathlib import Path

from lipmotion_studio.study.manifest import check_videos, read_study
from lipmotion_studio.study.store import StudyStore
from lipmotion_studio.web.listening import HOST, check_installed, listening, serve

PORT = 8000


def serve_study(
    folder: Path,
    *,
    host: str = HOST,
    port: int = PORT,
    names: Collection[str] = (),
    started: Callable[[str], object] | None = None,
) -> None:
    """Let raters take part in a study, until the process is stopped.

    host    : address to listen at; the default can be reached from this machine alone
    port    : 0: any that is free
    names   : of the server as raters call it, where another passes their requests on, as ``study.example.org``
    started : called with the address of the page once raters can come
    Every answer is on the disk before the rater's page learns that it is stored. A stopped study goes on where it was.
    Raises InputError: no study, a video is missing or has changed, or the address cannot be listened at.
    Raises MissingDependencyError: a package of the extra ``study`` is not installed.
    """
    check_installed("serving a study", "study")
    from lipmotion_studio.study.application import study_application

    study = read_study(folder)
    videos = check_videos(study, folder)
    with listening(host, port) as place, closing(StudyStore(folder)) as store:
        serve(study_application(study, videos, store, names), place, host=host, started=started)
