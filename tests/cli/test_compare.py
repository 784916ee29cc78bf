import json

from lipmotion import compare


def table(factor: float) -> str:
    rows = (f"{n / 8},{factor * (n % 5) / 10},{(n % 3) / 10}\n" for n in range(30))
    return "time_s,opening,width\n" + "".join(rows)


WAVE = table(1.0)


def test_the_figures_are_those_of_the_function_and_programs_read_lines_of_json(run, here):
    (here / "a.csv").write_text(WAVE)
    (here / "b.csv").write_text(table(0.5))
    done = run("compare", "a.csv", "b.csv", "a.csv", "-o", "figures.json")
    assert (done.code, done.err) == (0, [])
    figures = compare("a.csv", "b.csv", "a.csv")
    assert json.loads((here / "figures.json").read_text()) == json.loads(json.dumps(figures))
    assert done.out[0] == "reference: a.csv"
    assert done.out[-2:] == [
        "  mean ACC 1.000",
        "  closures: score 1.000 of 5, precision 1.000 of 5, F1 1.000, timing +0 ms",
    ]
    done = run("compare", "a.csv", "a.csv", "--machine-readable")
    assert (done.code, done.err) == (0, [])
    assert json.loads(done.out[-1])["figures"]["reference"] == "a.csv"
