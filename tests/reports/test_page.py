"""The page in a browser."""

import re
import shutil
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pandas as pd
import pytest

from bench.names import PLAIN
from reports import write
from reports.claims import CLAIMS
from reports.exhibit import Exhibit
from reports.page import render
from reports.results import Results
from reports.seed_statistics import OVER_SEEDS
from reports.write import write_report
from tasks.data import generator

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


METHODS = ("expert", "kodex", "nn", "mine")
RATES = {"expert": 1.0, "kodex": 0.95, "nn": 0.9, "mine": 0.45}
NOTE = "The made-up protocol."


class Few(Results):
    """Results of methods on one task: two seeds each, whose second fails more often."""

    provenance = ({"host": HOSTILE[0], "versions": {}},)
    finished = ("2026-01-02", "2026-01-03", "2026-01-05")
    source = None
    """It has no fits."""
    experts = ("first",)

    def __init__(self, methods, notes=(NOTE,)):
        self.folder, self._notes = Path("my-study"), notes
        places = ({"split": split} for split in ("validation", "test", "ood"))
        same = {
            **{"task": "door", "variant": "described", "size": "single", "demos": 200},
            **{"held_out": 0, "pins": "p"},
            **PLAIN | {"controller_key": "", "demos_key": "k"},
            **{
                "config": {},
                "episodes": 200,
                "diverged": 0,
                "fit_seconds": 2.0,
                "action_seconds": 0.1,
            },
        }
        self.frame = pd.DataFrame(
            {**same, **place, "method": method, "seed": seed, "folder": f"{method}-{seed}"}
            | {"controller": "none" if method == "expert" else "original"}
            | {"successes": int(200 * RATES.get(method, 0.5))}
            for place in places
            for method in methods
            for seed in (1, 2)
        )

    @property
    def notes(self):
        return [*self._notes]

    def outcomes(self, row):
        rate = 20 * RATES.get(row["method"], 0.5) - (row["seed"] == 2)
        success = np.arange(row["episodes"]) % 20 < rate
        return pd.DataFrame({"success": success, "diverged": False})

    def readings(self, row):
        return None

    def controller_spec(self, key):
        return {"config": {"learning_rate": 1e-4, "epochs": 300}}

    def diagnostics(self, folder):
        eigenvalues = 0.7 * generator(folder).standard_normal((50, 2))
        return {
            "eigenvalues": eigenvalues,
            "imitation_error": np.ones(24),
            "singular_values": np.logspace(0, -17, 50),
            "rank": np.array(40),
        }


ROWS = [("kodex", "door", 90.0), ("nn", "door", 100.0), ("ngf", "door", 9.5)]


