"""Two clients of a studio, whose project is changed behind their backs: what was acknowledged is there, and no more.

A shadow of the project holds what was acknowledged. A change is made exactly where its author has seen the line as it
is; what is refused changes nothing; sounds and edits of lines that were removed stay as they were.
"""

import json
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
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
TWO_WORDS_S = 0.4, 1.24
"""Where the first two words of the sentence are said."""
DAMAGES: dict[str, Callable[[Path], Any]] = {
    "cut": lambda file: file.write_bytes(file.read_bytes()[: file.stat().st_size // 2]),
    "empty": lambda file: file.write_bytes(b""),
    "noise": lambda file: file.write_bytes(b"\xff\x00{" * 40),
    "lost": lambda file: file.unlink(),
    "phones": lambda file: file.write_text(file.read_text(encoding="utf-8").replace('"start_s"', '"stort_s"')),
}


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
    damage: str = ""

    @property
    def content(self) -> str:
        """All that a client may have seen of it: damaged phones are found when they are needed."""
        damage = "" if self.damage.startswith("phones") else self.damage
        return repr((self.words, self.mark, self.steps, self.undone, self.versions, damage))


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
        if line.damage:
            assert state["status"] == "failed", state
            assert "copies" in state["error"]
        else:
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
        assert (reply.status == 409) == is_late or (line.damage and reply.status == 422), (what, content, reply.body)
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
            self.gone(line)

    def gone(self, line: Shadow) -> None:
        del self.lines[line.number]
        self.removed.append(line)

    @rule(
        pick=st.integers(0, 9),
        ways=st.permutations(("edits", "transcript", "remove", "mark")),
        number=st.integers(2, 4),
    )
    def together(self, pick: int, ways: list[str], number: int) -> None:
        """Several changes of one line at the same time, all of who has seen it as it is: one of them is made."""
        line = self.line(pick)
        if line.damage or len(self.lines) < 2:
            return
        self.look(0, line)
        contents: dict[str, dict[str, Any]] = {
            "edits": {"steps": [EDITS[0]]},
            "transcript": {"text": self.words[1]},
            "mark": {"mark": "redo"},
        }
        requests = [self.request(0, line, way, **contents.get(way, {})) for way in ways[:number]]
        replies = self.studio.ask_together(*requests, ("/api/project", None), *requests)
        listed = replies.pop(number)
        assert listed.status == 200
        assert len(listed.content["lines"]) in (len(self.lines), len(self.lines) - 1)
        assert {reply.status for reply in replies} <= {200, 404, 409, 422, 503}, [reply.body for reply in replies]
        made = [
            (way, reply.content) for way, reply in zip(ways[:number] * 2, replies, strict=True) if reply.status == 200
        ]
        if line.mark == "redo":  # it was that already: nothing has changed, and another change may be made, too
            made = [each for each in made if each[0] != "mark"] or made[:1]
        assert len(made) == 1, [(reply.status, reply.body[:200]) for reply in replies]
        ((way, reply),) = made
        type(self).acknowledged += 1
        if way == "remove":
            self.gone(line)
        elif way == "mark":
            line.mark = "redo"
        elif way == "transcript" and not line.steps:
            line.words, line.undone = self.words[1], []
        else:
            assert reply["steps"][:-1] == line.steps
            line.steps, line.undone = reply["steps"], []

    @rule(pick=st.integers(0, 9), damage=st.sampled_from(sorted(DAMAGES)), stays=st.booleans())
    def damaged(self, pick: int, damage: str, stays: bool) -> None:
        line = self.line(pick)
        if line.damage:
            return
        file = self.studio.folder.locate_edits(self.studio.folder.find_recording(line.number))
        self.ready(line)
        DAMAGES[damage](file)
        line.damage = f"{damage} {file.read_bytes()[:100]!r}" if file.exists() else damage
        assert self.change(1, line, "edits", steps=[EDITS[0]]) == {}
        if not stays:
            self.restored(0, pick)

    @rule(client=st.integers(0, 1), pick=st.integers(0, 9))
    def restored(self, client: int, pick: int) -> None:
        line = next((each for each in self.lines.values() if each.damage), self.line(pick))
        if not line.damage:
            self.look(client, line)
            assert self.change(client, line, "restore") == {}
            return
        self.look(client, line)
        if self.change(client, line, "restore"):
            line.damage = ""
            self.ready(line)

    @rule(pick=st.integers(0, 9), is_moved=st.booleans(), restarts=st.booleans())
    def another_sound(self, pick: int, is_moved: bool, restarts: bool) -> None:
        """In the place of a line's sound lies another one of the same length, or none, for a while."""
        line = self.line(pick)
        if line.damage:
            return
        self.ready(line)
        with self.away(line, is_moved):
            if restarts:
                self.restarted()
                state = self.studio.ready(line.number)
                assert (state["status"], line.sound.name in state["error"]) == ("failed", True)
                assert (
                    self.ask(f"/api/lines/{line.number}/edits", {"revision": state["revision"], "steps": []}).status
                    == 422
                )
            assert self.ask(f"/api/lines/{line.number}/sound.wav").status == 422
            (failed,) = self.ask(f"/api/lines/{line.number}/export", {"files": [".csv"]}).content["failed"]
            assert line.sound.name in failed["error"]
        self.ask("/api/understand", {"lines": [line.number]})
        self.ready(line)
        assert self.ask(f"/api/lines/{line.number}/sound.wav").status == 200

    @contextmanager
    def away(self, line: Shadow, is_moved: bool) -> Iterator[None]:
        place = line.sound.rename(line.sound.with_suffix(".old"))
        if not is_moved:
            other = next(each for each in self.sounds if sha256_of(each) != line.sha256)
            shutil.copy(other, line.sound)
        yield
        place.replace(line.sound)

    @rule()
    def restarted(self) -> None:
        self.closing.close()
        self.open()

    @rule(pick=st.integers(0, 9))
    def exported(self, pick: int) -> None:
        line = self.line(pick)
        reply = self.ask(f"/api/lines/{line.number}/export", {"files": [".csv"]}).content
        if line.damage:
            (failed,) = reply["failed"]
            assert "copies" in failed["error"]
            return
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
            if not line.damage and row["status"] == "ready":
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
