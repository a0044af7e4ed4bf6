"""A run, its page and a browser on a machine with nothing but its loopback; prints what was seen.

`unshare --net python -m tests.view.alone DIR [--pictures]`: DIR gets the run, and pictures.
"""

from __future__ import annotations

import atexit
import fcntl
import json
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tautwave import read_recording
from tests.commands import END_STOPS
from tests.view.browser import Browser
from tests.view.served import BENCH

SIOCSIFFLAGS, UP = 0x8914, 0x1 | 0x40
RUN = "from tautwave.cli import main; main()"
PLACES = ", ".join(f"[{0.5 * k}, {0.2 * (k // 2 % 2)}]" for k in range(4, 500))
MOVING = "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0], " + PLACES + "]}"
NAME = "name=<b onclick=alert(1)>bench</b>"
CALM = (
    "operate={}",
    *END_STOPS,
    "loop.overrun_limit=5000",
    "loop.missing_limit=5000",
    MOVING,
    NAME,
)
POLES = tuple(f"coupling.pairs.lever.pole_{side}=0.2" for side in ("master", "slave"))
K = "coupling.pairs.lever.wall_slave.stiffness"


def raise_loopback() -> None:
    """Switch on the namespace's only interface."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, SIOCSIFFLAGS, struct.pack("16sh14x", b"lo", UP))


def click(browser: Browser, selector: str) -> None:
    """Press a button as a person does, at its place."""
    at = browser.run(
        f"(()=>{{const e=document.querySelector({selector!r});"
        "e.scrollIntoView({block:'center'}); const r=e.getBoundingClientRect();"
        "return [r.x+r.width/2, r.y+r.height/2]})()"
    )
    press(browser, *at)


def press(browser: Browser, x: float, y: float, *, to: float | None = None, keys: int = 0) -> None:
    """Press the mouse at a place; drag it along if there is a `to`."""
    mouse: dict[str, Any] = {"button": "left", "clickCount": 1, "modifiers": keys}
    browser.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
    browser.call("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, **mouse)
    if to is not None:
        for part in (0.5, 1.0):
            browser.call(
                "Input.dispatchMouseEvent", type="mouseMoved", x=x + part * (to - x), y=y, buttons=1
            )
    browser.call("Input.dispatchMouseEvent", type="mouseReleased", x=to or x, y=y, **mouse)


def text(browser: Browser, name: str) -> str:
    return str(browser.run(f"document.getElementById({name!r}).textContent"))


def state(browser: Browser, word: str) -> bool:
    return browser.wait(f"document.getElementById('state').textContent == {word!r}")


def operate(browser: Browser) -> dict[str, bool]:
    """Press every button of the rig that its state allows; return which had its effect."""
    found = {}
    click(browser, "#sound")
    for word, after in (("engage", "engaged"), ("clutch", "clutched"), ("hold", "holding"),
                        ("rest", "idle"), ("engage", "engaged")):  # fmt: skip
        click(browser, f'[data-word="{word}"]')
        found[f"{word} {after}"] = state(browser, after)
    found["sound"] = browser.run("tautwave.controls.audio?.currentTime !== undefined")
    browser.run("document.getElementById('episode-name').value = 'pick'")
    click(browser, "#episode-begin")
    found["episode begins"] = browser.wait("!document.getElementById('episode-success').disabled")
    click(browser, "#episode-success")
    found["episode ends"] = browser.wait("document.getElementById('episode-success').disabled")
    return found


SHADES = """((faulted) => {
  const calm = tautwave.soFar;
  tautwave.soFar = {...calm, faulted};
  const shade = (id) => {
    const badge = document.getElementById(id);
    const {backgroundColor, color} = getComputedStyle(badge);
    return [badge.textContent, badge.className, backgroundColor, color];
  };
  const states = ["running", ...tautwave.facts.states].map((state) => {
    tautwave.showState(state);
    return shade("state");
  });
  const certificates = Object.keys({ok: 0, note: 0, bad: 0, open: 0}).map((severity) => {
    tautwave.showCertificate({...tautwave.facts.certificate, state: severity, severity});
    return shade("certificate");
  });
  tautwave.soFar = calm;
  tautwave.showCertificate(tautwave.facts.certificate);
  return [...states, ...certificates];
})"""
"""Texts, classes and colours of the header's badges: every state, every severity."""


def shades(browser: Browser) -> dict[str, list[list[str]]]:
    """Return what the badges say and how, by theme, without and after a fault."""
    found = {}
    for dark in (False, True):
        browser.look(1400, 1000, dark=dark)
        for faulted in (False, True):
            name = f"{'dark' if dark else 'light'}{' after a fault' if faulted else ''}"
            found[name] = list(browser.run(f"{SHADES}({json.dumps(faulted)})"))
    browser.look(1400, 1000, dark=False)
    return found


