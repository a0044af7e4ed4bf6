"""Our bring-up and our cycle, frame by frame, against `golden` (which names its sources)."""

from __future__ import annotations

from tests.drivers.canopen import golden
from tests.drivers.canopen.benches import Rig, block, make, node


def rig(**bus: bool) -> Rig:
    return make(block(node(1, mapping="lean")), ("impedance",), mass=0.1, **bus)


def lines(one: Rig, since: int = 0) -> list[str]:
    return [golden.line(can_id, data) for _, can_id, data in one.sent[since:]]


def writes(all_lines: list[str]) -> list[str]:
    return [text for text in all_lines if text.startswith("601#2")]


def test_the_writes_of_a_bring_up() -> None:
    one = rig()
    one.driver.open()
    reported = lines(one)
    assert reported[0] == golden.PRE_OPERATIONAL
    assert golden.READ_IDENTITY in reported
    # PDOs 2 to 4, on at power-up, are switched off in between: 1401h to 1403h, 1801h to 1803h
    others = [text for text in writes(reported) if text[6:10] in OTHER_PDOS]
    mine = [text for text in writes(reported) if text not in others]
    assert tuple(mine) == golden.SET_UP
    start = reported.index(golden.START)
    assert start > reported.index(golden.SET_UP[-1])
    assert golden.SAVE not in reported
    one.driver.close()


OTHER_PDOS = ("0114", "0214", "0314", "0118", "0218", "0318")


def test_saving_is_the_documented_frame() -> None:
    one = rig(configure=True)
    one.driver.open()
    assert golden.SAVE in lines(one)
    one.driver.close()


def test_every_value_written_is_read_afterwards() -> None:
    one = rig()
    one.driver.open()
    reported = lines(one)
    for text in golden.SET_UP[1:-1]:
        read = f"601#40{text[6:12]}00000000"
        assert read in reported[reported.index(text) :], text
    one.driver.close()


def test_the_frames_of_enabling() -> None:
    one = rig()
    one.driver.open()
    at = len(one.sent)
    one.enable()
    rpdos = [text for text in lines(one, at) if text.startswith("201#")]
    assert tuple(dict.fromkeys(rpdos)) == golden.ENABLING
    one.driver.close()


def test_the_frames_of_a_cycle() -> None:
    one = rig()
    one.open_and_enable()
    one.cycle()
    for effort, expected in ((0.05, golden.CYCLE), (-0.05, golden.CYCLE_BACK)):
        at = len(one.sent)
        one.cycle(effort)
        reported = [text for text in lines(one, at) if text[:3] in ("080", "201")]
        assert tuple(reported) == expected
    at = len(one.sent)
    for _ in range(20):
        one.cycle(0.05)
    assert lines(one, at).count(golden.BEAT) == 1
    one.driver.close()
    assert lines(one)[-1] == golden.PRE_OPERATIONAL
