#!/usr/bin/env python3
"""Opens pages of results in a headless browser, as a screen and as a phone, by day and by night.

    python3 tests/browser/pages.py target/debug/nav-sim          makes results with that program and opens their pages
    python3 tests/browser/pages.py --page page.html [results.json]   opens one page

Checks: no console message, no network, no page wider than the window, no text under 11 pixels, table numbers equal to the
JSON, tables that fit a desk, figures that answer to the mouse. Without a browser it is skipped; with NAV_SIM_CI it fails.
"""

import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

BROWSERS = ["chromium", "chromium-browser", "google-chrome"]
WIDTHS = [1280, 390]
# blink's preferredColorScheme
SCHEMES = {"light": 1, "dark": 0}
SMALLEST_PX = 11.0
# a window at least so wide holds every table
DESK_PX = 1280
# pages of tables alone
WITHOUT_FIGURE = ("choice/report.html", "tuned.html", "needed.html", "given.html", "ranked.html", "designs.html", "/design.html")

# Runs in the page's frame once it is loaded; its results are the text of the frame's parent.
MEASURE = """
const frame = document.querySelector("iframe");
frame.addEventListener("load", () => {
  const page = frame.contentDocument, view = frame.contentWindow;
  const shown = (e) => e.getClientRects().length > 0;
  const texts = [...page.querySelectorAll("svg text")].filter(shown);
  const scale = (text) => Math.hypot(text.getScreenCTM().a, text.getScreenCTM().b);
  const sizes = texts.map((text) => parseFloat(view.getComputedStyle(text).fontSize) * scale(text));
  const outside = texts.filter((t) => {
    const [a, b] = [t.getBoundingClientRect(), t.closest("svg.chart").getBoundingClientRect()];
    return a.left < b.left - 2 || a.right > b.right + 2;
  }).map((t) => t.textContent);
  const dark = view.matchMedia("(prefers-color-scheme: dark)").matches;
  const background = view.getComputedStyle(page.body).backgroundColor;
  // the mouse over the middle of the first plot that is no map: a line and values; its first key: a curve less
  const chart = [...page.querySelectorAll("svg.chart:not([data-group=map])")].find(shown);
  const answers = {};
  if (chart) {
    chart.scrollIntoView();
    const box = chart.querySelector("svg.plot");
    const corner = new view.DOMPoint(Number(box.getAttribute("x")) + 0.5 * Number(box.getAttribute("width")),
      Number(box.getAttribute("y")) + 0.5 * Number(box.getAttribute("height"))).matrixTransform(chart.getScreenCTM());
    const mouse = (kind, dx, dy) => chart.dispatchEvent(new view.PointerEvent(kind, { bubbles: true, pointerType: "mouse", button: 0,
      clientX: corner.x + dx, clientY: corner.y + dy }));
    mouse("pointermove", 0, 0);
    answers.cross = chart.querySelectorAll(".cross").length;
    // within the plot, which has the height of its rows where names stand on the axis
    const reach = Math.min(30, 0.3 * Number(box.getAttribute("height")) * chart.getScreenCTM().d);
    mouse("pointerdown", -40, -reach);
    mouse("pointermove", 40, reach);
    mouse("pointerup", 40, reach);
    answers.zoomed = box.getAttribute("viewBox") !== box.dataset.whole;
    chart.dispatchEvent(new view.MouseEvent("dblclick", { bubbles: true }));
    answers.reset = box.getAttribute("viewBox") === box.dataset.whole;
    const key = chart.querySelector(".key");
    if (key) {
      key.dispatchEvent(new view.MouseEvent("click", { bubbles: true }));
      answers.hidden = chart.querySelectorAll(".series.off").length;
      key.dispatchEvent(new view.MouseEvent("click", { bubbles: true }));
    }
  }
  const charts = [...page.querySelectorAll("svg.chart")].filter(shown).length;
  const cells = [...page.querySelectorAll("td[data-json]")].map((td) => [td.dataset.json, td.textContent]);
  // what is measured is measured while the page is still there
  const width = view.innerWidth, needed = page.documentElement.scrollWidth;
  const cut = [...page.querySelectorAll(".scroll")].filter((e) => e.scrollWidth > e.clientWidth + 1)
    .map((e) => e.innerText.slice(0, 40));
  document.body.innerHTML = "<pre></pre>";
  document.querySelector("pre").textContent = JSON.stringify({
    width, needed, smallest: Math.min(...sizes, 99), texts: texts.length, outside, dark, background, charts, answers, cells, cut,
  });
});
"""


