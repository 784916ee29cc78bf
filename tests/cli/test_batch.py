import json


def test_a_folder(run, takes, toy_model_file, here):
    words = ["batch", takes, "--out", "out", "--to", "csv,cues.tsv", "--model", toy_model_file, "--jobs", "1"]
    words += ["--channels", "opening,width", "--rate", "25"]
    done = run(*words)
    assert (done.code, done.err) == (0, [])
    assert done.out == [f"2 lines: 2 done, 0 kept, 0 failed; report: {here / 'out' / 'report.html'}"]
    assert (here / "out" / "a.csv").read_text().splitlines()[0] == "time_s,opening,width"
    assert {path.name for path in (here / "out").iterdir()} == {
        "a.csv", "a.cues.tsv", "b.csv", "b.cues.tsv", "batch.jsonl", "report.csv", "report.html",
    }  # fmt: skip


def test_the_frame_rate_is_that_of_animate(run, takes, toy_model_file, here):
    (takes / "b.wav").unlink()
    basics = ["--model", toy_model_file, "--fps", "30", "--recogniser", "own"]
    assert run("batch", takes, "--out", "out", *basics, "--jobs", "1").code == 0
    assert run("animate", takes / "a.wav", "-o", "a.json", *basics).code == 0
    assert (here / "out" / "a.json").read_bytes() == (here / "a.json").read_bytes()


def test_a_line_that_fails_is_told_by_the_exit_code(run, takes, toy_model_file, here):
    (takes / "b.wav").write_text("no sound")
    done = run("batch", takes, "--out", "out", "--model", toy_model_file, "--jobs", "1", "--machine-readable")
    events = [json.loads(line) for line in done.out]
    assert done.code == 3
    assert [(event["name"], event["outcome"]) for event in events if event["type"] == "item"] == [
        ("a", "done"), ("b", "failed"),
    ]  # fmt: skip
    assert events[-1]["type"] == "failure"
    assert "2 lines: 1 done, 0 kept, 1 failed; the reasons are in" in events[-1]["reason"]
    assert (here / "out" / "a.json").is_file()


def test_a_check_writes_nothing(run, takes, here):
    done = run("batch", "--check", takes, "--jobs", "1")
    assert done.code == 3
    assert done.out == ["problem\tline\tfound", "same sound\tb\tas of a"]
    assert done.err == ["lipmotion: error: 2 lines: 1 same sound"]
    (takes / "b.wav").unlink()
    done = run("batch", "--check", takes, "--jobs", "1")
    assert (done.code, done.out) == (0, ["1 lines: nothing found"])
    (takes / "b.wav").touch()
    done = run("batch", "--check", takes, "--jobs", "1", "--machine-readable")
    events = [json.loads(line) for line in done.out]
    assert [(each["name"], each["outcome"]) for each in events if each["type"] == "item"] == [("b", "unreadable")]
    assert events[-1]["exit_code"] == done.code == 3
    assert {path.name for path in here.iterdir()} == {"takes"}
    assert "add --out DIR" in run("batch", takes).err[0]
