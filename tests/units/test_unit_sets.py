from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion import errors, types
from lipmotion.units import LIP_CLOSING, PHONES, UNIT_SETS, UnitSet, is_silent, list_phone_classes, load_unit_set

DOCUMENT = Path(__file__).parents[2] / "docs" / "unit-sets.md"
PRINTED = {"2vis": 2, "pbVis": 9, "sVis": 6, "eVis": 19, "phone": 46}  # Hofer 2008, Table 1
SPOKEN = tuple(phone for phone in PHONES if not is_silent(phone))
DIPHTHONGS = {"aw", "ay", "ey", "ow", "oy"}
VOWELS = set("aa ae ah ao ax axr eh er ih ix iy uh uw".split()) | DIPHTHONGS
named = pytest.mark.parametrize("name", PRINTED)


def table(of: dict[str, str]) -> str:
    units = dict.fromkeys(of.values())
    return "".join(f"{unit} {' '.join(p for p in of if of[p] == unit)}\n" for unit in units)


def written(folder: Path, text: str) -> Path:
    path = folder / "mine.txt"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_counts_are_those_of_the_paper() -> None:
    assert {name: found.count for name, found in UNIT_SETS.items()} == PRINTED


@named
def test_silence_stands_alone_and_lips_that_meet_in_no_open_unit(name: str) -> None:
    found = load_unit_set(name)
    beside = {phone for unit in found.silence for phone in found.phones(unit)}
    assert beside - {"sil", "sp"} == (set(LIP_CLOSING) if name == "2vis" else set())
    assert [found.silent(unit) for unit in found.silence] == [name != "2vis"] * len(found.silence)
    assert not any(found.silent(found.unit(phone)) for phone in SPOKEN)
    closing = {found.unit(phone) for phone in LIP_CLOSING}
    assert all(phone in LIP_CLOSING or is_silent(phone) for unit in closing for phone in found.phones(unit))


def kinds(name: str) -> dict[str, int]:
    """Count units of diphthongs alone, of other vowels, and of the rest."""
    count = {"diphthong": 0, "vowel": 0, "other": 0}
    found = load_unit_set(name)
    for unit in found.units:
        phones = set(found.phones(unit))
        assert phones <= VOWELS or not phones & VOWELS
        count["diphthong" if phones <= DIPHTHONGS else "vowel" if phones <= VOWELS else "other"] += 1
    return count


def test_the_parts_of_the_sets_are_those_of_the_paper_and_break_one_another_down() -> None:
    assert kinds("eVis") == {"diphthong": 5, "vowel": 4, "other": 10}
    assert kinds("sVis") == {"diphthong": 0, "vowel": 3, "other": 3 + 1}
    assert load_unit_set("phone").unit_of_phone == {phone: phone for phone in PHONES}
    for fine, coarse in (("phone", "eVis"), ("eVis", "sVis"), ("sVis", "2vis")):
        for unit in load_unit_set(fine).units:
            speech = [phone for phone in load_unit_set(fine).phones(unit) if not is_silent(phone)]
            assert len({load_unit_set(coarse).unit(phone) for phone in speech}) <= 1


def check_classes(found: UnitSet) -> None:
    """By the definition, set by set."""
    whole = frozenset(found.units)
    wanted = {frozenset([unit]) for unit in found.units}
    for phones in list_phone_classes().values():
        wanted.add(frozenset(unit for unit in found.units if set(found.phones(unit)) <= phones))
    classes = found.classes()
    assert len(set(classes.values())) == len(classes)
    assert set(classes.values()) == wanted - {whole, frozenset()}
    for name, units in classes.items():
        assert (name in found.units) == (len(units) == 1)
        assert len(units) > 1 or units == {name}


@settings(max_examples=20)
@given(
    units=st.lists(st.sampled_from(["a", "vowel", "stop", "x"]), min_size=len(SPOKEN), max_size=len(SPOKEN)),
    quiet=st.sampled_from([("sil", "sp"), ("silence", "silence")]),
)
def test_classes_of_any_table(units: list[str], quiet: tuple[str, str]) -> None:
    found = UnitSet("any", dict(zip((*SPOKEN, "sil", "sp"), (*units, *quiet), strict=True)))
    check_classes(found)
    assert found.silence == tuple(dict.fromkeys(quiet))


