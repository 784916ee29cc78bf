import re
from pathlib import Path

import pytest

from lipmotion.errors import InputError
from lipmotion.formats.label_files import read_labels, read_phones
from lipmotion.formats.textgrid import parse_interval_tiers, write_textgrid
from lipmotion.types import Span, Timeline, Unit
from lipmotion.units import group_words

LABELLED = [(0.0, 0.31, "sil", ""), (0.31, 0.4, "m", "ma"), (0.4, 0.52, "aa", "ma"), (0.52, 0.7, "dh", 'a "the"')]


def test_phones_and_words_are_read_back(tmp_path: Path) -> None:
    units = Timeline(tuple(Span(a, b, Unit(phone, "", word)) for a, b, phone, word in LABELLED))
    write_textgrid(tmp_path / "a.TextGrid", units)
    again = read_phones(tmp_path / "a.TextGrid")
    assert [(s.start_s, s.end_s, s.label.phone) for s in again] == [row[:3] for row in LABELLED]
    assert read_labels(tmp_path / "a.TextGrid").words == ("ma", "a", "the")


def test_times_words_and_confidences_are_exact_and_gaps_become_intervals_without_text(tmp_path: Path) -> None:
    edges_s = [0.0, 1 / 3, 0.1 * 5 + 1e-12, 10 / 7]
    labels = [Unit("sil"), Unit("b", word="big", confidence=0.1 + 0.2), Unit("ih", word="big", confidence=1e-7)]
    units = Timeline(tuple(Span(a, b, label) for a, b, label in zip(edges_s, edges_s[1:], labels, strict=False)))
    write_textgrid(tmp_path / "a.TextGrid", units)
    assert read_phones(tmp_path / "a.TextGrid") == units
    write_textgrid(tmp_path / "b.TextGrid", Timeline((Span(0.1, 0.2, Unit("m")), Span(0.3, 0.4, Unit("aa")))))
    again = [(span.label.phone, span.end_s) for span in read_phones(tmp_path / "b.TextGrid")]
    assert again == [("sil", 0.1), ("m", 0.2), ("sil", 0.3), ("aa", 0.4)]


def test_recognised_phones_are_no_words_and_a_tier_of_that_name_may_hold_something_else(tmp_path: Path) -> None:
    path = tmp_path / "a.TextGrid"
    write_textgrid(path, Timeline((Span(0.0, 0.2, Unit("m", confidence=0.0)),)))
    text = path.read_text(encoding="utf-8")
    assert "m 0.0" in text
    assert read_labels(path).words is None
    path.write_text(text.replace("m 0.0", "said by Anna"), encoding="utf-8")
    assert [span.label.confidence for span in read_phones(path)] == [None]


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

WORDS: list[Interval] = [(0, 0.4, ""), (0.4, 0.9, 'say ""hi""'), (0.9, 1.5, "Bob"), (1.5, 2.0, "")]
PHONES: list[Interval] = [
    *[(0.0, 0.4, "sil"), (0.4, 0.6, "S"), (0.6, 0.75, "EY1"), (0.75, 0.8, "HH"), (0.8, 0.9, "AY1")],
    *[(0.9, 1.0, "B"), (1.0, 1.3, "AA1"), (1.3, 1.5, "B"), (1.5, 2.0, "")],
]
TIERS = {"words": WORDS, "phones": PHONES}


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


def test_both_forms_in_every_encoding(tmp_path):
    path = tmp_path / "a.TextGrid"
    names = {"S": "s", "EY1": "ey", "HH": "hh", "AY1": "ay", "B": "b", "AA1": "aa"}
    for form, encoding, ends in (
        *[(long_form, "utf-8", "\n"), (short_form, "utf-8-sig", "\n"), (long_form, "utf-16", "\n")],
        *[(short_form, "utf-16-be", "\n"), (long_form, "utf-8", "\r\n")],
    ):
        marked = "\ufeff" if encoding == "utf-16-be" else ""
        text = form(TIERS | {"näher": [(0, 2, "…")]}).replace("\n", ends)
        path.write_bytes((marked + text).encode(encoding))
        found = read_labels(path)
        assert found.words == ("say", "hi", "bob")
        assert found.phones is not None
        assert [(s.start_s, s.end_s, s.label.phone) for s in found.phones] == [
            (start_s, end_s, names.get(text, "sil")) for start_s, end_s, text in PHONES
        ]


