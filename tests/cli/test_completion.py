import shutil
import sys

import pytest

from children import run_child
from lipmotion.cli.verbs.about import SHELLS

ASKED: dict[tuple[str, ...], set[str]] = {
    ("cue",): {"cues"}, ("corpus", "pre"): {"prepare"}, ("corpus", "prepare", "--no"): {"--no-crops"},
    ("face", "info", "--struc"): set(), ("info", "--struc"): {"--structure"},
    ("animate", "--pauses", ""): {"rest", "natural"}, ("animate", "a.wav", "-o", "ou"): {"out.json"},
    ("completion", ""): set(SHELLS),
}  # fmt: skip
"""The words of a command line, and what may stand for the last of them."""
BASH = 'source "$1"; shift; COMP_WORDS=(lipmotion "$@"); COMP_CWORD=$#; _shtab_lipmotion'


@pytest.mark.parametrize("shell", SHELLS)
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
