import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.errors import InputError
from lipmotion.formats.label_files import LARGEST_LABELS, check_plain_text, find_labels, read_labels
from lipmotion.formats.label_tiers import MAX_LABELS
from lipmotion.units import PHONES, find_phone
from lipmotion.units.text_normalisation import LARGEST_TRANSCRIPT_BYTES

SPOKEN = [phone for phone in PHONES if phone not in ("sil", "sp")]


@pytest.fixture
def read(tmp_path):
    def read(text: str, name: str = "a.lab"):
        (tmp_path / name).write_text(text, encoding="utf-8")
        return read_labels(tmp_path / name)

    return read


def rows(found) -> list[tuple[float, float, str]]:
    return [(span.start_s, span.end_s, span.label.phone) for span in found.phones]


SAID = [(0, 0.13, "sil"), (0.13, 0.205, "hh"), (0.205, 0.3, "iy")]
STATES = [(t, phone, state) for t, (phone, state) in enumerate((p, s) for p in "ttk" for s in (2, 3, 4))]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0 1300000 sil\n1300000 2050000 hh -31.5\n2050000 3000000 IY1 -20 he\n", SAID),
        ("0 sil\n1300000 hh\n2050000 iy\n", [*SAID[:2], (0.205, math.inf, "iy")]),
        (  # phones between their neighbours
            "0 1000000 sil-hh+iy\n1000000 2000000 x^hh-iy+t=ae@1_2/A:0-1-2@1-1&1+4\n2000000 3000000 iy-t+sil\n",
            [(0, 0.1, "hh"), (0.1, 0.2, "iy"), (0.2, 0.3, "t")],
        ),
        (  # states of a phone are one phone
            "\n".join(f"{t * 100_000} {(t + 1) * 100_000} sil-{p}+sil[{s}]" for t, p, s in STATES),
            [(0, 0.03, "t"), (0.03, 0.06, "t"), (0.06, 0.09, "k")],
        ),
        (
            "0 1000000 p[2]\n1000000 2000000 p[3]\n2000000 3000000 aa[2]\n3000000 4000000 aa[3]\n",
            [(0, 0.2, "p"), (0.2, 0.4, "aa")],
        ),
        (  # stress decides which vowels are reduced
            "0 1000000 AH0\n1000000 2000000 B\n2000000 3000000 AH1\n3000000 4000000 T\n4000000 5000000 ER0\n",
            [(0, 0.1, "ax"), (0.1, 0.2, "b"), (0.2, 0.3, "ah"), (0.3, 0.4, "t"), (0.4, 0.5, "axr")],
        ),
    ],
)
def test_htk_counts_in_hundred_nanoseconds(read, text, expected):
    found = read(text)
    assert rows(found) == expected
    assert found.words is None


def test_audacity_counts_in_seconds_and_words_in_time_are_a_transcript(read):
    text = "0.000000\t0.130000\tsil\n\\\t200.0\t300.0\n0.130000\t0.205000\tHH\n0.205000\t0.300000\tIY0\n"
    assert rows(read(text, "a.txt")) == SAID
    assert read("0.5\t1.0\tHello\n1.0\t1.5\tyou there\n2.0\t2.0\t\n", "a.txt").words == ("hello", "you", "there")
    found = read("0 2000000 sil\n2000000 5000000 Fire\n5200000 8000000 fox\n")
    assert found.words == ("fire", "fox")
    assert found.phones is None


