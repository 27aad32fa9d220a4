"""The page in a browser: it runs, asks nobody, and what is turned turns."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest

import cosim
from cosim.cli.main import main
from cosim.live.page import opened
from cosim.live.server import Server

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)
QUIET = ("--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking")
AMPLITUDE = """() => {
  let low = Infinity, high = -Infinity;
  for (let row = history_.last - 9600; row <= history_.last; row++) {
    const v = history_.value(row, 0);
    low = Math.min(low, v);
    high = Math.max(high, v);
  }
  return high - low;
}"""
RUNS = "() => history_.last > 3 * 48000 && state.found"
"""Three seconds: the means are of the last one, so the start is over."""


@pytest.fixture
def tab() -> Iterator[Any]:
    """A tab, with what it asked for and what went wrong in it."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed")
    with playwright.sync_playwright() as player:
        browser = player.chromium.launch(executable_path=CHROMIUM, args=QUIET)
        page = browser.new_page(viewport={"width": 390, "height": 844})
        page.asked, page.faults = [], []
        page.on("request", lambda request: page.asked.append(request.url))
        page.on("console", lambda message: page.faults.append(message.text))
        page.on("pageerror", lambda error: page.faults.append(str(error)))
        yield page
        browser.close()


@pytest.fixture
def server() -> Iterator[Server]:
    with Server(*opened("paper-limited")) as found:
        Thread(target=found.serve_forever, daemon=True).start()
        yield found
        found.shutdown()


def test_page_is_one_small_file(tmp_path: Path) -> None:
    assert main(["live", "reference", "--out", str(tmp_path / "page.html")]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]
    text = (tmp_path / "page.html").read_text("utf-8")
    assert len(text.encode()) < 400_000
    assert "connect-src 'none'" in text and "http://" not in text and "https://" not in text


@pytest.mark.filterwarnings("ignore")
def test_page_from_a_file(tab: Any, tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    main(["live", "paper", "--set", "drive.amplitude=6", "--out", str(path)])
    tab.goto(path.as_uri())
    tab.wait_for_function(RUNS)
    assert tab.evaluate(AMPLITUDE) == pytest.approx(6.0, rel=2e-3)
    expected = cosim.run("paper-limited", {"drive.amplitude": 6.0}).summary["v_average"]
    assert tab.evaluate("() => state.found.velocity") == pytest.approx(expected, rel=0.01)

    tab.focus("#knob-amplitude")
    tab.keyboard.press("PageDown")  # 40 codes
    tab.wait_for_timeout(1500)
    turned = tab.evaluate("() => state.values['drive.amplitude']")
    assert turned == pytest.approx(6.0 - 40 * 10.53 / 1024, abs=0.01)
    assert tab.evaluate(AMPLITUDE) == pytest.approx(turned, rel=2e-3)
    assert "drive.pot_max=" in tab.url

    tab.click("#sound")
    tab.wait_for_function("() => audio && audio.state === 'running' && history_.last > 4800")
    wide = tab.evaluate("() => document.documentElement.scrollWidth")
    assert wide <= 390
    assert not tab.faults and not tab.inner_text("#fault")
    assert [url for url in tab.asked if not url.startswith(("blob:", "data:"))] == [path.as_uri()]


def test_link_of_a_stranger(tab: Any, tmp_path: Path) -> None:
    """Its words are text, and an unknown setting leaves the page at its own."""
    path = tmp_path / "page.html"
    main(["live", "--out", str(path)])
    tab.goto(f"{path.as_uri()}#scene=<img src=x onerror=alert(1)>")
    tab.wait_for_function(RUNS)
    assert "no scene" in tab.inner_text("#fault") and not tab.faults
    assert tab.locator("img").count() == 0

    tab.evaluate("() => { location.hash = '#scene=paper&friction.mu_s=0.1'; }")
    tab.wait_for_function("() => document.getElementById('fault').textContent.includes('refused')")


@pytest.mark.reliability
def test_server_answers_its_own_page_alone(server: Server) -> None:
    def asked(path: str, **headers: str) -> int:
        data = b"#scene=optimal" if path.startswith("/run") else None
        request = Request(server.address + path, data, headers)
        try:
            return urlopen(request, timeout=30).status
        except HTTPError as error:
            return error.code

    assert asked("/") == 200
    assert asked("/etc/passwd") == 404
    assert asked("/", Host="example.org") == 404
    assert asked("/run/full") == 404
    assert asked("/run/full", Origin="http://example.org") == 404
    assert asked("/run/other", Origin=server.address) == 404
    assert asked("/run/full", Origin=server.address) == 400


def test_comparison_with_ngspice(tab: Any, server: Server) -> None:
    tab.goto(f"{server.address}/#scene=paper-limited&drive.amplitude=6")
    tab.wait_for_function(RUNS)
    tab.click("#compare")
    tab.wait_for_function("() => state.others.length", timeout=120_000)
    there, here = tab.evaluate(
        "() => [1e3 * state.others[0].v_average, 1e3 * state.found.velocity]"
    )
    assert there == pytest.approx(here, abs=0.3)
    assert "difference" in tab.inner_text("#compared") and not tab.faults
    assert {url.partition("#")[0] for url in tab.asked if url.startswith("http")} == {
        f"{server.address}/",
        f"{server.address}/run/amplifier",
    }
