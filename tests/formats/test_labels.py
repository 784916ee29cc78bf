import html
import re
from pathlib import Path

import pytest

from formats.examples import LABEL_CASES
from lipmotion.errors import InputError
from lipmotion.formats import label_files, label_tiers
from lipmotion.formats.annotations import parse_interval_tiers, write_textgrid
from lipmotion.types import Span, Timeline, Unit
from lipmotion.units import group_words
from lipmotion.units.text_normalisation import LARGEST_TRANSCRIPT_BYTES


@pytest.fixture
def read(write):
    return lambda text, name="a.lab": label_files.read_labels(write(text, name))


def rows(found) -> list[tuple[float, float, str]]:
    return [(span.start_s, span.end_s, span.label.phone) for span in found.phones]


SAID = [(0, 0.13, "sil"), (0.13, 0.205, "hh"), (0.205, 0.3, "iy")]


def test_audacity_counts_in_seconds_and_words_in_time_are_a_transcript(read):
    text = "0.000000\t0.130000\tsil\n\\\t200.0\t300.0\n0.130000\t0.205000\tHH\n0.205000\t0.300000\tIY0\n"
    assert rows(read(text, "a.txt")) == SAID
    assert read("0.5\t1.0\tHello\n1.0\t1.5\tyou there\n2.0\t2.0\t\n", "a.txt").words == ("hello", "you", "there")
    found = read("0 2000000 sil\n2000000 5000000 Fire\n5200000 8000000 fox\n")
    assert found.words == ("fire", "fox")
    assert found.phones is None


def test_plain_text(read):
    for text, words in (
        ("this is it\n", ("this", "is", "it")), ("this\nis\nit\n", ("this", "is", "it")),
        ("20 30 people\n", ("twenty", "thirty", "people")),
        ("5 o'clock\n9 lives\n", ("five", "o'clock", "nine", "lives")), ("  \n\n", None), ("\x0c" * 100_000, None),
    ):  # fmt: skip
        assert (read(text).words, read(text).phones) == (words, None)


@pytest.mark.parametrize(
    ("text", "count", "message"),
    [
        ("0 1000000 p\n", label_tiers.MAX_LABELS, "more than 250000 labels; give those of one recording"),
        ("a", LARGEST_TRANSCRIPT_BYTES, "4194305 characters, required at most 4194304: is it a transcript"),
        (" ", label_files.LARGEST_LABELS, "16777217 bytes, required at most 16777216"),
    ],
)
def test_more_than_a_recording_has_is_refused(read, text, count, message):
    with pytest.raises(InputError, match=rf"a\.lab: .*{message}"):
        read(text * (count + 1))


def test_without_stress_the_word_decides(read):
    phones = [("B", 0.0, 0.1), ("AH", 0.1, 0.2), ("T", 0.2, 0.3), ("ER", 0.3, 0.4)]
    lines = ['"ooTextFile"', '"TextGrid"', "0 0.4 <exists> 2", '"IntervalTier" "words" 0 0.4 1', '0 0.4 "Butter"']
    lines += ['"IntervalTier" "phones" 0 0.4 4', *(f'{a} {b} "{name}"' for name, a, b in phones)]
    for words, found in (("Butter", "axr"), ("butter it", "er")):  # a sentence: no word to be had
        text = "\n".join(lines).replace("Butter", words)
        assert [phone for *_, phone in rows(read(text, "a.TextGrid"))] == ["b", "ah", "t", found]


def test_other_names_of_silence(read):
    names = ["SIL", "sp", "nsn", "pau", "h#", "#", "<p:>", "[laughs]"]
    labels = [label for name in names for label in (name, "aa")]
    text = "".join(f"{n}000000 {n + 1}000000 {label}\n" for n, label in enumerate(labels))
    assert {phone for *_, phone in rows(read(text))} == {"sil", "sp", "aa"}


