"""Phase steps of a steady beat: which packets they are found before, and what is no step."""

import numpy as np
import pytest

from instrument.devices.streamed_codes import PacketLossFinder, _steps

LIMIT = 0.2


def _bend(steps: dict[int, float], packets: int = 20, single: dict[int, float] | None = None) -> np.ndarray:
    """Return the second difference of phases that step before packets, some of which are disturbed by themselves."""
    phases = np.zeros(packets)
    for at, size in steps.items():
        phases[at:] += size
    for at, size in (single or {}).items():
        phases[at] += size
    return np.diff(phases, 2)


@pytest.mark.parametrize(
    ("steps", "single", "found", "at_end"),
    [
        ({7: 1.0}, {}, [7], False),
        ({7: -0.3, 12: 0.21}, {}, [7, 12], False),
        ({7: 0.19}, {}, [], False),
        ({}, {7: 0.5}, [], False),  # disturbed, not lost
        ({7: 1.0, 8: 0.7}, {}, [7], False),  # two losses at once are one seam
        ({18: 1.0}, {}, [], False),  # the last two bends: undecided without the next packets
        ({19: 1.0}, {}, [], False),
        ({17: 1.0, 18: -0.6}, {}, [17], True),
        ({0: 1.0, 1: 1.0}, {}, [], False),  # shows in the first bend alone
    ],
)
def test_a_step_is_found_before_its_packet(steps, single, found, at_end) -> None:
    bend = _bend(steps, single=single)
    assert _steps(bend, np.ones(bend.size, bool), LIMIT) == (found, at_end)


def test_a_packet_without_a_clear_beat_decides_nothing() -> None:
    bend = _bend({7: 1.0, 12: 1.0})
    judged = np.ones(bend.size, bool)
    judged[5] = False
    assert _steps(bend, judged, LIMIT) == ([12], False)


def _beat(samples: int, cycles_a_packet: float, offset: float = 128.0, seed: int = 1) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0, 1.5, samples)
    beat = 60 * np.cos(2 * np.pi * cycles_a_packet / 256 * np.arange(samples) + seed)
    return np.round(beat + offset + noise).astype(np.int16)


