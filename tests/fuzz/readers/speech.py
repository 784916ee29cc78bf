"""Readers of speech: models, phones, lexicons, transcripts, and the motion generated with them."""

import json
import tempfile
from pathlib import Path

from fuzz.inputs import Files, Good, Reader
from fuzz.plausible import check_generation, good_model, require, short_speech
from lipmotion import Request, animate, load_model, read_motion, write
from lipmotion.units import PHONES, Lexicon
from robustness.motion_cases import GOOD


def seed_model(good: Good) -> list[Files]:
    """Return a model of every engine."""
    return [{"a.lipmotion": path.read_bytes()} for path in good.models]


def read_model(folder: Path, good: Good) -> None:
    """Load a model; animate short speech, without and with a transcript."""
    model = load_model(folder / "a.lipmotion")
    for text in (None, "baby"):
        check_generation(animate(Request(short_speech(good), transcript=text, recogniser="own"), model=model))


def seed_units(good: Good) -> list[Files]:
    """Return motion files of ``animate``, and a minimal one."""
    found: list[Files] = [{"a.json": json.dumps(GOOD).encode()}]
    result = animate(Request(short_speech(good), recogniser="own"), model=good_model(good))
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / "a.json", Path(folder) / "a.npz"]
        write(result, paths, channels=["opening"])
        return found + [{path.name: path.read_bytes()} for path in paths]


def read_units(folder: Path, good: Good) -> None:
    """Animate a short sound with these phones."""
    (path,) = folder.iterdir()
    units = read_motion(path)[1]
    check_generation(animate(Request(short_speech(good), units=units, recogniser="own"), model=good_model(good)))


LEXICONS = (
    "# mine\nlipmotion L IH1 P M OW1 SH AH0 N\nnäh N EH\nlive(2) l ay v\n",
    "baby B EY1 B IY0\nbaby(2) b ey b ix\n'bout b aw t # short\n\n",
    "two T UW1\n2 t uw\n",
)


def seed_lexicon(_: Good) -> list[Files]:
    """Return small lexicons."""
    return [{"words.dict": text.encode()} for text in LEXICONS]


def read_lexicon(folder: Path, good: Good) -> None:
    """Read a lexicon; align short speech with its first word."""
    lexicon = Lexicon.from_file(folder / "words.dict")
    for word, pronunciations in lexicon.user.items():
        require(lexicon.known(word), "a word that is not known")
        require(all(set(phones) <= set(PHONES) for phones in pronunciations), "a phone that is none")
    words = " ".join(list(lexicon.user)[:1])
    request = Request(short_speech(good), words or "baby", lexicon=lexicon, recogniser="own")
    check_generation(animate(request, model=good_model(good)))


TRANSCRIPTS = (
    "baby",
    "Hi, 2!\n",
    "Mama's \u201cmap\u201d, ﬁve\n",
    "o'clock: 1,000\n",
    "Hello, you 42 people.\n",
    "baby's mother-in-law has 1,234,567 cats; 3 o'clock! (See two maps.)\nNow £5, 007, ½, twenty-three.\n",
    "naïve qwrx zzyx",
    "1\n00:00:00,100 --> 00:00:00,600\n<i>Baby</i>\n",
    '{"result": [{"word": "baby", "start": 0.1, "end": 0.5}], "text": "baby"}',
)
"""Some are too long for the sound, or have words without a pronunciation; the last ones have times."""


def seed_transcript(_: Good) -> list[Files]:
    """Return texts with punctuation, numbers, and unknown words."""
    return [{"said.txt": text.encode()} for text in TRANSCRIPTS]


def read_transcript(folder: Path, good: Good) -> None:
    """Animate short speech with the transcript."""
    path = folder / "said.txt"
    check_generation(animate(Request(short_speech(good), transcript=path, recogniser="own"), model=good_model(good)))


READERS = {
    "model": Reader("model", seed_model, read_model),
    "units": Reader("units", seed_units, read_units),
    "lexicon": Reader("lexicon", seed_lexicon, read_lexicon),
    "transcript": Reader("transcript", seed_transcript, read_transcript),
}
