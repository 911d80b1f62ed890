"""The page that `--report` writes, opened in a browser as its readers do.

It needs PREHEND_COMMAND, Playwright and Chromium; PREHEND_SCREENSHOTS names a folder for pictures of what was seen.
"""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

PHONE = {"width": 390, "height": 844}
DESKTOP = {"width": 1440, "height": 1000}


@pytest.fixture(scope="module")
def command():
    """Runs the command `prehend` in a folder of its own."""
    own = os.environ.get("PREHEND_COMMAND")
    if own is None:
        pytest.skip("PREHEND_COMMAND, the command prehend of the same build, is not set")

    def run(folder, words):
        subprocess.run([str(Path(own).resolve()), *words.split()], cwd=folder, check=True, capture_output=True)

    return run


@pytest.fixture(scope="module")
def folder(command, tmp_path_factory):
    """A page of each command, of a small dataset."""
    folder = tmp_path_factory.mktemp("reports")
    given = "--dataset ds --poses ds/init_low.csv"
    command(folder, "synth --out ds --objects 004_sugar_box,061_foam_brick --frames 4 --frames-per-grasp 2")
    command(folder, f"refine {given} --out refined.csv --report refine")
    command(folder, f"track {given} --out tracked.csv --report track")
    command(folder, f"study main {given.replace('--poses ', '--poses low=')} --methods depth --iterations 5 --out study.csv --report page")
    command(folder, f"calibrate {given} --passes 2 --out rig.json --report calibrate")
    return folder


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api")
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("Chromium is not installed")
    # Without a graphics card.
    options = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=chromium, args=options)
        yield browser
        browser.close()


@pytest.fixture
def opened(browser, folder):
    """Opens the page of a command; nothing may be fetched, and nothing go wrong."""
    contexts, faults = [], []

    def open_page(name, size=DESKTOP, colors="light"):
        context = browser.new_context(viewport=size, color_scheme=colors)
        contexts.append(context)
        page = context.new_page()
        file = (folder / name / "index.html").as_uri()
        page.on("request", lambda r: r.url.startswith(("data:", file)) or faults.append(f"fetched {r.url}"))
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("console", lambda said: faults.append(said.text) if said.type in ("error", "warning") else None)
        page.goto(file)
        page.wait_for_timeout(300)
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert not faults


def screenshot(page, name):
    if wanted := os.environ.get("PREHEND_SCREENSHOTS"):
        page.screenshot(path=Path(wanted) / f"{name}.png", full_page=True)


def column(page, number):
    return page.locator(f"#table tbody td:nth-child({number})").all_inner_texts()


def test_frames_are_sorted_and_filtered(opened):
    page = opened("refine")
    assert page.locator("#count").inner_text() == "8 rows"
    headings = page.locator("#table th").all_inner_texts()
    errors = 1 + next(k for k, text in enumerate(headings) if text.startswith("error mm"))
    unsorted = column(page, errors)
    heading = page.locator(f"#table th:nth-child({errors}) button")
    heading.click()
    assert column(page, errors) == sorted(unsorted, key=float) != unsorted
    page.locator(f"#table th:nth-child({errors}) button").click()
    assert column(page, errors) == sorted(unsorted, key=float, reverse=True)
    assert page.locator(f"#table th:nth-child({errors})").get_attribute("aria-sort") == "descending"
    middle = sorted(map(float, unsorted))[4]
    page.fill("#query", f"error<{middle}")
    assert all(float(error) < middle + 0.01 for error in column(page, errors))
    assert page.locator("#count").inner_text().endswith(" of 8 rows")
    page.fill("#query", "")
    # Words of a name: those of a scene, which has one object.
    page.fill("#query", column(page, 1)[0].partition(" image")[0])
    assert page.locator("#table tbody tr").count() == 4
    page.fill("#query", "no such frame")
    assert page.locator("#table tbody tr").count() == 0


def test_keys_choose_frames_and_flip_pictures(opened):
    page = opened("refine")
    detail = page.locator("#detail h2")
    first = detail.inner_text()
    page.keyboard.press("j")
    assert detail.inner_text() != first and page.url.endswith("#1")
    page.keyboard.press("ArrowUp")
    assert detail.inner_text() == first
    place = "document.querySelector('.slider').style.getPropertyValue('--at')"
    page.keyboard.press("b")
    assert page.evaluate(place) == "100%"
    page.keyboard.press("b")
    assert page.evaluate(place) == "0%"
    page.keyboard.press("/")
    page.keyboard.type("jjj")
    assert page.input_value("#query") == "jjj" and detail.inner_text() == first
    page.keyboard.press("Enter")
    page.keyboard.press("?")
    assert page.locator("#help").is_visible()


def test_hand_and_object_are_drawn_and_turned(opened):
    page = opened("refine")
    canvas = page.locator("canvas")

    def picture():
        page.wait_for_timeout(250)
        return canvas.screenshot()

    canvas.focus()
    whole = picture()
    assert len(whole) > 8000, "hardly anything is drawn"
    page.keyboard.press("ArrowLeft")
    turned = picture()
    assert turned != whole
    page.keyboard.press("0")
    assert picture() == whole
    seen = {whole, turned}
    for name in ["hand", "distance to the hand", "initial pose", "ellipsoid", "forces", "object"]:
        page.get_by_role("button", name=name, exact=True).click()
        page.mouse.move(0, 0)
        now = picture()
        assert now not in seen, f"{name}: nothing changed"
        seen.add(now)


def test_a_frame_shows_residuals_confidence_and_touch(opened):
    page = opened("refine")
    detail = page.locator("#detail")
    for text in ["Median residuals", "depth on the object", "touched skin", "probability of being right", "Touch", "3 σ"]:
        assert text in detail.inner_text(), text
    assert detail.locator(".patches circle").count() == 368
    screenshot(page, "refine")


@pytest.mark.parametrize(("name", "texts"), {
    "track": ["Tracked objects", "relocalized", "Probability of being right", "Error of position"],
    "page": ["Study: main", "depth", "means over 8 frames", "|ΔIV| cm³"],
    "calibrate": ["Rig", "Residuals by sensor", "depth scale", "outlines of object and hand"],
}.items())
def test_pages_of_other_commands(opened, name, texts):
    page = opened(name)
    for text in texts:
        assert text in page.inner_text("body"), text
    screenshot(page, name)


def test_dark_and_as_narrow_as_a_phone(opened):
    background = "getComputedStyle(document.body).backgroundColor"
    light, dark = opened("refine"), opened("refine", colors="dark")
    shades = [page.evaluate(background) for page in (light, dark)]
    assert shades[0] != shades[1]
    light.keyboard.press("t")
    assert light.evaluate(background) == shades[1]
    screenshot(dark, "dark")
    for name in ["refine", "track", "page", "calibrate"]:
        page = opened(name, PHONE)
        assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"], name
        screenshot(page, f"{name}-phone")


def test_pages_are_small(folder):
    # Hand and objects are in it once, 36 frames would have less than 10 MB.
    assert (folder / "refine" / "index.html").stat().st_size < 8 * 10e6 / 36 + 1.5e6
