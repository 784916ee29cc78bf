import pytest

from lipmotion.units import language_detection, text_normalisation

TEXTS = {
    "en": "bin blue at f two now", "es": "La sorpresa y el disgusto que produjo en los dos una noticia.",
    "fr": "Il est dans le jardin et la maison n'est pas à vous.",
    "de": "Die Katze ist nicht in der Küche, und das ist gut.", "it": "Il cane di Anna non è con gli altri.",
    "pt": "O menino não foi com os amigos para a praia, e é uma pena.",
    "nl": "De hond en het kind zijn niet in de tuin van oma.",
    "ja": "東京は 寒い。", "ko": "밥을 먹고", "zh": "今天天气很好",
    "": "привет мир 12",
}  # fmt: skip
ENGLISH = ["b l uw m", "k ax n f y uw z d", "w ih z axr d", "b ih hh ay n d", "k er t ax n", "l eh f t"]
SPANISH = ["l eh s ao f", "k ow s t ow", "k ax s ih t iy", "p er ao t ax", "ih s ax l m", "m ae n iy f"]


def test_of_a_text() -> None:
    for language, text in TEXTS.items():
        assert language_detection.detect_language(text_normalisation.split_written_words(text)) == language
    assert language_detection.detect_language(("mandrusa", "kolpeti", "vastrini")) == ""


@pytest.mark.long
def test_of_speech() -> None:
    english, spanish = ([tuple(word.split()) for word in words] for words in (ENGLISH, SPANISH))
    assert language_detection.is_english(2 * english) is True
    assert language_detection.is_english(2 * spanish) is False
    assert language_detection.is_english(2 * english + 3 * spanish) is None
    assert language_detection.is_english(english) is None  # too few


def test_words_are_as_they_are_written_in_every_script() -> None:
    for text, words in (
        ("L’homme, peut-être!", "l'homme peut être"),
        ("El 3 de mayo de 1984", "el 3 de mayo de 1984"),
        ("你好吗？12个", "你 好 吗 12 个"),
        ("こんにちは、ラーメン", "こんにちは ラーメン"),
        ("हिन्दी 'ok'", "हिन्दी ok"),
    ):
        assert " ".join(text_normalisation.split_written_words(text)) == words
