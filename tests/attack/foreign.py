"""TDMS, HDF5, WAV and CSV crafted: bombs, links out of the file, lengths that lie, 64 channels, bytes at random."""

import random
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from analysis.shot.recording import Role, Setup
from instrument.files.foreign_file import ForeignMapping, MappedChannel
from instrument.files.foreign_reading import foreign_channels, read_foreign
from instrument.files.recording_error import RecordingError
from tests.attack.trial import SURVIVED, Attempt, refused_in_a_line
from tests.instrument.mutating import spoilt_bytes

SAMPLES, RATE_HZ = 20_000, 1e6


def read_whole(path: Path) -> str:
    """List the file's channels, and read the first two (of them the second as the measuring beat)."""
    try:
        held = foreign_channels(path)
        names = [channel.name for channel in held.channels]
        roles = (Role.MEASUREMENT, Role.REFERENCE)
        mapped = tuple(MappedChannel(role, name) for role, name in zip(roles, names[-2:], strict=False))
        shot = read_foreign(path, ForeignMapping(held.format, mapped, Setup(0.018), RATE_HZ))
    except RecordingError as error:
        return refused_in_a_line(str(error), path.name)
    assert shot.samples >= 2 and all(np.isfinite(channel.volts_per_count) for channel in shot.channels)
    return SURVIVED


