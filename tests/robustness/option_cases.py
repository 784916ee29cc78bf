import os
from pathlib import Path

from robustness.case import Bench, case

GROUP = "options"


def _option(name: str, code: int, message: str, *more: object) -> None:
    case(GROUP, name, code, message)(lambda bench: bench.animate(None, *more))


_option("--fps inf", 3, "the frame rate is inf a second, required 1 to 1000 a second", "--fps=inf")
_option("--rate nan", 3, "the frame rate is nan a second, required 1 to 1000 a second", "--rate=nan")
_option("--channels of an empty text", 3, "no motion channel ''", "--channels", "")
_option("--channels of one name twice", 3, "channel names repeat", "--channels", "opening,opening")
_option(
    "an unknown --speaker", 3, "the model tells no speakers apart, so that there is no 'nobody'", "--speaker", "nobody"
)
_option("an unknown --recogniser", 3, "unknown recogniser 'best'; required one of: auto", "--recogniser", "best")
_option("--intensity nan", 3, "the intensity is nan, required 0 to 3", "--intensity=nan")
_option("--anticipation-ms 2000", 3, "the anticipation is 2000 ms, required -1000", "--anticipation-ms=2000")
_option("--offset-ms that leaves nothing", 3, "nothing is left; give a smaller one", "--offset-ms=-60000")
_option("--posteriors of a model without chains", 3, "'trajectory' has no chains", "--posteriors", "a.png")
_option("--posteriors as .jpg", 7, "unknown format '.jpg'; required: .png", "--posteriors", "a.jpg")
case(GROUP, "cues --hold 1000000000", 0)(
    lambda bench: [
        "cues", bench.speech, "--model", bench.model, "--recogniser", "own", "--hold", "1000000000", "-o", "a.json",
    ]
)  # fmt: skip


for _name, _options, _message in [
    ("--visual of an unknown name", ("--visual", "pixels"), "visual is 'pixels', required one of: geometry, eigenlips"),
    ("--set without a value", ("--set", "states"), "the setting 'states' has no value; required NAME=VALUE"),
    ("--set of a text instead of a number", ("--set", "states=many"), "states is 'many', required a whole number"),
    ("--set of a number out of range", ("--set", "states=4"), "states is 4, required an odd number from 1"),
    ("--system of an unknown name", ("--system", "HMM"), "no preset 'HMM'; there are: ph-HMM"),
]:

    @case(GROUP, f"train {_name}", 3, _message)
    def _(bench: Bench, options: tuple[str, ...] = _options) -> list[object]:
        return ["train", bench.corpus, "-o", "m", *options]


case(GROUP, "corpus prompts --text of 30 million bytes", 3, "30000000 bytes, required at most 4194304")(
    lambda bench: ["corpus", "prompts", "--text", bench.file("text.txt", b"a " * 15_000_000)]
)


@case(GROUP, "corpus prepare --workers -1", 3, "-1 processes, required 1 or more")
def _(bench: Bench) -> list[object]:
    (bench.folder / "a.mp4").touch()
    return ["corpus", "prepare", bench.folder, "-o", "c", "--workers=-1"]


OUTPUTS = "outputs"


def _output(name: str, output: str, *messages: str) -> None:
    case(OUTPUTS, name, 7, *messages)(lambda bench: bench.animate(output=output))


_output("a folder that does not exist", "none/a.json", "the folder none does not exist; create it first")
_output("an unknown format", "a.gif", "unknown format '.gif'; required one of: .json .csv .npz ")
_output("/dev/full", "/dev/full", "unknown format ''; required one of:")
_output("a folder where nothing can be written", "/proc/a.json", "/proc/a.json: cannot be written")
_output("a name that is too long", "x" * 300 + ".json", "cannot be written: File name too long")


@case(OUTPUTS, "a folder", 7, "is a folder; give the name of a file in it")
def _(bench: Bench) -> list[object]:
    (bench.folder / "a.json").mkdir()
    return bench.animate(output=bench.folder / "a.json")


case(OUTPUTS, "one name twice", 7, "is given twice; give every output another")(
    lambda bench: bench.animate(None, "-o", Path("./a.json"), output=Path.cwd() / "a.json")
)
case(OUTPUTS, "a name that is no UTF-8", 0)(lambda bench: bench.animate(output=os.fsdecode(b"a\xff.json")))
