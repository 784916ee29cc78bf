import json
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion import errors, units
from lipmotion.errors import InputError, MissingDependencyError
from lipmotion.units import PHONES, Lexicon, lexicon
from lipmotion.units.lexicon import LARGEST_LEXICON_BYTES, LONGEST_PRONUNCIATION, MAX_VARIANTS, pronounce_by_network
from lipmotion.units.spelling import guess_pronunciation, remove_accents

PRONOUNCED = json.loads(Path(__file__).with_name("said_texts.json").read_text("utf-8"))["pronounced"]


def said(word: str, lexicon: Lexicon | None = None) -> list[str]:
    return [" ".join(phones) for phones in (lexicon or Lexicon()).pronunciations(word)]


@pytest.fixture
def lexicon_file(tmp_path: Path) -> Path:
    return tmp_path / "words é.txt"


def test_dictionary_words() -> None:
    for word, phones in PRONOUNCED["words"].items():
        assert Lexicon().known(word)
        assert said(word) == phones
    for word, end in (("percent's", "t s"), ("eighth's", "th s"), ("box's", "s ix z"), ("emoji's", "iy z")):
        assert said(word)[-1].endswith(f" {end}")
    assert said("nodo's", Lexicon({"nodo": (("n", "ow"),)})) == ["n ow z"]  # and that of the user
    assert len(said("tomato")) == 2
    for word, first in (("of", "ax v"), ("cut", "k ah t"), ("her", "hh axr")):  # weak words alone are reduced
        assert said(word)[0] == first
    assert Lexicon().pronunciations("abducted")[1] == ("ax", "b", "d", "ah", "k", "t", "ix", "d")  # no full vowel


def test_the_whole_dictionary_maps_into_the_inventory() -> None:
    text = lexicon._dictionary().decode()
    assert {phone.lower() for line in text.splitlines() for phone in line.split()[1:]} <= set(PHONES)
    for line in text.splitlines()[1::997]:
        word = line.split()[0].split("(")[0]
        assert Lexicon().known(word)
        assert all(set(variant) <= set(PHONES) for variant in Lexicon().pronunciations(word))


def test_a_lengthened_word_is_the_word_that_is_meant() -> None:
    for word, meant in PRONOUNCED["lengthened"].items():
        assert Lexicon().known(word)
        assert said(word)[0] == said(meant)[0]
        assert Lexicon().spoken_forms(word)[0][0][1] == meant
    assert said("hahaha") == said("hahahah") == ["hh aa hh aa hh aa"]
    for word in ("aaaaaaargle", "xyyyz", "booker", "bananana"):
        assert not lexicon.expand_lengthened(word)
    assert not Lexicon().known("x" * 5000 + "yyy")


def test_sounds_in_letters_are_said_as_these() -> None:
    for word, phones in PRONOUNCED["sounds"].items():
        assert said(word)[0] == phones
        assert Lexicon().known(word)


def test_a_form_is_said_in_the_words_of_its_readings() -> None:
    forms = Lexicon().spoken_forms("21")
    words = [list(dict.fromkeys(word for _, word in form if word)) for form in forms]
    assert words == [["twenty", "one"]] * 2 + [["two", "one"]] * (len(words) - 2)
    assert forms[0][6] == ("sp", "")
    assert all("sp" not in phones for phones in Lexicon().pronunciations("21"))


def test_a_users_file(lexicon_file: Path) -> None:
    lexicon_file.write_text(
        "# my words\n;;; and\n\nLipmotion L IH1 P M OW1 SH AH0 N # name\nlipmotion(2) l ih p m ow sh en\nmap M AE0 P\n"
        "naïve n aa iy v\ndon’t d ow n t\n'em ax m\n4K f ao k\nCAFE\u0301 k ae f ey\none AH0 ER0 IH0 AH1 ER2 IH IY0\n",
        encoding="utf-8",
    )
    mine = Lexicon.from_file(lexicon_file)
    assert said("lipmotion", mine) == ["l ih p m ow sh ax n", "l ih p m ow sh en"]
    for word, phones in (
        ("map", "m ae p"), ("naïve", "n aa iy v"), ("don't", "d ow n t"), ("em", "ax m"), ("café", "k ae f ey"),
        ("4K", "f ao k"), ("one", "ax axr ix ah er ih iy"),  # unstressed vowels are reduced
    ):  # fmt: skip
        assert said(word, mine) == [phones]
    assert mine.known("lipmotion")
    assert said("bin", mine) == said("bin")
    aligner = "<unk> SPN\n!SIL SIL\nbim\t0.9\t0.1\t1.0\t1.2\tB IH M\nbam 1.0 B AE M"
    marked = 'bim: B IH M\n"bam" B AE M\nbim|B IH M\nbam, B AE M'
    for text in ("bim B IH M\r\nbam B AE M\r\n", "\ufeffbim B IH M\nbam B AE M", aligner, marked):
        lexicon_file.write_bytes(text.encode())
        assert [each[0][1] for each in Lexicon.from_file(lexicon_file).user.values()] == ["ih", "ae"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("bim B IH M\nbam B AE Q", r"words é.txt, line 2: unknown phone 'Q'; the phones are: aa ae"),
        ("# a\n\nbam", r"line 3: 0 phones after a word, required 1 to 1000"),
        ("bim B sil", r"line 1: unknown phone 'sil'"),
        ("bim B IH12 M", r"line 1: unknown phone 'IH12'"),
        ("bim " + "Q" * 500, r"unknown phone 'Q{80}\.\.\.'; the phones"),
        ("bim B IH M\n" + "bim B" + " B" * LONGEST_PRONUNCIATION, "line 2: 1001 phones"),
        ("bim B IH M\n" * (MAX_VARIANTS + 1), "line 33: more than 32 pronunciations of 'bim'"),
        ("#", "33554433 bytes, required at most 33554432"),
    ],
)
def test_it_says_which_line_is_wrong(lexicon_file: Path, text: str, message: str) -> None:
    lexicon_file.write_text(text * (LARGEST_LEXICON_BYTES + 1 if text == "#" else 1))
    with pytest.raises(InputError, match=message):
        Lexicon.from_file(lexicon_file)


