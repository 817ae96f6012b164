"""The page of a report in a real browser: no error, every figure drawn, nothing fetched.

Where no Chromium is installed the tests are skipped; with ``DUALBEND_REQUIRE_BROWSER=1``, as in
``.ci/slow``, that is a failure.
"""

import json
import os
import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from dualbend.report.page import write_report
from support.left_runs import leave

webdriver = pytest.importorskip("selenium.webdriver")

pytestmark = pytest.mark.slow

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
DRIVER = shutil.which("chromedriver")
ARGUMENTS = (
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--disable-dev-shm-usage", "--window-size=1200,900"),
)
SHORT = ("path.end_rad=0.4", "motion.speed_rad_per_s=0.4", "motion.settle_s=0.1")
LOCAL = ("file:", "data:", "blob:", "about:", "chrome:", "chrome-untrusted:", "devtools:")

COLOURED = """
// For each plot: how many of its canvases' pixels have a colour, as curves have and axes have not.
function canvases(root) {
  const found = [...root.querySelectorAll("canvas")];
  for (const child of root.querySelectorAll("*")) {
    if (child.shadowRoot) found.push(...canvases(child.shadowRoot));
  }
  return found;
}
const result = {};
for (const plot of document.querySelectorAll(".plot")) {
  let count = 0;
  for (const canvas of canvases(plot)) {
    if (!canvas.width || !canvas.height) continue;
    const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
    for (let i = 0; i < pixels.length; i += 4) {
      const [r, g, b, a] = pixels.slice(i, i + 4);
      if (a > 128 && Math.max(r, g, b) - Math.min(r, g, b) > 50) count += 1;
    }
  }
  result[plot.id] = count;
}
return result;
"""