BARRED = """["#stop", "#apply", "#episode-begin", ...["engage", "clutch", "hold", "rest"].map(
  (word) => `[data-word=${word}]`)].map((one) => [one, document.querySelector(one)])
  .map(([one, button]) => [one, button.disabled && button.title])"""
"""By button: what it says it is disabled for."""


def bad_day(browser: Browser) -> dict[str, Any]:
    """Give the page a run's faults; return what its header, its buttons and its journal say."""
    cause = {"at_s": 2.0, "word": "fault", "source": "controller", "state": "holding",
             "text": "slave.lever: no power", "refused": False}  # fmt: skip
    later = {**cause, "at_s": 3.0, "text": "slave.lever: 3 samples missing"}
    said = {"operated": True, "from_s": 0.0, "engaged_s": 1.0, "faults": 28, "stops": 1,
            "cut_off": 2, "faulted": True, "cause": cause,
            "kinds": [[900, cause, 1, 2.0], [901, later, 27, 66.6]]}  # fmt: skip
    calm = "structuredClone(tautwave.soFar)"
    return dict(browser.run(
        f"(()=>{{const calm = {calm}; const read = (id) => document.getElementById(id).textContent;"
        "const hear = (said) => tautwave.hear({op: 'so_far', ...said});"
        f"hear({json.dumps(said)});"
        "const engage = document.querySelector('[data-word=engage]');"
        "const found = {events: read('events'), why: read('why'), engage: engage.disabled,"
        " shade: document.getElementById('events').className,"
        " title: engage.title, entries: [...document.querySelectorAll('#entries li')].slice(0, 3)"
        ".map((one) => one.textContent)};"
        "hear({...calm, kinds: [], faults: 1});"
        "found.acknowledged = document.getElementById('events').className;"
        "hear(calm); return found})()"
    ))  # fmt: skip


def look_around(browser: Browser, directory: Path) -> dict[str, bool]:
    """Use the scope's own buttons, cursors and zoom; return which had their effect."""
    found = {}
    click(browser, "#pause")
    held = browser.run("tautwave.scope.view.to")
    time.sleep(0.3)
    found["pause"] = browser.run("tautwave.scope.view.to") == held
    x, y, width = browser.run(
        "(()=>{const r=document.querySelector('.u-over').getBoundingClientRect();"
        "return [r.x, r.y + 40, r.width]})()"
    )
    press(browser, x + 0.3 * width, y)
    press(browser, x + 0.6 * width, y, keys=8)
    found["cursors"] = browser.wait("document.querySelector('.key').textContent.includes('Δ')")
    press(browser, x + 0.4 * width, y, to=x + 0.5 * width)
    span = "tautwave.scope.view.to - tautwave.scope.view.from"
    found["zoom"] = browser.wait(f"Math.abs({span} - 0.1) < 0.005")
    csv = str(browser.run("tautwave.scope.csv()")).splitlines()
    view = "tautwave.scope.view"
    shown = f"tautwave.store.rowAt({view}.to + 1e-9) - tautwave.store.rowAt({view}.from)"
    found["csv"] = (  # a machine that is held up leaves out slots
        csv[0].startswith("time_s,master.lever.position")
        and len(csv) == 1 + browser.run(shown)
        and 1 < len(csv) < 110
    )
    found["png"] = browser.run("tautwave.scope.picture().toDataURL().length") > 10_000
    browser.call(
        "Browser.setDownloadBehavior", behavior="allow", downloadPath=str(directory / "saved")
    )
    for button in ("png", "csv"):
        click(browser, f"#{button}")
    until = time.monotonic() + 60.0
    saved: set[str] = set()
    while time.monotonic() < until and saved != {".png", ".csv"}:
        saved = {path.suffix for path in (directory / "saved").glob("*")}
        time.sleep(0.05)
    found["saved"] = saved == {".png", ".csv"}
    click(browser, "#all")
    found["reset zoom"] = browser.wait(f"{span} > 0.98")
    click(browser, "#clear")
    found["no cursors"] = browser.wait("!document.querySelector('.key').textContent.includes('Δ')")
    click(browser, "#run")
    found["run"] = browser.wait(f"tautwave.scope.view.to > {held} + 0.3")
    return found


def fire(browser: Browser, column: str, level: float, mode: str) -> float | None:
    """Set the trigger; return the time of the first row at which it fires [s]."""
    browser.run(
        "(()=>{const set=(k,v)=>{document.getElementById('trigger-'+k).value=v};"
        f"set('mode', {mode!r}); set('source', tautwave.facts.columns.indexOf({column!r}));"
        f"set('level', {level}); set('hysteresis', 0.01);"
        "document.getElementById('trigger-mode').onchange()})()"
    )
    if mode == "off" or not browser.wait("tautwave.scope.trigger.hit !== null"):
        return None
    return float(browser.run("tautwave.store.timeOf(tautwave.scope.trigger.hit)"))


