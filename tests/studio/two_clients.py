"""Two clients of a studio, whose project is changed behind their backs: what was acknowledged is there, and no more.

A shadow of the project holds what was acknowledged. A change is made exactly where its author has seen the line as it
is; what is refused changes nothing; sounds and edits of lines that were removed stay as they were.
"""

import json
import shutil
import tempfile
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule, run_state_machine_as_test

from lipmotion import Model
from lipmotion_studio.application import Access, create_application
from lipmotion_studio.folder import open_folder
from lipmotion_studio.project import digest_edits
from lipmotion_studio.studio import Studio
from pipeline.made import write_sound
from studio.open_studio import HOST, TOKEN, OpenStudio, toy
from study.asgi import Reply
from study.small_study import sha256_of
from testing.toy import ToySentence

EDITS = ("phone 2 is p", "pin opening 0.1 at 0.2", "set intensity 1.1", "remove phone 3", "phone 99 is p")
"""The last one is refused: there is no such phone."""
MAX_RECORDINGS = 4
TWO_WORDS_S = 0.4, 1.24  # where the first two words of the sentence are said


@dataclass
class Shadow:
    """What was acknowledged of a line."""

    number: int
    name: str
    sound: Path
    sha256: str
    words: str
    mark: str = "none"
    steps: list[str] = field(default_factory=list)
    undone: list[str] = field(default_factory=list)
    versions: dict[str, list[str]] = field(default_factory=dict)

    @property
    def content(self) -> str:
        """All that a client may have seen of it."""
        return repr((self.words, self.mark, self.steps, self.undone, self.versions))


def sounds_of(sentence: ToySentence, folder: Path) -> list[Path]:
    """Write two words as sounds that last equally long, and are other ones; return where."""
    part = slice(*(round(time_s * sentence.audio.rate_hz) for time_s in TWO_WORDS_S))
    sound = replace(sentence.audio, samples=sentence.audio.samples[part])
    paths = [folder / f"sound-{number}.wav" for number in range(3)]
    for number, path in enumerate(paths):
        write_sound(path, replace(sound, samples=sound.samples * (1 - 0.1 * number)))
    return paths


