"""What the site says to type is run: here, by the test of its page, or by hand, as a marker says, with the last output."""

from __future__ import annotations

import re
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from docs.site_pages import ROOT, Block, blocks, pages
from lipmotion.cli.command_line import parser
from lipmotion.cli.main import main

TESTED = {
    "docs/start": "test_readme.py",
    "docs/api": "docs/test_api_page.py",
    "docs/extend/": "docs/test_extend.py",
    "docs/results/": "docs/test_made_pages.py",
    "recipes/": "docs/test_corpus_recipes.py",
}
ALL = {page: list(blocks(page)) for page in pages()}


def commands(text):
    lines = re.sub(r"\\\n", " ", text).splitlines()
    return [shlex.split(line.split(" > ")[0].rpartition("| ")[2], comments=True) for line in lines]


HERE = {page: [b for b in found if not b.last] for page, found in ALL.items() if not page.startswith(tuple(TESTED))}
HERE = {page: found for page, found in HERE.items() if found}


@pytest.mark.parametrize("page", HERE)
def test_run(page, tmp_path, monkeypatch, desk, toy_model):
    import time
    import lipmotion
    shutil.copytree(desk, tmp_path / "desk")
    monkeypatch.chdir(tmp_path / "desk")
    names = {"lipmotion": lipmotion, "result": lipmotion.animate("speech.wav", transcript=Path("speech.txt"), model=toy_model), "Path": Path}
    for b in HERE[page]:
        if b.language == "python":
            t=time.process_time()
            try:
                exec(compile(b.text, page, "exec"), names)
                r = 0
            except BaseException as e:
                r = repr(e)
            print("RUN", page, "python", r, round(time.process_time()-t,2))
        else:
            for words in commands(b.text):
                t=time.process_time()
                r = None
                if words and words[0] == "lipmotion":
                    try:
                        r = main(words[1:])
                    except BaseException as e:
                        r = repr(e)
                print("RUN", page, " ".join(words), "->", r, round(time.process_time()-t,2))


@pytest.fixture(scope="module")
def desk(tmp_path_factory, toy_corpus, toy_model_file, toy_speech, toy_sentence, coupled_model_file, filmed_face_file, pictured_model_file):
    import lipmotion
    from meshes.heads import head, lip_points, write_glb
    from meshes.obj_writing import write_obj
    d = tmp_path_factory.mktemp("d") / "desk"
    shutil.copytree(ROOT / "examples", d / "examples")
    for name in ("speech.wav", "talk.wav", "a.wav", "b.wav", "one.wav", "three.flac", "recordings/one.wav", "recordings/two.wav", "takes/a.wav", "perro.wav"):
        (d / name).parent.mkdir(exist_ok=True)
        shutil.copy(toy_speech, d / name)
    words = " ".join(toy_sentence.words)
    for name in ("speech.txt", "story.txt", "sentences.txt", "script.txt"):
        (d / name).write_text(words)
    (d / "names.txt").write_text("anna AE N AH\n")
    shutil.copy(d / "examples" / "welcome.flac", d)
    for name in ("me", "her", "ridge", "evis", "phones", "other"):
        shutil.copy(toy_model_file, d / f"{name}.lipmotion")
    shutil.copy(coupled_model_file, d / "coupled.lipmotion")
    shutil.copy(pictured_model_file, d / "mine.lipmotion")
    shutil.copy(filmed_face_file, d / "anna.face")
    for name in ("CORPUS", "my-corpus", "build/grid-s1"):
        shutil.copytree(toy_corpus.path, d / name)
    write_glb(d / "head.glb", head())
    plain = head(shapes=False)
    write_obj(d / "head.obj", plain)
    (d / "points.csv").write_text("point,vertex\n" + "".join(f"{p},{v}\n" for p, v in lip_points(plain).items()))
    (d / "lines.csv").write_text("recording\nspeech.wav\n")
    return d