@pytest.mark.parametrize("cycles", [1.37, 2.61, 30.3, 110.4])
@pytest.mark.parametrize("offset", [0.0, 128.0])
def test_a_lost_packet_is_found_whatever_the_beat_and_the_offset(cycles: float, offset: float) -> None:
    whole = _beat(256 * 400, cycles, offset).reshape(-1, 256)
    kept = np.delete(whole, [150, 200, 201, 290], axis=0).reshape(-1)
    for pieces in (1, 3):
        seams, found, at = PacketLossFinder(256), [], 0
        for piece in np.split(kept, np.arange(1, pieces) * 256 * (396 // pieces)):
            found += [at + seam for seam in seams.find(piece)]
            at += piece.size // 256
        assert found == [150, 199, 287]


def test_a_loss_in_the_last_packets_is_told_by_the_next_call_with_a_negative_place() -> None:
    whole = _beat(256 * 300, 30.3).reshape(-1, 256)
    kept = np.delete(whole, 149, axis=0)
    for begins, place in ((150, -1), (151, -2), (149, 0)):
        seams = PacketLossFinder(256)
        assert seams.find(kept[:begins].reshape(-1)) == []
        assert seams.find(kept[begins:].reshape(-1)) == [place]


def test_after_it_forgot_the_next_packets_need_not_continue_the_last_ones() -> None:
    seams = PacketLossFinder(256)
    assert seams.find(_beat(256 * 100, 30.3, seed=1)) == []
    seams.forget()
    assert seams.find(_beat(256 * 100, 30.3, seed=2)) == []
    assert seams.find(_beat(256 * 100, 30.3, seed=3)) == [0]  # not forgotten: a step


def test_a_beat_that_changes_its_frequency_is_found_again() -> None:
    seams = PacketLossFinder(256)
    assert seams.find(_beat(256 * 200, 30.3)) == []
    seams.find(_beat(256 * 200, 44.9))  # nothing of it is in the old beat
    lost = np.delete(_beat(256 * 300, 44.9).reshape(-1, 256), 150, axis=0).reshape(-1)
    seams.forget()
    assert seams.find(lost) == [150]


def test_the_beat_is_learned_over_several_calls_and_less_than_a_packet_tells_nothing() -> None:
    seams = PacketLossFinder(256)
    whole = np.delete(_beat(256 * 300, 30.3).reshape(-1, 256), 200, axis=0)
    assert seams.find(whole[0, :200]) == []
    found, at = [], 0
    for part in np.array_split(whole, 10):
        found += [at + seam for seam in seams.find(part.reshape(-1))]
        at += len(part)
    assert found == [200]


def _stepped(step_rad: float, noise: float = 20.0, packets: int = 400, at: int = 200) -> np.ndarray:
    """Return a beat of 32 cycles a packet, amplitude 10000, whose phase steps before a packet."""
    n = np.arange(256 * packets)
    phase = 2 * np.pi / 8 * n + 0.3 + np.where(n >= 256 * at, step_rad, 0.0)
    drawn = np.random.default_rng(5).normal(0.0, noise, n.size)
    return np.round(10_000 * np.cos(phase) + drawn).astype(np.int16)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("step_rad", "found"), [(0.115, []), (0.125, [200]), (3.0, [200])])
def test_a_steady_beat_tells_steps_from_0_12_rad_on(step_rad: float, found: list[int], sign: float) -> None:
    assert PacketLossFinder(256).find(_stepped(sign * step_rad)) == found


@pytest.mark.parametrize(("step_rad", "found"), [(0.24, []), (0.36, [200])])
def test_a_noisy_beat_tells_steps_from_ten_times_its_noise_on(step_rad: float, found: list[int]) -> None:
    noise = 0.03 / np.sqrt(6) / np.sqrt(2 / 256) * 10_000  # of second differences of a packet's phase: 0.03 rad
    seams = PacketLossFinder(256)
    assert seams.find(_stepped(step_rad, noise)) == found
    assert seams._sigma == pytest.approx(0.03, rel=0.1)


def test_noise_alone_is_no_beat_and_a_dark_packet_decides_nothing() -> None:
    noise = np.random.default_rng(1).normal(0.0, 100.0, 256 * 200).astype(np.int16)
    seams = PacketLossFinder(256)
    assert seams.find(noise) == [] and seams._table is None
    dark = _stepped(1.0)
    dark[256 * 199 : 256 * 200] = noise[:256]  # the packet before the step
    assert PacketLossFinder(256).find(dark) == []
    for share, judged in ((0.35, True), (0.15, False)):  # of a packet's power in the beat
        mixed = _stepped(1.0).astype(float)
        packet = slice(256 * 199, 256 * 200)
        mixed[packet] += np.random.default_rng(2).normal(0.0, 10_000 * np.sqrt(0.5 * (1 / share - 1)), 256)
        mixed = np.clip(np.round(mixed), -32768, 32767).astype(np.int16)
        assert (len(PacketLossFinder(256).find(mixed)) > 0) == judged


def _strongest_over_median(counts: np.ndarray) -> float:
    spectrum = np.abs(np.fft.rfft((counts - counts.mean()) * np.hanning(counts.size)))[8:]
    return float(spectrum.max() / np.median(spectrum))


@pytest.mark.parametrize(("amplitude", "beat"), [(45.0, True), (24.0, False)])
def test_a_line_twenty_times_above_the_median_of_the_spectrum_is_a_beat(amplitude: float, beat: bool) -> None:
    n = np.arange(1 << 14)
    noise = np.random.default_rng(3).normal(0.0, 100.0, n.size)
    counts = np.round(amplitude * np.cos(2 * np.pi * 0.1234 * n) + noise).astype(np.int16)
    assert (_strongest_over_median(counts) > 20) == beat
    seams = PacketLossFinder(256)
    assert seams._lock(counts) == beat and (seams._table is not None) == beat


@pytest.mark.parametrize(("dark", "known"), [(45, True), (55, False)])
def test_a_beat_that_most_packets_lack_is_looked_for_anew(dark: int, known: bool) -> None:
    whole = _stepped(0.0, packets=64 + 100).reshape(-1, 256)
    seams = PacketLossFinder(256)
    assert seams.find(whole[:64].reshape(-1)) == []
    seams.forget()
    spoilt = whole[64:].copy()
    spoilt[:dark] = np.random.default_rng(1).normal(0.0, 3000.0, (dark, 256))
    seams.find(spoilt.reshape(-1))
    assert (seams._table is not None) == known


def test_the_steps_size_is_learned_from_sixteen_packets() -> None:
    whole = _stepped(1.0, packets=64 + 40, at=64 + 30)
    for first, learned in ((64, True), (17, False)):
        seams = PacketLossFinder(256)
        seams._lock(whole)
        assert seams.find(whole[: 256 * first]) == []
        assert (seams._sigma > 0.0) == learned
