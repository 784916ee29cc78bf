import json
import os
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from robustness.case import Bench, case
from robustness.motion_cases import GOOD
from robustness.spoken_cases import GROUP as SPOKEN

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
_output("an unknown format", "a.avi", "unknown format '.avi'; required a.mp4, or one of: .json .csv .npz ")
_output("/dev/full", "/dev/full", "unknown format ''; required one of:")
_output("a folder where nothing can be written", "/proc/a.json", "/proc/a.json: cannot be written")
_output("a name that is too long", "x" * 300 + ".json", "cannot be written: File name too long")


case(OUTPUTS, "one name twice", 7, "is given twice; give every output another")(
    lambda bench: bench.animate(None, "-o", Path("./a.json"), output=Path.cwd() / "a.json")
)
case(OUTPUTS, "a name that is no UTF-8", 0)(lambda bench: bench.animate(output=os.fsdecode(b"a\xff.json")))


LINES = "command lines"
ANIMATE = "animate SPEECH --model MODEL -o a.json a.mp4"
EXPERIMENT = "experiment learning-curve CORPUS"


def _line(
    line: str, code: int, message: str, files: Mapping[str, str] = MappingProxyType({}), group: str = LINES
) -> None:
    """Add a whole command line; capitals stand for good inputs, the names of ``files`` for what is written there."""

    @case(group, line, code, message)
    def _(bench: Bench) -> list[object]:
        known = {"SPEECH": bench.speech, "MODEL": bench.model, "COUPLED": bench.coupled, "CORPUS": bench.corpus}
        known |= {"FOLDER": bench.folder} | {name: bench.file(name, text) for name, text in files.items()}
        words = line.split()
        for name, path in known.items():
            words = [word.replace(name, str(path)) for word in words]
        return list(words)


_line(f"{ANIMATE} --fps 999", 7, "required 240 or fewer")
_line(f"{ANIMATE} --workers 0", 3, "required 1 or more")
_line(f"{ANIMATE} --transcript missing.txt", 3, "missing.txt: no such transcript file")
_line(f"{ANIMATE} --lexicon missing.txt", 3, "missing.txt: no such lexicon file")
_line(f"{ANIMATE} --still nose", 3, "blinks, gaze, brows, head")
_line(f"{ANIMATE} --size 63", 3, "even number")
_line(f"{ANIMATE} --background pink", 3, "#40a0ff")
_line(f"{ANIMATE} --background transparent", 7, "cannot be transparent")
_line(f"{ANIMATE} --onto missing.mp4", 3, "missing.mp4: no such file")
_line(f"{ANIMATE} --onto FOLDER", 4, "not a corpus")
_line(f"{ANIMATE} --onto-speaker ben", 3, "onto the speaker 'ben', but of what?")
_line(f"{ANIMATE} --onto CORPUS --onto-speaker ben", 3, "no speaker 'ben'")
_line("animate SPEECH --model MODEL --onto CORPUS -o CORPUS/one.json", 7, "lies in")
_line(f"{ANIMATE} --curves visems", 3, "no set of curves 'visems', required one of arkit, face, ")
_line(f"{ANIMATE} --control-points", 3, "belong to a character")
_line(f"{ANIMATE} --character nothing.glb", 3, "no such file")
_line("cues SPEECH --model MODEL --fps nan", 3, "frame rate is nan, required 1 to 100")
_line("cues SPEECH --model MODEL --hold 0", 3, "hold is 0 frames")
_line("cues SPEECH --model MODEL --shapes XYZ", 3, "optional shapes are 'XYZ'")
_line("cues SPEECH --model MODEL -o a.tsv a.txt", 7, "unknown cue format '.txt'")
_line("cues SPEECH --model MODEL -o a.tsv missing/a.dat", 7, "the folder missing does not exist")
_line("explain SPEECH --model COUPLED --at=-1", 3, "-1.0 s lies outside the recording (0 to ")
_line("explain SPEECH --model COUPLED --at nan", 3, "nan s lies outside the recording")
_line("explain COUPLED --model SPEECH --at 1", 6, "not a lipmotion model")
_line("info .", 3, ".: no such model")
_line("cite hofer", 3, "nothing to cite is called 'hofer'; give a model file, or one of: trajectory, coupled, joint, ")
_line("cite words", 6, "words: not a lipmotion model", {"words": "words"})
_line("corpus coverage CORPUS --text missing.txt", 3, "missing.txt: no such transcript file")
_line("corpus coverage missing", 4, "missing: no such corpus")
_line("corpus prompts --have missing", 4, "missing: no such corpus")
_line("corpus prompts --count 0", 3, "0 prompts asked for, required at least 1")
_line("corpus prompts --lexicon missing", 3, "missing: no such lexicon file")
_line(f"corpus info {'x' * 300}", 3, "File name too long")
_line("train missing -o m", 4, "missing: no such corpus; make one")
_line("train FOLDER -o m", 4, "not a corpus")
_line("train CORPUS -o missing/m", 7, "the folder missing does not exist")
_line("train CORPUS -o FOLDER", 7, "is a folder")
_line("train CORPUS -o m --split tset", 4, "no utterances of split 'tset' (there are train: 8, val: 2")
_line("train CORPUS -o m --speaker dora", 4, "no speaker 'dora' (there are: no speaker by name)")
_line("train CORPUS -o m --lexicon missing", 3, "missing: no such lexicon file")
_line("train CORPUS -o m --from nofile", 3, "nofile: no such model; train one (lipmotion train), or use the one")
_line("train CORPUS -o m --units evis", 3, "no unit set 'evis'; there are: 2vis, sVis, pbVis")
_line("train CORPUS -o m --units FOLDER", 3, "/bad: ")
_line("train CORPUS -o m --engine coupled --recordings missing", 4, "missing: no such folder")
_line("train CORPUS -o m --engine coupled --units eVis", 3, '--set chains="phone viseme"')
_line("train CORPUS -o m --engine joint --system ph-HMM", 3, "not of 'joint'; leave out one of them")
_line("train CORPUS -o m --set tree=1", 3, "no option 'tree'; there are: states, silent_states")
_line("train CORPUS -o m --engine joined", 3, "no engine 'joined'; there are: trajectory, coupled, joint")
_line("evaluate missing CORPUS", 3, "missing: no such model")
_line("evaluate MODEL missing", 4, "missing: no such corpus")
_line("evaluate MODEL CORPUS --split tset", 4, "no utterances of split 'tset'")
_line("evaluate MODEL CORPUS -o missing/a.json", 7, "the folder missing does not exist")
_line("evaluate MODEL CORPUS -o a.json --lexicon missing", 3, "missing: no such lexicon file")
_line("render none.json -o a.csv", 3, "none.json")
_line("render said.json -o said.json", 7, "said.json: is the motion file itself", {"said.json": json.dumps(GOOD)})
_line("render said.json --sound none.wav -o a.csv", 3, "none.wav: no such file", {"said.json": json.dumps(GOOD)})
_line("render brows.csv -o a.mp4", 7, "no channel 'opening' to draw a face from, nor the blendshape 'jawOpen'",
      {"brows.csv": "time_s,browInnerUp\n0,0\n0.1,1\n"})  # fmt: skip