def test_files_beside_a_recording(tmp_path):
    recording = tmp_path / "a.mp4"
    assert label_files.find_labels(recording).words is None
    (tmp_path / "a.lab").write_text("0 1000000 t\n1000000 2000000 uw\n")
    assert label_files.find_labels(recording).words is None
    (tmp_path / "a.txt").write_text("Two.")
    found = label_files.find_labels(recording)
    assert found.words == ("two",)
    assert [phone for *_, phone in rows(found)] == ["t", "uw"]
    (tmp_path / "a.TextGrid").write_text('"ooTextFile" "TextGrid" 0 1 <exists> 1 "IntervalTier" "w" 0 1 1 0 1 "too"')
    assert label_files.find_labels(recording).words == ("two",)  # plain text before labels
    assert label_files.find_labels(recording, ignored=frozenset({tmp_path / "a.txt"})).words == ("too",)


@pytest.mark.parametrize(("place", "first"), [("wavs", "LJ001"), (".", "wavs/LJ001.wav"), (".", "LJ001")])
def test_the_words_of_ljspeech_stand_in_one_table(tmp_path, place, first) -> None:
    recording, table = tmp_path / "wavs" / "LJ001.wav", tmp_path / place / "metadata.csv"
    recording.parent.mkdir()
    table.write_text(f"LJ0010|no|no\n{first}|In 2 parts|in two parts\nLJ002|other\n")
    assert label_files.find_labels(recording).words == ("in", "two", "parts")
    table.write_text(f"{first}|again\n")
    assert label_files.find_labels(recording).words == ("again",)
    assert label_files.find_labels(recording.with_name("LJ003.wav")).words is None
    recording.with_suffix(".txt").write_text("its own")
    assert label_files.find_labels(recording).words == ("its", "own")


@pytest.mark.recordings
def test_real_ones(recordings: Path):
    folder = recordings / "speech-open"
    phones = rows(label_files.read_labels(folder / "arctic_a0009_phone.lab"))
    assert phones == rows(label_files.read_labels(folder / "arctic_a0009_state.lab"))
    assert len(phones) == 40
    assert [phone for *_, phone in phones][:8] == ["sil", "hh", "iy", "t", "er", "n", "d", "sh"]
    assert phones[0][:2] == (0, 0.13)
    found = label_files.find_labels(folder / "sense_and_sensibility_01_austen_64kb-0880.wav")
    assert found.words == ("he", "was", "not", "an", "ill", "disposed", "young", "man")


TIMED = {
    "SubRip": ("1\n00:00:01,000 --> 00:00:02,000\nhello\n", "is a file of subtitles"),
    "WebVTT": ("WEBVTT\n\n00:01.000 --> 00:02.000\nhello\n", "is a file of subtitles"),
    "JSON": ('{"words": [{"start": 0.0, "word": "hello"}]}', "begins with '{|rich-text"),
    "CTM": ("a 1 0.00 0.5 hello\na 1 0.5 0.5 you\n", "labels in time"),
}
"""What is read as a transcript, but is no plain text."""
LABEL_WORDS = [
    "hello you", "3 5 7\n1 2 9\n", "20 30 people\n40 50 more\n",
    "Chapter 1\n\n1.5 million people came.\nThey stayed.\n", "It took 1234567 steps,\n3.5 days.\n", "a --> b",
    "# a heading\n\nhello\n", "<3 you", "[laughs] hello",
]  # fmt: skip


def test_what_would_be_read_as_words_is_refused(write) -> None:
    for case in (case for name, case in LABEL_CASES.items() if name.startswith("no plain text")):
        with pytest.raises(InputError, match=case["error"]):
            label_files.read_plain_text(write(case["content"], "a.lab"))


