import re
import shutil
import sys
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from pathlib import Path

import pytest

from children import PIPE, child, run_child
from cli.conftest import check_refused, is_one_error
from lipmotion import load_model, save_model
from lipmotion.cli import main
from lipmotion.cli.verbs.about import ENGINE_KEYS, bibliography, list_engine_citations, list_model_citations
from lipmotion.engines import ENGINES
from lipmotion.errors import AlignmentError, LipMotionError, MissingDependencyError
from lipmotion.pipeline.model import find_shipped, read_header

STOPPED = "lipmotion: stopped; run the same command again to go on"
VERBS = ["animate", "corpus", "train", "evaluate", "info"]


def test_help_lists_verbs_and_exit_codes(run):
    done = run("--help")
    assert (done.code, done.err) == (0, [])
    assert run() == done
    text = " ".join(" ".join(done.out).split())
    for verb in VERBS:
        assert f" {verb} " in text
    assert "0 done, 1 a bug (doctor: a broken part), 2 wrong command line, 3 unusable input, 4 corpus, 5 align" in text


def test_the_version(run):
    assert run("--version") == (0, [f"lipmotion {version('lipmotion')}"], [])
    assert f"version = {{{version('lipmotion')}}}" in bibliography()["lipmotion"]
    assert f"\nversion: {version('lipmotion')}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")


def test_a_wrong_command_line(run):
    for arguments in (["bogus"], ["corpus"], ["corpus", "bogus"], ["--bogus"], ["train"], ["cues", "a.wav", "b.wav"]):
        check_refused(run(*arguments), 2, " --help")


def _fail(error: BaseException, _: object) -> None:
    raise error


def test_an_error_is_one_line(run, make_info):
    errors: list[tuple[BaseException, int, str]] = [
        (LipMotionError("what"), 1, "lipmotion: error: what"),
        (AlignmentError("two\n  lines"), 5, "lipmotion: error: two\\n  lines"),
        (MissingDependencyError("pip install it"), 8, "lipmotion: error: pip install it"),
        (PermissionError(13, "Permission denied", "a"), 3, "lipmotion: error: [Errno 13] Permission denied: 'a'"),
        (MemoryError("no room"), 3, "lipmotion: error: not enough memory (no room); give a shorter recording or a "
         "smaller file"),
        (KeyboardInterrupt(), 130, STOPPED),
    ]  # fmt: skip
    for error, code, line in errors:
        make_info(partial(_fail, error))
        assert run("info") == (code, [], [line])


def test_a_bug_is_not_hidden(make_info):
    make_info(partial(_fail, ZeroDivisionError()))
    with pytest.raises(ZeroDivisionError):
        main.main(["info"])


@pytest.mark.parametrize("arguments", [["info"], ["--help"]])
def test_a_reader_that_has_gone_is_no_error(arguments):
    """As in ``lipmotion info | head -0``: the output is buffered, so it is found at the very end."""
    program = "import sys; sys.stdin.read(); from lipmotion.cli.main import main; sys.exit(main())"
    with child([sys.executable, "-c", program, *arguments], stdin=PIPE, stderr=PIPE) as process:
        process.stdout.close()
        process.stdin.close()  # now it may begin
        assert process.stderr.read() == ""
        assert process.wait() == 0


@pytest.mark.long
def test_a_terminal_that_does_not_know_the_letters(run_outside, toy_speech, toy_model_file, here):
    line = ("animate", toy_speech, "--model", toy_model_file, "-o", "ä.json", "--transcript", "see bimab papa mama")
    done = run_outside(*line, encoding="ascii")
    (warning,) = done.err
    assert warning.startswith("lipmotion: warning: 'bimab' is not in the dictionary; read as 'b ")
    assert (done.code, done.out) == (0, ["\\xe4.json"])
    assert [path.name for path in here.iterdir()] == ["ä.json"]


def test_the_package_is_a_program():
    done = run_child([sys.executable, "-m", "lipmotion", "info", "--help"], check=True)
    assert done.stdout.startswith("usage: lipmotion info ")


def test_the_console_script(run_outside):
    script = shutil.which("lipmotion", path=str(Path(sys.executable).parent))
    if script is None:
        pytest.skip("the package is not installed")
    assert is_one_error(run_outside("info", "missing", program=(script,)), 3)


BLENDER, WORD = b"BLENDER-v402REND", b"PK\x03\x04" + bytes(40) + b"word/document.xml"


@pytest.mark.parametrize(
    ("line", "content", "named"),
    [
        ("cues FILE.wav", b"my mother moved the baby boat\n", "is text"),
        ("explain FILE.wav", b"MThd\0\0\0\6" + bytes(90), "MIDI"),
        ("animate FILE.wav -o out.json", WORD, "a Word document"),
        ("cues SPEECH --transcript FILE.txt", WORD, "a Word document"),
        ("animate SPEECH -o out.json --units FILE.json", BLENDER, "a Blender file"),
        ("render FILE.csv -o out.json", BLENDER, "a Blender file"),
        ("render FILE.fbx -o out.json", b"Kaydara FBX Binary  \0", "an FBX file"),
        ("character FILE.glb", BLENDER, "a Blender file"),
        ("animate SPEECH -o out.mp4 --face FILE.blend", BLENDER, "a Blender file"),
        ("speak --text FILE.txt -o out.wav", b"%PDF-1.7", "a PDF"),
        ("batch FILE.csv --out out", WORD, "a Word document"),
        ("face build FILE.mp4 -o out.face", b"8BPS\0\1", "a Photoshop file"),
        ("animate SPEECH -o out.json --lexicon FILE.dict", WORD, "a Word document"),
    ],
)
def test_it_is_named(line, content, named, run, here, toy_speech):
    words = line.split()
    file = next(word for word in words if word.startswith("FILE"))
    (here / file).write_bytes(content)
    done = run(*(toy_speech if word == "SPEECH" else word for word in words))
    check_refused(done, 3, f"{file}: is ")
    assert named in done.err[0]
    assert ", required a" in done.err[0]


