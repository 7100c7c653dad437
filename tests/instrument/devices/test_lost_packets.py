"""Lost packets are found at the right place, and nothing else is reported as lost."""

from types import SimpleNamespace

import numpy as np
import pytest

from instrument.devices.bulk_stream import Chunk
from instrument.devices.streamed_codes import ByteClock, PacketLossFinder, StreamedCodes

RATE_HZ = 10e6


def _codes(samples: int, beat_hz: float, seed: int, amplitude: float = 60.0, noise: float = 1.5) -> np.ndarray:
    """Two channels, uint8: a steady beat and one that is swept hard."""
    rng = np.random.default_rng(seed)
    t = np.arange(samples) / RATE_HZ
    reference = amplitude * np.cos(2 * np.pi * beat_hz * t + rng.uniform(0, 6))
    swept = amplitude * np.cos(2 * np.pi * (2e6 * t + 1e4 * np.sin(300 * t)))
    both = np.stack((reference, swept), axis=1) + 128.5 + rng.normal(0, noise, (samples, 2))
    return np.clip(both, 0, 255).astype(np.uint8).reshape(-1)


@pytest.mark.parametrize("seed", range(8))
def test_every_lost_packet_is_found_at_its_place(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    beat_hz = rng.uniform(0.6e6, 4.4e6)
    packets = 2000
    step = abs((beat_hz * 256 / RATE_HZ + 0.5) % 1 - 0.5)
    if step < 0.03:
        beat_hz += 2000.0  # a whole number of cycles in a packet is no step at all
    codes = _codes(packets * 256, beat_hz, seed).reshape(packets, 512)
    lost = np.sort(rng.choice(np.arange(400, packets - 20, 12), 9, replace=False))
    kept = np.delete(codes, lost, axis=0).reshape(-1)
    places = [int(at) - i for i, at in enumerate(lost)]  # the first packet after each loss, in what was kept
    cuts = np.sort(rng.choice(np.arange(1, kept.size), 30, replace=False))
    stream = StreamedCodes(2 * RATE_HZ, 0)
    blocks = []
    for at, piece in enumerate(np.split(kept, cuts)):
        stream.accept(Chunk(piece, at * 1e-9 + float(cuts[min(at, 29)]) / (2 * RATE_HZ)))
        _drain(stream, blocks)
    stream.flush()
    _drain(stream, blocks)
    found, at = [], 8
    for counts, lost_before in blocks:
        if lost_before is None:
            found.append(at)
        at += counts.shape[0] / 256
    assert found == places
    everything = np.concatenate([counts for counts, _ in blocks]).reshape(-1)
    np.testing.assert_array_equal(everything, kept[8 * 512 :].astype(np.int16) - 128)


def _drain(stream: StreamedCodes, blocks: list) -> None:
    while stream.ready:
        buffer = np.empty((1000, 2), np.int16)
        block = stream.deliver(buffer)
        blocks.append((buffer[: block.samples].copy(), block.lost_before))


@pytest.mark.parametrize("kind", ["steady", "noise", "flat", "disturbed", "clipped"])
def test_what_is_whole_is_not_called_lost(kind: str) -> None:
    codes = _codes(256 * 4000, 2.7e6, 5, amplitude=200.0 if kind == "clipped" else 60.0)[::2].copy()
    rng = np.random.default_rng(3)
    if kind == "noise":
        codes = rng.integers(0, 256, codes.size).astype(np.uint8)
    elif kind == "flat":
        codes[:] = 128
    elif kind == "disturbed":  # a spark into single packets
        for packet in rng.choice(np.arange(100, 3900, 10), 20, replace=False):
            codes[packet * 256 + 40 : packet * 256 + 140] = rng.integers(0, 256, 100)
    seams = PacketLossFinder(256)
    found = [seam for piece in np.split(codes, 40) for seam in seams.find(piece)]
    assert found == []


def _clocked(received: np.ndarray, times_s: np.ndarray, rate: float) -> list[tuple[float, int]]:
    clock = ByteClock(rate)
    told = []
    for count, now in zip(received, times_s, strict=True):
        lost = clock.count(int(count), float(now))
        if lost:
            told.append((float(now), lost))
    return told


@pytest.mark.parametrize(("lost_s", "told_after_s"), [(0.012, 2.2), (0.05, 0.5)])
def test_the_clock_finds_a_loss_among_late_deliveries(lost_s: float, told_after_s: float) -> None:
    rng = np.random.default_rng(11)
    rate = 20e6
    chunks = 900
    size = 1 << 18
    due = np.arange(1, chunks + 1) * size / rate * (1 + 80e-6)  # its crystal is slow
    late = np.abs(rng.normal(0, 0.5e-3, chunks))
    late[200:206] += 0.06  # the host was away, the queue was not
    late[300:360] += 0.01  # and busy for a good while
    times = np.maximum.accumulate(due + late)
    assert _clocked(np.full(chunks, size), times, rate) == []
    times[500:] += lost_s
    told = _clocked(np.full(chunks, size), times, rate)
    assert len(told) == 1
    assert times[500] < told[0][0] < times[500] + told_after_s
    assert told[0][1] == pytest.approx(lost_s * rate, rel=0.15)
    late_in_the_day = _clocked(np.full(chunks, size), times + 86_000.0, rate)  # whatever the computer's clock shows
    assert [(now - 86_000.0, lost) for now, lost in late_in_the_day] == [pytest.approx(one, rel=1e-6) for one in told]


@pytest.mark.parametrize(("after_s", "losses"), [(2.4, 1), (2.6, 2)])
def test_a_loss_that_the_clock_shows_is_the_one_before_up_to_two_and_a_half_seconds(
    after_s: float, losses: int
) -> None:
    stream, blocks = StreamedCodes(2e6, None), []  # type: ignore[var-annotated]
    behind = {10.0 + after_s: 4096}
    stream._clock = SimpleNamespace(count=lambda size, now: behind.get(now, 0))  # type: ignore[assignment]
    for now_s, lost_before in ((9.0, False), (10.0, True), (10.0 + after_s, False), (13.0, False)):
        stream.accept(Chunk(np.zeros(512 * 20, np.uint8), now_s, lost_before))
        _drain(stream, blocks)
    stream.flush()
    _drain(stream, blocks)
    assert sum(lost is None for _, lost in blocks) == losses
    assert sum(len(counts) for counts, _ in blocks) == 256 * (4 * 20 - 8)


@pytest.mark.parametrize(("lost_s", "told_after"), [(0.012, range(120, 170)), (0.05, range(10, 40))])
def test_a_late_delivery_soon_after_a_loss_is_no_further_loss(lost_s: float, told_after: range) -> None:
    """The few chunks that came since do not tell a late delivery from a loss."""
    rate, chunks, size = 20e6, 900, 1 << 18
    due = np.arange(1, chunks + 1) * size / rate
    for chunk in told_after:
        late = np.abs(np.random.default_rng(11).normal(0, 0.5e-3, chunks))
        late[500 + chunk : 506 + chunk] += 0.06  # the host was away
        times = np.maximum.accumulate(due + late)
        times[500:] += lost_s
        ((_, lost),) = _clocked(np.full(chunks, size), times, rate)
        assert lost == pytest.approx(lost_s * rate, rel=0.15)


def test_a_loss_the_clock_tells_becomes_a_gap_without_a_reference() -> None:
    rng = np.random.default_rng(2)
    stream = StreamedCodes(2e6, None)
    now, told = 0.0, 0
    for i in range(60):
        now += 32768 / 2e6 + (0.05 if i == 30 else 0.0)
        stream.accept(Chunk(rng.integers(0, 256, 32768).astype(np.uint8), now))
        blocks: list = []
        _drain(stream, blocks)
        told += sum(lost is None for _, lost in blocks)
    assert told == 1


def test_the_clock_tells_large_losses_after_0_3_s_and_small_ones_after_2_s_and_follows_a_crystal() -> None:
    """Chunks of 10 ms that come exactly when they are due; those after 5 s come later by the loss."""
    due = np.arange(1, 1001) * 0.01
    for lost_s, after_s in ((0.031, 0.3), (0.029, 2.0), (0.005, 2.0), (0.0035, None)):
        told = _clocked(np.full(1000, 20_000), due + np.where(due > 5.0, lost_s, 0.0), 2e6)
        if after_s is None:
            assert told == []
        else:
            ((when, lost),) = told
            assert when == pytest.approx(5.0 + after_s, abs=0.05)
            assert lost_s - 0.7e-3 < lost / 2e6 <= lost_s  # less by what was taken for the crystal meanwhile
    for drift in (-290e-6, 290e-6):
        assert _clocked(np.full(1000, 20_000), due * (1 + drift), 2e6) == []
    early = due - np.where(due > 5.0, 0.02, 0.0)  # a queue that was full when the clock began
    ((when, lost),) = _clocked(np.full(1000, 20_000), early + np.where(due > 8.0, 0.035, 0.0), 2e6)
    assert 8.0 < when < 8.4 and lost == pytest.approx(0.035 * 2e6, rel=0.02)


def test_codes_are_delivered_less_128_and_what_settles_or_is_half_a_packet_is_not() -> None:
    stream = StreamedCodes(2e6, None)
    codes = np.arange(12 * 512 + 101).astype(np.uint8)
    stream.accept(Chunk(codes, 0.0))
    blocks: list = []
    _drain(stream, blocks)
    assert sum(len(counts) for counts, _ in blocks) == 256 * (12 - 8 - 2)  # two packets wait for the next ones
    stream.accept(Chunk(codes[:411], 0.003, lost_before=True))
    stream.flush()
    _drain(stream, blocks)
    everything = np.concatenate([counts for counts, _ in blocks]).reshape(-1)
    after = codes[:411][:410].astype(np.int16)
    np.testing.assert_array_equal(everything, np.concatenate((codes[4096:-1], after)).astype(np.int16) - 128)
    losses = [at for at, (_, lost) in enumerate(blocks) if lost is None]
    assert losses == [len(blocks) - 1] and len(blocks[-1][0]) == 205
    assert not stream.ready and stream.deliver(np.empty((4, 2), np.int16)).samples == 0
