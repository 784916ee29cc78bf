"""What pages say to type is run: here, by the test of the page, or by hand, as a marker says, with the last output."""

import re
import shlex
from pathlib import Path

import pytest

import lipmotion
from cli.conftest import RunCommand
from docs.desk import copied, set_desk
from docs.site_pages import ROOT, Block, blocks, pages
from lipmotion import Corpus
from lipmotion.cli.command_line import parser

TESTED = {
    "README": "test_readme.py", "docs/start": "test_readme.py", "docs/your-face": "docs/test_your_face.py",
    "docs/api": "docs/test_api_page.py", "docs/extend/": "docs/test_extend.py",
    "recipes/": "docs/test_corpus_recipes.py",
}  # fmt: skip
"""Pages, or folders of pages, with a test of their own."""
RESULTS = "docs/results/"  # pages that are the output of the commands on them: their sheets have commit and date
ALL = [block for page in ("README", *pages()) for block in blocks(page)]
HERE = [block for block in ALL if not block.last and not block.page.startswith((*TESTED, RESULTS))]


def commands(block: Block) -> list[list[str]]:
    """Return the words of the commands of a block; of a pipe those of its last part."""
    lines = re.sub(r"\\\n", " ", block.text).splitlines()
    words = [shlex.split(re.split(r" > ", line)[0].rpartition(" | ")[2], comments=True) for line in lines]
    return [each for each in words if each]


def test_every_command_is_understood():
    understood = parser()
    found = [words for block in ALL if block.language == "sh" for words in commands(block)]
    assert len(found) > 100
    for words in found:
        if words[0] == "lipmotion":
            assert understood.parse_args(words[1:]).verb == words[1]


def test_what_runs_here_is_ours_and_markers_say_when_and_what():
    assert [
        words for block in HERE if block.language == "sh" for words in commands(block) if words[0] != "lipmotion"
    ] == []
    for block in ALL:
        assert not block.last or re.match(r"(20\d\d-\d\d-\d\d[^:]*|not run): .", block.last), block
    for test in TESTED.values():
        assert (ROOT / "tests" / test).is_file()


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory, toy_model_file: Path, coupled_model_file: Path) -> Path:
    folder = tmp_path_factory.mktemp("pages") / "desk"
    folder.mkdir()
    models = dict.fromkeys(("me.lipmotion", "her.lipmotion"), toy_model_file)
    set_desk(folder, models | {"coupled.lipmotion": coupled_model_file})
    return folder


@pytest.mark.long
@pytest.mark.usefixtures("recognised_once")
@pytest.mark.parametrize("page", dict.fromkeys(block.page for block in HERE))
def test_blocks_of_a_page_run(page, desk, toy_model, tmp_path, monkeypatch, run):
    monkeypatch.chdir(copied(desk, tmp_path / "desk"))
    names: dict[str, object] = {"lipmotion": lipmotion, "corpus": Corpus.open(Path("my-corpus"))}
    of_page = [block for block in HERE if block.page == page]
    if any(block.language == "python" for block in of_page):
        names["result"] = lipmotion.animate("speech.wav", transcript=Path("speech.txt"), model=toy_model)
    with Path("speech.wav").open(encoding="latin-1") as piped:
        monkeypatch.setattr("sys.stdin", piped)
        for block in of_page:
            perform(block, names, run)


def perform(block: Block, names: dict[str, object], run: RunCommand) -> None:
    """Run a block in the current folder."""
    if block.language == "python":
        exec(compile(block.text, block.page, "exec"), names)  # noqa: S102
        return
    for words in commands(block):
        assert run(*words[1:]).code == 0, words
