import json
import os
import shutil
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

from children import NOWHERE, child
from lipmotion import Corpus, prepare
from lipmotion.errors import ExportError, InputError, MissingDependencyError
from lipmotion.storage.locks import lock_folder
from lipmotion.types import Channel, Item, Motion, Progress, Track
from pipeline.made import replace_tracking, write_noise


@pytest.fixture
def studio(tmp_path: Path) -> Path:
    folder = tmp_path / "studio"
    for seed, name in enumerate(("a", "b", "c")):
        write_noise(folder / f"{name}.mp4", seed=seed)
    (folder / "a.txt").write_text("Hello, you.")
    return folder


@pytest.fixture
def tracked(monkeypatch) -> list[str]:
    """Replaces face tracking; lists the names of the videos it was asked for."""
    asked: list[str] = []

    def track(path: Path, *, crops: bool, tracker: str) -> Track:
        assert tracker == "mediapipe"
        asked.append(path.stem)
        if "broken" in path.stem:
            raise InputError(f"{path}: no face in 25 of 25 frames")
        if "strange" in path.stem:
            raise ZeroDivisionError("what is this")
        images = np.zeros((25, 56, 72, 3), np.uint8) if crops else None
        notes = ("cut at 0.50 s",) if "cut" in path.stem else ()
        return Track(Motion(np.ones((25, 1)), 25.0, (Channel("opening"),)), np.arange(25) > 1, images, notes)

    replace_tracking(monkeypatch, track)
    return asked


def content(corpus: Path) -> dict[str, bytes]:
    files = (path for path in sorted(corpus.rglob("*")) if path.is_file())
    return {str(path.relative_to(corpus)): path.read_bytes() for path in files}


@pytest.mark.usefixtures("tracked")
def test_recordings_become_a_corpus(studio, tmp_path):
    report = prepare(studio, tmp_path / "corpus", workers=1)
    assert report.kind == "folder of videos"
    assert report.prepared == ("a", "b", "c")
    assert (report.kept, report.failed) == ((), {})
    assert report.unseen == {"a": 2, "b": 2, "c": 2}
    assert report.seconds > 0
    found = Corpus.open(report.corpus).utterance("a")
    assert found.words == ("hello", "you")
    assert found.features.values.shape == (101, 39)
    assert found.track.motion.rate_hz == 25
    assert found.source["file"] == "a.mp4"
    assert found.source["bytes"] == "32044"
    assert len(found.source["sha256"]) == 64
    assert found.source["mediapipe"] == "0"


@pytest.mark.usefixtures("tracked")
def test_remarks_on_a_video_are_reported_and_kept(studio, tmp_path):
    write_noise(studio / "cut.mp4", seed=9)
    for _ in range(2):  # prepared, then kept
        report = prepare(studio, tmp_path / "corpus", workers=1)
        assert report.notes == {"cut": ("cut at 0.50 s",)}
    assert Corpus.open(report.corpus).utterance("cut").track.notes == ("cut at 0.50 s",)


def test_what_is_up_to_date_is_kept(studio, tmp_path, tracked):
    prepare(studio, tmp_path / "corpus", workers=1)
    before = content(tmp_path / "corpus")
    report = prepare(studio, tmp_path / "corpus", workers=1)
    assert (report.prepared, report.kept) == ((), ("a", "b", "c"))
    assert report.unseen == {"a": 2, "b": 2, "c": 2}
    assert tracked == ["a", "b", "c"]
    assert content(tmp_path / "corpus") == before


@pytest.mark.usefixtures("tracked")
def test_changed_recordings_transcripts_and_lists_are_prepared_again(studio, tmp_path):
    prepare(studio, tmp_path / "corpus", workers=1)
    write_noise(studio / "b.mp4", seed=77)
    assert prepare(studio, tmp_path / "corpus", workers=1).prepared == ("b",)
    (studio / "a.txt").write_text("Goodbye.")
    assert prepare(studio, tmp_path / "corpus", workers=1).prepared == ("a",)
    (studio / "val.txt").write_text("c\n")
    assert prepare(studio, tmp_path / "corpus", workers=1).prepared == ("c",)
    corpus = Corpus.open(tmp_path / "corpus")
    assert corpus.utterance("a").words == ("goodbye",)
    assert corpus.names("val") == ("c",)


@pytest.mark.usefixtures("tracked")
def test_other_settings_prepare_again(studio, tmp_path):
    prepare(studio, tmp_path / "corpus", workers=1)
    assert len(prepare(studio, tmp_path / "corpus", workers=1, crops=False).prepared) == 3
    assert Corpus.open(tmp_path / "corpus").utterance("a").track.crops is None