def test_every_file_that_breaks_off_is_refused(tmp_path):
    """Cut after any token but the last, something is missing."""
    path = tmp_path / "a.TextGrid"
    tokens = short_form({"words": [(0, 1, "a"), (1, 2, "b")]}).split("\n")
    for count in range(3, len(tokens) - 1):
        path.write_text("\n".join(tokens[:count]))
        with pytest.raises(InputError, match=r"a\.TextGrid: (the header|tier .*) is damaged: .*save it again in Praat"):
            read_labels(path)


def test_two_tiers_of_phones_and_binary_grids_are_refused(tmp_path):
    two = short_form({"one": PHONES, "two": PHONES}).encode()
    for content, message in (
        (two, r"tier 'one' and tier 'two' both hold phones; .*--tier"),
        (b"ooBinaryFile\x08TextGrid\xff\xfe\x00", "is a binary TextGrid, required"),
        (b"ooBinaryFile\x08TextGrid", "is a binary TextGrid, required"),
    ):
        (tmp_path / "a.TextGrid").write_bytes(content)
        with pytest.raises(InputError, match=message):
            read_labels(tmp_path / "a.TextGrid")


@pytest.mark.recordings
def test_a_real_one(recordings: Path):
    found = read_labels(recordings / "speech-open" / "61-70968-0000.TextGrid")
    assert found.words is not None
    assert found.words[:4] == ("he", "began", "a", "confused")
    assert found.words == read_labels(recordings / "speech-open" / "61-70968-0000.lab").words
    assert found.phones is None


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
        ("0.6\n0.75", "0.6\n1e999", "tier 'phones', interval 3 has the time '1e999', required a finite one"),
        ('"IntervalTier"', f'"{"x" * 9000}"', "its kind is 'xxx"),
        ('"phones"', f'"{"x" * 9000}"\n"', "is damaged: there stands text 0 2 9 0.0 0.4, required a number"),
    ],
)
def test_what_cannot_be_used_is_named_in_one_short_line(tmp_path, old, new, words):
    text = short_form(TIERS)
    assert old in text
    (tmp_path / "a.TextGrid").write_text(text.replace(old, new))
    with pytest.raises(InputError, match=re.escape(words)) as caught:
        read_labels(tmp_path / "a.TextGrid")
    assert len(str(caught.value)) < 500 or "the phones are" in words
    assert "\n" not in str(caught.value)


def test_texts_may_hold_anything_and_quotes_are_written_twice() -> None:
    rows: list[Interval] = [(0.0, 1.0, 'he said ""no"" ! 5 <exists>'), (1.0, 2.0, "two\nlines"), (2, 3, '""')]
    rows += [(3, 4, '""a""""'), (4, 5, ""), (5, 6, '""' * 5000)]
    expected = ['he said "no" ! 5 <exists>', "two\nlines", '"', '"a""', "", '"' * 5000]
    for form in (long_form, short_form):
        (tier,) = parse_interval_tiers(form({"words": rows}), "a.TextGrid")
        assert [label.text for label in tier.labels] == expected


def test_comments_are_passed_over_and_a_grid_may_have_no_tiers(tmp_path: Path) -> None:
    text = short_form(TIERS).replace("<exists>", "<exists> ! are there 7 tiers?")
    assert [tier.name for tier in parse_interval_tiers(text, "a")] == ["words", "phones"]
    (tmp_path / "a.TextGrid").write_text('File type = "ooTextFile"\n"TextGrid"\n0\n1\n<absent>\n')
    found = read_labels(tmp_path / "a.TextGrid")
    assert (found.words, found.phones) == (None, None)


def test_a_word_that_is_said_again_stays_another_word(tmp_path):
    words: list[Interval] = [(0, 0.3, "city"), (0.3, 0.6, "city"), (0.6, 0.8, ""), (0.8, 0.9, "city")]
    said = "S DX IY S T IH SIL SIL IY".split()
    phones: list[Interval] = [(n / 10, (n + 1) / 10, phone) for n, phone in enumerate(said)]
    (tmp_path / "a.TextGrid").write_text(short_form({"words": words, "phones": phones}))
    units = read_phones(tmp_path / "a.TextGrid")
    assert [span.label for span in group_words(units)] == ["city", "city", "", "city"]
    assert [span.label.again for span in units] == [n == 3 for n in range(9)]


def test_vowels_are_reduced_word_by_word(tmp_path):
    words: list[Interval] = [(i, i + 1, "about") for i in range(40)]
    phones: list[Interval] = [(n / 4, (n + 1) / 4, phone) for n, phone in enumerate(["AH", "B", "AW", "T"] * 40)]
    (tmp_path / "a.TextGrid").write_text(short_form({"words": words, "phones": phones}))
    found = read_labels(tmp_path / "a.TextGrid").phones
    assert [span.label.phone for span in found] == ["ax", "b", "aw", "t"] * 40
