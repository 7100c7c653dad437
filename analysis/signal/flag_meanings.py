"""The flags of a shot's signals in words."""

MEANINGS = {
    "clipped": "the beat is cut off, at the digitizer's rail or before it: lower the gain",
    "gap": "samples were lost; short gaps are bridged by the predicted motion",
    "samples_lost": "the digitizer lost samples and did not report it: found by jumps of both beats, bridged like gaps",
    "gap_unknown": "samples were lost, how many is not known: only the longest part is analysed",
    "truncated": "the data file is shorter than its metadata say",
    "longer_than_declared": "the data file is longer than its metadata say",
    "drop_out": "the light failed for a moment; bridged by the predicted motion",
    "fringe_doubtful": "after a gap or drop-out the position may be off by whole fringes; velocity and force are right",
    "harmonics": "the beat is distorted (second or third harmonic above 1 %): detector or amplifier near its limit",
    "cross_talk_removed": "cross-talk of PD1 in PD0 (cables, amplifier) was removed",
    "cross_talk": "cross-talk of PD1 in PD0 could not be removed: separate their cables; no deflection is given",
    "leak_removed": "unshifted light reached PD1 (polarisation leak); its ripple was removed",
    "rest_drift": "the rest frequency drifted during the shot; followed by a smooth curve",
    "rest_unsteady": "the rest frequency was not smooth: subtract PD0 sample by sample (instantaneous)",
    "wander": "the optical path drifted; the uncertainties of velocity and force include it",
    "out_of_band": "the beat left the band it was read through: frequencies beyond it are not reliable",
    "rate_contradicted": "PD0 or the computer's clock contradicts the sample rate: all speeds may be wrong by that",
    "uneven_time": "the record's times were uneven and were interpolated to an even grid",
}
