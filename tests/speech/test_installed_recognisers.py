"""Recognisers that users install, with stand-ins that have their interfaces (faster-whisper 1.2, vosk 0.3.45)."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

from lipmotion import errors, types
from lipmotion.speech.recognition import installed_recognisers

WORDS = [(" See", 0.1, 0.5), (" five,", 0.6, 1.0), (" 20-foot", 1.0, 1.6)]
AUDIO = types.Audio(np.linspace(-1, 1, 20_000, dtype=np.float32), 16_000)


@pytest.fixture(autouse=True)
def no_cache() -> Iterator[None]:
    yield
    installed_recognisers._load_whisper.cache_clear()
    installed_recognisers._load_vosk.cache_clear()


class WhisperModel:
    """faster-whisper's, as far as it is used."""

    loaded: ClassVar[list[tuple[str, dict[str, object]]]] = []
    language = "en"
    words: ClassVar = [SimpleNamespace(word=word, start=start_s, end=end_s) for word, start_s, end_s in WORDS]
    segments: ClassVar = [SimpleNamespace(start=0.1, end=1.6, text="-", words=words)]

    def __init__(self, model_size_or_path: str, **options: object):
        self.loaded.append((model_size_or_path, options))
        if (Path(model_size_or_path) / "model.bin").read_bytes() != b"good":
            raise RuntimeError("Unsupported model binary version")

    def transcribe(self, audio: np.ndarray, **options: object) -> tuple[Iterator[Any], Any]:
        assert audio.dtype == np.float32
        assert options["word_timestamps"] is True
        return iter(self.segments), SimpleNamespace(language=self.language)


@pytest.fixture
def whisper(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> type[WhisperModel]:
    """Return a stand-in for the class of models; its model is in ``tmp_path``."""
    model = type("WhisperModel", (WhisperModel,), {"loaded": []})
    module = ModuleType("faster_whisper")
    module.WhisperModel = model  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "faster_whisper", module)
    monkeypatch.setenv("LIPMOTION_WHISPER_MODEL", str(tmp_path))
    monkeypatch.delenv("HF_HUB_OFFLINE", raising=False)
    (tmp_path / "model.bin").write_bytes(b"good")
    (tmp_path / "tokenizer.json").write_text("{}")
    return model


@pytest.fixture
def vosk(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[bytes]:
    """Install a stand-in for vosk, whose model is in ``tmp_path``; return the sound that it is given."""
    given: list[bytes] = []
    words = [{"conf": 1, "word": w.strip(" ,"), "start": a, "end": b} for w, a, b in WORDS]
    results: list[dict[str, object]] = [{"text": ""}, {"result": words, "text": ""}]

    class Recogniser:
        def __init__(self, model: object, rate_hz: float):
            assert (model, rate_hz) == (str(tmp_path), 16_000)

        def SetWords(self, wanted: bool) -> None:  # noqa: N802
            assert wanted

        def AcceptWaveform(self, sound: bytes) -> bool:  # noqa: N802
            given.append(sound)
            return len(given) == 2

        def Result(self) -> str:  # noqa: N802
            return json.dumps(results[0])

        def FinalResult(self) -> str:  # noqa: N802
            return json.dumps(results[1])

    def load(folder: str) -> str:
        if not (Path(folder) / "am" / "final.mdl").exists():
            raise Exception("Failed to create a model")
        return folder

    module = ModuleType("vosk")
    vars(module).update(Model=load, KaldiRecognizer=Recogniser, SetLogLevel=lambda level: None)  # noqa: ARG005
    monkeypatch.setitem(sys.modules, "vosk", module)
    monkeypatch.setenv("LIPMOTION_VOSK_MODEL", str(tmp_path))
    (tmp_path / "am").mkdir()
    (tmp_path / "am" / "final.mdl").touch()
    return given


def check_words(transcript: types.TimedTranscript | None) -> None:
    assert transcript.words == ("see", "five", "20", "foot")
    times = [time for word in transcript.lines[0].words for time in (word.start_s, word.end_s)]
    assert times == pytest.approx([0.1, 0.5, 0.6, 1.0, 1.0, 1.36, 1.36, 1.6])
    assert (transcript.lines[0].start_s, transcript.lines[0].end_s) == pytest.approx((0.1, 1.6))


def test_whisper(whisper: type[WhisperModel], tmp_path: Path) -> None:
    for _ in range(2):
        check_words(installed_recognisers.recognise_words(AUDIO, "whisper"))
    options = {"device": "cpu", "compute_type": "int8", "local_files_only": True}
    assert whisper.loaded == [(str(tmp_path), options)]


def test_whisper_without_times_of_words_and_in_another_language(
    whisper: type[WhisperModel], caplog: pytest.LogCaptureFixture
) -> None:
    whisper.segments = [SimpleNamespace(start=0.5, end=2.0, text=" [Music] Hi!", words=None)]
    found = installed_recognisers.recognise_words(AUDIO, "whisper")
    assert found.words == ("hi",)
    assert (found.lines[0].words[0].start_s, found.lines[0].end_s) == (None, 2.0)
    whisper.language = "fr"
    assert installed_recognisers.recognise_words(AUDIO, "whisper") is None
    assert "recognises the language 'fr', not English; its words are not used" in caplog.text


def test_vosk(vosk: list[bytes]) -> None:
    check_words(installed_recognisers.recognise_words(AUDIO, "vosk"))
    sound = np.frombuffer(b"".join(vosk), "<i2")
    assert len(sound) == 20_000
    assert (sound[0], sound[-1]) == (-32_768, 32_767)


@pytest.mark.usefixtures("whisper", "vosk")
def test_models_that_are_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(kind: str, message: str) -> None:
        with pytest.raises(errors.InputError, match=message):
            installed_recognisers.recognise_words(AUDIO, kind)

    (tmp_path / "model.bin").write_bytes(b"bad")
    refused("whisper", "faster-whisper cannot read this model: Unsupported model binary")
    (tmp_path / "tokenizer.json").unlink()  # it would be fetched
    refused("whisper", r"LIPMOTION_WHISPER_MODEL\): is no model of whisper, .* with tokenizer\.json")
    monkeypatch.delenv("LIPMOTION_WHISPER_MODEL")
    refused("whisper", "'whisper' needs a model: set LIPMOTION_WHISPER_MODEL to its folder")
    (tmp_path / "am" / "final.mdl").unlink()
    refused("vosk", "vosk cannot read this model: Failed to create a model")
    (tmp_path / "am").rmdir()
    refused("vosk", r"is no model of vosk, required a folder with am or final\.mdl")


@pytest.mark.usefixtures("whisper", "vosk")
@pytest.mark.parametrize(("kind", "package"), [("whisper", "faster_whisper"), ("vosk", "vosk")])
def test_packages_that_are_not_installed(kind: str, package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.delenv(f"LIPMOTION_{kind.upper()}_MODEL")  # what to install comes first
    with pytest.raises(errors.MissingDependencyError, match=rf'needs {package}: pip install ".*\[{kind}\]"'):
        installed_recognisers.recognise_words(AUDIO, kind)
