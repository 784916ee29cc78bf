import json

from lipmotion import evaluate, load_model
from lipmotion.measures.evaluation_table import figures_table


def test_the_figures_are_those_of_the_function(run, toy_corpus, toy_model_file, here):
    done = run("evaluate", toy_model_file, toy_corpus.path, "-o", "figures.json")
    assert (done.code, done.err) == (0, [])
    figures = evaluate(load_model(toy_model_file), toy_corpus)
    assert "\n".join(done.out) == figures_table(figures)
    assert json.loads((here / "figures.json").read_text()) == json.loads(json.dumps(figures))
    assert [path.name for path in here.iterdir()] == ["figures.json"]