def tune(browser: Browser, value: float) -> str:
    """Ask for a stiffness; return what the page says."""
    browser.run(
        f"(e=>{{e.value = {value}; e.dispatchEvent(new Event('input', {{bubbles: true}}))}})"
        f"(document.querySelector('[aria-label={json.dumps(K)}]'))"
    )
    browser.run("document.getElementById('note').textContent = ''")
    click(browser, "#apply")
    browser.wait("/K = |certified:|not on/.test(document.getElementById('note').textContent)")
    return text(browser, "note")


def pictures(browser: Browser, directory: Path) -> list[str]:
    """Take the page's picture at two widths, light and dark."""
    found = []
    for width in (1400, 500):
        for dark in (False, True):
            browser.look(width, 1000, dark=dark)
            browser.run("scrollTo(0, 0)")
            time.sleep(0.4)
            path = directory / f"view-{width}-{'dark' if dark else 'light'}.png"
            browser.shot(path, whole=width == 500)
            found.append(path.name)
    browser.look(1400, 1000, dark=False)
    return found


OVERPRINTS = """(async () => {
  const { Schematic } = await import("/schematic.js");
  const svg = document.getElementById("schematic");
  const drawing = new Schematic(svg, tautwave.store, tautwave.facts);
  const elements = ["port", "receiver", "align"].flatMap((e) => [`${e}_master`, `${e}_slave`]);
  drawing.show({ ...tautwave.facts.pairs[0], elements: [...elements, "network"] });
  drawing.draw();
  const boxes = [...svg.querySelectorAll("rect")].map((one) => one.getBBox());
  return drawing.flows.map(({ label }) => {
    label.textContent = "−123 mW";
    const a = label.getBBox();
    return boxes.filter((b) => a.x < b.x + b.width && b.x < a.x + a.width
                            && a.y < b.y + b.height && b.y < a.y + a.height).length;
  });
})()"""
"""By flow of a drawing with many boxes: how many of them the flow's number is printed over."""


GRAINS = """(async () => {
  const { Figures } = await import("/figures.js");
  const article = document.createElement("article");
  const host = article.appendChild(document.createElement("div"));
  const columns = Array.from({length: 12}, (_, k) => `scene.at.grain${k}`);
  const axis = {name: "bar", unit: "m", effort: "N", sides: {master: {range: [-1, 1]}}};
  const facts = {pairs: [], axes: [axis]};
  new Figures(host, {columns, newest: () => 0.1}, facts, () => {}).draw();
  const svg = host.querySelector("svg");
  const nodes = [...svg.querySelectorAll(".node")];
  const dots = nodes.map((one) => +one.getAttribute("d").match(/ (.*)h/)[1]);
  return [svg.viewBox.baseVal.y, svg.viewBox.baseVal.y + svg.viewBox.baseVal.height, ...dots];
})()"""
"""Where the picture of a scene begins and ends, and how high each of its grains stands there."""


