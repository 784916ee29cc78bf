from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from lipmotion import Corpus
from lipmotion.errors import CorpusError, InputError
from lipmotion.storage.sources import sha256_of
from lipmotion_faces.film import build as takes
from lipmotion_faces.film.build import MOST_FOOTAGE_S, choose_takes
from speech.sounds import tone, write_sound
from testing.toy import toy_utterances

MakeVideos = Callable[..., Path]


@pytest.fixture
def videos(tmp_path: Path) -> MakeVideos:
    """Writes videos of a second into a folder."""

    def make(*names: str, folder: str = "filmed/anna") -> Path:
        directory = tmp_path / folder
        first: Path | None = None
        for name in names:
            path = directory / f"{name}.mkv"
            path.parent.mkdir(parents=True, exist_ok=True)
            if first is None:
                first = write_sound(path, tone(16_000), 16_000, "flac", video=True)
            else:
                path.write_bytes(first.read_bytes())
        return directory

    return make


def names(found: list[takes.Take]) -> list[str]:
    return [take.name for take in found]


def test_one_video(videos):
    video = videos("a") / "a.mkv"
    (take,) = choose_takes(video)
    assert (take.name, take.file, take.collection, take.speaker) == ("a", video, "filmed/anna", "")
    assert (take.span.start_s, take.span.end_s) == (0.0, MOST_FOOTAGE_S)


def test_a_folder(videos):
    folder = videos("a", "b", "c")
    found = choose_takes(folder)
    assert names(found) == ["a", "b", "c"]
    assert {take.collection for take in found} == {"filmed/anna"}
    assert all(take.file.parent == folder for take in found)
    assert found[0].span.end_s == float("inf")


def test_of_a_folder_with_lists_the_training_list(videos):
    folder = videos("a", "b", "c", "d")
    (folder / "train.txt").write_text("b\nd\n")
    (folder / "test.txt").write_text("a\n")
    (folder / "val.txt").write_text("c\n")
    assert names(choose_takes(folder)) == ["b", "d"]


def test_long_footage_is_used_in_part_evenly(videos, monkeypatch):
    monkeypatch.setattr(takes, "MOST_FOOTAGE_S", 3.0)
    found = choose_takes(videos(*(f"clip{number}" for number in range(9))))
    assert 3 <= len(found) <= 4
    numbers = [int(name[-1]) for name in names(found)]
    assert numbers[0] <= 1
    assert numbers[-1] >= 7
    assert numbers == sorted(set(numbers))


def test_one_of_several_people(videos, tmp_path):
    videos("a", "b", folder="filmed/anna")
    videos("c", folder="filmed/ben")
    folder = tmp_path / "filmed"
    found = choose_takes(folder, speaker="anna")
    assert [take.speaker for take in found] == ["anna", "anna"]
    assert {Path(take.file).stem for take in found} == {"a", "b"}
    with pytest.raises(InputError, match=r"2 speakers, a face is that of one person; name it \(--speaker\): anna, ben"):
        choose_takes(folder)
    with pytest.raises(InputError, match=r"no speaker 'cleo', a face is that of one person; name it .*: anna, ben"):
        choose_takes(folder, speaker="cleo")


def test_no_videos(tmp_path):
    with pytest.raises(InputError, match="no such"):
        choose_takes(tmp_path / "missing.mp4")
    (tmp_path / "empty").mkdir()
    with pytest.raises(CorpusError, match="no videos in it"):
        choose_takes(tmp_path / "empty")
    (tmp_path / "empty.mp4").touch()
    with pytest.raises(InputError, match="the file is empty; give a video"):
        choose_takes(tmp_path / "empty.mp4")


def prepared(folder: Path, files: list[str], speakers: tuple[str, ...] = ("",)) -> Corpus:
    """Return a corpus that says which videos it was prepared from."""
    corpus = Corpus.create(folder)
    for number, (utterance, file) in enumerate(zip(toy_utterances(max(3, len(files))), files, strict=False)):
        source = {"file": file, "licence": "CC BY 4.0", "attribution": "anna", "collection": "filmed/anna"}
        corpus.add(replace(utterance, source=source, speaker=speakers[number % len(speakers)], split="train"))
    return corpus