@pytest.mark.usefixtures("tracked")
def test_a_damaged_utterance_is_prepared_again(studio, tmp_path):
    prepare(studio, tmp_path / "corpus", workers=1)
    before = content(tmp_path / "corpus")
    (tmp_path / "corpus" / "utterances" / "b" / "entry.json").write_text("{")
    assert prepare(studio, tmp_path / "corpus", workers=1).prepared == ("b",)
    assert content(tmp_path / "corpus") == before


@pytest.mark.usefixtures("tracked")
def test_bad_recordings_are_listed_and_the_rest_is_prepared(studio, tmp_path):
    write_noise(studio / "broken.mp4", seed=5)
    write_noise(studio / "strange.mp4", seed=6)
    (studio / "empty.mp4").touch()
    (studio / "words.mp4").write_text("not a video")
    (studio / "c.txt").write_bytes(b"\x81")
    report = prepare(studio, tmp_path / "corpus", workers=1)
    assert report.prepared == ("a", "b")
    assert list(report.failed) == ["broken", "c", "empty", "strange", "words"]
    assert "no face in 25 of 25 frames" in report.failed["broken"]
    assert "ZeroDivisionError: what is this" in report.failed["strange"]
    assert "empty" in report.failed["empty"]
    assert Corpus.open(report.corpus).names() == ("a", "b")


@pytest.mark.usefixtures("tracked")
def test_utterances_of_recordings_that_are_gone_are_named(studio, tmp_path, caplog):
    prepare(studio, tmp_path / "corpus", workers=1)
    assert prepare(studio, tmp_path / "corpus", workers=1).kept == ("a", "b", "c")
    assert not caplog.records
    (studio / "a.mp4").unlink()
    (studio / "c.mp4").write_bytes(b"")
    assert prepare(studio, tmp_path / "corpus", workers=1).kept == ("b",)
    assert (
        "2 utterances are from recordings that are no longer there, or cannot be used any longer: a, c;" in caplog.text
    )


def test_missing_packages_are_reported_at_once(studio, tmp_path, monkeypatch):
    replace_tracking(monkeypatch, None)
    with pytest.raises(MissingDependencyError):
        prepare(studio, tmp_path / "corpus")
    assert not (tmp_path / "corpus").exists()


@pytest.mark.usefixtures("tracked")
def test_an_interrupted_run_goes_on_where_it_stopped(studio, tmp_path):
    prepare(studio, tmp_path / "whole", workers=1)

    def interrupt(event: Progress | Item) -> None:
        if isinstance(event, Item):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        prepare(studio, tmp_path / "corpus", workers=1, monitor=interrupt)
    assert Corpus.open(tmp_path / "corpus").names() == ("a",)
    report = prepare(studio, tmp_path / "corpus", workers=1)
    assert (report.kept, report.prepared) == (("a",), ("b", "c"))
    assert content(tmp_path / "corpus") == content(tmp_path / "whole")


@pytest.mark.usefixtures("tracked")
def test_another_speaker_may_use_the_same_names(studio, tmp_path):
    prepare(studio, tmp_path / "corpus", workers=1)
    other = tmp_path / "home"
    write_noise(other / "a.mp4", seed=50)
    shutil.copy(studio / "b.mp4", other / "b.mp4")  # the same recording: it is there already
    report = prepare(other, tmp_path / "corpus", workers=1)
    qualified = f"{tmp_path.name}-home-a"
    assert (report.prepared, report.kept) == ((qualified,), ("b",))
    assert prepare(other, tmp_path / "corpus", workers=1).kept == ("b", qualified)
    assert len(Corpus.open(tmp_path / "corpus")) == 4


@pytest.mark.usefixtures("tracked")
def test_the_outcome_of_every_recording_is_reported_at_once(studio, tmp_path, capsys):
    write_noise(studio / "broken.mp4", seed=5)
    (studio / "empty.mp4").touch()
    prepare(studio, tmp_path / "corpus", workers=1, crops=False)
    (studio / "b.txt").write_text("Goodbye.")
    events: list[Progress | Item] = []
    prepare(studio, tmp_path / "corpus", workers=1, crops=False, monitor=events.append)
    found = {event.name: event.outcome for event in events if isinstance(event, Item)}
    assert found == {"a": "kept", "b": "prepared", "broken": "skipped", "c": "kept", "empty": "skipped"}
    reasons = {event.name: event.reason for event in events if isinstance(event, Item)}
    assert reasons["b"] == "no face in 2 frames, interpolated"
    assert "no face in 25 of 25 frames" in reasons["broken"]
    progress = [event for event in events if isinstance(event, Progress)]
    assert [event.step for event in progress] == list(range(progress[0].steps + 1))
    assert progress[-1].share == 1
    assert capsys.readouterr() == ("", "")


