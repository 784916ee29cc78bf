"""Extensions of installed packages, and built-in ones, by name."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path

import pytest

from lipmotion.corpora.discover import READERS
from lipmotion.engines import ENGINES, Engine, engine_named
from lipmotion.errors import ExportError, InputError
from lipmotion.export.base import MOTION_FORMATS, MotionFormat, check_motion
from lipmotion.extensions import Registry
from lipmotion.faces import FACES, Face, face_named
from lipmotion.testing.examples import example


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Entry points that name what is there, what is not there, and a name that is built in."""
    found = [
        metadata.EntryPoint("text", "json:dumps", "kind"),
        metadata.EntryPoint("broken", "no_such_module_at_all:x", "kind"),
        metadata.EntryPoint("built", "json:loads", "kind"),
    ]
    monkeypatch.setattr(metadata, "entry_points", lambda group: [e for e in found if e.group == group])


def test_names_and_loading(installed: None) -> None:  # noqa: ARG001
    registry: Registry[object] = Registry("thing", "kind", {"built": "json:dump"})
    import json

    assert registry.names == ("built", "broken", "text")
    assert registry.load("text") is json.dumps
    assert registry.load("built") is json.dump  # not what a package calls so
    with pytest.raises(InputError, match="no thing 'other'; there are: built, broken, text"):
        registry.load("other")
    with pytest.raises(
        InputError, match=r"'broken' of the package 'no_such_module_at_all' cannot be imported: No module"
    ):
        registry.load("broken")


def test_built_in_extensions_are_of_their_kinds() -> None:
    assert [issubclass(ENGINES.load(name), Engine) for name in ENGINES.built_in] == [True] * 4
    assert [ENGINES.load(name).name for name in ENGINES.built_in] == list(ENGINES.built_in)
    assert all(issubclass(FACES.load(name), Face) for name in FACES.built_in)
    assert all(isinstance(MOTION_FORMATS.load(name), MotionFormat) for name in MOTION_FORMATS.built_in)
    assert all(callable(READERS.load(name)) for name in READERS.built_in)


def test_what_is_of_another_kind_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for group in ("lipmotion.engines", "lipmotion.faces", "lipmotion.exporters"):
        point = metadata.EntryPoint("wrong", "json:dumps", group)
        for registry in (ENGINES, FACES, MOTION_FORMATS):
            if registry.group == group:
                monkeypatch.setitem(registry.__dict__, "_installed", {"wrong": point})
    with pytest.raises(InputError, match="required a class of Engine"):
        engine_named("wrong")
    with pytest.raises(InputError, match="required a class of Face"):
        face_named("wrong")
    with pytest.raises(ExportError, match=r"cannot write motion as '\.wrong'"):
        check_motion(tmp_path / "a.wrong", example(("aa",)).motion)