def foreign(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """Every crafted file that is known, then sound files with bytes at random in head, middle and end."""
    sound = {}
    for maker in (_hdf5, _tdms, _wav, _csv):
        for name, build in maker(folder):
            path = folder / name

            def attempt(path: Path = path, build: Callable[[Path], None] = build) -> str:
                build(path)
                return read_whole(path)

            yield f"{name}", attempt
            if name.startswith("sound"):
                build(path)
                sound[path] = path.read_bytes()
    while True:
        path = random_.choice(list(sound))
        whole = sound[path]
        spoilt = path.with_name(f"spoilt{path.suffix}")
        head = random_.choice((64, 512, 4096, len(whole)))  # lengths and types stand at the beginning

        def attempt(spoilt: Path = spoilt, whole: bytes = whole, head: int = head) -> str:
            spoilt.write_bytes(spoilt_bytes(whole[:head], random_) + whole[head:])
            return read_whole(spoilt)

        yield f"{path.name} at random", attempt


def _beat(channel: int = 0) -> Any:
    return np.rint(1000 * np.sin(np.arange(SAMPLES) * (0.3 + 0.01 * channel))).astype(np.int16)


def _hdf5(folder: Path) -> Iterator[tuple[str, Callable[[Path], None]]]:
    import h5py

    def made(fill: Callable[[Any], None]) -> Callable[[Path], None]:
        def build(path: Path) -> None:
            with h5py.File(path, "w") as file:
                fill(file)

        return build

    def plain(file: Any) -> None:
        for n in range(2):
            file.create_dataset(f"PD{n}", data=_beat(n), chunks=(4096,), compression="gzip")
        file.attrs["sample_rate_hz"] = RATE_HZ

    def bomb(file: Any) -> None:
        file.create_dataset("PD1", shape=(2**26,), dtype="f8", chunks=(2**20,), compression="gzip", fillvalue=0.0)
        file["PD1"][: 2**20] = 0.0

    def written_bomb(file: Any) -> None:
        data = file.create_dataset(
            "PD1", shape=(2**25,), dtype="f8", chunks=(2**22,), compression="gzip", compression_opts=9
        )
        for at in range(0, 2**25, 2**22):
            data[at : at + 2**22] = 0.0

    def sparse(file: Any) -> None:
        file.create_dataset("PD1", shape=(2**60,), dtype="i2", chunks=(2**20,))

    def one_piece(file: Any) -> None:
        file.create_dataset("PD1", shape=(2**28,), dtype="f8", chunks=(2**28,), compression="gzip")

    def outside(file: Any) -> None:
        file["PD1"] = h5py.ExternalLink("/etc/passwd", "/x")
        file["PD2"] = h5py.ExternalLink(str(folder / "sound.h5"), "PD1")
        file["PD3"] = h5py.SoftLink("/PD3")

    def raw_outside(file: Any) -> None:
        file.create_dataset("PD1", shape=(1000,), dtype="i2", external=[("/etc/passwd", 0, 2000)])

    def virtual(file: Any) -> None:
        layout = h5py.VirtualLayout(shape=(SAMPLES,), dtype="i2")
        layout[:] = h5py.VirtualSource(str(folder / "sound.h5"), "PD1", shape=(SAMPLES,))
        file.create_virtual_dataset("PD1", layout)

    def loops(file: Any) -> None:
        file.create_dataset("PD1", data=_beat())
        file["again"] = file["/"]
        file["soft"] = h5py.SoftLink("/soft2")
        file["soft2"] = h5py.SoftLink("/soft")

    def deep(file: Any) -> None:
        group = file
        for _ in range(300):
            group = group.create_group("g")
        group.create_dataset("PD1", data=_beat())

    def many(file: Any) -> None:
        for n in range(3000):
            file.create_dataset(f"c{n}", data=np.zeros(4, np.int16))

    def channels64(file: Any) -> None:
        file.create_dataset("all", data=np.stack([_beat(n) for n in range(64)], axis=1))
        file.attrs["fs"] = RATE_HZ

    def odd(file: Any) -> None:
        file.create_dataset("half", data=np.zeros(100, np.float16))
        file.create_dataset("pair", data=np.zeros(100, [("a", "i2"), ("b", "f8")]))
        file.create_dataset("text", data=np.array(["x"] * 100, "S5"))
        file.create_dataset("nan", data=np.full(100, np.nan))
        file.create_dataset("inf", data=np.full(100, np.inf))
        file.create_dataset("huge", data=np.full(100, 1e308) * np.where(np.arange(100) % 2, 1, -1))

    def attributes(file: Any) -> None:
        file.create_dataset("PD1", data=_beat())
        file["PD1"].attrs["rate"] = np.array([np.nan])
        file["PD1"].attrs["fs"] = 1e-320
        file.attrs["unit"] = "x" * 60_000

    yield "sound.h5", made(plain)
    bombs = (bomb, written_bomb, sparse, one_piece)
    for fill in (*bombs, outside, raw_outside, virtual, loops, deep, many, channels64, odd, attributes):
        yield f"{fill.__name__}.h5", made(fill)


def _tdms(folder: Path) -> Iterator[tuple[str, Callable[[Path], None]]]:
    from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

    def made(channels: int, properties: dict[str, Any], segments: int = 1) -> Callable[[Path], None]:
        def build(path: Path) -> None:
            with TdmsWriter(path) as writer:
                for _ in range(segments):
                    data = [ChannelObject("g", f"PD{n}", _beat(n)[: SAMPLES // segments], properties=properties)
                            for n in range(channels)]  # fmt: skip
                    writer.write_segment([RootObject(), GroupObject("g"), *data])

        return build

    sound = {"wf_increment": 1 / RATE_HZ, "unit_string": "V"}
    scales = {"NI_Number_Of_Scales": 2**31 - 1, "NI_Scale[0]_Scale_Type": "Linear"}
    yield "sound.tdms", made(2, sound)
    yield "channels64.tdms", made(64, sound)
    yield "segments.tdms", made(2, sound, 2000)
    yield "scales.tdms", made(2, scales)
    yield "no rate.tdms", made(2, {"wf_increment": 0.0})
    yield "tiny rate.tdms", made(2, {"wf_increment": 1e-320, "unit_string": "\x1b[2J" * 1000})
    for name, at, value in (
        ("offset of the next segment", 12, 2**63 - 1), ("offset of the data", 20, 2**62), ("no objects", 28, 2**32 - 1),
        ("both", 12, 2**40),
    ):  # fmt: skip

        def lie(path: Path, at: int = at, value: int = value) -> None:
            made(2, sound)(path)
            raw = bytearray(path.read_bytes())
            raw[at : at + 8] = struct.pack("<Q", value)
            path.write_bytes(raw)

        yield f"{name}.tdms", lie


def _wav(folder: Path) -> Iterator[tuple[str, Callable[[Path], None]]]:
    def made(
        channels: int = 2, size: int | None = None, rate: int = 1_000_000, bits: int = 16, align: int | None = None
    ) -> Callable[[Path], None]:
        def build(path: Path) -> None:
            data = np.stack([_beat(n) for n in range(max(1, min(channels, 64)))], axis=1).astype("<i2").tobytes()
            align_ = 2 * channels if align is None else align
            head = struct.pack("<HHIIHH", 1, channels, rate, (rate * align_) & 0xFFFFFFFF, align_, bits)
            claimed = len(data) if size is None else size
            whole = struct.pack("<I", min(2**32 - 1, 36 + claimed))
            sized = struct.pack("<I", 16) + head + b"data" + struct.pack("<I", claimed)
            path.write_bytes(b"RIFF" + whole + b"WAVEfmt " + sized + data)

        return build

    yield "sound.wav", made()
    yield "channels64.wav", made(64)
    for name, how in (
        ("longer", {"size": 2**32 - 1}), ("empty", {"size": 0}), ("no rate", {"rate": 0}), ("no bits", {"bits": 0}),
        ("many bits", {"bits": 65_535}), ("no channel", {"channels": 0}), ("no align", {"align": 0}),
        ("all channels", {"channels": 32_767}), ("24 bits", {"bits": 24, "align": 6}),
    ):  # fmt: skip
        yield f"{name}.wav", made(**how)  # type: ignore[arg-type]


def _csv(folder: Path) -> Iterator[tuple[str, Callable[[Path], None]]]:
    def written(content: bytes) -> Callable[[Path], None]:
        def build(path: Path) -> None:
            path.write_bytes(content)

        return build

    rows = b"".join(b"%.6f,%d,%d\n" % (n * 1e-6, a, b) for n, (a, b) in enumerate(zip(_beat(0), _beat(1), strict=True)))
    yield "sound.csv", written(b"time_s,PD0,PD1\n" + rows)
    yield "one line.csv", written(b"1," * 5_000_000)
    yield (
        "columns.csv",
        written(b",".join(b"c%d" % n for n in range(200_000)) + b"\n" + b",".join([b"1"] * 200_000) + b"\n"),
    )
    yield (
        "channels64.csv",
        written((b",".join(b"c%d" % n for n in range(64)) + b"\n") + (b",".join([b"1"] * 64) + b"\n") * 5000),
    )
    yield "numbers.csv", written(b"a,b\n" + b"1e999,nan\n" * 1000)
    yield "digits.csv", written(b"a,b\n" + b"9" * 100_000 + b",1\n1,1\n")
    yield "nul.csv", written(b"a,b\n" + b"\0" * 100_000)
    yield "quotes.csv", written(b'a,b\n"' + b"1,2\n" * 100_000)
    yield "blank.csv", written(b"\n" * 1_000_000)
