"""Good input, changed at random: a valid result or an error of ours, never another one, never a warning."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lipmotion.corpora.base import Curves
from lipmotion.corpora.facegood import channels_in, read_array
from lipmotion.corpora.grid import aligned_words
from lipmotion.corpora.labels import read_labels
from lipmotion.corpora.store import Corpus
from lipmotion.errors import LipMotionError
from lipmotion.export.base import read_motion
from lipmotion.pipeline.animate import animate
from lipmotion.pipeline.model import Model, load_model
from lipmotion.speech.mfcc import mfcc
from lipmotion.speech.read import read_audio
from lipmotion.types import Audio, Channel
from lipmotion.units import Lexicon, words_of
from lipmotion.vision.frames import open_video
from robustness.case import Bench, npy
from robustness.motion_cases import GOOD
from speech.sound import tone, write_sound

SLOW = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow, HealthCheck.data_too_large]
fuzzed = settings(deadline=None, derandomize=True, max_examples=60, suppress_health_check=SLOW)

PIECES = [b"\0", b"\xff", b"-", b"nan", b"1e999", b"9" * 40, b'"', b"{", b"[", b"]", b",", b"\n", b"\t", b" ", b"null"]


@st.composite
def mutation(draw: st.DrawFn) -> Callable[[bytes], bytes]:
    """Draw a change of bytes: cut off, overwritten, left out, put in, repeated."""
    kind = draw(st.sampled_from(["cut", "write", "remove", "insert", "repeat"]))
    places = draw(st.lists(st.floats(0, 1, exclude_max=True), min_size=1, max_size=4))
    piece = draw(st.one_of(st.sampled_from(PIECES), st.binary(min_size=1, max_size=8)))
    size = draw(st.integers(1, 64))

    def change(content: bytes) -> bytes:
        for share in places:
            at = int(share * len(content))
            parts = {
                "cut": content[:at],
                "write": content[:at] + piece + content[at + len(piece) :],
                "remove": content[:at] + content[at + size :],
                "insert": content[:at] + piece + content[at:],
                "repeat": content[:at] + content[at : at + size] * 2 + content[at + size :],
            }
            content = parts[kind]
        return content

    return change


def survives(read: Callable[[], object]) -> object | None:
    """Return what is read, or None where it was refused; any other error, or a warning, fails the test."""
    with suppress(LipMotionError):
        return read()
    return None


SOUNDS = {"wav": "pcm_s16le", "flac": "flac", "mp3": "libmp3lame", "ogg": "libopus", "mp4": "aac", "mkv": "aac"}


@pytest.mark.parametrize("suffix", SOUNDS)
@fuzzed
@given(changes=st.lists(mutation(), min_size=1, max_size=2))
def test_sounds(suffix: str, changes: list[Callable[[bytes], bytes]], tmp_path: Path) -> None:
    path, changed = tmp_path / f"a.{suffix}", tmp_path / f"b.{suffix}"
    if not path.exists():
        rate_hz = 48_000 if suffix == "ogg" else 16_000
        write_sound(path, tone(rate_hz, 0.6), rate_hz, SOUNDS[suffix])
    content = path.read_bytes()
    for change in changes:
        content = change(content)
    changed.write_bytes(content)
    audio = survives(lambda: read_audio(changed))
    if isinstance(audio, Audio):
        assert np.isfinite(audio.samples).all()
        survives(lambda: mfcc(audio))


@fuzzed
@given(change=mutation())
def test_videos(change: Callable[[bytes], bytes], tmp_path: Path) -> None:
    path, changed = tmp_path / "a.mp4", tmp_path / "b.mp4"
    if not path.exists():
        write_sound(path, tone(16_000, 0.6), 16_000, "aac", video=True)
    changed.write_bytes(change(path.read_bytes()))

    def read() -> None:
        with open_video(changed) as video:
            for frame in video.frames:
                assert frame.image.shape[2] == 3

    survives(read)


@pytest.mark.parametrize("suffix", [".json", ".csv", ".npz"])
@settings(fuzzed, max_examples=200)
@given(change=mutation())
def test_motion_files(suffix: str, change: Callable[[bytes], bytes], tmp_path: Path) -> None:
    content = io.BytesIO()
    np.savez(content, values=np.array(GOOD["values"]), document=np.array(json.dumps(GOOD)))
    good = {
        ".json": json.dumps(GOOD).encode(),
        ".csv": b"time_s,opening,width\n0,0.1,0.2\n0.01,0.1,0.2\n0.02,-1e-3,4\n",
        ".npz": content.getvalue(),
    }
    path = tmp_path / f"a{suffix}"
    path.write_bytes(change(good[suffix]))
    found = survives(lambda: read_motion(path))
    if isinstance(found, tuple):
        assert np.isfinite(found[0].values).all()
        assert 0 < found[0].rate_hz < np.inf


JSON = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5)),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(st.sampled_from(sorted(GOOD)), inner)),
    max_leaves=6,
)


@settings(fuzzed, max_examples=200)
@given(key=st.sampled_from(sorted(GOOD)), value=JSON)
def test_motion_documents(key: str, value: object, toy_model: Model, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps(GOOD | {key: value}))
    found = survives(lambda: read_motion(path))
    if isinstance(found, tuple) and len(found[1]):
        survives(lambda: animate(Audio(tone(16_000, 0.6)[0], 16_000), units=found[1], model=toy_model))


@settings(fuzzed, max_examples=80)
@given(data=st.data(), change=mutation())
def test_models(data: st.DataObject, change: Callable[[bytes], bytes], bench: Bench) -> None:
    """One member of the zip is changed, its checksum right: what is inside must be checked."""
    with zipfile.ZipFile(bench.model) as file:
        name = data.draw(st.sampled_from(sorted(file.namelist())))
        content = change(file.read(name))
    path = bench.changed_model({name: content})
    model = survives(lambda: load_model(path))
    if isinstance(model, Model):
        audio = Audio(tone(16_000, 0.6)[0], 16_000)
        survives(lambda: animate(audio, model=model, recogniser="own"))


@settings(fuzzed, max_examples=150)
@given(data=st.data(), change=mutation())
def test_corpora(data: st.DataObject, change: Callable[[bytes], bytes], toy_corpus: Corpus, tmp_path: Path) -> None:
    name = toy_corpus.names()[0]
    corpus = tmp_path / "corpus"
    (corpus / "utterances" / name).mkdir(parents=True, exist_ok=True)
    files = ["corpus.json", *(f"utterances/{name}/{path.name}" for path in toy_corpus.folder(name).iterdir())]
    for file in files:
        (corpus / file).write_bytes((toy_corpus.path / file).read_bytes())
    changed = corpus / data.draw(st.sampled_from(sorted(files)))
    content = changed.read_bytes()
    head = content[:400]  # of an array, the header is what matters
    changed.write_bytes(change(head) + content[400:] if data.draw(st.booleans()) else change(content))
    opened = survives(lambda: Corpus.open(corpus))
    if isinstance(opened, Corpus) and name in opened.names():
        utterance = survives(lambda: opened.utterance(name))
        if utterance is not None:
            assert np.isfinite(utterance.track.motion.values).all()  # type: ignore[attr-defined]
        survives(lambda: opened.speakers)


LONG = """File type = "ooTextFile"
Object class = "TextGrid"

