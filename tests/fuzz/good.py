"""The good corpus and models of the fuzzer, made from the toy corpus."""

from pathlib import Path

from fuzz.inputs import Good
from lipmotion import Corpus, save_model, train
from lipmotion.engines import engine_named
from testing.toy import SMALL, toy_utterances

SENTENCES = 6
ENGINES: dict[str, dict[str, object]] = {
    "trajectory": {},
    "coupled": {"chains": "sVis 2vis", "mixtures": 1, "states": 2},
    "joint": {},
}


def make_good(folder: Path) -> Good:
    """Prepare a corpus, and train a model of every engine on it."""
    corpus = Corpus.create(folder / "corpus")
    for utterance in toy_utterances(SENTENCES):
        corpus.add(utterance)
    for name, options in ENGINES.items():
        engine = engine_named(name, options)
        model, _ = train(corpus, recogniser=SMALL, engine=engine)
        save_model(model, folder / f"{name}.lipmotion")
    return good_in(folder)


def good_in(folder: Path) -> Good:
    return Good(folder / "corpus", tuple(folder / f"{name}.lipmotion" for name in ENGINES))
