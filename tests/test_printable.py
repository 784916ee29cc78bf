from lipmotion.printable import printable


def test_what_is_printable() -> None:
    for text in ("plain", "Ünïcödé 語 👩‍👧 ן ک‌ه", "\u00a0\u3000", "back\\slash"):
        assert printable(text) == text
    for code in (*range(0x20), *range(0x7F, 0xA0), 0xAD, 0x200E, 0x2028, 0x202E, 0x2066, 0xFEFF, 0xDC80, 0xE0041):
        assert printable(f"a{chr(code)}b") == "a" + chr(code).encode("unicode_escape").decode() + "b"
    assert printable(ValueError("two\nlines")) == r"two\nlines"
