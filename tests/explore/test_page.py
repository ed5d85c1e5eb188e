"""The page in a real browser: controls, no console errors, no requests to other hosts, accessibility.

Needs Chromium, which is no package of Python's; skips where there is none.
"""

import os
import shutil
import threading
import time
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from polarsim.explore.corrections import Corrections
from polarsim.explore.server import server
from polarsim.explore.site import page_of_run
from polarsim.formats.tables import write_parquet
from polarsim.formats.yaml_files import read_yaml
from polarsim.labels.seeds import read_corrections
from polarsim.photo import PhotoKey
from polarsim.run_files.run import Run
from polarsim.site import polar
from tests.support.polar_photos import HEIGHT

from .made_run import KEYS, MODELS, SEED, boxes_of

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = [
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",  # quicker without a GPU; WebGL stays
]
VIEWPORT = {"width": 1300, "height": 800}
LOCAL = ("http://127.0.0.1:", "blob:", "data:", "about:")
VIEWS = ("photos", "compare", "terrain", "detectors", "rover", "correct")
MARKS = {"boxes": ".box", "masks": ".mask", "ids": "text", "lines": ".link"}
playwright = pytest.importorskip("playwright.sync_api", reason="needs Playwright: pip install polarsim[dev]")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium"),
]


def is_wrong(message) -> bool:
    """Return whether a console message is an error or warning, except for the performance of a software GPU."""
    return message.type in ("error", "warning") and "GL Driver Message" not in message.text


