"""The page as a browser shows it."""

import shutil

import imageio_ffmpeg
import numpy as np
import pandas as pd
import pytest

from reports.exhibit import Exhibit
from reports.page import render
from reports.results import Results

CHROMIUM = shutil.which("chromium")
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-sync"]
HOSTILE = [
    "<script>document.title='hit'</script>",
    "<img src=x onerror=\"document.title='hit'\">",
    "\"><svg onload=\"document.title='hit'\">",
    "javascript:document.title='hit'",
    "{{ 7 * 7 }}",
    "</table><style>*{display:none}</style>",
    "<a href=\"http://example.org/\">out</a>",
    "‮gnp.exe", "a\u0000b".replace("\u0000", " "), "&lt;b&gt;",
]  # fmt: skip
ESCAPES = ("", '">', "'>", "</td></table>", "</script></style></title>")
ELEMENTS = (
    *(
        "img src=x onerror",
        "svg onload",
        "body onload",
        "input autofocus onfocus",
        "marquee onstart",
    ),
    *("details open ontoggle", "video src=x onerror", "audio src=x onerror", "iframe onload"),
    "object data=x onerror",
)
HOSTILE += [
    f"{escape}<{element}=document.title='hit'>" for escape in ESCAPES for element in ELEMENTS
]


class Few(Results):
    frame = pd.DataFrame({"episodes": [20, 20], "folder": ["a", "b"]})
    notes = (*HOSTILE,)
    provenance = ({"host": HOSTILE[0], "versions": {}},)

    def __init__(self):
        pass


ROWS = [("kodex", "door", 90.0), ("nn", "door", 100.0), ("ngf", "door", 9.5)]


def page(folder, names=()):
    rows = ROWS + [(name, "door", float(i)) for i, name in enumerate(names)]
    table = pd.DataFrame(rows, columns=["row", "column", "value"])
    shown = Exhibit("shown", "Shown: a table", "About.", lambda results: table)
    absent = Exhibit("absent", "Absent: another", "About.", lambda results: table)
    path = folder / "index.html"
    claim = dict.fromkeys(("says", "source", "paper", "ours", "evidence"), " ".join(names))
    page = render(Few(), {"shown": table}, [shown, absent], pd.DataFrame([claim]), folder, folder)
    path.write_text(page)
    return path


@pytest.fixture(scope="module")
def browser():
    if CHROMIUM is None:
        pytest.skip("no chromium on this machine")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def opened(browser, tmp_path):
    """Opens a page; notes whatever it asks the network for or complains about."""

    def open_page(names=(), **options):
        context = browser.new_context(**options)
        view = context.new_page()
        view.asked, view.said = [], []
        view.on("request", lambda request: view.asked.append(request.url))
        view.on("console", lambda message: view.said.append(message.text))
        view.on("pageerror", lambda error: view.said.append(str(error)))
        view.goto(page(tmp_path, names).as_uri())
        return view

    return open_page


def first_column(view):
    return view.locator("#shown tbody th").all_inner_texts()


def test_it_asks_for_nothing_but_itself_and_complains_of_nothing(opened):
    view = opened()
    assert len(view.asked) == 1
    assert view.said == []


def test_a_film_can_be_played(opened, tmp_path):
    writer = imageio_ffmpeg.write_frames(str(tmp_path / "door-success.mp4"), (32, 32), fps=5)
    writer.send(None)
    for shade in (0, 120, 240):
        writer.send(np.full((32, 32, 3), shade, np.uint8))
    writer.close()
    view = opened()
    assert view.locator("#films figcaption").inner_text() == "Door: success"
    view.wait_for_function("document.querySelector('video').readyState > 0")
    assert view.said == []
    assert [url for url in view.asked if not url.startswith("data:")] == view.asked[:1]


def test_a_film_that_is_being_written_is_left_out(tmp_path):
    (tmp_path / ".door-failure.mp4").touch()
    assert "data:video/mp4" not in page(tmp_path).read_text()


def test_tables_sort_by_number_and_by_name(opened):
    view = opened()
    assert first_column(view) == ["KODex", "NN", "NGF"]
    view.get_by_role("button", name="Door").click()
    assert first_column(view) == ["NGF", "KODex", "NN"]
    view.get_by_role("button", name="Door").press("Enter")
    assert first_column(view) == ["NN", "KODex", "NGF"]
    view.get_by_role("button", name="name", exact=True).click()
    assert first_column(view) == ["KODex", "NGF", "NN"]


def test_the_theme_follows_the_system_and_switches(opened):
    view = opened(color_scheme="dark")
    assert view.locator("html").get_attribute("data-theme") == "dark"
    view.locator("#theme").click()
    assert view.locator("html").get_attribute("data-theme") == "light"


def test_hostile_names_and_notes_stay_text(opened):
    assert len(HOSTILE) == 60
    view = opened(names=HOSTILE)
    assert view.title() == "Imitation policies on a dexterous hand"
    assert view.said == []
    assert len(view.asked) == 1
    text = view.locator("main").inner_text()
    assert "<script>document.title='hit'</script>" in text
    assert "{{ 7 * 7 }}" in text


@pytest.mark.parametrize("width", [360, 1280])
def test_it_fits_phones_and_desks(opened, width):
    view = opened(viewport={"width": width, "height": 800})
    assert view.evaluate("document.documentElement.scrollWidth") <= width


def test_what_is_missing_is_named(opened):
    assert "Not shown, for want of results: Absent: another." in opened().content()