xmin = 0
xmax = 2
tiers? <exists>
size = 1
item []:
  item [1]:
    class = "IntervalTier"
    name = "phones"
    xmin = 0
    xmax = 2
    intervals: size = 2
    intervals [1]:
      xmin = 0
      xmax = 1.5
      text = "P"
    intervals [2]:
      xmin = 1.5
      xmax = 2
      text = "AA1"
"""
LABELS = {
    "long.TextGrid": LONG,
    "short.TextGrid": '"ooTextFile"\n"TextGrid"\n0\n2\n<exists>\n1\n"IntervalTier"\n"words"\n0\n2\n1\n0\n2\n"hi you"\n',
    "htk.lab": "0 1000000 sil\n1000000 2000000 p\n2000000 3500000 aa\n",
    "starts.lab": "0 sil\n1000000 p\n2000000 aa\n",
    "audacity.txt": "0.0\t0.5\tp\n0.5\t1.25\taa\n\\\t100\t200\n",
    "words.txt": "Hello, you 42 people.\n",
}


@pytest.mark.parametrize("name", LABELS)
@settings(fuzzed, max_examples=150)
@given(change=mutation())
def test_labels(name: str, change: Callable[[bytes], bytes], tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(change(LABELS[name].encode()))
    survives(lambda: read_labels(path))


@settings(fuzzed, max_examples=150)
@given(change=mutation())
def test_word_times(change: Callable[[bytes], bytes], tmp_path: Path) -> None:
    path = tmp_path / "a.align"
    path.write_bytes(change(b"0 23750 sil\n23750 29500 bin\n29500 34000 blue\n"))
    survives(lambda: aligned_words(path))


@settings(fuzzed, max_examples=200)
@given(change=mutation())
def test_lexicons(change: Callable[[bytes], bytes], tmp_path: Path) -> None:
    path = tmp_path / "lexicon.txt"
    path.write_bytes(change("# mine\nlipmotion L IH1 P M OW1 SH AH0 N\nnäh N EH\nlive(2) l ay v\n".encode()))
    survives(lambda: Lexicon.from_file(path))


@settings(fuzzed, max_examples=300)
@given(text=st.text(max_size=60))
def test_texts(text: str) -> None:
    words = survives(lambda: words_of(text))
    if isinstance(words, tuple):
        for word in words:
            survives(lambda word=word: Lexicon().pronunciations(word))  # type: ignore[misc]


@settings(fuzzed, max_examples=30)
@given(words=st.lists(st.sampled_from("papa mama see bimab x 7 qqq".split()), min_size=1, max_size=40))
def test_transcripts(words: list[str], toy_model: Model) -> None:
    audio = Audio(tone(16_000, 0.6)[0], 16_000)
    survives(lambda: animate(audio, transcript=" ".join(words), model=toy_model, recogniser="own"))


@settings(fuzzed, max_examples=200)
@given(change=mutation())
def test_bare_arrays(change: Callable[[bytes], bytes], tmp_path: Path) -> None:
    values, names = tmp_path / "bs_value_a.npy", tmp_path / "x_bs_name.npy"
    values.write_bytes(change(npy(np.arange(30.0).reshape(10, 3) / 30)))
    names.write_bytes(change(npy(np.array(["jaw", "smile", "brow"]))))
    survives(lambda: channels_in(names))
    survives(lambda: read_array(Curves(values, 30.0, tuple(map(Channel, "abc")))))