@contextmanager
def served(run: Path, *, saves: bool = True):
    opened = Run.at(run)
    with server(page_of_run(opened, 484), corrections=Corrections(opened) if saves else None) as running:
        thread = threading.Thread(target=running.serve_forever, daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{running.server_address[1]}/"
        running.shutdown()
        thread.join()


@pytest.fixture(scope="module")
def address(copied):
    with served(copied) as found:
        yield found


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as running:
        chromium = running.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield chromium
        chromium.close()


@pytest.fixture(scope="module")
def opened(browser):
    """Open an empty page; return the page and a list of console errors, failed requests and other hosts."""
    context = browser.new_context(viewport=VIEWPORT, accept_downloads=True)
    context.set_default_timeout(60_000)
    page, wrong = context.new_page(), []
    page.on("console", lambda message: wrong.append(message.text) if is_wrong(message) else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda asked: None if asked.url.startswith(LOCAL) else wrong.append(asked.url))
    page.on("response", lambda answer: wrong.append(f"{answer.status} {answer.url}") if answer.status >= 400 else None)
    yield page, wrong
    context.close()


@pytest.fixture
def page(opened):
    """Return the page; after the test, check for errors and requests to other hosts."""
    page, wrong = opened
    page.set_viewport_size(VIEWPORT)
    wrong.clear()  # errors of an earlier test
    yield page
    page.goto("about:blank")  # ends requests before the server ends
    assert wrong == []


def shown(page, address: str, state: str = ""):
    page.goto("about:blank")
    page.goto(f"{address}#{state}")
    page.wait_for_selector("body[data-ready=yes]")
    return page


def until(page, true: str | Callable[[], bool]) -> None:
    """Wait for an expression of the page or a Python call to be true; wait_for_function violates the page's policy."""
    ends = time.monotonic() + 60  # a loaded machine draws slowly
    while not (page.evaluate(true) if isinstance(true, str) else true()):
        assert time.monotonic() < ends, true
        page.wait_for_timeout(30)


def compared(page, state: str, key: PhotoKey = SEED):
    """Wait until both images of a key are displayed."""
    page.wait_for_selector(f"[data-drawn='{key} {state}']")


def pixels(page, canvas: int) -> np.ndarray:
    """Return the pixels (h, w, 4) of a canvas of the comparison, reduced to an eighth."""
    script = """number => { const one = document.querySelectorAll('#compare canvas')[number];
        const [w, h] = [one.width >> 3, one.height >> 3];
        const pen = new OffscreenCanvas(w, h).getContext('2d', { willReadFrequently: true });
        pen.imageSmoothingEnabled = false;
        pen.drawImage(one, 0, 0, w, h);
        return [w, h, ...pen.getImageData(0, 0, w, h).data]; }"""
    width, height, *values = page.evaluate(script, canvas)
    return np.array(values).reshape(height, width, 4)


def address_of(page) -> dict[str, str]:
    return dict(
        part.split("=", 1) for part in page.evaluate("decodeURIComponent(location.hash).slice(1)").split("&") if part
    )


def test_the_comparison_starts_with_the_most_similar_twin(page, made, tmp_path):
    run = shutil.copytree(made, tmp_path / "similar", copy_function=os.link)
    table = run / "evaluation/appearance_Terrain03.parquet"
    scores = pd.read_parquet(table)
    best = (scores["key"] == str(KEYS[20])) & (scores["model"] == "principled")
    table.unlink()  # a link to the file of the other tests
    write_parquet(table, scores.assign(ssim=np.where(best, 0.8, scores["ssim"])))
    with served(run) as address:
        shown(page, address, "view=compare&f.domain=photo")
        compared(page, "photo principled", KEYS[20])
        shown(page, address, f"view=compare&f.camera={'L' if KEYS[20].camera == 'R' else 'R'}")
        page.wait_for_selector("[data-drawn$='photo hapke']")
        page.goto("about:blank")


def test_views_of_an_image_start_with_the_first_image_of_equal_similarity(page, address):
    for view in ("compare", "correct"):
        shown(page, address, f"view={view}&f.camera=R")
        until(page, lambda: address_of(page).get("key") == min(str(key) for key in KEYS if key.camera == "R"))
    shown(page, address, "view=compare&f.camera=R&f.position=C")
    assert page.locator("#compare .empty").is_visible()
    assert not page.locator("#compare .stage").is_visible()


def test_short_exposures_are_brightened(page, address):
    shown(page, address, "f.domain=hapke&f.camera=L&f.light=off&f.azimuth=30")
    gain = {}
    for exposure in ("0064", "1024"):
        picture = page.locator(f"[data-key='03_A_off_30_L_{exposure}'] img")
        until(page, lambda picture=picture: picture.evaluate("one => one.style.filter"))
        gain[exposure] = float(picture.evaluate("one => one.style.filter").removeprefix("brightness(")[:-1])
    assert gain["1024"] == 1
    assert gain["0064"] > 1.3


def test_filters_select_images(page, address):
    shown(page, address)
    count = page.locator("#count")
    assert count.inner_text() == f"{3 * len(KEYS)} of {3 * len(KEYS)} images"
    assert page.locator(".tile").count() < 60  # visible tiles and a margin
    wanted = {"camera": "L", "light": "on", "azimuth": "30", "domain": "hapke"}
    for field, value in wanted.items():
        page.locator(f"input[name={field}][value='{value}']").check()
    assert count.inner_text().startswith("3 of")
    until(page, "document.querySelectorAll('.tile').length === 3")
    assert page.locator(".tile").first.get_attribute("data-key") == "03_A_on_30_L_0064"
    until(page, lambda: address_of(page).get("f.light") == "on")
    page.locator("#reset").click()
    page.locator("input[name=score-maximum]").fill("0.7")
    page.locator("input[name=score-maximum]").press("Enter")
    right = sum(key.camera == "R" for key in KEYS)
    assert count.inner_text().startswith(f"{right + 2 * len(KEYS)} of")  # photos of 0.6, and all twins with 0.5
    page.locator("#reset").click()
    page.locator("input[name=defect][value=dark]").check()
    assert count.inner_text().startswith("1 of")
    page.locator("#reset").click()
    page.locator("input[name=confidence-minimum]").fill("0.9")
    page.locator("input[name=confidence-minimum]").press("Enter")
    assert count.inner_text().startswith("0 of")
    page.locator("#reset-empty").click()
    assert count.inner_text().startswith(f"{3 * len(KEYS)} of")
    page.get_by_label("sort by").select_option("score")
    until(page, "document.querySelector('.tile small').textContent.startsWith('hapke, SSIM 0.50')")
    page.get_by_role("button", name="descending").click()
    until(page, "document.querySelector('.tile small').textContent.startsWith('photo, IoU 0.90')")


def test_the_values_of_a_tile_are_visible_below_a_long_key(page, address):
    shown(page, address)
    page.evaluate("document.querySelector('.tile span').textContent = 'north-yard-a_south-gate_off_135_L_00040'")
    tile, values = (page.locator(name).first.bounding_box() for name in (".tile", ".tile small"))
    assert values["y"] + values["height"] <= tile["y"] + tile["height"]


def test_a_tile_opens_the_comparison_and_the_slider_divides_it(page, address):
    shown(page, address, "f.domain=photo")
    page.locator(f"[data-key='{KEYS[1]}']").click()
    compared(page, "photo hapke", KEYS[1])
    page.get_by_label("divider").fill("20")
    assert "80%" in page.locator("#compare canvas").nth(1).evaluate("one => one.style.clipPath")
    until(page, lambda: address_of(page).get("split") == "20")


def test_any_two_images_can_be_compared(page, address):
    shown(page, address, f"view=compare&key={SEED}&left=principled")
    for side in ("photo", *MODELS, "difference", "olat"):
        page.get_by_label("right", exact=True).select_option(side)
        compared(page, f"principled {side}")
        red, green, blue = pixels(page, 0)[5, 12, :3]
        if side == "difference":  # the principled twin is brighter than the photo by 1.2
            assert red > blue + 40  # orange
        else:
            assert red == green == blue > 20


def test_the_olat_sum_of_the_lamps_of_a_photo_is_its_twin(page, address):
    key = PhotoKey.parse("03_A_off_30_L_0064")
    shown(page, address, f"view=compare&key={key}&left=hapke&right=olat&auto=0")
    compared(page, "hapke olat", key)
    np.testing.assert_allclose(pixels(page, 0)[..., 0], pixels(page, 1)[..., 0], atol=2)
    page.get_by_label("lamp 180").fill("3")
    until(page, lambda: address_of(page).get("lamps") == "1,3,0,0,0")
    twin = pixels(page, 1)[1, 1, 0]
    until(page, lambda: pixels(page, 0)[1, 1, 0] == pytest.approx(twin * 4 ** (1 / 2.2), abs=3))


def test_the_exposure_slider_selects_photos_of_the_bracket(page, address):
    shown(page, address, f"view=compare&key={SEED}&auto=0")
    compared(page, "photo hapke")
    before = pixels(page, 1)[1, 1, 0]
    page.get_by_label("exposure").fill("0")
    compared(page, "photo hapke", SEED.with_exposure(64))
    assert pixels(page, 1)[1, 1, 0] == pytest.approx(before / 4 ** (1 / 2.2), abs=3)
    page.get_by_label("brightness").fill("2")  # two stops make up for a quarter of the time
    until(page, lambda: pixels(page, 1)[1, 1, 0] == pytest.approx(before, abs=5))
    page.locator("#key").click()
    page.keyboard.press("ArrowUp")
    compared(page, "photo hapke", SEED)
    page.get_by_role("button", name="auto", exact=True).click()
    until(page, lambda: "auto" not in address_of(page))


def test_marks_are_switched_by_buttons_and_keys(page, address):
    shown(page, address, f"view=compare&key={SEED}&show=")
    compared(page, "photo hapke")
    drawing = page.get_by_role("img", name="labels")
    for name, selector in MARKS.items():
        assert drawing.locator(selector).count() == 0
        page.get_by_role("button", name=name, exact=True).click()
        until(page, f"document.querySelectorAll('#compare svg {selector}').length > 0")
    assert drawing.locator(".box.rock").count() == 2
    assert drawing.locator(".doubtful").count() == 2  # rock 2 and its shadow
    page.locator("#key").click()
    page.keyboard.press("b")
    until(page, "document.querySelectorAll('#compare svg .box').length === 0")
    page.get_by_label("labels of").select_option("twins")
    until(page, lambda: address_of(page).get("labels") == "twins")


def test_predictions_are_drawn_where_the_detector_was_tested(page, address):
    shown(page, address, f"view=compare&key={KEYS[0]}&show=p&detector=photo/seed0/analog_on_analog")
    until(page, "document.querySelectorAll('#compare svg .seen').length === 3")
    assert page.locator("#compare svg .seen.false").count() == 1
    until(page, "document.querySelector('#prediction-count').textContent === '3 predictions'")
    page.get_by_label("confidence", exact=True).fill("0.7")
    until(page, "document.querySelector('#prediction-count').textContent === '2 predictions'")
    shown(page, address, f"view=compare&key={KEYS[-1]}&show=b")
    page.get_by_label("detector", exact=True).select_option("photo/seed0/analog_on_analog")
    until(page, "document.querySelector('#prediction-count').textContent.includes('not tested')")


def test_a_rock_is_found_in_photos_tables_and_3d(page, address):
    shown(page, address, f"view=compare&key={SEED}")
    page.locator("#compare svg .box.rock[data-rock='1']").click()
    panel = page.locator("#rock")
    panel.locator("h2", has_text="Rock 1 of terrain 3").wait_for()
    assert "size_m" in panel.inner_text()
    assert panel.locator(".crop").count() == len({key.bracket for key in KEYS})
    panel.locator("#rock-photos").click()
    until(page, "document.querySelector('#count').textContent.includes('with rock 1')")
    panel.get_by_role("button", name="in 3-D").click()
    page.wait_for_selector("#scene[data-drawn]")
    until(page, lambda: address_of(page).get("rock") == "3.1")
    page.locator("#terrain").click(position={"x": 5, "y": 300})
    page.keyboard.press("n")
    page.keyboard.press("Escape")
    panel.wait_for(state="hidden")


def test_the_terrain_is_drawn_in_every_colour(page, address):
    page.set_viewport_size({"width": 900, "height": 500})
    shown(page, address, "view=terrain")
    script = """() => { const scene = document.querySelector('#scene'), gl = scene.getContext('webgl2');
        const found = new Set();
        const data = new Uint8Array(4 * scene.width * scene.height);
        gl.readPixels(0, 0, scene.width, scene.height, gl.RGBA, gl.UNSIGNED_BYTE, data);
        for (let k = 0; k < data.length; k += 4) found.add((data[k] << 16) | (data[k + 1] << 8) | data[k + 2]);
        return [...found].sort(); }"""
    seen = set()
    for colour in ("lit", "id", "error_mm", "support"):
        page.get_by_label("colour").select_option(colour)
        page.wait_for_selector(f"#scene[data-drawn^='3 {colour}']")
        ids = {name for name in page.locator("#terrain .name").all_inner_texts() if name.isdigit()}
        assert ids == ({"1", "2"} if colour == "id" else set())
        shades = page.evaluate(script)
        assert len(shades) > 20  # shades of waves, not one flat colour
        seen.add(tuple(shades))
    assert len(seen) == 4
    names = page.locator("#terrain .name").all_inner_texts()
    assert "camera A" in names
    assert any(name.startswith("Sun lamp") for name in names)


def test_a_click_in_3d_selects_the_rock(page, address):
    page.set_viewport_size({"width": 900, "height": 500})
    shown(page, address, "view=terrain&orbit=-1.571,1.55,3,0.5,0.4,0.05")
    page.wait_for_selector("#scene[data-drawn]")
    scene = page.locator("#scene").bounding_box()
    page.mouse.click(scene["x"] + scene["width"] / 2, scene["y"] + scene["height"] / 2)
    page.locator("#rock h2", has_text="Rock 1").wait_for()
    page.mouse.move(scene["x"] + 300, scene["y"] + 300)
    page.mouse.down()
    page.mouse.move(scene["x"] + 380, scene["y"] + 330, steps=3)
    page.mouse.up()
    page.mouse.wheel(0, 200)
    page.locator("#scene").focus()
    page.keyboard.press("ArrowLeft")
    until(
        page, lambda: float(address_of(page)["orbit"].split(",")[0]) == pytest.approx(-1.571 - 80 / 200 + 0.1, abs=0.02)
    )
    assert float(address_of(page)["orbit"].split(",")[2]) > 3.3
    page.get_by_label("look through").select_option("AL")
    until(page, lambda: address_of(page).get("camera") == "AL")
    until(page, "document.querySelectorAll('#terrain .name').length === 0")  # cameras and lamps hide the view
    page.get_by_role("button", name="from above").click()


def test_false_positives_are_listed_by_confidence(page, address):
    shown(page, address, "view=detectors")
    until(page, "document.querySelectorAll('#detectors .crop').length === 6")
    counts = page.locator("#counts").inner_text()
    assert "18 predictions" in counts  # six photos; confidences 0.9, 0.8, 0.6
    assert "6 correct" in counts
    assert "6 of 12 labels missed" in counts
    page.get_by_label("confidence", exact=True).fill("0.85")
    until(page, "document.querySelector('#detectors .list').textContent.includes('No false positive')")
    assert "precision 1.000" in page.locator("#counts").inner_text()
    page.get_by_label("confidence", exact=True).fill("0.3")
    page.locator("#detectors .crop").first.click()
    page.wait_for_selector("#compare svg .seen.false")


def test_a_drive_is_on_the_map_with_its_frames(page, address):
    shown(page, address, "view=rover")
    page.wait_for_selector("#rover polyline")
    assert page.locator("#rover circle[data-frame]").count() == 4
    assert page.locator("#rover circle.camera").count() == 1
    page.locator("#rover circle[data-frame='2']").click()
    page.locator("#rover img[src$='front_left/1_hapke_0064/00002.jpg']").wait_for()
    page.locator("#status").click()
    page.keyboard.press("ArrowRight")
    page.get_by_text("No image of this frame.").wait_for()
    page.locator("#rover .stone").first.click()
    page.locator("#rock h2", has_text="Rock 1").wait_for()


def put_right(page, address):
    shown(page, address, f"view=correct&key={SEED}&rock=3.1")
    page.wait_for_selector("#editor .edited")
    figures = page.locator("#correct figure")
    figures.first.wait_for()
    captions = " ".join(figures.all_inner_texts())
    words = ("exposure", "other camera", "Sun 180", "Sun 270", "Sun 350")
    assert [captions.count(word) for word in words] == [2, 1, 1, 1, 1]
    for key in ("ArrowRight", "ArrowRight", "Shift+ArrowDown"):  # a box that the address chose needs no click
        page.keyboard.press(key)
    assert page.locator("#corrected").inner_text() == "corrected"
    box = page.locator("#editor .edited").bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2 + 30, box["y"] + box["height"] / 2, steps=3)
    page.mouse.up()
    page.locator("#undo").click()  # the drag
    page.get_by_role("button", name="new shadow").click()
    page.get_by_role("button", name="delete box").click()


