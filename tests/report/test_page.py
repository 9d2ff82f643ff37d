import base64
import html.parser

from jaxrot.report.show.page import as_page

TEXT = (
    "# Title ‖R‖\n\nA **finding**.\n\n![What is seen](a.png)\n\n| method | ns |\n| :--- | ---: |\n| `foam` | **12** |\n"
)


class _Seen(html.parser.HTMLParser):
    """The tags of a page with their attributes, in order."""

    def __init__(self):
        super().__init__()
        self.tags = []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))


def seen(page):
    parser = _Seen()
    parser.feed(page)
    return parser.tags


def test_the_pictures_are_inside():
    page = as_page(TEXT, {"a.png": b"\x89PNG picture"})
    (image,) = [attributes for tag, attributes in seen(page) if tag == "img"]
    kind, _, data = image["src"].partition(",")
    assert kind == "data:image/png;base64"
    assert base64.b64decode(data) == b"\x89PNG picture"
    assert image["alt"] == "What is seen"


def test_nothing_is_fetched_from_elsewhere_and_tables_scroll():
    page = as_page(TEXT, {"a.png": b""})
    places = [value for _, attributes in seen(page) for name, value in attributes.items() if name in ("src", "href")]
    assert all(place.startswith("data:") for place in places)
    assert "<title>Title ‖R‖</title>" in page
    tags = [tag for tag, _ in seen(as_page(TEXT, {}))]
    assert tags.count("table") == tags.count("div") == 1
    assert tags.count("td") == tags.count("th") == 2