def page(folder, names=()):
    """Writes a page of one table, with methods, claims and sentences of these names."""
    rows = ROWS + [(name, "door", float(i)) for i, name in enumerate(names)]
    table = pd.DataFrame(rows, columns=["row", "column", "value"])
    table = table.assign(low=table.value, high=table.value, basis=OVER_SEEDS)
    results = Few([row for row, *_ in rows], notes=HOSTILE)
    exhibits = [
        Exhibit(name, f"{name}: a table", "About.", lambda results: table).with_remarks(results)
        for name in ("success", "shown", "absent")
    ]
    columns = ("claim", "says", "source", "paper", "ours", "evidence")
    claim = dict.fromkeys(columns, " ".join(names))
    tables = {"success": table, "shown": table}
    claims = pd.DataFrame([claim])
    path = folder / "index.html"
    path.write_text(
        render(
            results, tables, exhibits, claims, folder, folder, {name: name for name in names}, names
        )
    )
    return path


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The page of a whole report."""
    folder = tmp_path_factory.mktemp("report")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(write, "_DATED", {"svg": ("Date",)})
        made = write_report(Few(METHODS), folder)
    assert made.failed == {}
    return made.page


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
    """Opens a page and records its requests and errors."""

    def open_page(names=(), path=None, **options):
        context = browser.new_context(**options)
        view = context.new_page()
        view.asked, view.said = [], []
        view.on("request", lambda request: view.asked.append(request.url))
        view.on("console", lambda message: view.said.append(message.text))
        view.on("pageerror", lambda error: view.said.append(str(error)))
        view.goto((path or page(tmp_path, names)).as_uri())
        return view

    return open_page


def unfold(view):
    view.evaluate("document.querySelectorAll('details').forEach(one => one.open = true)")


def first_column(view):
    return view.locator("#shown tbody th").all_inner_texts()


def test_page_makes_no_requests_and_logs_no_errors(opened):
    view = opened()
    assert len(view.asked) == 1
    assert view.said == []


def test_film_can_be_played(opened, tmp_path):
    writer = imageio_ffmpeg.write_frames(str(tmp_path / "door-success.mp4"), (32, 32), fps=5)
    writer.send(None)
    for shade in (0, 120, 240):
        writer.send(np.full((32, 32, 3), shade, np.uint8))
    writer.close()
    view = opened()
    unfold(view)
    assert view.locator("#films figcaption").inner_text() == "Door: success"
    view.wait_for_function("document.querySelector('video').readyState > 0")
    assert view.said == []
    assert [url for url in view.asked if not url.startswith("data:")] == view.asked[:1]


def test_unfinished_film_is_omitted(tmp_path):
    (tmp_path / ".door-failure.mp4").touch()
    assert "data:video/mp4" not in page(tmp_path).read_text()


def test_tables_sort_by_number_and_by_name(opened):
    view = opened()
    unfold(view)
    assert first_column(view) == ["KODex", "NN", "NGF"]
    view.locator("#shown").get_by_role("button", name="Door").click()
    assert first_column(view) == ["NGF", "KODex", "NN"]
    view.locator("#shown").get_by_role("button", name="Door").press("Enter")
    assert first_column(view) == ["NN", "KODex", "NGF"]
    view.locator("#shown").get_by_role("button", name="name", exact=True).click()
    assert first_column(view) == ["KODex", "NGF", "NN"]


def test_theme_follows_the_system_and_can_be_switched(opened):
    view = opened(color_scheme="dark")
    assert view.locator("html").get_attribute("data-theme") == "dark"
    view.locator("#theme").click()
    assert view.locator("html").get_attribute("data-theme") == "light"


def test_hostile_names_and_notes_are_shown_as_text(opened):
    assert len(HOSTILE) == 60
    view = opened(names=HOSTILE)
    assert view.title() == "Imitation policies on a dexterous hand"
    assert view.said == []
    assert len(view.asked) == 1
    unfold(view)
    text = view.locator("main").inner_text()
    assert "<script>document.title='hit'</script>" in text
    assert "{{ 7 * 7 }}" in text


WIDTHS = pytest.mark.parametrize("width", [390, 1280])
WIDER = """() => [...document.querySelectorAll("body *")]
    .filter(one => !one.closest(".scroll *, svg *, pre *"))
    .filter(one => one.getBoundingClientRect().right > innerWidth)
    .map(one => one.outerHTML.slice(0, 80))"""


@WIDTHS
def test_page_fits_the_width_of_the_screen(opened, report, width):
    view = opened(path=report, viewport={"width": width, "height": 844})
    unfold(view)
    assert view.evaluate(WIDER) == []
    assert view.evaluate("document.documentElement.scrollWidth") <= width


@WIDTHS
def test_first_screen_shows_what_was_run_and_the_answer(opened, report, width):
    view = opened(path=report, viewport={"width": width, "height": 844})
    last = view.locator(".answer li").last
    box = last.bounding_box()
    assert box["y"] + box["height"] < 844
    seen = view.locator("main").inner_text()
    for fact in (NOTE, "my-study", "2026-01-02 to 2026-01-05", "KODex, NN, mine, Expert"):
        assert fact in seen
    assert last.inner_text().startswith("Door: KODex leads with 92.5%; NN is behind KODex by")


def test_headings_are_closed_and_a_link_opens_its_target(opened, report):
    view = opened(path=report)
    parts = view.locator("details.part")
    headings = ["Success", "Robustness", "Data and time", "KODex inside", "Audit", "Provenance"]
    assert parts.locator("h2").all_inner_texts() == headings
    provenance = view.locator("#provenance summary").inner_text()
    assert re.search(r"\d+ evaluations, [\d,]+ episodes", provenance)
    assert view.locator("details[open]").count() == 0
    assert not view.locator("#figure_5").is_visible()
    view.evaluate("location.hash = '#figure_5'")
    view.locator("#figure_5 svg").wait_for(state="visible")


def test_claims_not_run_are_folded_with_their_evidence(opened, report):
    view = opened(path=report)
    claims = view.locator(".claims li")
    assert claims.count() == len(CLAIMS)
    evidence = claims.first.locator("p")
    assert not claims.first.is_visible()
    view.get_by_text(f"{len(CLAIMS)} not run, because results are missing").click()
    assert not evidence.is_visible()
    claims.first.locator("summary").click()
    assert "no training time of NN Tool" in evidence.inner_text()
    assert "Name: kodex-trains-faster." in evidence.inner_text()


def test_decided_claim_has_a_line(opened):
    view = opened(names=["decided"])
    assert view.locator(".claims summary").is_visible()
    assert not view.locator(".claims p").is_visible()


def test_users_method_is_highlighted(opened, report):
    view = opened(path=report)
    back = "one => getComputedStyle(one).backgroundColor"
    shades = [row.evaluate(back) for row in view.locator("#seeds tbody tr").all()]
    *others, own = shades
    assert len(shades) == len(METHODS)
    assert set(others) == {"rgba(0, 0, 0, 0)"}
    assert own not in others


def test_success_table_has_a_dot_for_each_seed(opened, report):
    rows = opened(path=report).locator("#seeds tbody tr").all()
    assert [row.locator("circle").count() for row in rows] == [2, 2, 2, 2]


def test_figures_follow_the_theme(opened, report):
    def colours(scheme):
        view = opened(path=report, color_scheme=scheme)
        ink = view.locator("#success figure svg use").first.evaluate(
            "one => getComputedStyle(one).fill"
        )
        paper = view.locator("#success figure svg path").first.evaluate(
            "one => getComputedStyle(one).fill"
        )
        return ink, paper

    (ink, paper), (dark_ink, dark_paper) = colours("light"), colours("dark")
    assert len({ink, paper, dark_ink, dark_paper}) == 4
    assert dark_paper == "rgb(23, 24, 26)"


def test_failing_start_has_a_film_or_the_command_that_makes_it(opened, tmp_path):
    (tmp_path / "door-kodex-s1-start-19.mp4").touch()
    view = opened()
    rows = view.locator("#failures tbody tr")
    assert rows.first.locator("a").get_attribute("href") == "#film-door-kodex-s1-start-19"
    (tmp_path / "door-kodex-s1-start-19.mp4").unlink()
    view = opened()
    view.evaluate("document.querySelectorAll('details').forEach(one => one.open = true)")
    command = view.locator("#failures td code").first
    assert command.text_content() == (
        "bench video door --results my-study --methods kodex --seed 1 --start 19"
    )
    command.click()
    assert command.evaluate("one => String(getSelection())") == command.text_content()


def test_same_results_give_the_same_bytes(report, tmp_path, monkeypatch):
    monkeypatch.setattr(write, "_DATED", {"svg": ("Date",)})
    assert write_report(Few(METHODS), tmp_path).page.read_bytes() == report.read_bytes()


def test_missing_exhibits_are_listed(opened):
    assert "Not shown, because results are missing: absent: a table." in opened().content()
