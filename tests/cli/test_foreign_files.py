"""What every verb says of a file of another program: what it is, and what to do, in one line."""

import pytest

from cli.conftest import check_refused

BLENDER, WORD = b"BLENDER-v402REND", b"PK\x03\x04" + bytes(40) + b"word/document.xml"


@pytest.mark.parametrize(
    ("line", "content", "named"),
    [
        ("cues FILE.wav", b"my mother moved the baby boat\n", "is text"),
        ("words FILE.wav", b"MThd\0\0\0\6" + bytes(90), "MIDI"),
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