def is_put_right(folder):
    found = read_corrections(folder, polar(), 3)
    assert set(found) == {SEED}
    was = boxes_of(SEED)
    wanted = was["rock", 1] + [2, 0, 2, 1]
    np.testing.assert_allclose(found[SEED].rocks, [wanted, was["rock", 2]], atol=2e-3)
    assert len(found[SEED].shadows) == 2


def download(page, folder):
    with page.expect_download() as waiting:
        page.locator("#download").click()
    waiting.value.save_as(folder / waiting.value.suggested_filename)


def test_corrections_are_downloaded_and_persist_until_they_are_discarded(page, address, corrected, tmp_path):
    kept = corrected / "corrections"
    put_right(page, address)
    download(page, tmp_path / "downloaded")
    is_put_right(tmp_path / "downloaded")
    until(page, lambda: kept.exists() and page.locator("#save-status").inner_text() == f"saved in {kept}")
    is_put_right(kept)
    before = [one["x0"] for one in edited(page)]
    with served(corrected) as address:  # another port
        shown(page, address, f"view=correct&key={SEED}&rock=3.1")
        page.wait_for_selector("#editor .edited")
        assert page.locator("#corrected").inner_text() == "corrected"
        assert page.locator("#undo").is_disabled()  # browsers store the steps by port
        np.testing.assert_allclose([one["x0"] for one in edited(page)], before, atol=2e-3)
        assert page.locator("#editor .edited title").text_content() == "rock 1"
        shown(page, address, f"view=correct&key={KEYS[1]}&rock=3.1")
        page.wait_for_selector("#editor .edited")
        page.keyboard.press("ArrowRight")
        until(page, lambda: len(list(kept.glob("*.txt"))) == 2)
        page.locator("#revert").click()
        assert page.locator("#corrected").inner_text() == "as propagated"
        until(page, lambda: [path.stem for path in kept.glob("*.txt")] == [str(SEED)])
        page.locator("#undo").click()
        until(page, lambda: len(list(kept.glob("*.txt"))) == 2)
        page.once("dialog", lambda dialog: dialog.dismiss())
        page.locator("#drop").click()
        assert page.locator("#download").inner_text() == "download corrections (2 photos)"
        page.once("dialog", lambda dialog: dialog.accept())
        page.locator("#drop").click()
        until(page, lambda: not list(kept.glob("*.txt")))
        assert page.locator("#corrected").inner_text() == "as propagated"
        page.locator("#undo").click()
        until(page, lambda: len(list(kept.glob("*.txt"))) == 2)
        page.goto("about:blank")
    assert set(read_corrections(kept, polar(), 3)) == {SEED, KEYS[1]}