class TwoClients(RuleBasedStateMachine):
    """See the top of the file."""

    model: Model
    sounds: list[Path]
    words: tuple[str, str]
    steps = acknowledged = late = refused = 0

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp())
        self.lines: dict[int, Shadow] = {}
        self.removed: list[Shadow] = []
        self.seen: dict[tuple[int, int], tuple[int, str]] = {}
        self.closing = ExitStack()
        self.open()

    def open(self) -> None:
        folder = self.closing.enter_context(open_folder(self.folder / "a.studio"))
        studio = self.closing.enter_context(closing(Studio(folder, toy(self.model))))
        folder.change(lambda project: replace(project, recogniser="own"))  # which is the fastest one
        application = create_application(studio, Access(TOKEN, frozenset({HOST})))
        self.studio = OpenStudio(folder, studio, application)

    def teardown(self) -> None:
        self.closing.close()
        shutil.rmtree(self.folder)

    def ask(self, path: str, content: Any = None, **headers: str) -> Reply:
        reply = self.studio.ask(path, content, **headers)
        assert reply.status < 500, (path, content, reply.body)
        return reply

    def ready(self, line: Shadow) -> dict[str, Any]:
        state = self.studio.ready(line.number)
        assert (state["name"], state["mark"], state["transcript"] or line.words) == (line.name, line.mark, line.words)
        assert state["status"] == "ready", state
        assert (state["steps"], state["redo"]) == (line.steps, len(line.undone))
        assert {each["name"]: each["digest"] for each in state["versions"]} == {
            name: digest_edits(steps) for name, steps in line.versions.items()
        }
        return state

    def line(self, pick: int) -> Shadow:
        return list(self.lines.values())[pick % len(self.lines)]

    def look(self, client: int, line: Shadow) -> None:
        self.seen[client, line.number] = self.ready(line)["revision"], line.content

    def request(self, client: int, line: Shadow, what: str, **content: Any) -> tuple[str, Any]:
        """Return a request of a client for a change of a line: the first one looks before, the second one seldom."""
        if client == 0 or (client, line.number) not in self.seen:
            self.look(client, line)
        return f"/api/lines/{line.number}/{what}", {"revision": self.seen[client, line.number][0], **content}

    def change(self, client: int, line: Shadow, what: str, **content: Any) -> dict[str, Any]:
        """Return what a change of a line replies, where it was made; it is refused exactly to who saw another line."""
        request = self.request(client, line, what, **content)
        reply = self.studio.ask(*request)
        if reply.status == 503:  # it is being opened
            self.ready(line)
            reply = self.ask(*request)
        is_late = self.seen[client, line.number][1] != line.content
        assert (reply.status == 409) == is_late, (what, content, reply.body)
        if reply.status != 200:
            assert reply.content["error"]
            type(self).late += reply.status == 409
            type(self).refused += reply.status == 422
            return {}
        type(self).acknowledged += 1
        return dict(reply.content)

    @initialize()
    def first(self) -> None:
        self.dropped(0)

    @rule(sound=st.integers(0, 2))
    def dropped(self, sound: int) -> None:
        """All that is dropped has the same name."""
        if len(self.lines) >= MAX_RECORDINGS:
            return
        content, words = self.sounds[sound].read_bytes(), self.words[0]
        reply = self.ask("/api/lines?name=take.wav", content, x_lipmotion_transcript=words)
        assert reply.status == 201
        row = reply.content
        line = self.studio.folder.find_recording(row["id"])
        sha256 = sha256_of(self.sounds[sound])
        shadow = Shadow(row["id"], row["name"], self.studio.folder.locate_sound(line), sha256, words)
        self.lines[shadow.number] = shadow
        self.ready(shadow)

    @rule(client=st.integers(0, 1), pick=st.integers(0, 9))
    def looked(self, client: int, pick: int) -> None:
        self.look(client, self.line(pick))

    @rule(
        client=st.integers(0, 1),
        pick=st.integers(0, 9),
        edits=st.lists(st.sampled_from(EDITS), min_size=1, max_size=4),
        instead=st.booleans(),
    )
    def edited(self, client: int, pick: int, edits: list[str], instead: bool) -> None:
        line = self.line(pick)
        for edit in edits:
            count = 1 if instead and line.steps else 0
            reply = self.change(client, line, "edits", steps=[edit], instead=count)
            if reply:
                line.steps, line.undone = [*line.steps[: len(line.steps) - count], edit], []
                assert reply["steps"] == line.steps
                self.seen[client, line.number] = reply["revision"], line.content

    @rule(client=st.integers(0, 1), pick=st.integers(0, 9), what=st.sampled_from(("undo", "redo")))
    def stepped(self, client: int, pick: int, what: str) -> None:
        line = self.line(pick)
        reply = self.change(client, line, what)
        if reply and what == "undo":
            line.undone.insert(0, line.steps.pop())
        elif reply:
            line.steps.append(line.undone.pop(0))
        if reply:
            assert (reply["steps"], reply["redo"]) == (line.steps, len(line.undone))

    @rule(client=st.integers(0, 1), pick=st.integers(0, 9), word=st.integers(0, 1))
    def said(self, client: int, pick: int, word: int) -> None:
        line = self.line(pick)
        reply = self.change(client, line, "transcript", text=self.words[word])
        if reply and line.steps:
            assert reply["steps"][:-1] == line.steps
            line.steps, line.undone = reply["steps"], []
        elif reply:
            line.words, line.undone = self.words[word], []
            self.ready(line)

    @rule(client=st.integers(0, 1), pick=st.integers(0, 9), mark=st.sampled_from(("approved", "redo", "none")))
    def marked(self, client: int, pick: int, mark: str) -> None:
        line = self.line(pick)
        if self.change(client, line, "mark", mark=mark):
            line.mark = mark

    @rule(client=st.integers(0, 1), pick=st.integers(0, 9), what=st.sampled_from(("keep", "back", "forget")))
    def kept(self, client: int, pick: int, what: str) -> None:
        line = self.line(pick)
        if what != "keep" and not line.versions:
            return
        name = list(line.versions)[pick % len(line.versions)] if line.versions else ""
        path, content = "versions" if what == "keep" else f"versions/{what}", {"version": name} if name else {}
        reply = self.change(client, line, path, **content)
        if not reply:
            return
        if what == "forget":
            del line.versions[name]
        elif line.steps not in line.versions.values():
            line.versions[reply["versions"][-1]["name"]] = list(line.steps)
        if what == "back" and line.steps != (steps := list(line.versions[name])):
            is_undone = line.steps[: len(steps)] == steps
            line.undone = [*line.steps[len(steps) :], *line.undone] if is_undone else []
            line.steps = steps
        self.ready(line)

    @rule(client=st.integers(0, 1), pick=st.integers(0, 9))
    def taken_out(self, client: int, pick: int) -> None:
        line = self.line(pick)
        if len(self.lines) > 1 and self.change(client, line, "remove"):
            self.removed.append(self.lines.pop(line.number))

    @rule()
    def restarted(self) -> None:
        self.closing.close()
        self.open()

    @rule(pick=st.integers(0, 9))
    def exported(self, pick: int) -> None:
        line = self.line(pick)
        reply = self.ask(f"/api/lines/{line.number}/export", {"files": [".csv"]}).content
        (done,) = reply["exported"]
        file = json.loads((self.studio.folder.path / done["edits"]).read_text(encoding="utf-8"))
        assert (file["steps"], file["recording_sha256"]) == (line.steps, line.sha256)

    @invariant()
    def all_is_there(self) -> None:
        type(self).steps += 1
        rows = self.ask("/api/project").content["lines"]
        assert [(row["id"], row["name"], row["mark"]) for row in rows] == [
            (line.number, line.name, line.mark) for line in self.lines.values()
        ]
        for row, line in zip(rows, self.lines.values(), strict=True):
            if row["status"] == "ready":
                assert (row["edits"], row["edits_digest"]) == (len(line.steps), digest_edits(line.steps))
        for line in [*self.lines.values(), *self.removed]:
            assert sha256_of(line.sound) == line.sha256
        for line in self.removed:
            kept = self.studio.folder.path / "copies" / f"{line.name}.edits.json"
            file = json.loads(kept.read_text(encoding="utf-8"))
            assert (file["steps"], file["recording_sha256"]) == (line.steps, line.sha256)


def walk(model: Model, sentence: ToySentence, folder: Path, examples: int, steps: int) -> type[TwoClients]:
    """Let two clients make some steps, the same ones every time; return what they did and how often."""
    first, second = " ".join(sentence.words[:2]), sentence.words[1]
    members = {
        "model": model, "sounds": sounds_of(sentence, folder), "words": (first, second), "steps": 0,
        "acknowledged": 0, "late": 0, "refused": 0,
    }  # fmt: skip
    machine = type("Walk", (TwoClients,), members)
    run_state_machine_as_test(
        machine,
        settings=settings(
            max_examples=examples,
            stateful_step_count=steps,
            derandomize=True,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        ),
    )
    return machine
