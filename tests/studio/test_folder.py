import json
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from lipmotion.errors import ExportError, InputError
from lipmotion.storage.files import make_portable
from lipmotion_studio.folder import PROJECT, ProjectFolder, RevisionError, find_project_path, open_folder
from lipmotion_studio.project import ExportRecord, Project, ProjectRecording, describe_project, parse_project
from pipeline.made import write_sound
from testing.toy import ToySentence

LINE = {"number": 1, "name": "a", "sound": "a.wav", "sha256": "0"}
RECORD = ExportRecord("arkit", {"exports/a.livelink.csv": "1"}, "exports/a.edits.json", "2", "3", "0.1.0")


@pytest.fixture
def lines(tmp_path: Path, toy_sentence: ToySentence) -> Path:
    folder = tmp_path / "lines"
    (folder / "inner").mkdir(parents=True)
    for name in ("b.wav", "a.wav", "inner/a.wav"):
        write_sound(folder / name, toy_sentence.audio)
    return folder


def test_a_project_is_there_again(lines):
    with open_folder(lines) as folder:
        assert [line.name for line in folder.project.lines.values()] == ["a", "b", "inner/a"]
        for content in ("sound", "other"):
            (folder.path / content).write_text(content, encoding="utf-8")
        number = folder.drop("C:\\over there\\..\\A.WAV", folder.path / "sound", "hello")
        assert folder.find_recording(number).name == "C__over there_.._A"
        assert folder.drop("a.wav", folder.path / "other", "") == number + 1
        folder.change_recording(1, lambda line: replace(line, mark="approved", exports=(RECORD,)))
        seen = folder.compute_word_revision("tear")
        folder.add_pronunciation("tear", ("t", "eh", "r"), seen)
        with pytest.raises(RevisionError):
            folder.add_pronunciation("tear", ("d", "eh", "r"), seen)
        folder.add_pronunciation("tear", ("t", "ih", "r"), folder.compute_word_revision("tear"))
        project = folder.project
    assert folder.path == lines.with_name("lines.studio")
    with open_folder(folder.path) as again:
        assert again.project == project
        assert again.load_lexicon().user == {"tear": (("t", "ih", "r"), ("t", "eh", "r"))}
        assert again.find_recording(number + 1).sound == "sounds/a-2.wav"
    with open_folder(lines) as once_more:
        assert once_more.project == project  # nothing is added twice
        with pytest.raises(ExportError, match="another lipmotion"), open_folder(lines):
            pass
    document = json.loads((folder.path / PROJECT).read_text(encoding="utf-8"))
    assert document["lines"][0]["sound"] == "../lines/a.wav"


def test_the_folder_of_a_project(tmp_path, lines):
    assert find_project_path(lines / "a.wav") == lines / "a.studio"
    assert find_project_path(lines, tmp_path / "x") == tmp_path / "x"
    with pytest.raises(InputError, match="no such file"):
        find_project_path(tmp_path / "nothing")


def test_a_project_that_is_not_there_is_an_empty_one(tmp_path):
    for _ in range(2):
        with open_folder(tmp_path / "hero.studio") as folder:
            assert (folder.path, folder.project) == (tmp_path / "hero.studio", Project())
    assert (tmp_path / "hero.studio" / PROJECT).is_file()


def test_what_cannot_be_written_is_not_kept(lines):
    with open_folder(lines) as folder:
        before, file = folder.project, folder.path / PROJECT
        content = file.read_bytes()
        file.unlink()
        file.mkdir()
        with pytest.raises(ExportError):
            folder.change_recording(1, lambda line: replace(line, mark="redo"))
        assert folder.project == before
        file.rmdir()
        file.write_bytes(content)


def test_a_project_is_what_its_document_says():
    project = Project(
        {1: ProjectRecording(1, "a", "a.wav", "0", "hello", 1.5, 0.25, "redo", "4", (RECORD,))}, preset="arkit"
    )
    assert parse_project(json.loads(json.dumps(describe_project(project)))) == replace(project, next_number=2)


@pytest.mark.parametrize(
    "change",
    [
        {"format": "other"}, {"version": 2}, {"lines": [LINE, LINE]}, {"lines": [LINE, LINE | {"number": 2}]},
        {"lines": [LINE | {"name": "../a"}]}, {"lines": [LINE | {"mark": "perhaps"}]},
        {"lines": [LINE | {"number": "1"}]}, {"lines": [LINE | {"sound": 3}]}, {"lines": [LINE | {"unknown": 3}]},
        {"lines": 3}, {"model": 3}, {"characters": []}, {"more": 1},
    ],
)  # fmt: skip
def test_documents_that_are_refused(tmp_path, change):
    document = describe_project(Project()) | {"lines": [LINE]}
    assert list(parse_project(document).lines) == [1]
    (tmp_path / PROJECT).write_text(json.dumps(document | change), encoding="utf-8")
    with pytest.raises((InputError, ExportError)):
        ProjectFolder(tmp_path)


@pytest.mark.parametrize("name", ["CON.wav", "nul .wav", "Aux..wav", "com1.take.wav"])
def test_what_is_called_as_a_device_gets_another_name(lines, tmp_path, name):
    sound = (lines / "a.wav").rename(tmp_path / name)
    assert make_portable(find_project_path(sound).name) == find_project_path(sound).name
    with open_folder(sound, tmp_path / "own") as folder:
        (folder.path / "came").write_text("sound", encoding="utf-8")
        for number in (1, folder.drop(name, folder.path / "came", "")):
            line = folder.find_recording(number)
            assert make_portable(line.name) == line.name
            assert make_portable(folder.locate_edits(line).name) == folder.locate_edits(line).name


@pytest.mark.skipif(sys.platform == "win32", reason="links as POSIX has them")
def test_the_usual_folder_of_a_project_is_no_link(lines, tmp_path):
    (lines / "a.studio").symlink_to(tmp_path)
    with pytest.raises(InputError, match="is a link"):
        find_project_path(lines / "a.wav")
    assert find_project_path(lines / "a.wav", lines / "a.studio") == lines / "a.studio"
