from dataclasses import replace

from lipmotion import load_model, save_model
from lipmotion.pipeline.model import read_header, shipped_path


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
    assert (prior["engine"], prior["utterances"], prior["licence"]) == ("trajectory", "524", "CC BY 4.0")
    assert prior["attribution"].startswith("GRID corpus")


def test_its_trees_can_be_printed(run, toy_model_file):
    done = run("info", toy_model_file, "--structure")
    assert (done.code, done.err) == (0, [])
    assert done.out[0] == "speech.0"
    assert sum("leaf (" in line for line in done.out) >= 18


def test_the_chains_of_a_coupled_model(run, coupled_model_file):
    done = run("info", coupled_model_file, "--structure")
    assert (done.code, done.err) == (0, [])
    assert done.out[0].startswith("coupled: chains whose transitions depend on all chains")
    assert "  asynchrony: up to 1 state(s) apart" in done.out
    assert "chain 2: 2vis, 2 units of 3 states" in done.out
    assert any(line.startswith("stream geometry: ") and "6 densities of 1 Gaussian" in line for line in done.out)
    assert any(line.startswith("means of geometry: ") for line in done.out)


def test_the_shipped_model_is_the_default(run):
    done = run("info")
    assert done.out == run("info", shipped_path()).out
    assert any(line.startswith("attribution") and "GRID" in line for line in done.out)
