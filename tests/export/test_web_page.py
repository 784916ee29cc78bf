import re
from xml.etree import ElementTree

import pytest

from lipmotion.formats.web_page import SHARED_COLOURS, Html, colour_code, element, joined, whole_page


def test_every_text_is_escaped_and_html_is_not():
    made = element("p", "<b>&\u202e", element("b", "bold"), title='"quoted"')
    assert made == '<p title="&quot;quoted&quot;">&lt;b&gt;&amp;\\u202e<b>bold</b></p>'
    assert joined("a < b", Html("<br>")) == "a &lt; b<br>"


def test_attributes_are_named_as_in_html():
    made = element("video", class_="shown", aria_label="a", controls=True, hidden=False, poster=None)
    assert made == '<video class="shown" aria-label="a" controls></video>'
    assert element("img", src="a.png") == '<img src="a.png">'


@pytest.mark.parametrize("name", ["b onclick=x", "", "1", "a>"])
def test_what_is_no_name_is_refused(name):
    with pytest.raises(ValueError, match="is no name of an element or an attribute"):
        element(name)
    with pytest.raises(ValueError, match="is no name of an element or an attribute"):
        element("p", **{name: "x"})


def test_a_page_loads_nothing_from_elsewhere():
    page = whole_page("</title><script>", f"{SHARED_COLOURS} p {{ color: red; }}", element("p", "text"))
    assert "<title>&lt;/title&gt;&lt;script&gt;</title>" in page
    assert "default-src &#x27;none&#x27;" in page
    assert "script-src" not in page
    assert "script-src" in whole_page("a", "", script="1;")
    assert not re.search("https?:|//", page)
    body = page[page.index("<body>") : page.index("</body>") + len("</body>")]
    assert ElementTree.fromstring(body).find("p").text == "text"  # noqa: S314 (our own)


def test_all_pages_have_the_same_colours():
    light, dark = colour_code(SHARED_COLOURS).split("prefers-color-scheme: dark")
    assert set(re.findall(r"--[\w-]+(?=:)", light)) == set(re.findall(r"--[\w-]+(?=:)", dark))