def test_a_model_says_whose_recordings_it_comes_from(run, toy_model_file):
    done = run("info", toy_model_file)
    assert (done.code, done.err) == (0, [])
    assert done.out[0].split() == ["file", str(toy_model_file), "(1.1", "MB)"]
    header = dict(line.split(maxsplit=1) for line in done.out if len(line.split()) > 1)
    assert header["licence"] == "synthesised by lipmotion"
    assert header["engine"] == "trajectory"
    assert header["utterances"] == "8"
    assert "states=5" in header["configuration"]
    assert [line.split()[0] for line in done.out[1:]] == list(read_header(toy_model_file))
    shipped = run("info")
    assert shipped.out == run("info", find_shipped()).out
    assert any(line.startswith("attribution") and "GRID" in line for line in shipped.out)


def test_the_model_inside_is_named_with_its_rights(run, toy_model_file, here):
    model = load_model(toy_model_file)
    about = {**model.about, "licence": [], "attribution": []}
    save_model(replace(model, about=about, prior=load_model()), here / "on.lipmotion")
    done = run("info", here / "on.lipmotion")
    assert done.code == 0
    assert not [line for line in done.out if "{" in line]
    own = [line.split(maxsplit=1)[1] for line in done.out if line.startswith(("licence", "attribution"))]
    assert own == ["none stated", "none stated"]
    prior = {line.split()[1]: line.split(maxsplit=2)[2] for line in done.out if line.startswith("prior ")}
    assert (prior["engine"], prior["utterances"], prior["licence"]) == ("trajectory", "523", "CC BY 4.0")
    assert prior["attribution"].startswith("GRID corpus")


def test_its_trees_can_be_printed(run, toy_model_file):
    done = run("info", toy_model_file, "--structure")
    assert (done.code, done.err) == (0, [])
    assert done.out[0] == "speech.0"
    assert sum("leaf (" in line for line in done.out) >= 18


ROOT = Path(__file__).parents[2]


def keys(lines: list[str]) -> list[str]:
    return re.findall(r"^@\w+\{(\w+),$", "\n".join(lines), flags=re.MULTILINE)


def test_the_shipped_model_is_cited_by_default(run, coupled_model_file):
    done = run("cite")
    assert (done.code, done.err, keys(done.out)) == (0, [], ["lipmotion", *ENGINE_KEYS["trajectory"], "cooke2006"])
    assert done.out == run("cite", find_shipped()).out
    done = run("cite", coupled_model_file)
    assert (done.code, done.err, keys(done.out)) == (0, [], ["lipmotion", *ENGINE_KEYS["coupled"]])


def test_engines_and_keys(run):
    for name in sorted({*ENGINE_KEYS, *ENGINES.built_in}):
        assert keys(run("cite", name).out) == ["lipmotion", *ENGINE_KEYS[name]]
    for key in set(bibliography()) - {"lipmotion"}:
        done = run("cite", key)
        assert (done.code, done.err, keys(done.out)) == (0, [], [key])


def test_what_a_header_adds():
    header = {"engine": "joint", "visual": "both", "adapted": {}, "attribution": ["GRID corpus, CC BY 4.0", "a; b"]}
    text = list_model_citations(header)
    assert keys(text.splitlines()) == ["lipmotion", *ENGINE_KEYS["joint"], "xieliu2007", "gales1998", "cooke2006"]
    assert text.endswith("\n% recordings: a; b")
    assert "another package" in list_engine_citations("ridge")
    assert keys(list_model_citations({"engine": "ridge"}).splitlines()) == ["lipmotion"]


ASKED: dict[tuple[str, ...], set[str]] = {
    ("cue",): {"cues"}, ("corpus", "pre"): {"prepare"}, ("corpus", "prepare", "--no"): {"--no-crops"},
    ("face", "info", "--struc"): set(), ("info", "--struc"): {"--structure"},
    ("animate", "--pauses", ""): {"rest", "natural"}, ("animate", "a.wav", "-o", "ou"): {"out.json"},
    ("completion", ""): {"bash", "zsh", "fish", "powershell"},
}  # fmt: skip
"""The words of a command line, and what may stand for the last of them."""
BASH = 'source "$1"; shift; COMP_WORDS=(lipmotion "$@"); COMP_CWORD=$#; _shtab_lipmotion'


@pytest.mark.parametrize("shell", sorted(ASKED["completion", ""]))
def test_a_script_offers_verbs_and_options(run, shell):
    done = run("completion", shell)
    assert (done.code, done.err) == (0, [])
    text = "\n".join(done.out)
    assert all(name in text for name in ("animate", "prepare", "no-crops", "machine-readable", "natural"))


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_bash_completes(run, here):
    (here / "script").write_text("\n".join(run("completion", "bash").out) + "\n")
    (here / "out.json").touch()
    program = f"{BASH}; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    offered = {}
    for words in ASKED:
        done = run_child(["bash", "--norc", "-c", program, "bash", here / "script", *words], check=True)
        offered[words] = {word for word in done.stdout.split("\n") if word}
    assert offered == ASKED


def test_it_loads_no_numpy():
    """A shell asks for it whenever it starts."""
    asked = "main(['completion', 'bash']); sys.exit('numpy' in sys.modules)"
    program = f"import sys; from lipmotion.cli.main import main; {asked}"
    assert run_child([sys.executable, "-c", program]).returncode == 0
