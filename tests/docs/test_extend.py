"""The pages of docs/extend: their code is written to files, installed as packages, checked and used."""

import os
import re
import shutil
import sys
from pathlib import Path

import pytest

from children import LIPMOTION, Done, environment, run_child

pytestmark = pytest.mark.long
PAGES = Path(__file__).parents[2] / "docs" / "extend"
PROJECT = """[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"
[project]
name = "{name}"
version = "1.0"
{entry}
[tool.hatch.build.targets.wheel]
only-include = ["{module}.py"]
"""


class Package:
    """What a page describes, installed in a folder of its own."""

    def __init__(self, page: str, folder: Path) -> None:
        text = (PAGES / page).read_text(encoding="utf-8")
        blocks = dict(enumerate(re.findall(r"^```(?:python|toml)\n(.*?)^```", text, re.MULTILINE | re.DOTALL)))
        self.check = "\n".join(block for block in blocks.values() if "check_" in block or "CHECKS" in block)
        if "CHECKS" in self.check:
            self.check += "\nfor promise in ENGINE_CHECKS:\n    test_promise(promise)\n"
        (module,) = set(re.findall(r"^`(\w+)\.py`", text, re.MULTILINE))
        self.sources, self.installed = folder / "sources", folder / "installed"
        self.sources.mkdir(parents=True)
        (self.sources / f"{module}.py").write_text(blocks[0], encoding="utf-8")
        project = next(block for block in blocks.values() if "entry-points" in block)
        if "[project]" not in project:
            project = PROJECT.format(name=module, entry=project, module=module)
        (self.sources / "pyproject.toml").write_text(project, encoding="utf-8")
        pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--quiet", "--no-index"]
        build = ["--no-deps", "--no-build-isolation", "--target", str(self.installed), str(self.sources)]
        run_child([*pip, *build], check=True)
        shutil.rmtree(self.sources)

    def run(self, *command: object) -> Done:
        """Run Python with the package installed."""
        path = os.pathsep.join(filter(None, [str(self.installed), os.environ.get("PYTHONPATH", "")]))
        return run_child([sys.executable, *command], variables=environment(PYTHONPATH=path))

    def lipmotion(self, *arguments: object) -> str:
        """Return what a verb prints."""
        done = self.run("-m", "lipmotion.cli.main", *arguments)
        assert done.returncode == 0, done.stderr
        return done.stdout


@pytest.mark.parametrize("page", ["engine.md", "face.md", "exporter.md"])
def test_what_a_page_writes_keeps_its_contract(page, tmp_path):
    package = Package(page, tmp_path)
    done = package.run("-c", package.check)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("page", "chosen", "missing"),
    [
        ("engine.md", ("--engine", "ridge", "--set", "penalty=500"),
         "no engine 'ridge'; there are: trajectory, coupled, joint, selection; install the package that adds it"),
        ("predictor.md", ("--set", "predictor=frames"),
         "no predictor 'frames'; there are: network, posteriors, prior, encoding; install the package that adds it"),
    ],
)  # fmt: skip
def test_what_is_installed_trains_saves_loads_and_animates(page, chosen, missing, toy_corpus, toy_speech, tmp_path):
    package, model = Package(page, tmp_path / "package"), tmp_path / "a.lipmotion"
    package.lipmotion("train", toy_corpus.path, "-o", model, *chosen)
    assert chosen[-1] in package.lipmotion("info", model)
    package.lipmotion("animate", toy_speech, "--model", model, "-o", tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text(encoding="utf-8").startswith("time_s,opening,width,outer")
    package.lipmotion("explain", toy_speech, "--model", model, "--at", "1.0")
    without = run_child([*LIPMOTION, "animate", toy_speech, "--model", model, "-o", tmp_path / "b.csv"])
    assert without.returncode == 6
    assert missing in without.stderr


def test_an_installed_face_format_and_output_work_from_the_command_line(toy_speech, tmp_path):
    face, table = Package("face.md", tmp_path / "face"), Package("exporter.md", tmp_path / "table")
    words = Package("output.md", tmp_path / "words")
    words.lipmotion("animate", toy_speech, "--transcript", "see bob papa mama", "-o", tmp_path / "a.words.csv")
    assert (tmp_path / "a.words.csv").read_text(encoding="utf-8").endswith(",mama\n")
    face.lipmotion("animate", toy_speech, "-o", tmp_path / "a.mp4", "--face", "bar")
    assert (tmp_path / "a.mp4").stat().st_size > 1000
    table.lipmotion("animate", toy_speech, "-o", tmp_path / "a.tab", "--channels", "opening,width")
    code = f"import lipmotion; print(lipmotion.read_motion({str(tmp_path / 'a.tab')!r})[0].names)"
    assert table.run("-c", code).stdout.strip() == "('opening', 'width')"
    unknown = face.run("-m", "lipmotion.cli.main", "animate", toy_speech, "-o", tmp_path / "b.mp4", "--face", "rab")
    assert "no face 'rab'; there are: portrait, woman, man, cartoon, head, bar; or give" in unknown.stderr
    assert not (tmp_path / "b.mp4").exists()
