"""Texts and tones of the banner, the signal line, flags and verdicts."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from analysis.collision import Effect
from analysis.shot import DEFAULT_WAVELENGTH_AIR_M, Quantity, Role
from analysis.uncertainty import combined_uncertainties, with_combined_uncertainty
from app.session import Entry
from app.window.controls.theme import MARKS, Tone
from app.window.panels.rig import TileText
from app.words import (
    DASH,
    MILD_FLAGS,
    VERDICTS,
    flag_words,
    joined,
    localised_number,
    localised_text,
    number,
    size_words,
    tag,
    value_text,
)
from instrument.capture import SignalLine, Snapshot, State
from instrument.devices import Grade
from instrument.live import MOVING_HZ, ChannelSignal, doppler_shift_hz, judge_beat
from instrument.trigger import Level

TONES = {Grade.OK: Tone.GOOD, Grade.WARN: Tone.WARNING, Grade.FAIL: Tone.BAD}
FULL_DISK_BYTES = 2e9
AT_REST = "Not measured while the block moves"


@dataclass(frozen=True, slots=True)
class LastShot:
    """The banner's sentences on the last shot: one if it is on disk, one if it is only in memory."""

    name: str
    saved: str
    in_memory: str


def banner(snapshot: Snapshot, last_shot: LastShot | None) -> tuple[str, str, Tone]:
    """Return (word, sentence, tone) of the banner for the state of the rig."""
    state = snapshot.state
    if state is State.ARMING:
        return "ARMING", "Starting the digitizer; wait for ARMED before you push.", Tone.BUSY
    if state is State.ARMED:
        again = " Re-arms automatically." if snapshot.automatic else ""
        return "ARMED", f"Waiting for the light switch: push the block.{again}{_waiting(snapshot)}", Tone.WAITING
    if state is State.TRIGGERED:
        return "CAPTURED", "The light switch fired; recording the shot.", Tone.GOOD
    if state is State.TRANSFERRING:
        return "CAPTURED", "All samples received; saving them.", Tone.GOOD
    if state is State.ANALYSING:
        return "ANALYSING", f"The recording is saved. You can arm the next shot now.{_waiting(snapshot, 1)}", Tone.BUSY
    if state is State.FAULT:
        return "FAULT", fault_words(snapshot), Tone.BAD
    hint = "Press ARM (space), then push the block."
    if last_shot is not None:
        hint = last_shot.in_memory if last_shot.name in snapshot.unsaved else last_shot.saved
    return "READY", (_sentences(snapshot.message, snapshot.remedy) or hint) + _waiting(snapshot), Tone.NEUTRAL


def _waiting(snapshot: Snapshot, but: int = 0) -> str:
    """Return a sentence on the number of shots waiting for analysis, not counting ``but`` of them."""
    count = len(snapshot.waiting) - but
    if count <= 0:
        return ""
    return f" {count} more shot{' waits' if count == 1 else 's wait'} for analysis."


def last_shot(entry: Entry) -> LastShot:
    """Return the banner's sentences on a shot."""
    shot, number = entry.shot, entry.number
    if shot is None or shot.problem or shot.impact is None:
        why = (shot.problem if shot is not None else None) or "no impact was found"
        saved, unsaved = f"Shot {number} is saved but not analysed: {why}.", why
    else:
        key = "cor_quasi_static"
        cor = with_combined_uncertainty(shot.impact.cor_quasi_static, key, combined_uncertainties(shot))
        words = f"restitution {value_text(cor)}" if isinstance(cor, Quantity) else "no restitution was measured"
        saved, unsaved = f"Shot {number} is saved: {words}.", words
    return LastShot(entry.name, saved, _sentences(f"Shot {number} is only in memory: save it (Ctrl+S)", unsaved))


def fault_words(snapshot: Snapshot) -> str:
    """Return sentences on a fault: what happened, what was saved, what to do."""
    if snapshot.unsaved:
        saved = f"In memory only: {', '.join(snapshot.unsaved)}."
    elif snapshot.shots:
        one = snapshot.shots == 1
        saved = "The one shot taken so far is saved." if one else f"All {snapshot.shots} shots so far are saved."
    else:
        saved = "No shot was lost: none had been taken."
    kept = snapshot.save_failed and not snapshot.unsaved  # saved to another folder since
    remedy = "Arm again, or choose another folder first (F2)" if kept else snapshot.remedy or "arm again"
    return _sentences(snapshot.message or "something went wrong", saved, remedy)


def _sentences(*parts: str) -> str:
    sentences = [part.strip() for part in parts if part.strip()]
    return " ".join(part[0].upper() + part[1:] + ("" if part.endswith((".", "!", "?")) else ".") for part in sentences)


