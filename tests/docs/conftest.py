from collections.abc import Iterator
from functools import partial

import pytest

from cli.conftest import run
from lipmotion.hmm.model import HmmConfig
from lipmotion.speech.recognition.recognised_speech import Recognition
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.types import Audio, ParallelMap

__all__ = ["recognised_once", "run", "small_phone_models"]


@pytest.fixture(autouse=True)
def small_phone_models(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lipmotion.pipeline.training.train.HmmConfig", partial(HmmConfig, mixtures=1, iterations=1))


@pytest.fixture(scope="module")
def recognised_once() -> Iterator[None]:
    """Most examples recognise the same recordings by the same models: each is done once."""
    known: dict[tuple[int, str, bytes], Recognition] = {}
    plain = Recogniser.recognise

    def recognise(self: Recogniser, audio: Audio, each: ParallelMap = map, *, english: bool = True) -> Recognition:
        key = id(self.own), self.kind, audio.samples.tobytes()
        if self.adaptation is not None:
            return plain(self, audio, each, english=english)
        if key not in known:
            known[key] = plain(self, audio, each, english=english)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Recogniser, "recognise", recognise)
        yield