def test_undo_reverts_an_edit_and_survives_a_reload(page, address, corrected):
    """Presses of the arrow keys on a box are one edit, until another box is selected."""
    shown(page, address, f"view=correct&key={SEED}&rock=3.1")
    page.wait_for_selector("#editor .edited")
    confirms = page.locator("#confirms")
    assert confirms.inner_text() == "an edit confirms all 4 boxes as annotations"
    was = named(page)
    for _ in range(12):
        page.keyboard.press("ArrowRight")
    assert confirms.inner_text() == "all 4 boxes are annotations"
    for _ in range(3):
        page.keyboard.press("Shift+ArrowRight")
    page.get_by_role("button", name="whole photo").click()
    page.locator("#editor rect", has_text="shadow 2").click()
    page.locator("#editor").focus()
    for _ in range(2):
        page.keyboard.press("ArrowLeft")
    steps = []
    for number in range(3):
        until(page, "document.querySelector('#save-status').textContent.startsWith('saved in ')")
        page.reload()
        page.wait_for_selector("#editor .box")
        shift = {name: np.subtract(edges, was[name]).round(2).tolist() for name, edges in named(page).items()}
        steps.append({name: edges for name, edges in shift.items() if any(edges)})
        page.locator("#undo").click()
        assert page.locator("#undo").is_disabled() == (number == 2)
    assert steps == [
        {"rock 1": [12, 3], "shadow 2": [-2, 0]},
        {"rock 1": [12, 3]},
        {"rock 1": [12, 0]},
    ]
    until(page, lambda: not list((corrected / "corrections").glob("*.txt")))


