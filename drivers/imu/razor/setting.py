"""Bringing a board with the default firmware to the wished stream with as few keys as possible.

Each key is a toggle that is written to flash. So the state is never assumed: it is a set of states
that explain the lines; a key moves every one of them, and the next lines show which were wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from drivers.errors import DeviceFaultError
from drivers.imu.razor.columns import WISHED, Columns, accel_range_g, candidates
from drivers.imu.razor.lines import Row, reply_of, row_of
from drivers.imu.razor.talk import Talk

ENOUGH_ROWS, FEW_ROWS = 6, 2
FEW_ROWS_AFTER_S, PATIENCE_S = 0.3, 2.2
RATE_HZ = 100
SLOWEST_STEP_MS = 10.5
"""Median step of a stream of 100 Hz, with its whole milliseconds."""
SLOW_S = 0.2
MOST_KEYS = 24
REPLY_S = 0.5


@dataclass
class Setting:
    """What the board turned out to print, and what was pressed to get there.

    certain_* : whether that full scale was seen or is the factory's.
    """

    columns: Columns
    keys: str = ""
    accel_range_g: int = 2
    gyro_range_deg_s: int = 2000
    certain_accel: bool = False
    certain_gyro: bool = False
    replies: dict[str, int] = field(default_factory=dict)


def bring_to_wish(
    talk: Talk, accel_wish_g: int | None = None, gyro_wish_deg_s: int | None = None
) -> Setting:
    """Press what differs from the wished columns, rate and full scales, and check what then comes.

    accel_wish_g, gyro_wish_deg_s : None leaves the full scale as it is.
    Raises `DeviceFaultError` where the lines make no sense or the board does not do as told.
    """
    rows = _rows(talk)
    states = candidates(rows)
    if not states:
        raise _no_sense(talk, rows)
    setting = Setting(WISHED)
    if talk.pace_s > SLOW_S:  # each key would take seconds to show
        _press_until(talk, setting, "r", "rate_hz", RATE_HZ)
    if not states[0].time:
        states, rows = _press(talk, setting, "t", states)
    _set_rate(talk, setting, rows)
    while (key := states[0].key_towards(WISHED)) is not None:
        states, rows = _press(talk, setting, key, states)
    _set_ranges(talk, setting, accel_wish_g, gyro_wish_deg_s)
    return setting


def _press(
    talk: Talk, setting: Setting, key: str, states: list[Columns]
) -> tuple[list[Columns], list[Row]]:
    """The states that are left after a key, and the lines that followed it."""
    before = states[0].decimals()
    after = [state.toggled(key) for state in states]
    forms = {state.decimals() for state in after}
    _send(talk, setting, key)
    # Lines of the old form are still under way; they mean something only if no others come.
    patience_s = FEW_ROWS_AFTER_S if before in forms else PATIENCE_S
    rows = _rows(talk, *(forms - {before}), patience_s=patience_s)
    if not rows and before in forms:
        rows = _rows(talk, before)
    if not rows:
        raise DeviceFaultError(
            f"{talk.port.name}: the Razor does not do as the key {key!r} says; its firmware is not "
            f"SparkFun's default (keys pressed so far: {setting.keys})"
        )
    return [state for state in candidates(rows) if state in after], rows


def _set_rate(talk: Talk, setting: Setting, rows: list[Row]) -> None:
    """Press r until the board says 100 Hz, unless its clock, in front, steps that fast already."""
    step_ms = float(np.median(np.diff([row.values[0] for row in rows])))
    if step_ms > SLOWEST_STEP_MS and setting.replies.get("rate_hz") != RATE_HZ:
        _press_until(talk, setting, "r", "rate_hz", RATE_HZ)


def _set_ranges(
    talk: Talk, setting: Setting, accel_wish_g: int | None, gyro_wish_deg_s: int | None
) -> None:
    """Find the full scales, and change them where that is wished."""
    setting.accel_range_g, setting.certain_accel = _seen_accel_range(talk)
    if accel_wish_g is not None and (
        not setting.certain_accel or setting.accel_range_g != accel_wish_g
    ):
        _press_until(talk, setting, "A", "accel_range_g", accel_wish_g)
        setting.accel_range_g, setting.certain_accel = accel_wish_g, True
    if gyro_wish_deg_s is not None:
        _press_until(talk, setting, "G", "gyro_range_deg_s", gyro_wish_deg_s)
        setting.gyro_range_deg_s, setting.certain_gyro = gyro_wish_deg_s, True


def _seen_accel_range(talk: Talk) -> tuple[int, bool]:
    """By the size of the acceleration, which at rest is 1 g; it must come in the wished form."""
    rows = _rows(talk, WISHED.decimals())
    if not rows:
        raise _no_sense(talk, rows)
    place = WISHED.places()["accel"]
    return accel_range_g(float(np.mean([np.linalg.norm(row.values[place]) for row in rows])))


def _press_until(talk: Talk, setting: Setting, key: str, name: str, wanted: int) -> None:
    """Press a key that steps through values and names each, until it names the wanted one."""
    seen: list[int] = []
    while setting.replies.get(name) != wanted:
        _send(talk, setting, key)
        end_ns = talk.port.now_ns() + round(REPLY_S * 1e9)
        reply = None
        while reply is None and talk.port.now_ns() < end_ns:
            text = talk.line((end_ns - talk.port.now_ns()) * 1e-9)
            found = None if text is None else reply_of(text)
            reply = found[1] if found is not None and found[0] == name else None
        if reply is None or reply in seen:
            raise DeviceFaultError(
                f"{talk.port.name}: the Razor does not answer the key {key!r} with {wanted} "
                f"(it said {seen or 'nothing'}); its firmware is not SparkFun's default"
            )
        seen.append(reply)
        setting.replies[name] = reply


def _send(talk: Talk, setting: Setting, key: str) -> None:
    if len(setting.keys) >= MOST_KEYS:
        raise DeviceFaultError(
            f"{talk.port.name}: the Razor cannot be brought to raw values at {RATE_HZ} Hz with "
            f"{MOST_KEYS} keys ({setting.keys}); set it by hand in a terminal and try again"
        )
    setting.keys += key
    talk.port.write(key.encode())


def _rows(talk: Talk, *forms: tuple[int, ...], patience_s: float = PATIENCE_S) -> list[Row]:
    """Lines in a row that have one of the forms, or any form if none is given, the same for all.

    Some of them if enough come, fewer if they come slowly, none if it takes too long.
    """
    rows: list[Row] = []
    start_ns = talk.port.now_ns()
    while (spent_s := (talk.port.now_ns() - start_ns) * 1e-9) < patience_s:
        if len(rows) >= ENOUGH_ROWS or (len(rows) >= FEW_ROWS and spent_s > FEW_ROWS_AFTER_S):
            break
        text = talk.line(patience_s - spent_s)
        if text is None:
            break
        row = row_of(text)
        if row is None or (forms and row.decimals not in forms):
            continue
        if rows and rows[-1].decimals != row.decimals:
            rows.clear()
        rows.append(row)
    return rows if len(rows) >= FEW_ROWS else []


def _no_sense(talk: Talk, rows: list[Row]) -> DeviceFaultError:
    what = f"lines of {len(rows[0].values)} numbers" if rows else "lines that keep changing"
    return DeviceFaultError(
        f"{talk.port.name}: the Razor prints {what}, which no setting of SparkFun's default "
        "firmware explains; upload that firmware again"
    )
