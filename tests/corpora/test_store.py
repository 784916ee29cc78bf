import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from children import run_child
from lipmotion import Corpus
from lipmotion.corpora import quantise, read_entry
from lipmotion.errors import CorpusError, InputError
from lipmotion.types import Audio, Channel, Features, Motion, Span, Timeline, Track, Unit, Utterance
from lipmotion_faces.corpus import source_recordings
from lipmotion_faces.corpus.source_recordings import MAX_MISSING_NAMES


def utterance(name: str = "one", split: str = "train", crops: bool = True) -> Utterance:
    rng = np.random.default_rng(len(name))
    audio = quantise(Audio(rng.uniform(-1, 1, 16_000).astype(np.float32), 16_000))
    motion = Motion(rng.normal(size=(25, 2)), 25.0, (Channel("opening"), Channel("jaw", "degrees")))
    images = rng.integers(0, 256, (25, 56, 72, 3)).astype(np.uint8) if crops else None
    return Utterance(
        name=name,
        audio=audio,
        features=Features(rng.normal(size=(101, 39)).astype(np.float32), audio.duration_s),
        track=Track(motion, np.arange(25) > 2, images),
        words=("bin", "näh") if crops else None,
        split=split,
        source={"file": f"{name}.mp4"},
    )


@pytest.fixture
def corpus(tmp_path: Path) -> Corpus:
    corpus = Corpus.create(tmp_path / "corpus")
    for name, split in (("two", "train"), ("one", "train"), ("three", "test")):
        corpus.add(utterance(name, split))
    return corpus


@pytest.mark.parametrize("crops", [True, False])
def test_an_utterance_survives_the_round_trip(tmp_path, crops):
    given = replace(utterance(crops=crops), speaker="anna", phones=PHONES)
    made = Corpus.create(tmp_path / "corpus")
    made.add(given, {"crops": "yes"})
    entry = read_entry(made.folder("one"))
    assert (entry["settings"], entry["unseen_frames"]) == ({"crops": "yes"}, 3)
    for corpus in (made, Corpus.open(tmp_path / "corpus")):
        found = corpus.utterance("one")
        np.testing.assert_array_equal(found.audio.samples, given.audio.samples)
        np.testing.assert_array_equal(found.features.values, given.features.values)
        np.testing.assert_array_equal(found.track.motion.values, given.track.motion.values.astype(np.float32))
        np.testing.assert_array_equal(found.track.seen, given.track.seen)
        np.testing.assert_array_equal(found.track.crops, given.track.crops)
        assert found.track.motion.channels == given.track.motion.channels
        assert found.track.motion.rate_hz == given.track.motion.rate_hz
        assert found.features.duration_s == given.features.duration_s
        for name in ("name", "words", "split", "source", "speaker", "phones"):
            assert getattr(found, name) == getattr(given, name)


def test_large_arrays_stay_on_disk(corpus):
    found = corpus.utterance("one")
    assert isinstance(found.track.crops, np.memmap)
    assert isinstance(found.features.values, np.memmap)
    assert not found.features.values.flags.writeable


def test_reading_needs_no_video_packages(corpus):
    code = (
        "import sys; sys.modules['cv2'] = sys.modules['mediapipe'] = sys.modules['av'] = None; "
        "from pathlib import Path; from lipmotion.corpora import Corpus; "
        f"Corpus.open(Path({str(corpus.path)!r})).utterance('one').track.crops.sum()"
    )
    run_child([sys.executable, "-c", code], check=True)


def test_sixteen_bit_sound_is_kept_exactly():
    samples = np.array([-32768, -1, 0, 1, 32767], np.float32) / np.float32(32768)
    beyond = np.array([1.0, -1.5], np.float32)
    for given, kept in ((samples, samples), (beyond, [32767 / 32768, -1])):
        np.testing.assert_array_equal(quantise(Audio(given, 16_000)).samples, kept)


