"""Pictures of the page of a run, for README and docs, and for a person to look at.

`python -m tests.view.pictured DIR [NAME ...]`: the two of docs/howto/watch-a-run.md (`bench`),
README's moving picture (`arms`: leader and follower on the page of their run), and two of each rig
that is played with the pointer, led and ended, with how its run went.
"""

from __future__ import annotations

import io
import math
import signal
import sys
import time
from base64 import b64decode
from itertools import pairwise
from pathlib import Path
from typing import Any

from PIL import Image

from tautwave import read_recording
from tautwave.summary import read_summary
from tests.view.alone import CALM, click, fire, press, start, state
from tests.view.browser import Browser
from tests.view.served import BENCH

PLAYED = ("bench-room-loopback", "scene-resonator", "scene-string", "scene-granular")
PLAYED_S, LEFT_S = 8.0, 4.0
"""How long a hand is led, and how long it is left alone after that [s]."""
READY = "window.tautwave?.store?.end > 10"
FILMED_S, FRAME_S, COLOURS = 5.8, 0.15, 24
WIDTH, HEIGHT = 960, 440
"""Of the page while it is filmed [px]."""


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


def arms(browser: Browser, directory: Path) -> None:
    """Film two arms on the page of their run, which stands still while a picture is taken.

    On the fake clock it does not notice. Leaves `arms-live.gif`.
    """
    rig, out = BENCH.parent / "arms/koch.yaml", directory / "arms"
    run, url = start(out, (), "--clock", "fake", "--duration", f"{FILMED_S + 0.2:g}", rig=rig)

    def go_on() -> None:
        run.send_signal(signal.SIGCONT)
        time.sleep(0.02)
        run.send_signal(signal.SIGSTOP)
        time.sleep(0.1)  # for the page to have its rows

    while not (out / "live.json").exists():
        time.sleep(0.01)
    run.send_signal(signal.SIGSTOP)
    browser.look(WIDTH, HEIGHT, dark=False)
    browser.open(url)
    while not browser.run(READY):
        go_on()
    browser.wait("document.querySelector('#figures svg')")
    browser.run("scrollTo(0, 0)")
    frames: list[tuple[float, Image.Image]] = []
    while not frames or frames[-1][0] < FILMED_S:
        at = float(browser.run("tautwave.store.newest('time_s')"))
        if frames and at < frames[-1][0] + FRAME_S:
            go_on()
            continue
        png = b64decode(browser.call("Page.captureScreenshot")["data"])
        picture = Image.open(io.BytesIO(png)).convert("RGB")
        frames.append((at, picture.quantize(COLOURS, dither=Image.Dither.NONE)))
    run.kill()
    run.wait(30)
    first, *others = (picture for _, picture in frames)
    lasts = [int(1e3 * (end - at)) for (at, _), (end, _) in pairwise(frames)]
    first.save(
        directory / "arms-live.gif", save_all=True, append_images=others,
        duration=[*lasts, 1500], loop=0, optimize=True,
    )  # fmt: skip


def played(browser: Browser, name: str, directory: Path) -> dict[str, Any]:
    """Lead a rig's first hand by the mouse, let go, stop; return how the run and its sound went.

    At the rig's own rate and limits, as a person plays it.
    """
    out = directory / name
    run, url = start(out, (), "--pointer", rig=BENCH.parent / f"{name}.yaml")
    browser.look(1300, 1080, dark=False)
    browser.open(url)
    assert browser.wait(READY, 240.0), "the run does not begin"
    browser.wait("document.querySelector('#figures svg.led')")
    led, (low, high) = browser.run("Object.entries(tautwave.figures.ranges)[0]")
    x, y, width = browser.run(
        "(()=>{const e=document.querySelector('#figures svg.led');"
        "e.scrollIntoView({block:'center'}); const r=e.getBoundingClientRect();"
        "return [r.x+r.width/2, r.y+0.4*r.height, r.width]})()"
    )
    mouse = {"button": "left", "buttons": 1, "clickCount": 1, "y": y}
    began, word = time.monotonic(), "mousePressed"
    while (now := time.monotonic() - began) < PLAYED_S and not browser.run("tautwave.ended"):
        side = 0.45 * width * math.sin(2.0 * math.pi * 0.7 * now)
        browser.call("Input.dispatchMouseEvent", type=word, x=x + side, **mouse)
        if word == "mousePressed":
            word = "mouseMoved"
        time.sleep(0.02)
    browser.shot(directory / f"{name}.png")
    browser.call("Input.dispatchMouseEvent", type="mouseReleased", x=x, **mouse)
    time.sleep(LEFT_S)
    click(browser, "#stop")
    found: dict[str, Any] = {"range": [low, high], "ended": browser.wait("tautwave.ended")}
    if name.startswith("scene-"):
        found["sound"] = browser.wait("!document.getElementById('listen').hidden", 120.0)
        if found["sound"]:
            click(browser, "#listen")
            found["heard_s"] = browser.run("tautwave.playing.buffer.duration")
    browser.shot(directory / f"{name}-ended.png")
    found["code"] = run.wait(120)
    summary, _ = read_summary(out)
    found |= {"outcome": summary.outcome.sentence, "cycles": summary.cycles,
              "missed": summary.missed_cycles}  # fmt: skip
    rows = read_recording(out, [f"true.master.{led}.position"])
    places = rows[f"true.master.{led}.position"]
    found["places"] = [float(places.min()), float(places.max())]
    return found


def main(directory: Path, *wanted: str) -> None:
    """Take the pictures of the bench, and of scenes, or of those named."""
    directory.mkdir(parents=True, exist_ok=True)
    with Browser() as browser:
        if not wanted or "bench" in wanted:
            bench(browser, directory)
        if not wanted or "arms" in wanted:
            arms(browser, directory)
        for name in PLAYED:
            if not wanted or name in wanted:
                print(name, played(browser, name, directory), flush=True)
        print(browser.problems or "no problems", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
