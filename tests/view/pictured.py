"""Pictures of the page of a run, for docs/howto/watch-a-run.md and for a person to look at.

`python -m tests.view.pictured DIR [NAME ...]`: the two of the docs (`bench`), and a
picture of each scene that is played with the pointer, with how far its hand was led.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

from tests.view.alone import CALM, click, fire, press, start, state
from tests.view.browser import Browser
from tests.view.served import BENCH

PLAYED = ("scene-string", "scene-granular")
UNHURRIED = ("rate_hz=4000", "loop.overrun_limit=5000", "loop.missing_limit=5000")
READY = "window.tautwave?.store?.end > 10"
DRAGGED_PX = 60.0


def bench(browser: Browser, directory: Path) -> None:
    """Take the engaged bench with its panels, and the same held by a trigger with two cursors."""
    sets = ("operate={start: engaged}", *CALM[1:-1])
    run, url = start(directory / "bench", sets, "--allow-tuning")
    browser.look(1300, 1080, dark=False)
    browser.open(url)
    assert browser.wait(READY, 240.0), "the run does not begin"
    state(browser, "engaged")
    browser.run("(e=>{e.value = 5; e.onchange()})(document.getElementById('span'))")
    browser.wait(f"tautwave.store.end > {browser.run('tautwave.store.end')} + 6000")
    browser.run("scrollTo(0, 0)")
    browser.shot(directory / "watch-a-run.png")
    browser.run("(e=>{e.value = 1; e.onchange()})(document.getElementById('span'))")
    fire(browser, "master.lever.position", 0.1, "normal")
    click(browser, "#pause")
    x, y, width = browser.run(
        "(()=>{const r=document.querySelector('.u-over').getBoundingClientRect();"
        "return [r.x, r.y + 40, r.width]})()"
    )
    press(browser, x + 0.3 * width, y)
    press(browser, x + 0.6 * width, y, keys=8)
    browser.wait("document.querySelector('.key').textContent.includes('Δ')")
    browser.look(1300, 620, dark=False)
    browser.run("scrollTo(0, 0)")
    time.sleep(0.4)
    browser.shot(directory / "watch-a-run-trigger.png")
    run.kill()
    run.wait(30)


def played(browser: Browser, name: str, directory: Path) -> str:
    """Drag a scene's first hand by the mouse; return how far it was led."""
    rig = BENCH.parent / f"{name}.yaml"
    run, url = start(directory / name, UNHURRIED, "--pointer", "--allow-uncertified", rig=rig)
    browser.look(1300, 1080, dark=False)
    browser.open(url)
    assert browser.wait(READY, 240.0), "the run does not begin"
    browser.wait("document.querySelector('#figures svg.led')")
    at = (
        "(()=>{const n=Object.keys(tautwave.figures.ranges)[0]; const c=tautwave.facts.columns"
        ".find((one)=>one.endsWith(n+'.reference')); return [n, c, tautwave.store.newest(c)]})()"
    )
    before = browser.run(at)
    x, y = browser.run(
        "(()=>{const e=document.querySelector('#figures svg.led');"
        "e.scrollIntoView({block:'center'}); const r=e.getBoundingClientRect();"
        "return [r.x+r.width/2, r.y+r.height/2]})()"
    )
    mouse = {"button": "left", "buttons": 1, "clickCount": 1}
    for word, dx, dy in (("mousePressed", 0, 0), *(("mouseMoved", k, -k) for k in (20, 40, 60))):
        browser.call("Input.dispatchMouseEvent", type=word, x=x + dx, y=y + dy, **mouse)
    browser.wait(f"{at}[2] != {before[2]}")
    after = browser.run(at)
    browser.shot(directory / f"{name}.png")
    browser.call("Input.dispatchMouseEvent", type="mouseReleased", x=x + 60, y=y - 60, **mouse)
    run.kill()
    run.wait(30)
    return f"{name}: {before} to {after}"


def main(directory: Path, *wanted: str) -> None:
    """Take the pictures of the bench, and of scenes, or of those named."""
    directory.mkdir(parents=True, exist_ok=True)
    with Browser() as browser:
        if not wanted or "bench" in wanted:
            bench(browser, directory)
        for name in PLAYED:
            if not wanted or name in wanted:
                print(played(browser, name, directory), flush=True)
        print(browser.problems or "no problems", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