def browser():
    """The first browser there is."""
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)


def readable(x):
    """Numbers as the pages show them: three significant digits, or four figures before the point."""
    if x is None or not math.isfinite(x):
        return "–"
    size = abs(x)
    if size == 0:
        return "0"
    if not 1e-3 <= size < 1e6:
        mantissa, exponent = f"{x:.2e}".split("e")
        return f"{mantissa}e{int(exponent)}"
    digits = 0 if size >= 100 else 1 if size >= 10 else 2 if size >= 1 else int(2 - math.floor(math.log10(size)))
    return f"{x:.{digits}f}"


def value_at(results, pointer):
    """What stands at a JSON pointer."""
    for part in pointer.split("/")[1:]:
        part = part.replace("~1", "/").replace("~0", "~")
        results = results[int(part)] if isinstance(results, list) else results[part]
    return results


def open_page(program, page, width, scheme):
    """What the page looks like in a window of this width, and what the browser said."""
    with tempfile.TemporaryDirectory() as place:
        harness = Path(place) / "harness.html"
        harness.write_text(
            f'<body><iframe src="{page.resolve().as_uri()}" style="border:0;width:{width}px;height:900px"></iframe>'
            f"<script>{MEASURE}</script></body>"
        )
        command = [program, "--headless", "--no-sandbox", "--disable-gpu", "--allow-file-access-from-files",
                   "--disable-background-networking", f"--user-data-dir={place}/profile", "--enable-logging=stderr",
                   f"--blink-settings=preferredColorScheme={SCHEMES[scheme]}", f"--window-size={max(width, 520)},1000",
                   "--virtual-time-budget=4000", "--dump-dom", harness.as_uri()]
        ran = subprocess.run(command, capture_output=True, text=True, timeout=120)
    said = [line for line in ran.stderr.splitlines() if "CONSOLE" in line]
    found = re.search(r"<pre>(.*?)</pre>", ran.stdout, re.S)
    if not found:
        raise SystemExit(f"{page}: the browser did not open it\n{ran.stdout[:300]}\n{ran.stderr[:600]}")
    text = found[1]
    for entity, sign in [("&lt;", "<"), ("&gt;", ">"), ("&quot;", '"'), ("&amp;", "&")]:
        text = text.replace(entity, sign)
    return json.loads(text), said


def check(program, page, results):
    """Everything that is wrong with a page."""
    wrong = []
    html = page.read_text()
    if re.search(r'(?:src|href)="(?:https?:)?//|@import|url\(', html):
        wrong.append("asks something of the network")
    for width in WIDTHS:
        for scheme in SCHEMES:
            seen, said = open_page(program, page, width, scheme)
            place = f"{width} px, {scheme}"
            wrong += [f"{place}: {line}" for line in said]
            if seen["needed"] > seen["width"]:
                wrong.append(f"{place}: needs {seen['needed']} px")
            if seen["smallest"] < SMALLEST_PX:
                wrong.append(f"{place}: text of {seen['smallest']:.1f} px in a figure")
            if seen["outside"]:
                wrong.append(f"{place}: text beyond its figure: {seen['outside'][:5]}")
            if seen["dark"] != (scheme == "dark") or (seen["background"] == "rgb(255, 255, 255)") == seen["dark"]:
                wrong.append(f"{place}: background {seen['background']}")
            if width >= DESK_PX and seen["cut"]:
                wrong.append(f"{place}: tables are cut: {seen['cut']}")
            if (seen["texts"] == 0) != str(page).endswith(WITHOUT_FIGURE):
                wrong.append(f"{place}: {seen['charts']} figures")
            answers = seen["answers"]
            if answers and not (answers["cross"] and answers["zoomed"] and answers["reset"] and answers.get("hidden", 1)):
                wrong.append(f"{place}: the figures do not answer to the mouse: {answers}")
    if results:
        parsed = json.loads(results.read_text())
        for pointer, text in seen["cells"]:
            try:
                value = value_at(parsed, pointer)
            except (KeyError, IndexError):
                wrong.append(f"{pointer} is not in {results.name}")
                continue
            if text != (f"{100 * value:.0f} %" if text.endswith(" %") else readable(value)):
                wrong.append(f"{pointer}: {text} on the page, {value} in {results.name}")
        print(f"  {len(seen['cells'])} numbers as in {results.name}")
    return wrong