def test_a_file_that_is_none(tmp_path: Path, lexicon_file: Path) -> None:
    other = tmp_path / "other.txt"
    other.write_bytes(b"bim\xff B")
    for path, message in (
        (lexicon_file, "no such lexicon file"),
        (tmp_path, "is a folder; give one lexicon file"),
        (other, "not a readable UTF-8 lexicon"),
    ):
        with pytest.raises(InputError, match=message):
            Lexicon.from_file(path)


def test_without_a_dictionary_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pocketsphinx", None)
    lexicon._dictionary.cache_clear()
    with pytest.raises(MissingDependencyError, match="pip install pocketsphinx"):
        Lexicon().known("binocularly")


@pytest.mark.long
def test_the_dictionary_is_searched_as_if_line_by_line() -> None:
    """Words at both ends, with variants, beside longer ones, and none at all."""
    lines = [line.split() for line in lexicon._dictionary().decode().lower().splitlines() if line]
    words = [lines[0][0], lines[1][0], lines[-1][0], "a", "aa", "the", "tomato", "read", "zzz", "!", "日本", "hello("]
    words += [line[0].partition("(")[0] for line in lines[:: len(lines) // 40]]
    for word in words:
        expected = tuple(tuple(line[1:]) for line in lines if line[0].partition("(")[0] == word)
        assert lexicon.list_entries(word) == expected


def test_a_made_up_word_is_read_as_people_read_it() -> None:
    pytest.importorskip("hama.inference")
    assert Lexicon().pronunciations("lipmotion") == (tuple("l ih p m ow sh ax n".split()),)
    assert Lexicon().pronunciations("lípmotion") == Lexicon().pronunciations("lipmotion")
    assert pronounce_by_network("abc" * 20) == ()
    with pytest.raises(InputError, match="cannot guess"):
        Lexicon().pronunciations("лип")


def test_without_the_network_rules_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "hama", None)
    lexicon._network.cache_clear()
    pronounce_by_network.cache_clear()
    try:
        assert Lexicon().pronunciations("lipmotion") == (tuple("l ih p m aa sh ax n".split()),)
    finally:
        lexicon._network.cache_clear()
        pronounce_by_network.cache_clear()


LETTERS = "abcdefghijklmnopqrstuvwxyz"


def test_rules() -> None:
    for word, phones in PRONOUNCED["rules"].items():
        assert " ".join(guess_pronunciation(word)) == phones


@settings(max_examples=60)
@given(st.lists(st.sampled_from(LETTERS), min_size=1, max_size=20).map("".join))
def test_any_word_can_be_said(word: str) -> None:
    phones = guess_pronunciation(word)
    assert phones
    assert all(phone in units.PHONES and not units.is_silent(phone) for phone in phones)


def test_accents_are_left_out() -> None:
    for word, plain in PRONOUNCED["plain"].items():
        assert remove_accents(word) == plain
        assert guess_pronunciation(word) == guess_pronunciation(plain)


def test_a_word_with_accents_is_said_as_the_dictionary_says_it_without() -> None:
    assert said("café") == said("cafe")
    assert all(map(Lexicon().known, "café zoë josé renée naïve señor".split()))
    assert not Lexicon().known("grögu")
    assert said("café", Lexicon({"café": (("k", "ae"),)})) == ["k ae"]


def test_it_says_what_it_cannot_guess() -> None:
    for word, message in (
        ("日本", r"how '日本' is said \(日 本\): give the language of the words \(--language\), or add it"),
        ("éкран", r"\(а к н р\)"), ("한", r"\(한\)"), ("mp3", r"\(3\)"), ("''", r"\(no letters\)"),
        ("", r"\(no letters\)"), ("ж" * 1000, r"^.{,299}$"),
    ):  # fmt: skip
        with pytest.raises(errors.InputError, match=message):
            guess_pronunciation(word)