_line("render slow.csv -o a.json", 3, "1e-06 frames a second, required 1 to 10000; export it again",
      {"slow.csv": "time_s,opening\n0,0.1\n999999,0.2\n"})  # fmt: skip
_line("render fast.csv -o a.json", 3, "1e+06 frames a second, required 1 to 10000",
      {"fast.csv": "time_s,opening\n0,0.1\n1e-6,0.2\n"})  # fmt: skip
LISTS = {"empty.txt": "\n", "strange.txt": "toy00\nnobody\n"}
_line(f"{EXPERIMENT} --order missing.txt", 4, "missing.txt: no such list file; required: one name a line")
_line(f"{EXPERIMENT} --order empty.txt", 3, "the list of utterances to train on is empty", LISTS)
_line(f"{EXPERIMENT} --order strange.txt", 4, "1 of 2 names to train on (nobody) are not in the corpus", LISTS)
_line(f"{EXPERIMENT} --sizes 0,8", 3, "sizes 0, 8; required: from 1 to 8")
_line(f"{EXPERIMENT} --split all", 4, "are in the split that is compared with")
_line("experiment folds CORPUS --folds 1", 3, "1 folds; required: from 2 to 8")
_line("experiment folds CORPUS -o missing/a.json", 7, "the folder missing does not exist")
_line("experiment folds missing", 4, "missing: no such corpus; make one")
_line("experiment xieliu2007 CORPUS --systems ph-RNN", 3, "no system 'ph-RNN'; there are: ph-HMM")
_line("experiment xieliu2007 CORPUS --quick --order strange.txt", 3, "--quick takes recordings of its own", LISTS)
_line("experiment xieliu2007 CORPUS --plots missing/a", 7, "the folder missing does not exist")
_line("experiment engines CORPUS --models CORPUS", 7, "is the corpus itself; give another name")
_line("experiment engines CORPUS --models empty.txt", 7, "empty.txt: is a file", LISTS)
_line("experiment all CORPUS -o empty.txt", 7, "cannot be used: Not a directory; give another folder", LISTS)
_line("experiment all CORPUS -o CORPUS/r", 7, "lies in the corpus")
_line("experiment all CORPUS -o r --only hofer", 3, "no experiment 'hofer'; there are: hofer2008, xieliu2007")
_line("experiment hofer2008 CORPUS --split tset", 4, "no utterances of split 'tset'")
_line("experiment hofer2008 CORPUS --lexicon missing", 3, "missing: no such lexicon file")
for _line_of_speech, _code, _message in [
    ("-o a.mp3", 7, ".wav .flac .ogg"),
    ("-o no/a.wav", 7, "does not exist"),
    ("-o a.wav ./a.wav", 7, "is given twice"),
    ("-o a.wav --voice three", 3, "no voice 'three' is installed; lipmotion speak --voices"),
    ("-o a.wav --voice stand-out:one", 3, "unknown synthesiser 'stand-out'"),
    ("-o a.json --channels smile", 3, "no motion channel 'smile'"),
    ("-o a.json --speaker nobody", 3, "no 'nobody'"),
]:
    _line(f"speak papa --model MODEL {_line_of_speech}", _code, _message, group=SPOKEN)