@pytest.mark.usefixtures("tracked")
def test_two_at_a_time_are_refused(studio, tmp_path):
    with lock_folder(tmp_path / "corpus"):
        (tmp_path / "corpus" / ".part-of-the-other").touch()
        with pytest.raises(ExportError, match=rf"corpus: another lipmotion \(process {os.getpid()}\) is at work on it"):
            prepare(studio, tmp_path / "corpus", workers=1)
        assert (tmp_path / "corpus" / ".part-of-the-other").exists()
    assert len(prepare(studio, tmp_path / "corpus", workers=1).prepared) == 3
    assert [path.name for path in sorted((tmp_path / "corpus").iterdir())] == ["corpus.json", "utterances"]


@pytest.fixture
def clips(recordings: Path, tmp_path: Path) -> Path:
    """Six GRID clips."""
    pytest.importorskip("mediapipe")
    source = recordings / "grid-s1" / "clips"
    if not source.is_dir():
        pytest.skip("the real recordings are not here")
    folder = tmp_path / "clips"
    folder.mkdir()
    for path in sorted(source.glob("*.mkv"))[:6]:
        (folder / path.name).symlink_to(path)
    return folder


SCRIPT = """
import sys
import time
from pathlib import Path
from lipmotion_faces.corpus.prepare import prepare
from lipmotion.types import Item

items = []

def hold(event):
    items.append(isinstance(event, Item))
    if sum(items) == 2:
        print("two are done", flush=True)
        while True:
            time.sleep(0.05)  # a signal that comes just before one long sleep would be handled after it

if __name__ == "__main__":
    prepare(Path(sys.argv[1]), Path(sys.argv[2]), workers=2, monitor=hold)
"""


def prepare_partly(script: Path, folder: Path, corpus: Path, stop: signal.Signals) -> None:
    """Prepare in another process, which goes no further than the first utterances, and stop it when they are there.

    Each worker may finish one more meanwhile.
    """
    script.write_text(SCRIPT)
    with child([sys.executable, script, folder, corpus], stderr=NOWHERE) as process:
        assert process.stdout.readline() == "two are done\n"
        if stop == signal.SIGINT:
            os.killpg(process.pid, stop)  # as Ctrl-C does: the workers get it, too
        else:
            process.send_signal(stop)
        assert process.stdout.read() == ""  # workers of a killed run end by themselves
        assert process.wait() != 0


@pytest.mark.long
@pytest.mark.video
@pytest.mark.recordings
@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGKILL])
def test_real_clips_in_two_processes_stopped_and_gone_on(clips, tmp_path, stop):
    prepare_partly(tmp_path / "script.py", clips, tmp_path / "corpus", stop)
    done = len(list((tmp_path / "corpus").glob("utterances/[a-z]*")))
    assert 2 <= done <= 4
    if stop == signal.SIGINT:
        assert len(Corpus.open(tmp_path / "corpus")) == done
    report = prepare(clips, tmp_path / "corpus", workers=2)
    assert len(report.kept) == done
    assert len(report.prepared) == 6 - done
    assert not list((tmp_path / "corpus").rglob(".part-*"))

    prepare(clips, tmp_path / "whole", workers=1)
    assert content(tmp_path / "corpus") == content(tmp_path / "whole")


@pytest.mark.video
@pytest.mark.recordings
def test_real_clips_with_their_words(clips, tmp_path, capfd):
    for path in sorted(clips.iterdir())[2:]:
        path.unlink()
    report = prepare(clips, tmp_path / "corpus", workers=1)
    found = Corpus.open(report.corpus).utterance("bbaf2n")
    assert found.words == ("bin", "blue", "at", "f", "two", "now")
    assert found.source["licence"] == "CC BY 4.0"
    assert found.track.motion.values.shape == (75, 159)
    assert found.audio.duration_s == pytest.approx(2.978)
    entry = json.loads((report.corpus / "utterances" / "bbaf2n" / "entry.json").read_text())
    assert entry["settings"]["tracker"].startswith("mediapipe 0.10.")
    assert capfd.readouterr() == ("", "")
