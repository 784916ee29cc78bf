"""The recipes for published corpora: three commands each."""

import re
import shlex
from pathlib import Path

from docs.test_links import broken
from lipmotion.cli.command_line import parser

FOLDER = Path(__file__).parents[2] / "recipes"
INDEX = FOLDER / "README.md"
PAGES = sorted(page for page in FOLDER.glob("*.md") if page != INDEX)
MAX_LINES = 40


def commands(page: Path) -> list[list[str]]:
    """Return the commands in the blocks of a page, each as its words."""
    (block,) = re.findall(r"```sh\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    return [shlex.split(line)[1:] for line in block.splitlines()]


def test_a_recipe_is_a_short_page_with_three_commands():
    understood, index = parser(), INDEX.read_text(encoding="utf-8")
    assert len(PAGES) >= 6
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        assert len(text.splitlines()) <= MAX_LINES
        assert f"({page.name})" in index
        prepare, train, folds = map(understood.parse_args, commands(page))
        assert (prepare.verb, train.verb, folds.verb) == ("corpus", "train", "experiment")
        assert prepare.output == train.corpus == folds.corpus
        assert (train.start, folds.by_speaker) == ("none", True)
        assert f"    {prepare.recordings.parts[0]}/\n" in text


def test_links_of_the_recipes_resolve():
    assert {page.name: broken(page.read_text(encoding="utf-8"), page) for page in (INDEX, *PAGES)} == {
        page.name: [] for page in (INDEX, *PAGES)
    }


@pytest.fixture
def lrs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of LRS2 with nine sentences of three speakers, whose tracks are known; small phone models."""
    said = toy_utterances(9)
    tracks: dict[Path, Track] = {}
    for number, utterance in enumerate(said):
        clip = tmp_path / "lrs" / "main" / PEOPLE[number % 3] / f"{number:05}.mp4"
        clip.parent.mkdir(parents=True, exist_ok=True)
        write_sound(clip, utterance.audio)
        clip.with_suffix(".txt").write_text(f"Text:  {' '.join(utterance.words or ()).upper()}\nConf:  4\n")
        tracks[clip.resolve()] = utterance.track

    def track(path: Path, **_: object) -> Track:
        return tracks[path.resolve()]

    replace_tracking(monkeypatch, track)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.long
def test_three_commands_make_a_model_of_many_and_judge_it_on_strangers(lrs, run):
    prepare, train, folds = commands(FOLDER / "lrs.md")
    folds[folds.index("5")] = "3"
    for command in (prepare, train, folds):
        assert run(*command, "--workers", "1").code == 0
    corpus = Corpus.open(lrs / "lrs-corpus")
    assert {speaker: count for speaker, (count, _) in corpus.speakers.items()} == dict.fromkeys(PEOPLE, 3)
    assert corpus.utterance("anna-00001").words == toy_utterances(9)[1].words
    assert load_model(lrs / "lrs.lipmotion").speakers.keys() == {*PEOPLE}
    figures = json.loads((lrs / "lrs.json").read_text())
    assert (figures["folds"], figures["trained_on"]) == (3, [6, 6, 6])
    for row in figures["conditions"].values():
        assert list(row["speakers"]) == list(PEOPLE)
        assert min(row["speakers"].values()) > 0.5
