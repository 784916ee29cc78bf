"""Bad values of options, and outputs that cannot be written."""

from __future__ import annotations

import os
from pathlib import Path

from robustness.case import Bench, case

GROUP = "options"
RATE = "required 1 to 1000 a second"


def _option(name: str, code: int, messages: tuple[str, ...], *more: object) -> None:
    @case(GROUP, name, code, *messages)
    def _(bench: Bench) -> list[object]:
        return bench.animate(None, *more)


for _value in ("0", "-1", "nan", "inf", "1e9"):
    for _name in ("--fps", "--rate"):
        _option(f"{_name} {_value}", 3, ("the frame rate is", RATE), f"{_name}={_value}")
_option("--channels of an unknown name", 3, ("no motion channel 'smile' among",), "--channels", "opening,smile")
_option("--channels of an empty text", 3, ("no motion channel ''",), "--channels", "")
_option("--channels of one name twice", 3, ("channel names repeat",), "--channels", "opening,opening")
_option("an unknown --speaker", 3, ("the model tells no speakers apart", "no 'nobody'"), "--speaker", "nobody")
_option("an unknown --recogniser", 3, ("unknown recogniser 'best'; required one of: auto",), "--recogniser", "best")


for _value in ("nan", "inf", "-1", "4"):
    _option(f"--intensity {_value}", 3, ("the intensity is", "required 0 to 3"), f"--intensity={_value}")
for _value in ("nan", "2000", "-1e9"):
    _option(f"--anticipation-ms {_value}", 3, ("the anticipation is", "required -1000"), f"--anticipation-ms={_value}")
_option("--offset-ms nan", 3, ("the offset is nan ms",), "--offset-ms=nan")
_option("--offset-ms that leaves nothing", 3, ("nothing is left; give a smaller one",), "--offset-ms=-60000")
_option("--min-hold-ms -1", 3, ("the least hold is -1 ms",), "--min-hold-ms=-1")


def _cues(name: str, code: int, messages: tuple[str, ...], *more: object) -> None:
    @case(GROUP, f"cues {name}", code, *messages)
    def _(bench: Bench) -> list[object]:
        return ["cues", bench.speech, "--model", bench.model, "--recogniser", "own", *more]


for _value in ("0", "-1", "nan", "inf", "1e9"):
    _cues(f"--fps {_value}", 3, ("the frame rate is", "required 1 to 60"), f"--fps={_value}")
_cues("--hold 0", 3, ("the hold is 0 frames, required 1 or more",), "--hold", "0")
_cues("--hold -1", 3, ("the hold is -1 frames, required 1 or more",), "--hold=-1")
_cues("--hold 1000000000", 0, (), "--hold", "1000000000", "-o", "a.json")
_cues("--shapes of unknown letters", 3, ("the optional shapes are 'QZ', required letters out of",), "--shapes", "QZ")


for _verb in ("evaluate", "train"):
    for _name, _options, _messages in [
        ("--split of an unknown name", ("--split", "tomorrow"), ("no utterances of split 'tomorrow'", "there are")),
        ("--speaker of an unknown name", ("--speaker", "nobody"), ("no speaker 'nobody'", "there are:")),
    ]:

        @case(GROUP, f"{_verb} {_name}", 4, *_messages)
        def _(bench: Bench, verb: str = _verb, options: tuple[str, ...] = _options) -> list[object]:
            what = ["evaluate", bench.model, bench.corpus] if verb == "evaluate" else ["train", bench.corpus, "-o", "m"]
            return [*what, *options]


@case(GROUP, "train --visual of an unknown name", 3, "visual is 'pixels', required one of: geometry, eigenlips, both")
def _(bench: Bench) -> list[object]:
    return ["train", bench.corpus, "-o", "m", "--visual", "pixels"]


for _value in ("-1", "99", "nan", "inf"):

    @case(GROUP, f"explain --at {_value}", 3, "lies outside the recording (0 to")
    def _(bench: Bench, value: str = _value) -> list[object]:
        return ["explain", bench.model, bench.speech, f"--at={value}"]


_option("--posteriors of a model without chains", 3, ("'trajectory' has no chains",), "--posteriors", "a.png")
_option("--posteriors as .jpg", 7, ("unknown format '.jpg'; required: .png",), "--posteriors", "a.jpg")