def test_names_and_splits_also_of_utterances_written_by_others(corpus):
    for each in (corpus, Corpus.open(corpus.path), Corpus.create(corpus.path)):
        assert len(each) == 3
        assert each.names() == ("one", "three", "two")
        assert each.names("train") == ("one", "two")
        assert each.names("val") == ()
    manifest = corpus.path / "corpus.json"
    whole = manifest.read_bytes()
    manifest.write_text(manifest.read_text().replace('"version": 2', '"version": 3'))
    with pytest.raises(CorpusError, match="corpus version 3, this lipmotion reads version 2; upgrade lipmotion"):
        Corpus.open(corpus.path)
    content = json.loads(whole)
    del content["utterances"]["two"]
    manifest.write_text(json.dumps(content))
    again = Corpus.create(corpus.path)
    again.refresh()
    assert manifest.read_bytes() == whole


def test_the_bytes_do_not_depend_on_the_order(corpus, tmp_path):
    other = Corpus.create(tmp_path / "other")
    for name, split in (("three", "test"), ("one", "train"), ("two", "train")):
        other.add(utterance(name, split))
    files = [path.relative_to(corpus.path) for path in sorted(corpus.path.rglob("*")) if path.is_file()]
    assert files == [path.relative_to(other.path) for path in sorted(other.path.rglob("*")) if path.is_file()]
    for path in files:
        assert (corpus.path / path).read_bytes() == (other.path / path).read_bytes()


def test_an_utterance_is_replaced(corpus):
    corpus.add(replace(utterance("two", "val"), words=("new",)))
    assert Corpus.open(corpus.path).utterance("two").words == ("new",)
    assert [Corpus.open(corpus.path).names(split) for split in ("train", "val")] == [("one",), ("two",)]


def test_leftovers_of_a_killed_run_are_removed(corpus):
    (corpus.path / ".part-0-corpus.json").touch()
    (corpus.path / "utterances" / ".part-1-four").mkdir()
    again = Corpus.create(corpus.path)
    again.refresh()
    assert len(again) == 3
    assert not list(corpus.path.rglob(".part-*"))


def test_something_else_is_not_overwritten(tmp_path):
    (tmp_path / "letter.txt").write_text("dear")
    for path in (tmp_path, tmp_path / "letter.txt"):
        with pytest.raises(CorpusError, match="is not a corpus; give a new or an empty folder"):
            Corpus.create(path)


def test_not_a_corpus(tmp_path):
    for name in ("../two", "a/b", ".hidden", "", ".."):  # names must be those of folders
        with pytest.raises(InputError, match="cannot be named"):
            Corpus.create(tmp_path / "good").add(replace(utterance(), name=name))
    with pytest.raises(CorpusError, match="no such corpus; make one: lipmotion corpus prepare"):
        Corpus.open(tmp_path / "none")
    for content in (None, "", "[]", "{}", '{"format": "lipmotion.motion", "version": 1}'):
        if content is not None:
            (tmp_path / "corpus.json").write_text(content)
        with pytest.raises(CorpusError, match=r"make one: .* prepare /.* -o CORPUS|give a prepared corpus"):
            Corpus.open(tmp_path)


PHONES = Timeline((Span(0.0, 0.25, Unit("sil")), Span(0.25, 1.0, Unit("aa"))))


def test_speakers(tmp_path):
    corpus = Corpus.create(tmp_path / "corpus")
    for each in ("a train anna", "b test anna", "c train ben", "d val "):
        name, split, speaker = each.split(" ")
        corpus.add(replace(utterance(name, split), speaker=speaker))
    assert corpus.speakers == {"": (1, 1.0), "anna": (2, 2.0), "ben": (1, 1.0)}
    assert corpus.names(speakers=["anna"]) == ("a", "b")
    assert corpus.names("train", ["anna", "ben"]) == ("a", "c")
    assert corpus.required("test", ["anna"]) == ("b",)
    with pytest.raises(CorpusError, match=r"split 'val' by anna \(there are train: 1, val: 0, test: 1\).*test\.txt"):
        corpus.required("val", ["anna"])
    with pytest.raises(CorpusError, match=r"no speaker 'bob' \(there are: anna, ben\)"):
        corpus.required(None, ["anna", "bob"])
    assert corpus.summary()["speakers"] == "unknown (1, 1.0 seconds), anna (2, 2.0 seconds), ben (1, 1.0 seconds)"
    assert corpus.summary()["motion"] == "2 channels (opening, jaw) at 25 Hz"
    assert corpus.summary()["labelled"] == "0 with phones in time"


