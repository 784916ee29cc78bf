from dataclasses import replace

import numpy as np
import pytest

from lipmotion.errors import ExportError, InputError
from lipmotion.formats import read_motion, write_motion
from lipmotion.types import Channel, Motion


def test_the_table_is_as_specified(tmp_path, generation):
    path = tmp_path / "a.csv"
    write_motion(path, generation, source={}, model={})
    lines = path.read_text(encoding="utf-8").split("\n")
    assert lines[0] == "time_s,opening,x_17"
    assert lines[4] == "0.03,0.00000,0.12346"
    assert lines[-1] == ""
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    assert table[:, 0] == pytest.approx(np.arange(101) / 100)
    assert table[:, 1:] == pytest.approx(generation.motion.values, abs=5.1e-6)


def test_a_table_saved_by_a_spreadsheet_is_read(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes("\ufefftime_s,opening\r\n0,0.1\r\n0.04,0.2\r\n".encode())
    motion, units = read_motion(path)
    assert motion.rate_hz == 25
    assert motion["opening"].tolist() == [0.1, 0.2]
    assert len(units) == 0


WRONG = [
    ("time_s\n0\n", "first line is 'time_s'"),
    ("opening\n0\n", "first line is 'opening', required 'time_s,opening"),
    ("time_s,opening\n0,a\n0.1,b\n", "not a table of numbers"),
    ("time_s,opening\n0,1\n0.1\n", "not a table of numbers"),
    ("time_s,opening\n0,1,2\n0.1,1,2\n", "required 2 numbers in each"),
    ("time_s,opening\n0,1\n", "fewer than two rows"),
    ("time_s,opening\n0.1,1\n0.2,1\n", "begin at 0"),
    ("time_s,opening\n0,1\n0.1,1\n0.3,1\n", "even steps"),
    ("time_s,opening\n0,1\n0,1\n", "even steps"),
    ("time_s,opening\n0,1\ninf,1\n", "values that are no times, required seconds up to"),
    ("time_s,opening\n0,1\n1,nan\n", "1 values that are not finite, the first is 'opening' in frame 1"),
    ("time_s,opening,opening\n0,1,1\n0.1,1,1\n", "names repeat"),
    ("time_s,jawOpen\n0,0\n0.1,55\n", "jawOpen goes up to 55, required 0 to 1; divide percent by 100"),
    *(
        (f"time_s,{field}\n0,1\n1,1\n", "begins as a spreadsheet's formula")
        for field in ("=1", "@A", "-1", "+x", "\t=1")
    ),
    ("time,jaw\n0,1\n", "1 rows with values, required two or more"),
    ("time,jaw\n0,1\n0,2\n", "1 rows with values, required two or more"),
    ("time,jaw\n" + "0,1\n" * 5 + "1,1\n", "4 of 6 rows are not later than those before, as row 2"),
    ("time,jaw\n0,inf\n1,nan\n", "0 rows with values"),
    ("frame,jaw\n0,1\n1,1\n", "first line is 'frame,jaw', required .* a column of times"),
    ("time,jaw\nsoon,1\n1,1\n", "line 2: could not convert"),
    ("time,jaw\n0,1\n0.01,1\n0.02,1\n0.03,1\n99,1\n", "most of the time there are none; cut the take"),
]


def test_what_is_wrong_is_said(tmp_path):
    path = tmp_path / "a.csv"
    for text, message in WRONG:
        path.write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=message):
            read_motion(path)


def test_names_that_other_separators_would_part_are_refused_and_odd_ones_come_back(tmp_path, generation):
    path = tmp_path / "a.csv"

    def written(name: str) -> None:
        odd = Motion(generation.motion.values[:, :1], 100.0, (Channel(name),))
        write_motion(path, replace(generation, motion=odd), source={}, model={})

    for name in ("a,b", 'a"b', "a\nb", "a;b", "a\tb", "a\u2028b", "a\x1bb"):
        with pytest.raises(ExportError, match=r"does not fit in a table; write .json or .npz"):
            written(name)
        assert not list(tmp_path.iterdir())
    for name in ("jaw open", "Mouth (L)", "a=b", "p1.x", "öffnen", "a|b", "x-y", "'x"):
        written(name)
        assert read_motion(path)[0].names == (name,)


def test_a_line_without_end_is_not_read_whole(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s," + "a," * 600_000 + "b\n0,1\n")
    with pytest.raises(InputError, match="fields, required"):
        read_motion(path)


@pytest.mark.parametrize(
    ("head", "times"),
    [("time", [5.0, 5.5, 6.0]), ("Timestamp", [0, 0.5, 1.0]), ("time_ms", [100, 600, 1100]), (" t ", [0, 0.5, 1])],
)
def test_tables_of_other_programs_begin_with_their_first_row(tmp_path, head, times):
    path = tmp_path / "a.csv"
    path.write_text(f"{head}, jawOpen,chin\n" + "".join(f"{t},{n},{n}\n" for n, t in enumerate(times)))
    motion, _ = read_motion(path)
    assert motion.rate_hz == pytest.approx(2.0)
    assert motion.channels == (Channel("jawOpen", "weight"), Channel("chin"))
    assert motion["chin"].tolist() == [0, 1, 2]


def test_uneven_times_of_other_programs_are_evened_out(tmp_path):
    chance = np.random.default_rng(4)
    times_s = np.sort(np.arange(300) / 60 + chance.uniform(-0.004, 0.004, 300))
    path = tmp_path / "a.csv"
    path.write_text("time,jaw\n" + "".join(f"{t},{t - times_s[0]}\n" for t in times_s))
    motion, _ = read_motion(path)
    assert motion.rate_hz == 60
    np.testing.assert_allclose(motion["jaw"][:-1], motion.time_s[:-1], atol=1e-9)