def named(page) -> dict[str, list[float]]:
    """Return left edge and width of the editor's boxes by name."""
    boxes = zip(page.locator("#editor rect.box title").all_text_contents(), edited(page), strict=True)
    return {name: [one["x0"], one["width"]] for name, one in boxes}


def test_changes_by_another_program_remove_the_steps_of_undo(page, address, corrected):
    shown(page, address, f"view=correct&key={SEED}&rock=3.1")
    page.wait_for_selector("#editor .edited")
    page.keyboard.press("ArrowRight")
    until(page, "document.querySelector('#save-status').textContent.startsWith('saved in ')")
    (corrected / f"corrections/{SEED}.txt").write_text("")
    page.reload()
    page.wait_for_selector("#effects label")
    assert page.locator("#undo").is_disabled()


def test_the_page_prepares_the_next_run_and_shows_what_it_changed(page, address, corrected):
    shown(page, address, f"view=correct&key={SEED}&rock=3.1")
    page.wait_for_selector("#editor .edited")
    assert page.locator("#prepare").is_disabled()
    page.keyboard.press("ArrowRight")
    page.locator("#prepare").click()
    overlay = corrected / "corrections.yaml"
    until(
        page, f"document.querySelector('#next-run code')?.textContent === 'polarsim run labels --configfile {overlay}'"
    )
    assert read_yaml(overlay) == {"labels": {"corrections": str(corrected / "corrections")}}
    assert page.locator("#correction-effect").count() == 0
    table = corrected / "labels/tables/Terrain03.parquet"
    labels = pd.read_parquet(table)
    of_photo = (labels["key"] == str(KEYS[1])) & (labels["kind"] == "rock")
    moved, gone = of_photo & (labels["rock"] == 1), of_photo & (labels["rock"] == 2)
    write_parquet(table, labels.assign(x0=labels["x0"] + 7.0 * moved)[~gone])  # the next run
    page.reload()
    effect = page.locator("#correction-effect")
    effect.wait_for()
    assert (
        effect.inner_text()
        == "labels changed by the last corrections (dotted: former box), in 1 photo: 1 moved (up to 7 px), 1 removed"
    )
    page.get_by_label("in", exact=True).select_option(str(KEYS[1]))
    until(page, "document.querySelectorAll('#editor .former').length === 2")
    write_parquet(table, labels)
    overlay.unlink()
    shutil.rmtree(corrected / "labels/before_corrections")


