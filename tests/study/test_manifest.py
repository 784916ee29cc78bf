import json
from collections.abc import Callable
from typing import Any

import pytest

from lipmotion.errors import InputError
from lipmotion_studio.study.answers import KINDS
from lipmotion_studio.study.manifest import MANIFEST, check_videos, read_study
from study.small_study import small_study


@pytest.mark.parametrize("kind", KINDS)
def test_a_study_survives_its_file(tmp_path, kind):
    study = small_study(tmp_path / "study", kind)
    assert read_study(tmp_path / "study") == study
    assert set(check_videos(study, tmp_path / "study")) == {video.file for video in study.videos}


def put(**members: Any) -> Callable[[dict[str, Any]], object]:
    return lambda content: content.update(members)


@pytest.mark.parametrize(
    "change",
    [
        put(version=2),
        put(format="other"),
        put(kind="guess"),
        put(trials=[]),
        put(trials=[{"videos": [0, 999]}]),
        put(trials=[{"videos": [0]}]),
        put(trials=[{"videos": [0, 1], "expected": "third"}]),
        put(surprise=1),
        put(title=7),
        put(videos={}),
        lambda content: content["videos"][0].update(file="../../secret.mp4"),
        lambda content: content.pop("seed"),
    ],
)
def test_a_manifest_that_was_changed_is_refused(tmp_path, change):
    small_study(tmp_path / "study")
    path = tmp_path / "study" / MANIFEST
    content = json.loads(path.read_text(encoding="utf-8"))
    change(content)
    path.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(InputError, match="design it again"):
        read_study(tmp_path / "study")


def test_a_folder_that_is_no_study_says_how_to_make_one(tmp_path):
    with pytest.raises(InputError, match="lipmotion study design"):
        read_study(tmp_path)
    (tmp_path / MANIFEST).write_text("[]", encoding="utf-8")
    with pytest.raises(InputError, match="not a study"):
        read_study(tmp_path)


def test_videos_that_are_missing_or_changed_are_noticed(tmp_path):
    study = small_study(tmp_path / "study")
    path = check_videos(study, tmp_path / "study")[study.videos[0].file]
    path.write_bytes(b"another video")
    with pytest.raises(InputError, match="has changed"):
        check_videos(study, tmp_path / "study")
    path.unlink()
    with pytest.raises(InputError, match="is missing"):
        check_videos(study, tmp_path / "study")