def start(
    out: Path, sets: Sequence[str], *options: str, rig: Path = BENCH
) -> tuple[subprocess.Popen[str], str]:
    """Start a run with its page; return it and the address."""
    words = ["run", str(rig), *(word for override in sets for word in ("--set", override)),
             "--duration", "260", "--out", str(out), "--view", "--quiet", *options]  # fmt: skip
    run = subprocess.Popen(
        [sys.executable, "-c", RUN, *words],
        stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    atexit.register(run.kill)  # whatever becomes of the browser
    assert run.stderr is not None
    return run, run.stderr.readline().split()[1]


def rescale(browser: Browser, out: Path) -> bool:
    """Press the button of another scale; return whether it acts, and the rig is engaged again."""
    run, url = start(out, (*CALM, "operate={scales: [0.5]}", *POLES))
    browser.open(url)
    browser.wait("window.tautwave?.store?.end > 10", 120.0)
    click(browser, '[data-word="engage"]')
    state(browser, "engaged")
    click(browser, '#scales button[value="0.5"]')
    acts = browser.wait("tautwave.store.newest('operation.scale') == 0.5")
    acts = acts and browser.wait("document.querySelector('#scales .on').value == '0.5'")
    acts = acts and state(browser, "engaged")
    run.kill()
    run.wait(30)
    return acts


def pointed(browser: Browser, out: Path) -> dict[str, bool]:
    """Drag the lever by the mouse, then let go; return whether the hand followed, and let go."""
    run, url = start(out, ("loop.overrun_limit=5000", "loop.missing_limit=5000"), "--pointer",
                     "--allow-uncertified")  # fmt: skip
    browser.open(url)
    browser.wait("window.tautwave?.store?.end > 10", 120.0)
    x, y, scale = browser.run(
        "(()=>{const s=document.querySelector('#figures svg.led'); const m=s.getScreenCTM();"
        "return [m.e, m.f, m.a]})()"
    )
    mouse: dict[str, Any] = {"button": "left", "buttons": 1, "clickCount": 1}
    place = {"x": x + 60.0 * scale, "y": y - 90.0 * scale}  # 0.46 rad on the dial
    browser.call("Input.dispatchMouseEvent", type="mousePressed", **place, **mouse)
    at = "tautwave.store.newest('true.master.lever.reference')"
    end = browser.run("tautwave.figures.ranges.lever[1]")
    follows = browser.wait(f"Math.abs({at} - {end}) < 0.01")
    browser.call("Input.dispatchMouseEvent", type="mouseReleased", **place, **mouse)
    position = "tautwave.store.newest('true.master.lever.position')"
    lets_go = browser.wait(f"{at} === {position}")
    run.kill()
    run.wait(30)
    return {"pointer leads": follows, "pointer lets go": lets_go}


def main(directory: Path, looked_at: bool) -> None:
    """Do all of it, and print it as JSON; take pictures for a person to look at."""
    raise_loopback()
    out = directory / "run"
    run, url = start(out, CALM, "--allow-tuning")
    found: dict[str, Any] = {}
    with Browser() as browser:
        browser.look(1400, 1000, dark=False)
        browser.open(url)
        found["loads"] = browser.wait("window.tautwave?.store?.end > 10", 120.0)
        found["name"] = text(browser, "rig")
        found["token in address"] = "#" in browser.run("location.href")
        found["bad day"] = bad_day(browser)
        found["shades"] = shades(browser)
        found["buttons"] = operate(browser)
        browser.run("(e=>{e.value = 1; e.onchange()})(document.getElementById('span'))")
        found["fired"] = {mode: fire(browser, "master.lever.position", 0.1, mode)
                          for mode in ("normal", "auto")}  # fmt: skip
        click(browser, "#single")
        single = browser.wait("tautwave.scope.trigger.done && !tautwave.scope.running")
        found["buttons"]["single"] = single
        fire(browser, "master.lever.position", 99.0, "off")
        found["buttons"] |= look_around(browser, directory)
        click(browser, "#pause")  # the certificate has the processor that drawing took
        found["refused"] = tune(browser, 20.0)
        found["tuned"] = tune(browser, 3.1)
        found["acts"] = browser.wait(
            "Math.abs(tautwave.store.newest('tuning.slave.lever.wall_stiffness') - 3.1) < 1e-9"
        )
        browser.run("(e=>{e.value = 5; e.onchange()})(document.getElementById('span'))")
        if looked_at:
            found["pictures"] = pictures(browser, directory)
        found["wide"] = []
        for width in (1400, 420):
            browser.look(width, 1000, dark=False)
            wide = "document.documentElement.scrollWidth"
            browser.wait(f"{wide} <= {width}", 20.0)  # then curves are drawn anew
            found["wide"].append(browser.run(wide) - width)
        browser.look(1400, 1000, dark=False)
        found["overprints"] = browser.run(OVERPRINTS)
        found["grains"] = browser.run(GRAINS)
        click(browser, "#stop")
        found["ended"] = browser.wait("tautwave.ended")
        found["barred"] = dict(browser.run(BARRED))
        found["seen"] = browser.run("tautwave.store.end")
        found["first"] = browser.run("tautwave.store.first")
        found["requests"] = sorted(set(browser.requests))
        found["problems"] = list(browser.problems)
        found["buttons"]["scale"] = rescale(browser, directory / "scaled")
        found["buttons"] |= pointed(browser, directory / "pointed")
    while (out / "live.json").exists():
        time.sleep(0.05)
    run.terminate()  # its report is not needed here
    run.wait(60)
    rows = read_recording(out, ["time_s", "master.lever.position"])
    found["rows"] = len(rows)
    found["edges"] = edges(rows, "master.lever.position", 0.1)
    print(json.dumps(found))


def edges(rows: Any, column: str, level: float) -> list[float]:
    """Return the times of the first rows at or above a level [s]."""
    time_s, values = rows["time_s"], rows[column]
    at = [k for k in range(1, len(values)) if values[k - 1] < level <= values[k]]
    return [float(time_s[k]) for k in at]


if __name__ == "__main__":
    main(Path(sys.argv[1]), "--pictures" in sys.argv)