def test_described_numbers_that_cannot_be(corpus: Corpus) -> None:
    manifest, entry = corpus.path / "corpus.json", corpus.folder("one") / "entry.json"
    whole = manifest.read_text()
    for seconds in (10**400, 1e10, -1, float("nan")):
        content = json.loads(whole)
        content["utterances"]["one"]["duration_s"] = seconds
        manifest.write_text(json.dumps(content))
        with pytest.raises(CorpusError, match=r"prepare the corpus again|no readable corpus\.json"):
            Corpus.open(corpus.path)
    manifest.write_text(whole)
    described = json.loads(entry.read_text())
    for key in ("rate_hz", "duration_s", "frames"):
        entry.write_text(json.dumps(described | {key: 10**400}))
        with pytest.raises(CorpusError, match="delete this folder and prepare again"):
            corpus.summary()


def recordings(count: int) -> source_recordings.RecordingFolder:
    found = (source_recordings.SourceRecording(f"name{i}", Path(f"name{i}.wav"), None) for i in range(count))
    return source_recordings.RecordingFolder("folder", tuple(found))


def test_names_elsewhere_are_names_without_a_recording(tmp_path: Path) -> None:
    (tmp_path / "train.txt").write_text("name0\n/etc/passwd\n../name1\n..\nname0\n")
    found = source_recordings.assign_splits(recordings(2), tmp_path)
    assert [(item.name, item.split) for item in found.recordings] == [("name0", "train")]
    assert sorted(found.problems) == ["-etc-passwd", "..", "..-name1", "name1"]


def test_a_list_of_another_folder_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "val.txt").write_text("".join(f"other{i}\n" for i in range(MAX_MISSING_NAMES + 1)))
    with pytest.raises(CorpusError, match=f"name {MAX_MISSING_NAMES + 1} recordings .* at most {MAX_MISSING_NAMES}"):
        source_recordings.assign_splits(recordings(2), tmp_path)
    (tmp_path / "train.txt").write_bytes(b"\n" * (source_recordings.LARGEST_LIST_BYTES + 1))
    with pytest.raises(CorpusError, match="required at most 16777216: is it a list"):
        source_recordings.read_names(tmp_path / "train.txt")


def test_a_list_may_name_files(tmp_path: Path) -> None:
    (tmp_path / "test.txt").write_text("name1.wav\nname2.mkv\nname7.wav\n")
    dotted = source_recordings.RecordingFolder(
        "folder", (*recordings(3).recordings, source_recordings.SourceRecording("name0.b", Path("c"), None))
    )
    (tmp_path / "val.txt").write_text("name0.b\n")
    found = source_recordings.assign_splits(dotted, tmp_path)
    splits = {item.name: item.split for item in found.recordings}
    assert splits == {"name0": "train", "name1": "test", "name2": "test", "name0.b": "val"}
    assert list(found.problems) == ["name7.wav"]
    (tmp_path / "val.txt").write_text("name1\n")
    with pytest.raises(CorpusError, match=r"name1 is in val\.txt and in test\.txt"):
        source_recordings.assign_splits(recordings(3), tmp_path)


def test_a_corpus_by_url_is_that_of_its_folder(toy_corpus):
    """A URL's utterances are copied when they are read; nothing is added to it."""
    fsspec = pytest.importorskip("fsspec")
    system = fsspec.filesystem("memory")
    system.put(str(toy_corpus.path), "/away/toy", recursive=True)
    for url in ("memory://away/toy", "memory://away/toy/", toy_corpus.path.absolute().as_uri()):
        corpus = Corpus.open(url)
        name = corpus.names()[1]
        assert len(corpus) == len(toy_corpus)
        assert not (corpus.path / "utterances").exists()
        found, wanted = corpus.divided({"val": [name]}).utterance(name), toy_corpus.utterance(name)
        assert np.array_equal(found.features.values, wanted.features.values)
        assert found.words == wanted.words
        with pytest.raises(CorpusError, match="only read"):
            corpus.add(wanted)
    gone = sorted(corpus.names())[2]
    system.rm(f"/away/toy/utterances/{gone}", recursive=True)
    with pytest.raises(CorpusError, match="cannot be read"):
        Corpus.open("memory://away/toy").utterance(gone)
    for url, words in (("memory://nothing", "cannot be read"), ("never://here", "cannot be opened")):
        with pytest.raises(CorpusError, match=words):
            Corpus.open(url)