def make(nav_sim, place):
    """Results of every command that makes a page: page and, where there is one, the JSON it shows."""
    here = Path(__file__).resolve().parents[2]

    def run(words, keep=None, codes=(0,)):
        ran = subprocess.run([nav_sim, "-q", *words.split()], cwd=place, capture_output=True, text=True)
        if ran.returncode not in codes:
            raise SystemExit(f"nav-sim {words}: exit code {ran.returncode}\n{ran.stderr}")
        if keep:
            (place / keep).write_text(ran.stdout)

    for name in ["calib_data", "trajectories", "examples"]:
        os.symlink(here / name, place / name)
    model = "calib_data/consumer_mems.toml"
    run(f"synthesize {model} --replicates 4 --samples 32768 --spread --seed 1 -o static")
    run("wv static/replicate_1.csv --plot wv.html")
    run("calibrate static --seed 1 --bootstrap 50 --format json -o model.toml", keep="fits.json")
    for run_of, extra in [("I_awv", ""), ("I_dr-awv", f"--truth {model}")]:
        made = "model.toml" if run_of == "I_dr-awv" else model
        run(f"run trajectories/land_vehicle.toml {made} {extra} --runs 4 --seed 1 -o runs/{run_of}", codes=(0, 3))
    run(f"run trajectories/land_vehicle.toml {model} --method lincov --outage none -o runs/lincov")
    run("compare runs/I_dr-awv --reference runs/I_awv -o comparison.json")
    run("trajectory record trajectories/land_vehicle.toml calib_data/tactical.toml --seed 3 -o drive")
    run("fuse drive/imu.csv drive/gnss.csv calib_data/tactical.toml --reference drive/reference.csv --outage 300:360 "
        "-o fused", codes=(0, 3))
    run("choose static --trajectory trajectories/figure_eight.toml --outage 60:90 --estimator awv --model WN+RW --filter 15 "
        "--inflate none,x10 --seed 1 -o choice")
    run("batch examples/quick_study.toml -o study", codes=(0, 3))
    tuned = "tune calib_data/tactical.toml --truth calib_data/consumer_mems.toml --outage 60:90"
    run(f"{tuned} --plot tuned.html --format json", keep="tuned.json")
    asked = "require trajectories/figure_eight.toml"
    run(f"{asked} --outage 60 --require p95_m<=50 --plot needed.html --format json", keep="needed.json")
    run(f"{asked} calib_data/tactical.toml --outage 60:120 --require rmse_m<=100 --plot given.html --format json",
        keep="given.json", codes=(0, 3))
    run(f"{asked} --outage 60 --require p95_m<=50 --catalogue --plot ranked.html --format json", keep="ranked.json",
        codes=(0, 3))
    run("design calib_data/consumer_mems.toml --draws 40 --estimator awv --plot designs.html --format json",
        keep="designs.json")
    run("design calib_data/tactical.toml --recordings 4 --hours 1 --draws 40 --trajectory trajectories/figure_eight.toml "
        "--outage 300:360 --plot design.html --format json", keep="design.json")
    pages = [("wv.html", None), ("model.html", "fits.json"), ("runs/I_awv/report.html", "runs/I_awv/summary.json"),
             ("runs/lincov/report.html", "runs/lincov/summary.json"), ("comparison.html", "comparison.json"),
             ("fused/report.html", "fused/summary.json"), ("choice/report.html", "choice/ranking.json"),
             ("study/report.html", "study/summary.json"), ("tuned.html", "tuned.json"), ("needed.html", "needed.json"),
             ("given.html", "given.json"), ("ranked.html", "ranked.json"), ("designs.html", "designs.json"),
             ("design.html", "design.json")]
    return [(place / page, results and place / results) for page, results in pages]


def main(words):
    program = browser()
    if not program:
        print("skipped: no browser (" + ", ".join(BROWSERS) + ")")
        return int("NAV_SIM_CI" in os.environ)
    with tempfile.TemporaryDirectory() as place:
        if words[0] == "--page":
            pages = [(Path(words[1]), Path(words[2]) if len(words) > 2 else None)]
        else:
            pages = make(os.path.abspath(words[0]), Path(place))
        failed = 0
        for page, results in pages:
            print(f"{page} ({page.stat().st_size // 1000} kB)", flush=True)
            wrong = check(program, page, results)
            failed += bool(wrong)
            for line in wrong[:20]:
                print(f"  WRONG: {line}")
    print(f"{len(pages) - failed} of {len(pages)} pages are right")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:] or ["target/debug/nav-sim"]))