def test_a_corpus_with_its_videos(tmp_path, videos):
    folder = videos("a", "b", "c")
    corpus = prepared(tmp_path / "corpus", ["a.mkv", "b.mkv", "gone.mkv"])
    found = choose_takes(corpus.path, folder)
    assert names(found) == ["toy00", "toy01"]
    assert [take.file.name for take in found] == ["a.mkv", "b.mkv"]
    assert {take.collection for take in found} == {"filmed/anna"}
    assert dict(found[0].rights) == {"licence": "CC BY 4.0", "attribution": "anna"}


def test_a_corpus_of_several_people(tmp_path, videos):
    folder = videos("a", "b", "c", "d")
    corpus = prepared(tmp_path / "corpus", ["a.mkv", "b.mkv", "c.mkv", "d.mkv"], ("anna", "ben"))
    assert [take.file.name for take in choose_takes(corpus.path, folder, "ben")] == ["b.mkv", "d.mkv"]
    with pytest.raises(InputError, match=r"2 speakers, a face is that of one person"):
        choose_takes(corpus.path, folder)


def test_a_corpus_without_its_videos(tmp_path, videos):
    corpus = prepared(tmp_path / "corpus", ["a.mkv"])
    with pytest.raises(InputError, match=r"holds the pictures of mouths, but not of faces; .* --recordings FOLDER"):
        choose_takes(corpus.path)
    with pytest.raises(InputError, match="no such folder; give the one of the videos of the corpus"):
        choose_takes(corpus.path, tmp_path / "missing")
    with pytest.raises(InputError, match=r"holds none of the videos of .*; give the folder that they are in"):
        choose_takes(corpus.path, videos("other"))


def test_long_videos_are_shortened_before_short_ones_are_left_out(videos, monkeypatch):
    """The seconds of a folder are bounded, and not by the first of its videos."""
    durations = {"a": 300.0, "b": 3.0, "c": 3.0, "d": 7200.0}
    monkeypatch.setattr(takes, "_duration_s", lambda take: durations[take.name])
    found = choose_takes(videos(*durations))
    assert names(found) == list(durations)
    used = [min(take.span.end_s - take.span.start_s, durations[take.name]) for take in found]
    assert sum(used) == pytest.approx(MOST_FOOTAGE_S)
    assert used == pytest.approx([117.0, 3.0, 3.0, 117.0])


def test_many_long_videos_are_used_in_part(videos, monkeypatch):
    monkeypatch.setattr(takes, "MOST_FOOTAGE_S", 30.0)
    monkeypatch.setattr(takes, "_duration_s", lambda _: 600.0)
    found = choose_takes(videos("a", "b", "c", "d", "e", "f"))
    assert [take.span.end_s for take in found] == [takes.LONG_S] * 3


def test_videos_of_the_same_name_are_told_apart(tmp_path, videos):
    """Every person of GRID says the same sentences, in files of the same names."""
    videos("x", folder="filmed/anna")
    ben = write_sound(videos("y", folder="filmed/ben") / "x.mkv", tone(16_000, 0.9), 16_000, "flac", video=True)
    for file in (ben, tmp_path / "filmed/anna/x.mkv"):
        corpus = Corpus.create(tmp_path / f"corpus-{file.parent.name}")
        source = {"file": "x.mkv", "bytes": str(file.stat().st_size), "sha256": sha256_of(file)}
        for utterance in toy_utterances(3)[:1]:
            corpus.add(replace(utterance, source=source, split="train"))
        (found,) = choose_takes(corpus.path, tmp_path / "filmed")
        assert found.file == file
    (tmp_path / "other").mkdir()
    other = write_sound(tmp_path / "other" / "x.mkv", tone(16_000, 0.5), 16_000, "flac", video=True)
    with pytest.raises(InputError, match="holds none of the videos"):
        choose_takes(corpus.path, other.parent)
