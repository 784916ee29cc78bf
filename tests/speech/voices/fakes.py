"""Programs that answer as the synthesisers do, and speak a tone; some texts make them misbehave."""

import sys
from pathlib import Path

COMMON = f"""#!{sys.executable}
import json, math, os, re, struct, sys, wave

def tone(path, seconds):
    count = round(16000 * seconds)
    values = [round(9000 * math.sin(i * 0.3)) * (3200 < i < count - 1600) for i in range(count)]
    with wave.open(path, "wb") as file:
        file.setparams((1, 2, 16000, 0, "NONE", ""))
        file.writeframes(struct.pack(f"<{{len(values)}}h", *values))

def misbehave(text):
    if "crash" in text:
        sys.exit("no such sound")
    if "bytes" in text:
        sys.stdout.buffer.write(bytes([255, 254]))
"""
FLITE = """
given = dict(zip(sys.argv[1::2], sys.argv[2::2]))
if "-lv" in sys.argv:
    print("Voices available: kal awb_time kal16 slt ")
    sys.exit()
given = {name: sys.argv[sys.argv.index(name) + 1] for name in ("-voice", "-o", "-t")}
misbehave(given["-t"])
tone(given["-o"], 1.0)
print("nonsense" if "nonsense" in given["-t"] else "pau:0.2 hh:0.3 ax:0.4 l:0.5 ow:0.9 pau:1.0 ")
"""
FESTIVAL = """
if "voice.list" in sys.argv[2]:
    print("cmu_us_slt_arctic_hts english american")
    print("kal_diphone english american")
    print("nsk hindi indian")
    sys.exit()
script = open(sys.argv[2], encoding="utf-8").read()
quoted = r'"((?:[^"\\\\]|\\\\.)*)"'
for text, path in re.findall(r"^\\(say " + quoted + " " + quoted + r"\\)$", script, re.MULTILINE):
    misbehave(text)
    if "stop here" in text:
        break
    tone(path, 1.0)
    print("-- sentence")
    segments = "pau 0 0.2", "hh 0.2 0.3", "ax 0.3 0.4", "l 0.4 0.5", "ow 0.5 0.9", "pau 0.9 1.0"
    print("nonsense" if "nonsense" in text else "\\n".join(segments))
"""
ESPEAK_EVENTS = """
task = json.load(sys.stdin)
said = []
for number, text in enumerate(task["texts"]):
    misbehave(text)
    tone(f"{task['folder']}/{number}.wav", 1.0)
    labels = "_", "h", "@", "l", "'oU", "_:"
    if task["ipa"]:
        labels = "_", "h", "ə", "ɬ", "ˈøː" if "strange" not in text else "ꙮ", "_"
    said.append([[label, start, 0] for label, start in zip(labels, (0.0, 0.2, 0.3, 0.4, 0.5, 0.9))])
print("nonsense" if "nonsense" in text else json.dumps(said))
"""
PROGRAMS = {"flite": FLITE, "festival": FESTIVAL, "espeak-events": ESPEAK_EVENTS}


def install(folder: Path) -> None:
    """Write the programs, and the Python package of espeak-ng in a folder beside them."""
    install_package(folder.parent / "packages" / "espeakng_loader")
    for name, text in PROGRAMS.items():
        path = folder / name
        path.write_text(COMMON + text, encoding="utf-8")
        path.chmod(0o755)


def install_package(folder: Path) -> None:
    """Write a package with data as espeak-ng's: the language files of German and both Englishes, and two variants."""
    data = folder / "espeak-ng-data"
    files = {"lang/gmw/de": "name German\nlanguage de\n", "lang/gmw/en": "language en-gb  2\nlanguage en 2\n"}
    files |= {"lang/gmw/en-US": "name English (America)\nlanguage en-us 2\n"}
    for name, text in (files | {"voices/!v/f2": "language variant\n", "voices/!v/robosoft": "\n"}).items():
        path = data / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    for name in ("libespeak-ng.so", "__init__.py"):
        (folder / name).touch()