def test_words_and_labels_in_time_are_no_plain_text_and_words_with_numbers_are(read, write) -> None:
    for text, message in TIMED.values():
        with pytest.raises(InputError, match=message):
            label_files.read_plain_text(write(text, "a.txt"))
        assert "hello" in (read(text, "a.txt").words or ())
    for text in ("0 1000000 p\n1000000 2000000 aa\n", "0.0\t0.5\thello\n", '"ooTextFile" "TextGrid"'):
        with pytest.raises(InputError, match=r"a\.txt: holds labels in time, required the words alone"):
            label_files.read_plain_text(write(text, "a.txt"))
    for text in LABEL_WORDS:
        assert label_files.read_plain_text(write(text, "a.txt")) == text
        assert read(text, "a.txt").words


LABELLED = [(0.0, 0.31, "sil", ""), (0.31, 0.4, "m", "ma"), (0.4, 0.52, "aa", "ma"), (0.52, 0.7, "dh", 'a "the"')]


def test_phones_and_words_are_read_back(tmp_path: Path) -> None:
    units = Timeline(tuple(Span(a, b, Unit(phone, "", word)) for a, b, phone, word in LABELLED))
    write_textgrid(tmp_path / "a.TextGrid", units)
    again = label_files.read_phones(tmp_path / "a.TextGrid")
    assert [(s.start_s, s.end_s, s.label.phone) for s in again] == [row[:3] for row in LABELLED]
    assert label_files.read_labels(tmp_path / "a.TextGrid").words == ("ma", "a", "the")


def test_times_words_and_confidences_are_exact_and_gaps_become_intervals_without_text(tmp_path: Path) -> None:
    edges_s = [0.0, 1 / 3, 0.1 * 5 + 1e-12, 10 / 7]
    labels = [Unit("sil"), Unit("b", word="big", confidence=0.1 + 0.2), Unit("ih", word="big", confidence=1e-7)]
    units = Timeline(tuple(Span(a, b, label) for a, b, label in zip(edges_s, edges_s[1:], labels, strict=False)))
    write_textgrid(tmp_path / "a.TextGrid", units)
    assert label_files.read_phones(tmp_path / "a.TextGrid") == units
    write_textgrid(tmp_path / "b.TextGrid", Timeline((Span(0.1, 0.2, Unit("m")), Span(0.3, 0.4, Unit("aa")))))
    again = [(span.label.phone, span.end_s) for span in label_files.read_phones(tmp_path / "b.TextGrid")]
    assert again == [("sil", 0.1), ("m", 0.2), ("sil", 0.3), ("aa", 0.4)]


def test_recognised_phones_are_no_words_and_a_tier_of_that_name_may_hold_something_else(tmp_path: Path) -> None:
    path = tmp_path / "a.TextGrid"
    write_textgrid(path, Timeline((Span(0.0, 0.2, Unit("m", confidence=0.0)),)))
    text = path.read_text(encoding="utf-8")
    assert "m 0.0" in text
    assert label_files.read_labels(path).words is None
    path.write_text(text.replace("m 0.0", "said by Anna"), encoding="utf-8")
    assert [span.label.confidence for span in label_files.read_phones(path)] == [None]


def test_others_read_it(tmp_path: Path) -> None:
    """Oracles: praatio, and Praat itself in parselmouth."""
    textgrid, parselmouth = pytest.importorskip("praatio.textgrid"), pytest.importorskip("parselmouth")
    sure = (None, 0.37, None, None)
    rows = zip(LABELLED, sure, strict=True)
    units = Timeline(tuple(Span(a, b, Unit(phone, "", word, each)) for (a, b, phone, word), each in rows))
    write_textgrid(tmp_path / "a.TextGrid", units)
    found = textgrid.openTextgrid(str(tmp_path / "a.TextGrid"), includeEmptyIntervals=True, reportingMode="error")
    assert found.tierNames == ("phones", "words", "recognised")
    assert [entry.label for entry in found.getTier("recognised").entries] == ["", "m 0.37", ""]
    assert [tuple(entry) for entry in found.getTier("phones").entries] == [row[:3] for row in LABELLED]
    assert [entry.label for entry in found.getTier("words").entries] == ["", "ma", 'a "the"']
    praat = parselmouth.praat
    grid = parselmouth.read(str(tmp_path / "a.TextGrid"))
    assert praat.call(grid, "Get number of intervals", 1) == len(LABELLED)
    assert praat.call(grid, "Get label of interval", 2, 3) == 'a "the"'


