from __future__ import annotations

from pathlib import Path

import pytest

from lipmotion.corpora.labels.lines_in_time import lines_in_time
from lipmotion.errors import InputError

TEXTGRID = """File type = "ooTextFile"
Object class = "TextGrid"

0 3 <exists> 2
"IntervalTier" "phones" 0 3 2
0 1 "sil"
1 3 "aa"
"IntervalTier" "words" 0 3 3
0 1 ""
1 2 "hello"
2 3 "you"
"""


@pytest.mark.parametrize(
    ("suffix", "text", "expected"),
    [
        (
            ".txt",
            "0.5\t1.5\tHello there.\n1.5\t2.0\t\n2.0\t2.5\t...\n3.0\t4.0\tAgain\n",
            [(0.5, 1.5, ("hello", "there")), (3.0, 4.0, ("again",))],
        ),
        (".lab", "0 5000000 hello\n5000000 9000000 you\n", [(0.0, 0.5, ("hello",)), (0.5, 0.9, ("you",))]),
        (".TextGrid", TEXTGRID, [(1.0, 2.0, ("hello",)), (2.0, 3.0, ("you",))]),
        (
            ".srt",
            "1\n00:00:01,000 --> 00:00:02,000\n<i>Hello</i>\n\n2\n00:00:02,500 --> 00:00:03,000\n[music]\n\n"
            "3\n00:00:04,000 --> 00:00:05,000\nyou\n\n4\n00:00:04,500 --> 00:00:05,500\nthere\n",
            [(1.0, 2.0, ("hello",)), (4.0, 5.5, ("you", "there"))],
        ),
        (
            ".json",
            '{"segments": [{"start": 0.5, "end": 1.5, "text": " Hi."}, {"start": 3.0, "end": null, "text": "No"}]}',
            [(0.5, 1.5, ("hi",))],
        ),
        (".txt", "only words, at no time", []),
        (".lab", "0 5000000 aa\n5000000 9000000 iy\n", []),
    ],
)
def test_lines_of_label_files(tmp_path: Path, suffix: str, text: str, expected: list[object]) -> None:
    (tmp_path / f"talk{suffix}").write_text(text)
    found = lines_in_time(tmp_path / "talk.mp4")
    assert [(line.start_s, line.end_s, line.label) for line in found] == expected


def test_no_file_no_lines(tmp_path: Path) -> None:
    assert lines_in_time(tmp_path / "talk.mp4") == []


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "talk.txt").write_text("0.5\t1.5\thello\nand then\n")
    with pytest.raises(InputError, match=r"talk\.txt: line 2 is 'and then'"):
        lines_in_time(tmp_path / "talk.mp4")