def edited(page) -> list[dict[str, float]]:
    """Return the edges of the editor's boxes."""
    script = "all => all.map((one) => ({ x0: one.x.baseVal.value, width: one.width.baseVal.value }))"
    return page.locator("#editor rect.box").evaluate_all(script)


def test_boxes_cannot_be_dragged_out_of_the_photo(page, address, corrected):
    shown(page, address, f"view=correct&key={SEED}&rock=3.1")
    page.wait_for_selector("#editor .edited")
    page.get_by_role("button", name="whole photo").click()
    box = page.locator("#editor .edited").bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(3, 790, steps=3)
    page.mouse.up()
    until(page, "document.querySelector('#save-status').textContent.startsWith('saved in ')")
    moved = read_corrections(corrected / "corrections", polar(), 3)[SEED].rocks[0]
    size = boxes_of(SEED)["rock", 1][2:] - boxes_of(SEED)["rock", 1][:2]
    np.testing.assert_allclose(moved, [0, HEIGHT - size[1], size[0], HEIGHT], atol=2e-3)


def test_a_correction_that_cannot_be_saved_is_named_and_can_be_downloaded(browser, address, corrected):
    page = browser.new_page()
    shown(page, address, f"view=correct&key={SEED}&rock=3.1")
    page.wait_for_selector("#editor .edited")
    page.context.set_offline(True)  # as after the end of the server
    page.keyboard.press("ArrowRight")
    until(page, "document.querySelector('#save-status').textContent.startsWith('1 photo not saved')")
    assert page.locator("#download").is_enabled()
    page.close()