HEADS = """
// For each plot with a title: the title's upper and the toolbar's lower edge.
function parts(root, name) {
  const found = [...root.querySelectorAll(name)];
  for (const child of root.querySelectorAll("*")) {
    if (child.shadowRoot) found.push(...parts(child.shadowRoot, name));
  }
  return found;
}
return [...document.querySelectorAll(".plot")]
  .map((plot) => [parts(plot, ".bk-Title"), parts(plot, ".bk-Toolbar")])
  .filter(([titles]) => titles.length)
  .map((found) => found.map(([part]) => part.getBoundingClientRect()))
  .map(([title, toolbar]) => [title.top, toolbar.bottom, toolbar.height]);
"""


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Three runs: both gains, and an assembly that was stopped on its way."""
    top = tmp_path_factory.mktemp("runs")
    return [
        leave(top / "fig8", "fig8", *SHORT),
        leave(top / "fig9", "fig9", *SHORT, 'expect.outcome=["completed","failed"]'),
        leave(top / "pwb", "pwb", until=400),
    ]


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator["webdriver.Chrome"]:
    if CHROMIUM is None or DRIVER is None:
        message = "no chromium and chromedriver: apt-get install chromium chromium-driver"
        if os.environ.get("DUALBEND_REQUIRE_BROWSER") == "1":
            pytest.fail(message)
        pytest.skip(message)
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for argument in (*ARGUMENTS, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    driver.set_script_timeout(120.0)  # a busy machine reads many canvases slowly
    try:
        yield driver
    finally:
        driver.quit()


@pytest.fixture(scope="module")
def page(
    browser: "webdriver.Chrome", folders: list[Path], tmp_path_factory: pytest.TempPathFactory
) -> int:
    """Their report, loaded once, since that takes a minute: how many plots are drawn."""
    path = tmp_path_factory.mktemp("page") / "report.html"
    write_report(folders, path)
    return open_page(browser, path)


def open_page(browser: "webdriver.Chrome", page: Path) -> int:
    """Load a page and wait until it says that its plots are drawn; return how many."""
    browser.get(page.as_uri())
    end = time.monotonic() + 120.0
    while time.monotonic() < end:
        drawn = browser.execute_script("return document.documentElement.dataset.plots")
        if drawn is not None:
            return int(drawn)
        time.sleep(0.1)
    raise AssertionError(f"no plots after 120 s; console: {console_errors(browser)}")


def console_errors(browser: "webdriver.Chrome") -> list[str]:
    return [
        entry["message"]
        for entry in browser.get_log("browser")
        if entry["level"] in {"SEVERE", "WARNING"}
    ]


def outside(browser: "webdriver.Chrome") -> list[str]:
    """Return every address that was asked for and is not of the page itself."""
    messages = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    asked = [
        message["params"]["request"]["url"]
        for message in messages
        if message["method"] == "Network.requestWillBeSent"
    ]
    assert any(url.startswith("file:") for url in asked), "the log has not even the page"
    return [url for url in asked if not url.startswith(LOCAL)]


def coloured(browser: "webdriver.Chrome") -> dict[str, int]:
    """Return the coloured pixels of each plot, when they have been painted."""
    found: dict[str, int] = {}
    for _ in range(50):
        found = browser.execute_script(COLOURED)
        if found and min(found.values()) > 0:
            break
        time.sleep(0.2)
    return found


def test_the_page_is_drawn_without_an_error_and_without_a_network(
    browser: "webdriver.Chrome", page: int
) -> None:
    places = browser.execute_script("return document.querySelectorAll('.plot').length")
    assert page == places > 30
    found = coloured(browser)
    assert len(found) == places
    assert min(found.values()) >= 20, found
    assert console_errors(browser) == []
    assert outside(browser) == []


@pytest.mark.usefixtures("page")
def test_zooming_one_plot_zooms_those_beside_it(browser: "webdriver.Chrome") -> None:
    titles = browser.execute_script(
        """
        const beside = Bokeh.documents[0].roots().filter(
          (figure) => figure.title && String(figure.title.text).includes("the paper's Fig."));
        beside[0].x_range.setv({start: 0.1, end: 0.2});
        return beside.map((figure) => [figure.x_range.start, figure.x_range.end]);
        """
    )
    assert titles == [[0.1, 0.2]] * 2


@pytest.mark.usefixtures("page")
def test_no_toolbar_lies_over_a_title(browser: "webdriver.Chrome") -> None:
    """Each has a row of its own, however long the title and narrow the plot."""
    heads = browser.execute_script(HEADS)
    # Two figures of the paper beside each other, and a map of two axes for each.
    assert len(heads) >= 4
    for title_top, toolbar_bottom, toolbar_height in heads:
        assert toolbar_height > 0.0
        assert title_top >= toolbar_bottom


def test_a_phone_scrolls_down_only(
    browser: "webdriver.Chrome", folders: list[Path], tmp_path: Path
) -> None:
    """Two runs beside each other; a narrow window of many plots is laid out for a minute."""
    write_report(folders[:2], tmp_path / "report.html")
    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True},
    )
    try:
        open_page(browser, tmp_path / "report.html")
        wide, screen = browser.execute_script(
            "return [document.documentElement.scrollWidth, window.innerWidth]"
        )
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    assert wide <= screen


def test_what_the_test_looks_for_would_be_seen(
    browser: "webdriver.Chrome", folders: list[Path], tmp_path: Path
) -> None:
    """A page made worse: an error, a picture from outside, a plot that is not drawn."""
    good = tmp_path / "report.html"
    write_report(folders[:1], good)
    text = good.read_text(encoding="utf-8").replace("default-src", "x-default-src")
    text = text.replace("script-src", "x-script-src").replace("img-src", "x-img-src")
    bad = "<img src='http://127.0.0.1:9/x.png'><div class='plot' id='none'></div>"
    worse = tmp_path / "worse.html"
    worse.write_text(
        text.replace("</body>", f"{bad}<script>throw new Error('seen')</script></body>"),
        encoding="utf-8",
    )
    open_page(browser, worse)
    assert browser.execute_script(COLOURED)["none"] == 0
    assert outside(browser) == ["http://127.0.0.1:9/x.png"]
    assert any("seen" in message for message in console_errors(browser))