Interval = tuple[float, float, str]
TEXTGRID_WORDS: list[Interval] = [(0, 0.4, ""), (0.4, 0.9, 'say ""hi""'), (0.9, 1.5, "Bob"), (1.5, 2.0, "")]
TEXTGRID_PHONES: list[Interval] = [
    *[(0.0, 0.4, "sil"), (0.4, 0.6, "S"), (0.6, 0.75, "EY1"), (0.75, 0.8, "HH"), (0.8, 0.9, "AY1")],
    *[(0.9, 1.0, "B"), (1.0, 1.3, "AA1"), (1.3, 1.5, "B"), (1.5, 2.0, "")],
]
TIERS = {"words": TEXTGRID_WORDS, "phones": TEXTGRID_PHONES}


def long_form(tiers: dict[str, list[Interval]]) -> str:
    """As Praat saves it by default."""
    lines = ['File type = "ooTextFile"', 'Object class = "TextGrid"', "", "xmin = 0 ", "xmax = 2 ", "tiers? <exists> "]
    lines += [f"size = {len(tiers) + 1} ", "item []: "]
    for number, (name, rows) in enumerate(tiers.items(), 1):
        lines += [f"    item [{number}]:", '        class = "IntervalTier" ', f'        name = "{name}" ']
        lines += ["        xmin = 0 ", "        xmax = 2 ", f"        intervals: size = {len(rows)} "]
        for row, (start_s, end_s, text) in enumerate(rows, 1):
            lines += [f"        intervals [{row}]:", f"            xmin = {start_s} ", f"            xmax = {end_s} "]
            lines += [f'            text = "{text}" ']
    lines += ["    item [9]:", '        class = "TextTier" ', '        name = "clicks" ', "        xmin = 0 "]
    lines += ["        xmax = 2 ", "        points: size = 1 ", "        points [1]:", "            number = 0.5 "]
    return "\n".join([*lines, '            mark = "click 3" ', ""])


def short_form(tiers: dict[str, list[Interval]]) -> str:
    lines = ['File type = "ooTextFile"', 'Object class = "TextGrid"', "", "0", "2", "<exists>", str(len(tiers) + 1)]
    lines += ['"TextTier"', '"clicks"', "0", "2", "1", "0.5", '"click 3"']
    for name, rows in tiers.items():
        lines += ['"IntervalTier"', f'"{name}"', "0", "2", str(len(rows))]
        lines += [str(item) for start_s, end_s, text in rows for item in (start_s, end_s, f'"{text}"')]
    return "\n".join([*lines, ""])


def test_both_forms_in_every_encoding(read):
    names = {"S": "s", "EY1": "ey", "HH": "hh", "AY1": "ay", "B": "b", "AA1": "aa"}
    for form, encoding, ends in (
        *[(long_form, "utf-8", "\n"), (short_form, "utf-8-sig", "\n"), (long_form, "utf-16", "\n")],
        *[(short_form, "utf-16-be", "\n"), (long_form, "utf-8", "\r\n")],
    ):
        marked = "\ufeff" if encoding == "utf-16-be" else ""
        text = form(TIERS | {"näher": [(0, 2, "…")]}).replace("\n", ends)
        found = read((marked + text).encode(encoding), "a.TextGrid")
        assert found.words == ("say", "hi", "bob")
        assert rows(found) == [(start_s, end_s, names.get(text, "sil")) for start_s, end_s, text in TEXTGRID_PHONES]


def test_every_file_that_breaks_off_is_refused(read):
    """Cut after any token but the last, something is missing."""
    tokens = short_form({"words": [(0, 1, "a"), (1, 2, "b")]}).split("\n")
    for count in range(3, len(tokens) - 1):
        with pytest.raises(InputError, match=r"a\.TextGrid: (the header|tier .*) is damaged: .*save it again in Praat"):
            read("\n".join(tokens[:count]), "a.TextGrid")


