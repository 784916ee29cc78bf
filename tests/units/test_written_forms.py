import pytest

from lipmotion import load_model
from lipmotion.units import Lexicon, find_words, group_words, split_words, text_normalisation, written_forms
from pipeline.made import features_of, recogniser_of
from testing.formant_synthesiser import synthesise

USUAL = (
    ("1 000 000 of 12 345 678",
     "one million of twelve million three hundred forty five thousand six hundred seventy eight"),
    ("$1'000'000, 10\u202f000 km", "one million dollars ten thousand kilometers"),
    ("call 600 123 456", "call six hundred one hundred twenty three four hundred fifty six"),
    ("C++ or C#", "c plus plus or c sharp"), ("w/o you? w/o.", "without you without"),
    ("№ 5, №5", "number five number five"), ("10^3 or 10^2", "ten to the third or ten squared"),
    ("in 1995", "in nineteen ninety five"), ("1956", "nineteen fifty six"), ("1900", "nineteen hundred"),
    ("1905", "nineteen oh five"), ("2000", "two thousand"), ("2005", "two thousand five"), ("2010", "twenty ten"),
    ("1066", "ten sixty six"), ("the 1990s", "the nineteen nineties"), ("the '80s", "the eighties"),
    ("the 1900s", "the nineteen hundreds"), ("in her 30s", "in her thirties"), ("5:00", "five o'clock"),
    ("5:00 p.m.", "five p m"), ("5:30pm", "five thirty p m"), ("7:05", "seven oh five"), ("12:00", "twelve o'clock"),
    ("17:00", "seventeen hundred"), ("0:15", "zero fifteen"), ("6:45", "six forty five"),
    ("9am-5pm", "nine a m to five p m"), ("5:00-6:30", "five o'clock to six thirty"),
    ("1:30:05", "one thirty oh five"), ("16:9", "sixteen to nine"), ("555-1234", "five five five one two three four"),
    ("(555) 123-4567", "five five five one two three four five six seven"),
    ("1-800-555-1234", "one eight zero zero five five five one two three four"),
    ("+44 20 7946 0958", "plus four four two zero seven nine four six zero nine five eight"),
    ("555.123.4567", "five five five one two three four five six seven"), ("call 911", "call nine one one"),
    ("9-5", "nine to five"), ("10–12 people", "ten to twelve people"),
    ("1939-45", "nineteen thirty nine to forty five"), ("5-10%", "five to ten percent"),
    ("won 3-0", "won three to zero"), ("20-20", "twenty twenty"), ("$20M", "twenty million dollars"),
    ("$1.5k", "one point five thousand dollars"), ("$2bn", "two billion dollars"),
    ("$3 million", "three million dollars"), ("$5.50", "five dollars and fifty cents"), ("$1", "one dollar"),
    ("$1.01", "one dollar and one cent"), ("$0.99", "ninety nine cents"), ("£5", "five pounds"),
    ("€2.50", "two euros and fifty cents"), ("5€", "five euros"), ("99¢", "ninety nine cents"),
    ("¥500", "five hundred yen"), ("$5-10", "five to ten dollars"),
    ("$1,234.05", "one thousand two hundred thirty four dollars and five cents"), ("US$5", "five dollars"),
    ("0", "zero"), ("101", "one hundred one"), ("2,000", "two thousand"),
    ("1,234", "one thousand two hundred thirty four"), ("12345", "twelve thousand three hundred forty five"),
    ("007", "zero zero seven"), ("1000000", "one million"), ("20%", "twenty percent"),
    ("0.5%", "zero point five percent"), ("100%", "one hundred percent"), ("3.5", "three point five"),
    ("0.5", "zero point five"), (".5", "point five"), ("3.14", "three point one four"), ("v2.0", "v two point zero"),
    ("1.2.3", "one point two point three"),
    ("192.168.0.1", "one hundred ninety two dot one hundred sixty eight dot zero dot one"),
    ("1st 2nd 3rd", "first second third"), ("the 21ST", "the twenty first"), ("1/2", "one half"),
    ("3/4", "three quarters"), ("2/3", "two thirds"), ("2 1/2", "two and a half"), ("2½ cups", "two and a half cups"),
    ("½", "one half"), ("24/7", "twenty four seven"), ("9/11", "nine eleven"), ("8/10", "eight out of ten"),
    ("50/50", "fifty fifty"), ("10 km", "ten kilometers"), ("5km", "five kilometers"), ("1 km", "one kilometer"),
    ("a 10-km run", "a ten kilometer run"), ("60 mph", "sixty miles per hour"), ("6 ft", "six feet"),
    ("5'10\"", "five ten"), ("16GB", "sixteen gigabytes"), ("5 lbs", "five pounds"),
    ("20°C", "twenty degrees celsius"), ("-5°C", "minus five degrees celsius"),
    ("70°F", "seventy degrees fahrenheit"), ("98.6°", "ninety eight point six degrees"),
    ("5m²", "five meters squared"), ("10k", "ten k"), ("4K", "four k"), ("5M", "five million"), ("3D", "three d"),
    ("5G", "five g"), ("B2B", "b two b"), ("2021-05-03", "may third twenty twenty one"),
    ("3/4/2021", "march fourth twenty twenty one"), ("31/12/2021", "the thirty first of december twenty twenty one"),
    ("May 5th", "may fifth"), ("May 5, 1995", "may fifth nineteen ninety five"), ("5 May", "the fifth of may"),
    ("Dec. 25", "december twenty fifth"), ("Henry VIII", "henry the eighth"), ("World War II", "world war two"),
    ("World War I", "world war one"), ("Chapter IV", "chapter four"), ("Malcolm X", "malcolm x"),
    ("Rocky V", "rocky five"), ("I am", "i am"), ("Dr. Brown", "doctor brown"),
    ("Mr. Smith and Mrs. Jones", "mister smith and missus jones"), ("St. Mary", "saint mary"),
    ("Main St.", "main street"), ("cats vs. dogs", "cats versus dogs"), ("pens, etc.", "pens et cetera"),
    ("e.g. this", "for example this"), ("i.e. that", "that is that"), ("Prof. Lee", "professor lee"),
    ("No. 5", "number five"), ("I said no.", "i said no"), ("Sammy Davis Jr.", "sammy davis junior"),
    ("U.S.A.", "u s a"), ("5 p.m.", "five p m"), ("the FBI", "the fbi"), ("the XKCD", "the x k c d"),
    ("GPUs", "g p u s"), ("NASA", "nasa"), ("IT'S", "it's"), ("HELLO XKCD", "hello xkcd"), ("3x", "three times"),
    ("2x4", "two by four"), ("#1", "number one"), ("#tag", "hashtag tag"), ("you & me", "you and me"),
    ("AT&T", "a t and t"), ("a + b", "a plus b"), ("2 = 2", "two equals two"), ("w/ milk", "with milk"),
    ("w/o milk", "without milk"), ("and/or", "and or"), ("~5", "about five"), ("me@home.com", "me at home dot com"),
    ("www.example.com/faq", "w w w dot example dot com slash faq"), ("https://example.org", "example dot org"),
    ("can´t", "can't"), ("can`t", "can't"), ("canʼt", "can't"), ("can′t", "can't"), ("can’t", "can't"),
    ("exam\u00adple", "example"), ("exam\u00ad\nple", "example"), ("zero\u200bwidth", "zerowidth"),
    ("a\u00a0b", "a b"), ("x\u2011ray", "x ray"), ("ﬁne", "fine"), ("ＯＫ１", "ok one"), ("b-b-but", "but"),
    ("w-w-what", "what"), ("I-I", "i i"), ("D-Day", "d day"), ("so-so", "so so"), ("re-read", "re read"),
    ("T-shirt", "t shirt"), ("I <3 you :) xD", "i you"), ("hi 🙂 there", "hi there"), ("one™", "one"),
    ("x²", "x squared"), ("&amp; so", "and so"), ("H2O", "h two o"), ("F-16", "f sixteen"), ("−3", "minus three"),
    ("minus 5", "minus five"), ("an MP3, C4 and Ⅷ", "an m p three c four and viii"),
    ("you may, 5 of you, march 3 miles", "you may five of you march three miles"),
    ("2.5 kg, 1.000 m, 12,34", "two point five kilograms one point zero zero zero meters twelve thirty four"),
    ("Pages 3–7; 1995–2003", "pages three to seven nineteen ninety five to two thousand three"),
    ("$3 bn or $2m", "three billion dollars or two million dollars"), ("1h 20m", "one hour twenty minutes"),
    ("2h05, 2 min 30 s", "two hours five minutes two minutes thirty seconds"), ("100µs", "one hundred microseconds"),
    ("1GB/s", "one gigabyte per second"), ("USD 20 or 20 EUR", "twenty dollars or twenty euros"),
    ("the USDA", "the usda"), ("5%-10%", "five percent to ten percent"), ("$5-$10", "five dollars to ten dollars"),
    ("18th–19th", "eighteenth to nineteenth"), ("in '05", "in oh five"), ("±5", "plus or minus five"),
    ("WWII", "world war two"), ("3×10⁵ of 2³⁰", "three times ten to the fifth of two to the thirtieth"),
    ("hello¹ you,²³", "hello you"), ("m̄a n̈o", "ma no"), ("3,50 €", "three point five zero euros"),
    ("€1.234,56", "one thousand two hundred thirty four euros and fifty six cents"),
    ("1,5 km, 2,5%", "one point five kilometers two point five percent"), ("1.000.000", "one million"),
    ("$-5, A$5, CA$20", "minus five dollars five dollars twenty dollars"), ("y ≥ 3", "y at least three"),
    ("Fig. 3, vol. 2, pp. 10-12", "figure three volume two pages ten to twelve"), ("Ph.D., Mon.", "p h d monday"),
    ("Super Bowl LVIII", "super bowl fifty eight"), ("2021/03/04", "march fourth twenty twenty one"),
    ("CO₂", "c o two"), ("0800 123 4567", "zero eight zero zero one two three four five six seven"),
    ("9 a.m.–5 p.m.", "nine a m to five p m"),
)  # fmt: skip
"""What is said of a form where nothing else is known."""
SAID = (
    ("1995", "one thousand nine hundred ninety five"), ("1995", "one nine nine five"), ("2005", "twenty oh five"),
    ("5:00", "five"), ("5:00", "five hundred hours"), ("7:05", "five past seven"), ("6:45", "quarter to seven"),
    ("17:00", "five o'clock"), ("555-1234", "five five five twelve thirty four"), ("9-5", "nine five"),
    ("$20M", "twenty million"), ("$1.5k", "one point five k"), ("$1.5k", "fifteen hundred dollars"),
    ("$1.5k", "one thousand five hundred dollars"), ("$5.50", "five fifty"), ("0", "oh"), ("101", "one oh one"),
    ("101", "one hundred and one"), ("2,000", "two thousand"), ("1/2", "half"), ("3/4", "three out of four"),
    ("3.5", "three and a half"), ("3x", "three x"), ("007", "double oh seven"), ("St.", "saint"), ("05", "oh five"),
    ("Dr.", "drive"),
    ("Henry VIII", "henry eight"), ("2021-05-03", "the third of may twenty twenty one"), ("b-b-but", "but"),
    ("noooo", "no"), ("boooom", "boom"), ("hahaha", "ha ha ha"),
)  # fmt: skip
"""What else is said of a form."""