def test_a_page_without_server_offers_the_download_only(page, made, tmp_path):
    with served(made, saves=False) as address:  # the content of a written page, see test_site
        put_right(page, address)
        assert page.locator("#save-status").inner_text().startswith("1 photo not saved: this page has no server")
        download(page, tmp_path / "corrections")
        page.goto("about:blank")
    is_put_right(tmp_path / "corrections")


@pytest.mark.parametrize("view", ["compare", "correct"])
def test_an_unknown_key_is_named(page, address, view):
    shown(page, address)
    for key in ("99_Z_off_30_L_0256", "03_B_off_30_L_0256", "what"):
        page.evaluate(f"location.hash = 'view={view}&key={key}'")
        note = page.locator(f"#{view} .empty", has_text=key)
        note.wait_for()
        assert page.locator(f"#{view} input, #{view} #editor").locator("visible=true").count() == 0


def test_labels_that_depend_on_a_seed_are_counted(page, address):
    shown(page, address, f"view=correct&key={SEED}&seed={SEED}")
    effect = page.locator("#seed-effect")
    effect.wait_for()
    assert effect.inner_text() == "labels without this seed, in 5 photos: 4 moved (up to 4 px), 1 removed"


def test_an_address_restores_the_state(page, address):
    state = f"view=compare&key={SEED}&left=hapke&right=difference&split=30&ev=-1.5&show=bm&rock=3.2&labels=twins"
    shown(page, address, state)
    compared(page, "hapke difference")
    assert page.get_by_label("brightness").input_value() == "-1.5"
    assert page.get_by_role("button", name="masks").get_attribute("aria-pressed") == "true"
    page.locator("#rock h2", has_text="Rock 2").wait_for()
    page.evaluate("location.hash = 'view=nonsense&ev=much&key=%E0%A4%A&split=1e9&other=1'")
    page.wait_for_selector("#photos:not([hidden])")