def tile_texts(line: SignalLine, rate_hz: float | None, bandwidth_hz: float) -> dict[str, TileText]:
    """Return the text of each tile of the signal line."""
    found = {"pd0": TileText(DASH, Tone.NEUTRAL), "pd1": TileText(DASH, Tone.NEUTRAL)}
    moves = abs(doppler_shift_hz(line.channels) or 0.0) > MOVING_HZ
    for channel in line.channels:
        if channel.role is Role.REFERENCE:
            found["pd0"] = _beat(channel, rate_hz)
        elif channel.role is Role.MEASUREMENT:
            found["pd1"] = _beat(channel, rate_hz, moves)
    found["switch"] = _switch(line)
    # a sweeping beat is spread over the spectrum, so that the noise beside it cannot be measured
    found["floor"] = TileText(DASH, Tone.NEUTRAL, AT_REST) if moves else _floor(line, rate_hz, bandwidth_hz)
    found["disk"] = _disk(line)
    return found


def _beat(channel: ChannelSignal, rate_hz: float | None, moves: bool = False) -> TileText:
    if channel.frequency_hz is None or channel.snr_db is None:
        words = "no beat"
    else:
        words = localised_number(f"{1e-6 * channel.frequency_hz:.5f} MHz  ")
        if moves and not channel.clipped_fraction:  # a sweeping beat is spread over the spectrum: it has no SNR
            return TileText(f"{words}moving", Tone.NEUTRAL, AT_REST)
        words += f"{channel.snr_db:.0f} dB"
    check = judge_beat(channel, rate_hz or math.inf)
    return TileText(words, TONES[check.grade], f"{check.name}: {localised_text(check.line)}")


def _switch(line: SignalLine) -> TileText:
    words = {Level.LOW: "low", Level.HIGH: "high"}.get(line.switch_level, DASH)
    if line.switch_toggles:
        return TileText(words, Tone.GOOD, f"Toggled {line.switch_toggles} times")
    return TileText(words, Tone.NEUTRAL, "Has not toggled yet: pass the block through it once")


def velocity_floor_m_per_s(line: SignalLine, rate_hz: float, bandwidth_hz: float) -> float | None:
    """Return the standard deviation of velocity in a bandwidth B due to the noise of both beats.

    Each beat has white phase noise of density 1/(SNR * rate/2) in rad^2/Hz.  Differentiated and integrated up to B,
    the summed density gives lambda/2 * sqrt(density * B^3 / 3).  None if an SNR is missing.
    """
    density = 0.0
    for channel in line.channels:
        if channel.role is Role.SWITCH:
            continue
        if channel.snr_db is None:
            return None
        density += 2.0 / (10 ** (channel.snr_db / 10) * rate_hz)
    if density == 0.0:
        return None
    return 0.5 * DEFAULT_WAVELENGTH_AIR_M * math.sqrt(density * bandwidth_hz**3 / 3.0)


def _floor(line: SignalLine, rate_hz: float | None, bandwidth_hz: float) -> TileText:
    floor = velocity_floor_m_per_s(line, rate_hz, bandwidth_hz) if rate_hz else None
    if floor is None:
        return TileText(DASH, Tone.NEUTRAL)
    words = f"{number(1e6 * floor, 2)} µm/s at {number(1e-3 * bandwidth_hz, 3)} kHz"
    return TileText(words, Tone.NEUTRAL, "Standard deviation of velocity due to the noise of both beats")


def _disk(line: SignalLine) -> TileText:
    if line.folder_problem:
        return TileText("cannot save", Tone.BAD, line.folder_problem)
    if line.disk_free_bytes is None:
        return TileText(DASH, Tone.NEUTRAL)
    tone = Tone.GOOD if line.disk_free_bytes > FULL_DISK_BYTES else Tone.BAD
    hover = "Room on the disk of the folder" if tone is Tone.GOOD else "Nearly full: choose another folder (F2)"
    return TileText(f"{size_words(line.disk_free_bytes)} free", tone, hover)


def flag_tone(flag: str) -> Tone:
    """Return the tone of a flag; a flag that only increases an uncertainty is no warning."""
    return Tone.NEUTRAL if flag in MILD_FLAGS else Tone.WARNING


def flag_line(flag: str) -> str:
    """Return a flag's mark and meaning."""
    return f"{MARKS[flag_tone(flag)]} {flag_words(flag)}"


def verdict_line(entry: Entry | None, effects: Iterable[Effect] = (), holds: bool = True) -> tuple[str, Tone]:
    """Return an entry's verdict in words and its tone, for a fit with these effects; "" without a verdict.

    ``holds``: whether the verdict refers to the present model and shots.
    """
    of = entry.verdict_of if entry is not None else None
    if of is None:
        return "", Tone.NEUTRAL
    if not holds:
        return joined(tag("s", of.words), " outdated: run Diagnose again"), Tone.NEUTRAL
    if VERDICTS[of.conclusion].names and of.found and set(of.found) <= set(effects):
        return f"{of.words}: in the model", Tone.GOOD
    return of.words, Tone(VERDICTS[of.conclusion].tone)


def misfit_advice(entry: Entry | None, effects: Iterable[Effect], holds: bool) -> str:
    """Return what to do about a misfit of an entry's own fit with these ``effects``; "" where nothing was found."""
    of = entry.verdict_of if entry is not None else None
    if of is None or not holds:
        return "run Diagnose"
    found = of.found if VERDICTS[of.conclusion].names else ()
    return "" if set(found) <= set(effects) else "this fit lacks what the diagnosis found: add it to the model"