@named
def test_classes_hold_whole_units(name: str) -> None:
    check_classes(load_unit_set(name))


GOOD = table(dict(load_unit_set("eVis").unit_of_phone))
WRONG = {
    "a phone is missing": (GOOD.replace(" zh", ""), r"mine\.txt.*missing zh"),
    "a phone twice": (GOOD + "more zh\n", r"line 20: phone 'zh' has a unit in line 15"),
    "a phone twice in a line": (GOOD.replace("f v", "f v v"), r"line 11: phone 'v' has a unit in line 11"),
    "no phone of ours": (GOOD + "more xx\n", r"line 20: unknown phone 'xx'; the phones are: aa ae"),
    "a unit twice": (GOOD.replace("dental th dh", "dental th\ndental dh"), r"line 13: unit 'dental' stands in line 12"),
    "a unit without phones": ("empty\n" + GOOD, r"line 1: unit 'empty' without phones"),
    "silence beside speech": (GOOD.replace("silence sil sp\n", "").replace("f v", "f v sil sp"), "holds .*'closed'"),
    "a pause beside speech": (GOOD.replace("sil sp\n", "sil\n").replace("f v", "f v sp"), "holds .*'closed'"),
    "nothing": ("# nothing\n", "missing aa ae"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_table_is_refused(case: str, tmp_path: Path) -> None:
    text, message = WRONG[case]
    assert text != GOOD
    with pytest.raises(errors.InputError, match=message):
        load_unit_set(written(tmp_path, text))


def test_neither_a_name_nor_a_file(tmp_path: Path) -> None:
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00")
    for asked, message in (
        ("evis", r"'evis'; there are: 2vis, sVis, pbVis, eVis, phone"),
        ("x" * 300, "there are: 2vis"),
        (tmp_path, r"not a file|directory|folder"),
        (tmp_path / "binary", "UTF-8"),
    ):
        with pytest.raises(errors.InputError, match=message):
            load_unit_set(asked)


def test_a_unit_is_a_word() -> None:
    for unit in ("", "a b", " a", "a\n"):
        with pytest.raises(errors.InputError, match="not a word"):
            UnitSet("mine", {**load_unit_set("phone").unit_of_phone, "zh": unit})


def test_the_document_counts_the_units_of_every_set() -> None:
    rows = [line.strip("| ").split(" | ") for line in DOCUMENT.read_text(encoding="utf-8").splitlines()]
    head = [row for row in rows if row[0].strip("`") in PRINTED and len(row) == 4]
    assert [(r[0].strip("`"), int(r[1]), int(r[2]), r[3]) for r in head] == [
        (name, found.count, len(found.units), ", ".join(f"`{unit}`" for unit in found.silence))
        for name, found in UNIT_SETS.items()
    ]


def test_the_table_in_the_document_is_one(tmp_path: Path) -> None:
    example = DOCUMENT.read_text(encoding="utf-8").partition("```text\n")[2].partition("```")[0]
    found = load_unit_set(written(tmp_path, example))
    assert found.units == ("closed", "teeth", "rounded", "open")
    assert found.silence == ("closed",)


def test_what_is_spoken_has_the_unit_of_its_phone_or_else_its_own() -> None:
    units = UNIT_SETS["eVis"]
    assert units.unit_of(types.Unit("p", "sil-hidden+aa")) == "bilabial"
    assert units.unit_of(types.Unit("", "bilabial")) == "bilabial"
    for label in (types.Unit("", "MBP"), types.Unit("xx", "bilabial"), types.Unit("")):
        with pytest.raises(errors.InputError):
            units.unit_of(label)


def test_a_unit_alone_tells_its_phone_only_where_it_has_one() -> None:
    for name, unit, label in (
        ("eVis", "aw", types.Unit("aw", "aw")),
        ("eVis", "bilabial", types.Unit("", "bilabial")),
        ("eVis", "silence", types.Unit("sil", "silence")),
        ("2vis", "closed", types.Unit("", "closed")),
        ("phone", "sp", types.Unit("sp", "sp")),
    ):
        assert UNIT_SETS[name].label(unit) == label