def test_keys_switch_views_and_open_the_help(page, address):
    shown(page, address, f"key={SEED}&f.domain=photo")
    for number, view in enumerate(VIEWS, 1):
        page.keyboard.press(str(number))
        page.wait_for_selector(f"#{view}:not([hidden])")
        assert page.locator("nav [aria-current=page]").get_attribute("id") == f"tab-{view}"
    page.keyboard.press("2")
    page.keyboard.press("ArrowRight")
    following = KEYS_IN_ORDER[KEYS_IN_ORDER.index(str(SEED)) + 1]
    until(page, f"document.querySelector('#key').textContent === '{following}'")
    page.keyboard.press("?")
    page.get_by_role("heading", name="Keys").wait_for()
    page.get_by_role("button", name="Close").click()


KEYS_IN_ORDER = sorted(str(key) for key in KEYS)


def test_the_page_is_accessible(page, address):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="needs axe-playwright-python").Axe()
    shown(page, address, f"key={SEED}&rock=3.1&seed={SEED}&show=bmilp&detector=photo/seed0/analog_on_analog")
    for view in VIEWS:
        page.locator(f"#tab-{view}").click()
        page.wait_for_timeout(300)
        found = axe.run(page).response["violations"]
        assert [(view, one["id"], [node["html"][:120] for node in one["nodes"]][:3]) for one in found] == []


def test_a_run_without_photos_meshes_and_detectors_is_shown(page, made, tmp_path):
    """Labels and twins only, as in runs of the published release."""
    for part in ("labels", "renders/hapke", "renders/tables", "renders/instances"):
        shutil.copytree(made / part, tmp_path / "bare" / part, copy_function=os.link)
    with served(tmp_path / "bare") as address:
        shown(page, address)
        assert page.locator("#count").inner_text() == f"{len(KEYS)} of {len(KEYS)} images"
        page.locator(f"[data-key='{KEYS[1]}']").click()
        compared(page, "photo hapke", KEYS[1])
        assert page.locator("#compare .tag.left").inner_text() == "photo: not available"
        for view in VIEWS:
            page.locator(f"#tab-{view}").click()
            page.wait_for_timeout(100)
        page.locator("#editor .box").first.wait_for()
        assert page.locator("#status").inner_text().startswith("terrains 3")
        page.goto("about:blank")