def test_plain_text(read):
    for text, words in (
        ("this is it\n", ("this", "is", "it")),
        ("this\nis\nit\n", ("this", "is", "it")),
        ("20 30 people\n", ("twenty", "thirty", "people")),
        ("5 o'clock\n9 lives\n", ("five", "o'clock", "nine", "lives")),
        ("  \n\n", None),
        ("\x0c" * 100_000, None),
    ):
        assert (read(text).words, read(text).phones) == (words, None)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0 1300000 sil\nhello\n", "line 2 is 'hello'; required, as in line 1: start end label"),
        ("0.0 0.5 sil\n\n0.5 x hh\n", "line 3 is '0.5 x hh'"),
        ("0 sil\nhh\n2050000 iy\n", "line 2 is 'hh'; required, as in line 1: start label"),
        (
            "0 1300000 hh\n1300000 2000000 iy\n2000000 3000000 t\n3000000 4000000 s\n4000000 5000000 qx\n",
            "line 5 is 'qx'",
        ),
        ("0 1300000 hh\n1200000 2000000 iy\n", "line 2 starts at 0.12 s, before the one ahead of it ends"),
        ("0 1300000 hh\n1400000 2000000 iy\n", "line 2 starts at 0.14 s, the one before it ends at 0.13 s"),
        (f"0 1000000 p\n1000000 2000000 p\n2000000 3000000 p\n3000000 4000000 p[{'9' * 5000}]\n", "which is no phone"),
        ("1300000 20000 Hello\n", "line 1 ends at 0.002 s, before its start at 0.13 s"),
        ("hh\niy\nsil\n", "a list of phones without times"),
        ("0 20000000 ...\n", "holds no word"),
        (f"0 {'9' * 5000} p\n", f"line 1 has the time '{'9' * 79}..., required a finite one"),
        (f"0 sil\n1000000 p\n{'9' * 5000} aa\n", "line 3 has the time '9"),
        (f"0.0\t{'9' * 400}.0\tp\n", "line 1 has the time '9"),
        ("0 1000000 p\n", "more than 250000 labels; give those of one recording"),
        ("a", "4194305 characters, required at most 4194304: is it a transcript"),
        (" ", "16777217 bytes, required at most 16777216"),
    ],
)
def test_what_cannot_be_used_is_named_with_its_line(read, text, message):
    most = {"0 1000000 p\n": MAX_LABELS, "a": LARGEST_TRANSCRIPT_BYTES, " ": LARGEST_LABELS}
    with pytest.raises(InputError) as error:
        read(text * (1 + most.get(text, 0)))
    assert "a.lab" in str(error.value)
    assert message in str(error.value)


@settings(max_examples=25)
@given(st.lists(st.tuples(st.sampled_from(SPOKEN), st.integers(1, 40)), min_size=1, max_size=30))
def test_what_is_written_is_read(tmp_path_factory, phones):
    """Every phone of the inventory, in HTK's and Audacity's form."""
    path = tmp_path_factory.mktemp("labels") / "a.lab"
    edges = [0]
    for _, length in phones:
        edges.append(edges[-1] + length)
    names = [name for name, _ in phones]
    spans = list(zip(edges, edges[1:], names, strict=False))
    path.write_text("".join(f"{a * 100_000} {b * 100_000} {name}\n" for a, b, name in spans))
    htk = rows(read_labels(path))
    path.write_text("".join(f"{a / 100:.6f}\t{b / 100:.6f}\t{name.upper()}\n" for a, b, name in spans))
    audacity = rows(read_labels(path))
    for found in (htk, audacity):
        assert [name for *_, name in found] == names
        assert [round(100 * start_s) for start_s, *_ in found] == edges[:-1]
        assert [round(100 * end_s) for _, end_s, _ in found] == edges[1:]


def test_without_stress_the_word_decides(tmp_path):
    phones = [("B", 0.0, 0.1), ("AH", 0.1, 0.2), ("T", 0.2, 0.3), ("ER", 0.3, 0.4)]
    lines = ['"ooTextFile"', '"TextGrid"', "0 0.4 <exists> 2", '"IntervalTier" "words" 0 0.4 1', '0 0.4 "Butter"']
    lines += ['"IntervalTier" "phones" 0 0.4 4', *(f'{a} {b} "{name}"' for name, a, b in phones)]
    path = tmp_path / "a.TextGrid"
    path.write_text("\n".join(lines))
    assert [phone for *_, phone in rows(read_labels(path))] == ["b", "ah", "t", "axr"]
    path.write_text("\n".join(lines).replace('"Butter"', '"butter it"'))  # a sentence: no word to be had
    assert [phone for *_, phone in rows(read_labels(path))] == ["b", "ah", "t", "er"]


def test_other_names_of_silence(read):
    names = ["SIL", "sp", "nsn", "pau", "h#", "#", "<p:>", "[laughs]"]
    labels = [label for name in names for label in (name, "aa")]
    text = "".join(f"{n}000000 {n + 1}000000 {label}\n" for n, label in enumerate(labels))
    assert {phone for *_, phone in rows(read(text))} == {"sil", "sp", "aa"}


def test_names_of_phones():
    for phone in SPOKEN:
        for stress in ("", "1", "2"):
            assert find_phone(phone + stress) == find_phone(phone.upper() + stress) == phone
        assert find_phone(phone + "!9") is None


def test_a_file_that_cannot_be_read(tmp_path, monkeypatch):
    def refused(_path: Path) -> bytes:
        raise PermissionError(13, "Permission denied")

    (tmp_path / "a.lab").touch()
    monkeypatch.setattr(Path, "read_bytes", refused)
    with pytest.raises(InputError, match=r"a\.lab: not a readable label \(Permission denied"):
        find_labels(tmp_path / "a.mp4")


