from pathlib import Path

import pytest

from lipmotion.corpora.source_recordings import (
    LARGEST_LIST_BYTES,
    MAX_MISSING_NAMES,
    RecordingFolder,
    SourceRecording,
    assign_splits,
    read_names,
)
from lipmotion.errors import CorpusError


def recordings(count: int) -> RecordingFolder:
    found = (SourceRecording(f"name{i}", Path(f"name{i}.wav"), None) for i in range(count))
    return RecordingFolder("folder", tuple(found))


def test_names_elsewhere_are_names_without_a_recording(tmp_path: Path) -> None:
    (tmp_path / "train.txt").write_text("name0\n/etc/passwd\n../name1\n..\nname0\n")
    found = assign_splits(recordings(2), tmp_path)
    assert [(item.name, item.split) for item in found.recordings] == [("name0", "train")]
    assert sorted(found.problems) == ["-etc-passwd", "..", "..-name1", "name1"]


def test_long_lists_of_many_recordings(tmp_path: Path) -> None:
    (tmp_path / "train.txt").write_text("".join(f"name{i}\n" for i in range(200)))
    found = assign_splits(recordings(50), tmp_path)
    assert len(found.recordings) == 50
    assert len(found.problems) == 150


def test_a_list_of_another_folder_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "val.txt").write_text("".join(f"other{i}\n" for i in range(MAX_MISSING_NAMES + 1)))
    with pytest.raises(CorpusError, match=f"name {MAX_MISSING_NAMES + 1} recordings .* at most {MAX_MISSING_NAMES}"):
        assign_splits(recordings(2), tmp_path)
    (tmp_path / "train.txt").write_bytes(b"\n" * (LARGEST_LIST_BYTES + 1))
    with pytest.raises(CorpusError, match="required at most 16777216: is it a list"):
        read_names(tmp_path / "train.txt")


def test_a_list_may_name_files(tmp_path: Path) -> None:
    (tmp_path / "test.txt").write_text("name1.wav\nname2.mkv\nname7.wav\n")
    dotted = RecordingFolder("folder", (*recordings(3).recordings, SourceRecording("name0.b", Path("c"), None)))
    (tmp_path / "val.txt").write_text("name0.b\n")
    found = assign_splits(dotted, tmp_path)
    splits = {item.name: item.split for item in found.recordings}
    assert splits == {"name0": "train", "name1": "test", "name2": "test", "name0.b": "val"}
    assert list(found.problems) == ["name7.wav"]
    (tmp_path / "val.txt").write_text("name1\n")
    with pytest.raises(CorpusError, match=r"name1 is in val\.txt and in test\.txt"):
        assign_splits(recordings(3), tmp_path)