def test_two_tiers_of_phones_and_binary_grids_are_refused(write):
    two = short_form({"one": TEXTGRID_PHONES, "two": TEXTGRID_PHONES}).encode()
    for content, message in (
        (two, r"tier 'one' and tier 'two' both hold phones; .*--tier"),
        (b"ooBinaryFile\x08TextGrid\xff\xfe\x00", "is a binary TextGrid, required"),
        (b"ooBinaryFile\x08TextGrid", "is a binary TextGrid, required"),
    ):
        with pytest.raises(InputError, match=message):
            label_files.read_labels(write(content, "a.TextGrid"))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"IntervalTier"', '"PitchTier"', "its kind is 'PitchTier', required IntervalTier or TextTier"),
        ('Object class = "TextGrid"', 'Object class = "Sound 2"', "a Praat file of another kind; save a TextGrid"),
        ('"EY1"', '"EY9x"', "tier 'phones', interval 3 is 'EY9x', which is no phone; the phones are: aa ae"),
        ("0.6\n0.75", "0.5\n0.75", "interval 3 starts at 0.5 s, before the one ahead of it ends (0.6 s)"),
        ("0.6\n0.75", "0.7\n0.75", "tier 'phones', interval 3 starts at 0.7 s, the one before it ends at 0.6 s"),
        ("0.6\n0.75", "0.75\n0.6", "interval 3 ends at 0.6 s, before its start at 0.75 s"),
        ("9\n0.0", "8\n0.0", "what follows the last tier is damaged: more is there than the counts say"),
        ("9\n0.0", "9" * 5000 + "\n0.0", "tier 'phones' is damaged: there stands number 999"),
        ("9\n0.0", "250001\n0.0", "more than 250000 labels; give those of one recording"),
        ("0.6\n0.75", "0.6\n1e999", "tier 'phones', interval 3 has the time '1e999', required finite seconds"),
        ('"IntervalTier"', f'"{"x" * 9000}"', "its kind is 'xxx"),
        ('"phones"', f'"{"x" * 9000}"\n"', "is damaged: there stands text 0 2 9 0.0 0.4, required a number"),
    ],
)
def test_what_cannot_be_used_is_named_in_one_short_line(write, old, new, words):
    text = short_form(TIERS)
    assert old in text
    with pytest.raises(InputError, match=re.escape(words)) as caught:
        label_files.read_labels(write(text.replace(old, new), "a.TextGrid"))
    assert len(str(caught.value)) < 500 or "the phones are" in words
    assert "\n" not in str(caught.value)


def test_texts_may_hold_anything_and_quotes_are_written_twice() -> None:
    rows: list[Interval] = [(0.0, 1.0, 'he said ""no"" ! 5 <exists>'), (1.0, 2.0, "two\nlines"), (2, 3, '""')]
    rows += [(3, 4, '""a""""'), (4, 5, ""), (5, 6, '""' * 5000)]
    expected = ['he said "no" ! 5 <exists>', "two\nlines", '"', '"a""', "", '"' * 5000]
    for form in (long_form, short_form):
        (tier,) = parse_interval_tiers(form({"words": rows}), "a.TextGrid")
        assert [label.text for label in tier.labels] == expected


def test_comments_are_passed_over_and_a_grid_may_have_no_tiers(write):
    text = short_form(TIERS).replace("<exists>", "<exists> ! are there 7 tiers?")
    assert [tier.name for tier in parse_interval_tiers(text, "a")] == ["words", "phones"]
    found = label_files.read_labels(write('File type = "ooTextFile"\n"TextGrid"\n0\n1\n<absent>\n', "a.TextGrid"))
    assert (found.words, found.phones) == (None, None)


