"""A studio with one line of the toy's speech, which requests are sent to in this process."""

import asyncio
import shutil
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from lipmotion import Model
from lipmotion_studio.application import TOKEN_HEADER, Access, create_application
from lipmotion_studio.folder import ProjectFolder, open_folder
from lipmotion_studio.studio import KnownModel, Studio
from study.asgi import Application, Reply, answered, ask

TOY_DIGEST = "0" * 64
HOST, TOKEN = "127.0.0.1:8000", "a-token"
SENT = {"host": HOST, TOKEN_HEADER: TOKEN}
PATIENCE_S = 120.0


class OpenStudio(NamedTuple):
    folder: ProjectFolder
    studio: Studio
    application: Application

    def ask(self, path: str, content: Any = None, **headers: str) -> Reply:
        sent = SENT | {name.replace("_", "-"): value for name, value in headers.items()}
        return ask(self.application, path, content, headers=sent)

    def ask_together(self, *requests: tuple[str, Any]) -> list[Reply]:
        async def replies() -> list[Reply]:
            sent = (answered(self.application, path, content, headers=SENT) for path, content in requests)
            return list(await asyncio.gather(*sent))

        return asyncio.run(replies())

    def ready(self, number: int = 1) -> dict[str, Any]:
        ends_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < ends_s:
            state = self.ask(f"/api/lines/{number}").content
            if state["status"] not in ("waiting", "working"):
                return dict(state)
            time.sleep(0.02)
        raise AssertionError(f"line {number} is not ready after {PATIENCE_S} s")

    def row(self, number: int = 1) -> dict[str, Any]:
        return self.studio.describe_row(self.folder.find_recording(number))

    def change(self, what: str, number: int = 1, **content: Any) -> Reply:
        """Return the reply to a change of a line by somebody who sees it as it is."""
        return self.ask(f"/api/lines/{number}/{what}", {"revision": self.row(number)["revision"], **content})

    def edit(self, *steps: str, **more: Any) -> Reply:
        """Return the reply to edits of the first line as it is."""
        revision = self.ready()["revision"]
        return self.ask("/api/lines/1/edits", {"revision": revision, "steps": list(steps), **more})


def toy(model: Model) -> KnownModel:
    """Return a model of the tests, which has no file, as the studio knows models."""
    return KnownModel(model, "toy", TOY_DIGEST)


@contextmanager
def open_studio(speech: Path, transcript: str, model: Model, folder: Path) -> Iterator[OpenStudio]:
    """Give a studio of a recording that is copied into a folder."""
    folder.mkdir(exist_ok=True)
    sound = folder / "line.wav"
    if not sound.exists():
        shutil.copy(speech, sound)
        sound.with_suffix(".txt").write_text(transcript, encoding="utf-8")
    with open_folder(sound) as opened, closing(Studio(opened, toy(model))) as studio:
        yield OpenStudio(opened, studio, create_application(studio, Access(TOKEN, frozenset({HOST}))))