for _name, _options, _messages in [
    ("--set without a value", ("--set", "states"), "the setting 'states' has no value; required NAME=VALUE"),
    ("--set of an unknown option", ("--set", "part=5"), "no option 'part'; there are: states"),
    ("--set of a text instead of a number", ("--set", "states=many"), "states is 'many', required a whole number"),
    ("--set of a number out of range", ("--set", "states=4"), "states is 4, required an odd number from 1"),
    ("--system of another engine", ("--system", "ph-HMM"), "add --engine coupled"),
    ("--system of an unknown name", ("--engine", "coupled", "--system", "HMM"), "no system 'HMM'; there are: ph-HMM"),
    (
        "--units of chains",
        ("--engine", "coupled", "--units", "eVis"),
        "there is a unit set for each chain; say --set chains=",
    ),
]:

    @case(GROUP, f"train {_name}", 3, _messages)
    def _(bench: Bench, options: tuple[str, ...] = _options) -> list[object]:
        return ["train", bench.corpus, "-o", "m", *options]


@case(GROUP, "corpus prompts --text of 30 million bytes", 3, "30000000 bytes, required at most 4194304")
def _(bench: Bench) -> list[object]:
    return ["corpus", "prompts", "--text", bench.file("text.txt", b"a " * 15_000_000)]


@case(GROUP, "corpus prompts --count -1", 3, "-1 prompts asked for, required at least 1")
def _(_bench: Bench) -> list[object]:
    return ["corpus", "prompts", "--count=-1"]


@case(GROUP, "corpus prepare --workers -1", 3, "-1 processes, required at least 1")
def _(bench: Bench) -> list[object]:
    (bench.folder / "a.mp4").touch()
    return ["corpus", "prepare", bench.folder, "-o", "c", "--workers=-1"]


OUTPUTS = "outputs"


def _output(name: str, output: str, *messages: str) -> None:
    @case(OUTPUTS, name, 7, *messages)
    def _(bench: Bench) -> list[object]:
        return bench.animate(output=output)


_output("a folder that does not exist", "none/a.json", "the folder none does not exist; create it first")
_output("an unknown format", "a.gif", "unknown format '.gif'; required one of: .json .csv .npz ")
_output("no suffix", "a", "unknown format ''; required one of:")
_output("/dev/full", "/dev/full", "unknown format ''; required one of:")
_output("a folder where nothing can be written", "/proc/a.json", "/proc/a.json: cannot be written")
_output("a name that is too long", "x" * 300 + ".json", "cannot be written: File name too long")


@case(OUTPUTS, "a folder", 7, "is a folder; give the name of a file in it")
def _(bench: Bench) -> list[object]:
    (bench.folder / "a.json").mkdir()
    return bench.animate(output=bench.folder / "a.json")


@case(OUTPUTS, "the recording itself", 7, "is the recording itself; give another name")
def _(bench: Bench) -> list[object]:
    path = bench.folder / "a.mp4"
    path.write_bytes(bench.speech.read_bytes())
    return bench.animate(path, output=path)


@case(OUTPUTS, "one name twice", 7, "is given twice; give every output another")
def _(bench: Bench) -> list[object]:
    return bench.animate(None, "-o", Path("./a.json"), output=Path.cwd() / "a.json")


@case(OUTPUTS, "one name twice for cues", 7, "is given twice; give every output another")
def _(bench: Bench) -> list[object]:
    return ["cues", bench.speech, "--model", bench.model, "-o", "a.tsv", "a.tsv"]


@case(OUTPUTS, "a name that is no UTF-8", 0)
def _(bench: Bench) -> list[object]:
    return bench.animate(output=os.fsdecode(b"a\xff.json"))


def _input(name: str, messages: str, *line: str) -> None:
    @case(OUTPUTS, name, 7, messages)
    def _(bench: Bench) -> list[object]:
        bench.file("words.txt", "papa mama")
        (bench.folder / "link.json").symlink_to(bench.speech)
        given = {"SPEECH": bench.speech, "MODEL": bench.model, "CORPUS": bench.corpus, "BAD": bench.folder}
        return [
            given.get(word, word.replace("CORPUS", str(bench.corpus)).replace("BAD", str(bench.folder)))
            for word in line
        ]


_input(
    "the transcript",
    "is the transcript itself; give another name, or add --force to replace it",
    *("cues", "SPEECH", "--transcript", "BAD/words.txt", "-f", "tsv", "-o", "BAD/words.txt"),
)
_input("a link to the recording", "is the recording itself", "animate", "SPEECH", "-o", "BAD/link.json")
_input("the manifest of the corpus", "lies in the corpus", "train", "CORPUS", "-o", "CORPUS/corpus.json")
_input("figures in the place of the model", "is the model itself", "evaluate", "MODEL", "CORPUS", "-o", "MODEL")
_input("a corpus in its recordings", "lies in the folder of recordings", "corpus", "prepare", "BAD", "-o", "BAD/c")
_input("the recording, with --force", "is the recording itself", "adapt", "SPEECH", "-o", "SPEECH", "--force")
