"""Extensions of installed packages, and built-in ones, by name."""

import importlib
import json
import re
import shutil
import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

import pytest

from lipmotion.cli.terminal.progress import describe_outcome
from lipmotion.engines import ENGINES, Engine, engine_named
from lipmotion.errors import ExportError, InputError
from lipmotion.extensions import Registry, install_command
from lipmotion.formats import MotionFormat
from lipmotion.formats.base import MOTION_FORMATS, check_motion
from lipmotion.testing import example
from lipmotion_faces import FACES, Face, make_face
from lipmotion_faces.corpus.folder import READERS


@pytest.fixture
def distribution(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Installs a package with some files about it, before all others."""
    monkeypatch.syspath_prepend(tmp_path)

    def install(name: str, **files: str) -> None:
        folder = tmp_path / f"{name.replace('-', '_')}-1.0.dist-info"
        folder.mkdir(exist_ok=True)
        for file, text in {"METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", **files}.items():
            (folder / file).write_text(text)
        importlib.invalidate_caches()

    return install


def test_names_and_loading(distribution: Callable[..., None]) -> None:
    """A package names what is there, what is not there, and a name that is built in."""
    points = "[kind]\ntext = json:dumps\nbroken = no_such_module_at_all:x\nbuilt = json:loads\n"
    distribution("odd-name", **{"entry_points.txt": points})
    registry: Registry[object] = Registry("thing", "kind", {"built": "json:dump"})
    assert registry.names == ("built", "broken", "text")
    assert registry.load("text") is json.dumps
    assert registry.load("built") is json.dump  # not what a package calls so
    with pytest.raises(InputError, match="no thing 'other'; there are: built, broken, text"):
        registry.load("other")
    with pytest.raises(
        InputError, match=r"'broken' cannot be imported from the package .*_at_all:x of kind\): .*No mo"
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
        make_face("wrong")
    with pytest.raises(ExportError, match=r"cannot write motion as '\.wrong'"):
        check_motion(tmp_path / "a.wrong", example(("aa",)).motion)


PLUGINS = {
    "quits": "import sys; sys.exit()",
    "quits well": "import sys; sys.exit(0)",
    "stops": "raise SystemExit('no licence')",
    "raises": "1 / 0",
    "is closed": "raise GeneratorExit",
    "is no Python": "def",
    "is empty": "",
}


@pytest.fixture
def plugin(tmp_path: Path, distribution: Callable[..., None]) -> Callable[..., Registry[object]]:
    """Returns a registry of one installed package, whose module ``odd_plugin`` holds a text."""

    def install(text: str, value: str = "odd_plugin:x") -> Registry[object]:
        shutil.rmtree(tmp_path / "__pycache__", ignore_errors=True)
        (tmp_path / "odd_plugin.py").write_text(text)
        distribution("odd-name", **{"entry_points.txt": f"[lipmotion.faces]\nodd = {value}\n"})
        sys.modules.pop("odd_plugin", None)
        return Registry("face", "lipmotion.faces", {})

    return install


def test_whatever_a_package_does_when_it_is_imported_is_one_error(plugin, capsys: pytest.CaptureFixture[str]) -> None:
    assert plugin("print('hello'); x = 1").load("odd") == 1
    assert capsys.readouterr() == ("", "hello\n")  # what it prints is no output
    for what, text in PLUGINS.items():
        with pytest.raises(InputError, match=r"package 'odd-name' \(entry point odd = odd_plugin:x of lipm.*remove it"):
            pytest.fail(f"{what}: {plugin(text).load('odd')}")
    with pytest.raises(KeyboardInterrupt):
        plugin("raise KeyboardInterrupt").load("odd")


def test_malformed_entry_points_are_named(plugin) -> None:
    for value in ("", "::", "odd plugin", "odd_plugin:x y", "odd_plugin:", "1/0", "odd_plugin:x.y"):
        message = rf"'odd-name' \(entry point odd = {re.escape(value)} of lipmotion.faces\)"
        with pytest.raises(InputError, match=message):
            pytest.fail(f"{value}: {plugin('x = 1', value).load('odd')}")
    with pytest.raises(InputError, match=r"entry_points.txt of the package 'odd-name' cannot be read: .*install the"):
        pytest.fail(str(plugin("x = 1", "odd_plugin:x\nno equals sign").names))


def test_what_fails_in_a_package_is_told_from_a_bug(plugin) -> None:
    called = plugin("import sys\ndef x(how):\n    return 1 / 0 if how else sys.exit()\n").load("odd")
    for how, said in ((1, "ZeroDivisionError: division by zero"), (0, "SystemExit")):
        with pytest.raises((ZeroDivisionError, SystemExit)) as caught:
            called(how)  # type: ignore[operator]
        code, message = describe_outcome(caught.value) or (0, "")
        assert code == 3
        assert re.search(rf"'odd-name' .* failed: {said} \(.*odd_plugin.py, line 3\); tell its authors", message)
    with pytest.raises(ZeroDivisionError) as own:
        1 / 0  # noqa: B018
    assert describe_outcome(own.value) is None


def test_an_extra_is_installed_from_where_lipmotion_came_from(distribution, tmp_path: Path) -> None:
    distribution("lipmotion")
    assert install_command("video") == 'pip install "lipmotion[video]"'
    place = {"url": (tmp_path / "a copy").as_uri(), "dir_info": {}}
    distribution("lipmotion", **{"direct_url.json": json.dumps(place)})
    assert install_command("video") == 'pip install "lipmotion[video]"'
    (tmp_path / "a copy").mkdir()
    assert install_command("video") == f'pip install "{tmp_path / "a copy"}[video]"'
