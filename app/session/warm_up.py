"""Warm up the kernels: analyse a synthetic shot, so that they are compiled or loaded before the first real shot.

Each function makes its own synthetic data, so that several processes can warm up in parallel and compile few kernels
twice.
"""

import tempfile
from pathlib import Path

import numpy as np

from analysis.shot import Channel, Floats, Motion, Recording, Role, Setup, Shot
from levimass import PAPER_MODEL

_MASS_KG, _SPEED_M_PER_S, _TOUCH_S, _LENGTH_S = 0.018, 0.25, 12e-3, 60e-3
_PLATE_KG, _PLATE_N_PER_M, _CONTACT_N_PER_M, _CONTACT_N_S_PER_M = 2e-4, 220.0, 1e4, 0.4
_RAW_HZ, _MOTION_HZ, _REST_HZ, _WAVELENGTH_M = 10e6, 100e3, 2e6, 633e-9
_SHAKEN_M, _SHAKEN_HZ = 2e-7, 60.0


def readings() -> Shot:
    """Warm up the kernels of a shot's readings and of the live view.

    The synthetic shot is read from disk, because numba compiles separate kernels for read-only arrays.
    """
    from analysis.pipeline import read
    from instrument.files import analyse_and_check_hash, write_recording
    from instrument.live import warm

    warm()
    with tempfile.TemporaryDirectory(prefix="levimass-") as folder:
        return analyse_and_check_hash(write_recording(_recording(), Path(folder) / "shot"), read)


def fit() -> None:
    """Fit the base model to a synthetic motion, and compute the model's motion on a moving frame."""
    from analysis.collision import PAPER, linear_path, moved_by_frame
    from analysis.fitted import fitted_contact_cor
    from analysis.inference import fit_shots

    fitted_contact_cor(fit_shots([_motion()], model=PAPER_MODEL), _MASS_KG)
    time_s = np.arange(-_TOUCH_S, _LENGTH_S - _TOUCH_S, 5.0 / _MOTION_HZ)
    moved_by_frame(linear_path(PAPER, (), time_s), PAPER, np.array([2 * np.pi * _SHAKEN_HZ]), time_s.size)


def bench() -> None:
    from instrument.bench import BenchDigitizer, simulate

    BenchDigitizer().prepare()
    with tempfile.TemporaryDirectory(prefix="levimass-") as folder:
        simulate(folder, 1, duration_s=0.05)


def effects() -> None:
    """Compile every effect of the catalogue, for real arguments and for complex ones (derivatives)."""
    from analysis.collision import CATALOGUE, WIDER_EFFECTS, address, complex_address

    for row in (*CATALOGUE.values(), *WIDER_EFFECTS.values()):
        for kernel in {row.kernel, row.locked} - {None}:
            if kernel is not None:
                address(kernel)
                complex_address(kernel)


def diagnosis() -> None:
    """Diagnose a synthetic motion."""
    from analysis.diagnosis import diagnose

    diagnose([_motion()])


def _inside_m(time_s: Floats) -> Floats:
    """Return the simulated position of the block, (n,) in m: a collision with a sprung plate on a vibrating table."""
    grid_s, way_m = 1.0 / _MOTION_HZ, [-_SPEED_M_PER_S * _TOUCH_S]
    x, v, y, u = -_SPEED_M_PER_S * _TOUCH_S, _SPEED_M_PER_S, 0.0, 0.0
    for _ in range(round(_LENGTH_S * _MOTION_HZ)):
        push_n = max(0.0, _CONTACT_N_PER_M * (x - y) + _CONTACT_N_S_PER_M * (v - u)) if x > y else 0.0
        v -= push_n / _MASS_KG * grid_s
        u += (push_n - _PLATE_N_PER_M * y) / _PLATE_KG * grid_s
        x, y = x + v * grid_s, y + u * grid_s
        way_m.append(x)
    way = np.interp(time_s, np.arange(len(way_m)) * grid_s, way_m)
    shaken: Floats = way + _SHAKEN_M * np.sin(2 * np.pi * _SHAKEN_HZ * time_s)
    return shaken


def _motion() -> Motion:
    """Return the block's motion with 1 nm of noise."""
    from analysis.signal import motion_from_displacement

    t = np.arange(round(_LENGTH_S * _MOTION_HZ)) / _MOTION_HZ
    x = np.random.default_rng(1).normal(0, 1e-9, t.size) - _inside_m(t)  # sign: the block approaches with v < 0
    return motion_from_displacement(t, x, None, None, moving_mass_kg=_MASS_KG)


def _recording() -> Recording:
    """Return a recording of that motion: both beats and the light switch, with noise."""
    t = np.arange(round(_LENGTH_S * _RAW_HZ)) / _RAW_HZ
    rest = 2 * np.pi * _REST_HZ * t
    shifted = rest + 4 * np.pi * _inside_m(t) / _WAVELENGTH_M
    volts = np.stack([np.cos(rest), np.cos(shifted), np.where(t < 0.5 * _TOUCH_S, -1.0, 1.0)], axis=1)
    noise = np.random.default_rng(1).normal(0, 10, volts.shape)
    counts = np.rint(1500 * volts + noise).astype(np.int16)
    counts.flags.writeable = False
    channels = tuple(Channel(role, 5e-4) for role in (Role.REFERENCE, Role.MEASUREMENT, Role.SWITCH))
    setup = Setup(_MASS_KG, wavelength_air_m=_WAVELENGTH_M, digitizer_bits=12)
    return Recording("shot", counts, _RAW_HZ, channels, setup, trigger_sample=round(0.5 * _TOUCH_S * _RAW_HZ))
