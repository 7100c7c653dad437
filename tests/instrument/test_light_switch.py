"""The light switch: the same steps for any lengths of blocks, and none from noise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.shot.recording import Channel, Role
from instrument.files.recording_file import read_recording
from instrument.files.recording_search import find_recordings
from instrument.trigger.light_switch import (
    _HIGH,
    _LEVEL,
    _LOW,
    _MAXIMUM,
    _MINIMUM,
    _SEEN,
    _SWING,
    LEARNED_FROM,
    Edge,
    Level,
    LightSwitch,
    TriggerSettings,
    _passes,
    middle_of_step,
)

STEP = LEARNED_FROM + 900


def stream(noise: float = 20.0, high: int = 1800, falling_at: int = STEP + 700) -> np.ndarray:
    """Return two channels; the second steps up at STEP over 12 samples and down again at ``falling_at``."""
    rng = np.random.default_rng(3)
    t = np.arange(STEP + 1_500)
    rise = np.clip((t - STEP) / 12, 0, 1) - np.clip((t - falling_at) / 12, 0, 1)
    counts = np.zeros((t.size, 2), np.int16)
    counts[:, 1] = np.rint(100 + (high - 100) * rise + rng.normal(0, noise, t.size))
    return counts


def steps(counts: np.ndarray, cuts: list[int], settings: TriggerSettings) -> tuple[list[int], int, Level]:
    """Return the first step of each block as an index of the stream, toggles, and the level at the end."""
    switch = LightSwitch(settings, 1, 12)
    found = []
    for a, b in zip([0, *cuts], [*cuts, len(counts)], strict=True):
        step = switch.first_step(counts[a:b])
        if step is not None:
            found.append(a + step)
    return found, switch.toggles, switch.level


LEARNED = TriggerSettings()
GIVEN = TriggerSettings(low_counts=700, high_counts=1200)


@pytest.mark.parametrize("how", [LEARNED, GIVEN], ids=["learned", "given"])
def test_every_place_to_cut_gives_the_same_steps(how: TriggerSettings) -> None:
    counts = stream()
    tail = counts[STEP - LEARNED_FROM - 60 :]  # learning ends shortly before the step
    whole, toggles, level = steps(tail, [len(tail) - 400], how)
    assert toggles == 2 and level is Level.LOW and len(whole) == 1
    for cut in range(len(tail)):
        found, t, lv = steps(tail, [cut], how)
        assert found[0] == whole[0] and (t, lv) == (toggles, level), cut


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(0, STEP + 1_500), max_size=12), st.sampled_from(list(Edge)))
def test_any_cutting_gives_the_same_steps(cuts: list[int], edge: Edge) -> None:
    counts = stream()
    once = steps(counts, [], TriggerSettings(edge))
    many = steps(counts, sorted(cuts), TriggerSettings(edge))
    assert many[0][0] == once[0][0] and many[1:] == once[1:]
    assert once[0][0] >= (STEP + 600 if edge is Edge.FALLING else STEP)


def test_the_polarity_chooses_the_step() -> None:
    counts = stream()
    for how in (LEARNED, GIVEN):
        rising = LightSwitch(TriggerSettings(Edge.RISING, how.low_counts, how.high_counts), 1, 12).first_step(counts)
        falling = LightSwitch(TriggerSettings(Edge.FALLING, how.low_counts, how.high_counts), 1, 12).first_step(counts)
        assert rising is not None and falling is not None
        assert STEP <= rising <= STEP + 12 and STEP + 700 <= falling <= STEP + 712


def test_the_first_of_several_steps_is_told_though_it_is_the_first_sample_of_a_block() -> None:
    for channels in (1, 2, 3, 4):
        counts = np.zeros((6000, channels), np.int16)
        counts[:3000, -1] = 2000
        counts[4500:, -1] = 2000
        for how in (TriggerSettings(low_counts=700, high_counts=1200), LEARNED):
            switch = LightSwitch(how, channels - 1, 12)
            switch.first_step(np.zeros((LEARNED_FROM + 1, channels), np.int16))
            assert switch.first_step(counts) == 0 and switch.toggles == 3


def test_noise_alone_is_no_step() -> None:
    rng = np.random.default_rng(5)
    switch = LightSwitch(LEARNED, 0, 12)
    for _ in range(20):
        block = np.rint(rng.normal(100, 60, (200_000, 1))).astype(np.int16)
        assert switch.first_step(block) is None
    assert switch.toggles == 0 and switch.level is Level.UNKNOWN


def test_hysteresis_holds_against_noise_on_the_way() -> None:
    t = np.arange(100_000)
    rng = np.random.default_rng(6)
    slow = np.rint(100 + 1_700 * np.clip((t - 30_000) / 40_000, 0, 1) + rng.normal(0, 60, t.size))
    switch = LightSwitch(TriggerSettings(low_counts=600, high_counts=1_200), 0, 12)
    switch.first_step(slow.astype(np.int16)[:, None])
    assert switch.toggles == 1


@pytest.mark.parametrize("wrong", [{"low_counts": 1.0}, {"low_counts": 5.0, "high_counts": 5.0}])
def test_settings_that_make_no_sense_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="light switch"):
        TriggerSettings(**wrong)


def test_the_middle_of_the_step_is_where_independent_recordings_say_it_fired(recordings) -> None:
    for path in find_recordings(sorted(recordings.iterdir())):
        shot = read_recording(path)
        column = shot.column(Role.SWITCH)
        if column is None:
            continue
        found = LightSwitch(LEARNED, column, shot.setup.digitizer_bits).first_step(shot.counts)
        assert found is not None and shot.trigger_sample is not None
        middle = middle_of_step(shot.counts[:, column], found, 1_000)
        assert abs(middle - shot.trigger_sample) * 1.0 / shot.sample_rate_hz < 1e-6, path


def test_a_middle_that_is_not_there_leaves_the_sample_as_it_is() -> None:
    flat = np.full(5_000, 100, np.int16)
    assert middle_of_step(flat, 2_000, 500) == 2_000
    assert middle_of_step(flat, 4_990, 500) == 4_990


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("late", [-90, -7, 0, 30, 99])
def test_the_middle_of_a_step_is_the_first_sample_at_or_beyond_the_mean_of_its_levels(sign: int, late: int) -> None:
    t = np.arange(1000)
    ramp = (sign * np.clip(10 * (t - 500), 0, 200)).astype(np.int16)  # in the middle at sample 510
    assert middle_of_step(ramp, 510 + late, 100) == 510
    spoilt = ramp.copy()
    spoilt[: 510 + late - 200] = spoilt[510 + late + 200 :] = -sign * 3000  # beyond the samples that give the levels
    spoilt[510 + late - 150], spoilt[510 + late + 150] = sign * 60, sign * 20  # medians, not extremes
    assert middle_of_step(spoilt, 510 + late, 100) == 510


def test_levels_that_differ_by_less_than_four_times_their_noise_are_no_step() -> None:
    t = np.arange(1000)
    for high, found in ((1, 490), (2, 500), (3, 500)):  # the noise is at least half a count
        assert middle_of_step(np.where(t < 500, 0, high).astype(np.int16), 490, 100) == found
    for swing, found in ((9, 490), (11, 500)):
        for noisy in (t < 500, t >= 500):  # the noisier side counts: plus and minus 5
            counts = 2 * np.where(t < 500, 0, 2 * swing) + np.where(noisy, np.where(t % 2, 10, -10), 0)
            assert middle_of_step(counts.astype(np.int16), 490, 100) == found
    early = np.where(t < 60, 0, 50).astype(np.int16)
    assert middle_of_step(early, 65, 40) == 60  # a shorter stretch before it gives the level
    assert middle_of_step(early, 39, 40) == 39 and middle_of_step(early[:100], 65, 40) == 65  # none is left


@pytest.mark.parametrize(
    ("edge", "low_v", "high_v", "per_count", "known"),
    [
        (Edge.RISING, 0.625, 1.625, 2**-10, (Edge.RISING, 512.0, 1536.0)),
        (Edge.RISING, 0.625, 1.625, -(2**-10), (Edge.FALLING, -1536.0, -512.0)),
        (Edge.EITHER, 0.625, 1.625, -(2**-10), (Edge.EITHER, -1536.0, -512.0)),
        (Edge.FALLING, None, 1.625, -(2**-10), (Edge.FALLING, None, None)),
        (Edge.FALLING, 0.625, None, 2**-10, (Edge.FALLING, None, None)),
    ],
)
def test_thresholds_in_volts_are_those_of_the_channel_and_an_inverting_one_exchanges_levels_and_edges(
    edge: Edge, low_v: float | None, high_v: float | None, per_count: float, known: tuple[object, ...]
) -> None:
    made = TriggerSettings.in_volts(edge, low_v, high_v, Channel(Role.SWITCH, per_count, 0.125))
    assert made == TriggerSettings(*known)  # type: ignore[arg-type]


@pytest.mark.parametrize("how", [LEARNED, GIVEN], ids=["learned", "given"])
def test_the_thresholds_are_where_the_next_step_is_found(how: TriggerSettings) -> None:
    tail = stream()[STEP - LEARNED_FROM - 60 :]
    switch = LightSwitch(how, 1, 12)
    assert switch.thresholds_counts == ((None, None) if how is LEARNED else (700, 1200))
    switch.first_step(tail[: LEARNED_FROM + 1])
    level, steps_seen = switch.level, 0
    for counts in tail[LEARNED_FROM + 1 :]:
        falls, rises = switch.thresholds_counts
        up = rises is not None and counts[1] >= rises and level is not Level.HIGH
        down = falls is not None and counts[1] <= falls and level is not Level.LOW
        assert (switch.first_step(counts[None]) is not None) == (up or down)
        steps_seen += up or down
        level = switch.level
    assert steps_seen == 2


def test_a_stretch_is_passed_over_where_its_extremes_allow_no_step_and_looked_into_where_they_do() -> None:
    """The next step up is at 300, the next step down at 100, each only from the other side or from none."""
    low, middle, high = (100, 190), (150, 240), (210, 300)
    for level, passed in ((0, [False, True, False]), (1, [False, True, True]), (-1, [True, True, False])):
        for learned in (False, True):
            for (lowest, highest), wanted in zip((low, middle, high), passed, strict=True):
                state = np.zeros(10)
                state[_LOW], state[_HIGH] = (np.nan, np.nan) if learned else (100, 300)
                state[_LEVEL], state[_SEEN], state[_SWING] = level, 1, 100
                state[_MINIMUM], state[_MAXIMUM] = 200, 200
                before = state.copy()
                assert _passes(lowest, highest, state) == wanted, (level, learned, lowest)
                if learned and wanted:
                    before[_MINIMUM], before[_MAXIMUM] = min(lowest, 200), max(highest, 200)
                np.testing.assert_array_equal(state, before)
    unlearned = np.zeros(10)
    unlearned[_LOW] = np.nan
    for seen, swing in ((0, 100), (1, 0)):
        unlearned[_SEEN], unlearned[_SWING] = seen, swing
        assert not _passes(150, 240, unlearned)


class SampleBySample:
    """The light switch as its settings define it: one sample after another, nothing passed over."""

    def __init__(self, how: TriggerSettings, least: float, swing: float) -> None:
        self.how, self.least, self.swing = how, least, swing
        self.level = self.seen = self.toggles = 0
        self.squares = self.previous = self.minimum = self.maximum = 0.0

    def step(self, value: float) -> int:
        """Return 1 for a step up, -1 for a step down, 0 for none."""
        found = self._given(value) if self.how.low_counts is not None else self._learned(value)
        self.previous = value
        self.seen += 1
        if found:
            self.level, self.minimum, self.maximum = found, value, value
            self.toggles += 1
        return found

    def _given(self, value: float) -> int:
        assert self.how.low_counts is not None and self.how.high_counts is not None
        side = 1 if value >= self.how.high_counts else -1 if value <= self.how.low_counts else 0
        if self.level == 0:
            self.level = side
            return 0
        return side if side != self.level else 0

    def _learned(self, value: float) -> int:
        if self.seen == 0:
            self.minimum = self.maximum = value
        if not self.swing:
            if self.seen:
                self.squares += (value - self.previous) ** 2
            if self.seen == LEARNED_FROM:
                self.swing = max(self.least, 12.0 * np.sqrt(0.5 * self.squares / LEARNED_FROM))
                self.minimum = self.maximum = value
        self.minimum, self.maximum = min(self.minimum, value), max(self.maximum, value)
        if self.swing and self.level <= 0 and value >= self.minimum + self.swing:
            return 1
        return -1 if self.swing and self.level >= 0 and value <= self.maximum - self.swing else 0


@pytest.mark.parametrize(("noise", "needed"), [(100, 12 * 100 / np.sqrt(2)), (10, 0.05 * 4096)])
def test_a_step_takes_twelve_times_the_noise_of_the_beginning_and_a_twentieth_of_the_range(
    noise: int, needed: float
) -> None:
    switch = LightSwitch(LEARNED, 0, 12)
    assert switch.needed_counts == 0.05 * 4096
    counts = np.where(np.arange(LEARNED_FROM + 2) % 2, noise, 0).astype(np.int16)[:, None]
    for part, known in ((slice(LEARNED_FROM), 0.05 * 4096), (slice(LEARNED_FROM, None), needed)):
        assert switch.first_step(counts[part]) is None
        assert switch.needed_counts == pytest.approx(known)
    for height, step in ((np.ceil(needed) - 1, None), (np.ceil(needed) + noise, 0)):
        assert switch.first_step(np.full((1, 1), height, np.int16)) == step


@settings(max_examples=150, deadline=None)
@given(
    st.sampled_from([(LEARNED, 0.0), (LEARNED, 200.0), (TriggerSettings(low_counts=0, high_counts=200), 0.0)]),
    st.sampled_from(list(Edge)),
    st.lists(st.tuples(st.integers(-2, 3), st.integers(1, 2_600)), min_size=1, max_size=12),
    st.lists(st.tuples(st.integers(0, 12_000), st.integers(-2, 3)), max_size=5),
    st.lists(st.integers(0, 12_000), max_size=5),
    st.sampled_from([1, 3]),
)
def test_passing_over_still_stretches_finds_what_looking_at_every_sample_finds(
    start_from: tuple[TriggerSettings, float],
    edge: Edge,
    plateaus: list[tuple[int, int]],
    spikes: list[tuple[int, int]],
    cuts: list[int],
    channels: int,
) -> None:
    # levels a hundred counts apart meet the thresholds exactly, and spikes of one sample lie within long plateaus
    values = np.concatenate([np.full(length, 100 * level, np.int16) for level, length in plateaus])
    for at, level in spikes:
        values[at % values.size] = 100 * level
    counts = np.zeros((values.size, channels), np.int16)
    counts[:, -1] = values
    how, swing = start_from
    how = TriggerSettings(edge, how.low_counts, how.high_counts)
    switch, plain = LightSwitch(how, channels - 1, 12), SampleBySample(how, 0.05 * 4096, swing)
    switch._state[_SWING] = swing  # as if it had been learned
    inner = sorted(cut for cut in cuts if cut < values.size)
    for a, b in zip([0, *inner], [*inner, values.size], strict=True):
        steps_seen = [plain.step(float(value)) for value in values[a:b]]
        wanted = next((i for i, s in enumerate(steps_seen) if s and edge in (0, s)), None)
        assert switch.first_step(counts[a:b]) == wanted
        assert (switch.level, switch.toggles) == (plain.level, plain.toggles)
        if how.low_counts is None:
            assert switch.moved_counts == (plain.maximum - plain.minimum if plain.seen else None)
            assert switch.needed_counts == max(plain.swing, 0.05 * 4096)