def test_files_beside_a_recording(tmp_path):
    recording = tmp_path / "a.mp4"
    assert find_labels(recording).words is None
    (tmp_path / "a.lab").write_text("0 1000000 t\n1000000 2000000 uw\n")
    assert find_labels(recording).words is None
    (tmp_path / "a.txt").write_text("Two.")
    found = find_labels(recording)
    assert found.words == ("two",)
    assert [phone for *_, phone in rows(found)] == ["t", "uw"]
    (tmp_path / "a.TextGrid").write_text('"ooTextFile" "TextGrid" 0 1 <exists> 1 "IntervalTier" "w" 0 1 1 0 1 "too"')
    assert find_labels(recording).words == ("two",)  # plain text before labels
    assert find_labels(recording, ignored=frozenset({tmp_path / "a.txt"})).words == ("too",)


@pytest.mark.recordings
def test_real_ones(recordings: Path):
    folder = recordings / "speech-open"
    phones = rows(read_labels(folder / "arctic_a0009_phone.lab"))
    assert phones == rows(read_labels(folder / "arctic_a0009_state.lab"))
    assert len(phones) == 40
    assert [phone for *_, phone in phones][:8] == ["sil", "hh", "iy", "t", "er", "n", "d", "sh"]
    assert phones[0][:2] == (0, 0.13)
    found = find_labels(folder / "sense_and_sensibility_01_austen_64kb-0880.wav")
    assert found.words == ("he", "was", "not", "an", "ill", "disposed", "young", "man")


OTHER = {
    "master labels": ('#!MLF!#\n"*/a.lab"\n0 1000000 sil\n.\n', "is a master label file"),
    "RTF": ("{\\rtf1\\ansi hello}", "begins with '{|rich-text"),
    "HTML": ("\n<html><body>hello</body></html>", "begins with '<html>|web page"),
    "ESPS with a header": ("signal b\nnfields 1\n#\n 0.0500 26 sil\n 0.1 26 p\n 0.2 26 aa\n", "its lines hold times"),
    "NUL": ("hello you\0 there", "holds NUL characters"),
    "ESPS": ("signal a\nnfields 1\n#\n 0.0500 26 sil\n 0.1 26 p\n 0.2 26 aa\n", "its lines hold times"),
    "mixed seconds": ("0 0.5 p\n0.5 1 aa\n", "its lines hold times"),
    "a start of NaN": ("nan 1000000 sil\n1000000 2000000 p\n2000000 3500000 aa\n", "its lines hold times"),
    "a last start of 0": ("0 sil\n1000000 p\n0 aa\n", "its lines hold times"),
}
TIMED = {
    "SubRip": ("1\n00:00:01,000 --> 00:00:02,000\nhello\n", "is a file of subtitles"),
    "WebVTT": ("WEBVTT\n\n00:01.000 --> 00:02.000\nhello\n", "is a file of subtitles"),
    "JSON": ('{"words": [{"start": 0.0, "word": "hello"}]}', "begins with '{|rich-text"),
    "CTM": ("a 1 0.00 0.5 hello\na 1 0.5 0.5 you\n", "labels in time"),
}
"""What is read as a transcript, but is no plain text."""
WORDS = [
    "hello you", "3 5 7\n1 2 9\n", "20 30 people\n40 50 more\n",
    "Chapter 1\n\n1.5 million people came.\nThey stayed.\n", "It took 1234567 steps,\n3.5 days.\n", "a --> b",
    "# a heading\n\nhello\n", "<3 you", "[laughs] hello",
]  # fmt: skip


def test_what_would_be_read_as_words_is_refused(tmp_path: Path) -> None:
    for text, message in OTHER.values():
        for suffix in (".txt", ".lab"):
            path = tmp_path / f"a{suffix}"
            path.write_text(text, encoding="utf-8")
            with pytest.raises(InputError, match=message):
                read_labels(path)
        with pytest.raises(InputError, match=message):
            check_plain_text(text, "a.txt")


def test_words_and_labels_in_time_are_no_plain_text_and_words_with_numbers_are(tmp_path: Path) -> None:
    for text, message in TIMED.values():
        with pytest.raises(InputError, match=message):
            check_plain_text(text, "a.txt")
        (tmp_path / "a.txt").write_text(text, encoding="utf-8")
        assert "hello" in (read_labels(tmp_path / "a.txt").words or ())
    for text in ("0 1000000 p\n1000000 2000000 aa\n", "0.0\t0.5\thello\n", '"ooTextFile" "TextGrid"'):
        with pytest.raises(InputError, match=r"a\.txt: holds labels in time, required the words alone"):
            check_plain_text(text, "a.txt")
    for text in WORDS:
        check_plain_text(text, "a.txt")
        (tmp_path / "a.txt").write_text(text, encoding="utf-8")
        assert read_labels(tmp_path / "a.txt").words