def test_a_word_that_is_said_again_stays_another_word(write):
    words: list[Interval] = [(0, 0.3, "city"), (0.3, 0.6, "city"), (0.6, 0.8, ""), (0.8, 0.9, "city")]
    said = "S DX IY S T IH SIL SIL IY".split()
    phones: list[Interval] = [(n / 10, (n + 1) / 10, phone) for n, phone in enumerate(said)]
    units = label_files.read_phones(write(short_form({"words": words, "phones": phones}), "a.TextGrid"))
    assert [span.label for span in group_words(units)] == ["city", "city", "", "city"]
    assert [span.label.again for span in units] == [n == 3 for n in range(9)]


ROWS = [(0.0, 0.31, "sil", ""), (0.31, 0.4, "m", "ma"), (0.4, 0.52, "aa", "ma"), (0.52, 3599.9996, "dh", "r&d <the>")]
UNITS = Timeline(tuple(Span(start, end, Unit(phone, "", word)) for start, end, phone, word in ROWS))
FIRST, SECOND, THIRD = "00:00:00.310 --> 00:00:00.520", "00:00:00.520 --> 01:00:00.000", "00:00:00.310 --> 00:00:00.400"
WEBVTT = f"WEBVTT\n\n{FIRST}\nma\n\n{SECOND}\nr&amp;d &lt;the&gt;\n"
WEBVTT_PHONES = f"WEBVTT\n\n{THIRD}\nm\n\n00:00:00.400 --> 00:00:00.520\naa\n\n{SECOND}\ndh\n"


def as_subrip(webvtt: str) -> str:
    """Return cues with numbers, and commas in their times."""
    cues = webvtt.replace(".", ",").rstrip().split("\n\n")[1:]
    return "".join(f"{number}\n{cue}\n\n" for number, cue in enumerate(cues, 1))


@pytest.mark.parametrize("suffix", [".srt", ".vtt"])
def test_words_and_phones_are_written_and_words_come_back(tmp_path: Path, suffix: str) -> None:
    def text(units: Timeline[Unit], name: str) -> str:
        label_files.write_labels(tmp_path / name, units)
        return (tmp_path / name).read_text(encoding="utf-8")

    words, phones = WEBVTT, WEBVTT_PHONES
    if suffix == ".srt":
        words, phones = as_subrip(html.unescape(words)), as_subrip(phones)
    assert text(UNITS, f"a{suffix}") == words
    assert text(UNITS, f"a.phones{suffix.upper()}") == phones
    text(Timeline((*UNITS.spans[:3], Span(0.52, 3599.9996, Unit("dh", "", "there")))), f"a{suffix}")
    transcript = label_files.read_labels(tmp_path / f"a{suffix}").transcript
    assert [(line.start_s, line.end_s) for line in transcript.lines] == [(0.31, 0.52), (0.52, 3600.0)]
    assert transcript.words == ("ma", "there")
    silence = text(Timeline((Span(0.0, 1.0, Unit("sil")),)), f"b{suffix}")
    assert silence.strip() == ("WEBVTT" if suffix == ".vtt" else "")


def test_webvtt_py_reads_it(tmp_path: Path) -> None:
    """Oracle: webvtt-py."""
    webvtt = pytest.importorskip("webvtt")
    label_files.write_labels(tmp_path / "a.vtt", UNITS)
    found = [(cue.start, cue.end, cue.text) for cue in webvtt.read(str(tmp_path / "a.vtt"))]
    assert found[0] == ("00:00:00.310", "00:00:00.520", "ma")
    assert found[1][:2] == ("00:00:00.520", "01:00:00.000")


def test_a_word_that_is_said_twice_is_written_twice_whatever_the_capitals_of_the_suffix(tmp_path: Path) -> None:
    big = tuple(Span(n / 10, (n + 1) / 10, Unit(phone, word="big")) for n, phone in enumerate("b ih g b ih g".split()))
    for name, start, said in (("a.vtt", "WEBVTT", "big"), ("a.TEXTGRID", "File type", '"big"')):
        label_files.write_labels(tmp_path / name, Timeline(big))
        text = (tmp_path / name).read_text()
        assert text.startswith(start)
        assert text.count(said) == 2