@pytest.mark.parametrize(("text", "words"), USUAL)
def test_the_usual_reading(text: str, words: str) -> None:
    assert " ".join(find_words(text)) == words


def test_a_form_has_few_readings_and_a_word_has_one() -> None:
    assert written_forms.list_readings("boat") == (("boat",),)
    for text, _ in USUAL:
        for token in text_normalisation.tokenise(text):
            found = written_forms.list_readings(token)
            assert 1 <= len(found) == len(set(found)) <= written_forms.MAX_READINGS
            assert all(word == word.lower() and not any(map(str.isdecimal, word)) for said in found for word in said)


@pytest.mark.parametrize(("text", "said"), SAID)
def test_what_else_may_be_said_is_a_reading(text: str, said: str) -> None:
    (token,) = text_normalisation.tokenise(text)
    forms = Lexicon().spoken_forms(token)
    phones = [phone for word in said.split() for phone in Lexicon().pronunciations(word)[0]]
    assert phones in [[phone for phone, word in form if word] for form in forms]
    assert {word for form in forms for _, word in form if word} >= set(said.split())
    assert Lexicon().known(token)


@pytest.mark.long
def test_the_sound_chooses_the_reading() -> None:
    lexicon, recogniser = Lexicon(), recogniser_of(load_model(), "general")
    wrong = []
    for text, said in SAID:
        words = ("mother", "saw", *split_words(said), "to", "baby")
        phones = [phone for word in words for phone in lexicon.pronunciations(word)[0]]
        audio, _ = synthesise(
            [("sil", 0.2), *((phone, 0.09) for phone in phones), ("sil", 0.2)], rate_hz=16_000, seed=1
        )
        given = ("mother", "saw", *text_normalisation.tokenise(text), "to", "baby")
        units = recogniser.align(audio, features_of(audio), given, lexicon)
        found = tuple(span.label for span in group_words(units) if span.label)
        wrong += [(text, found)] if found != words else []
    assert not wrong


def test_a_user_s_word_goes_before_readings() -> None:
    own = Lexicon({"xkcd": (("z", "iy"),), "noooo": (("n", "ow", "w"),), "1995": (("b", "iy"),)})
    assert own.pronunciations("XKCD") == (("z", "iy"),)
    assert own.pronunciations("noooo") == (("n", "ow", "w"),)
    assert own.pronunciations("1995") == (("b", "iy"),)
