"""Declarations of the commands and options of ``levimass``, from which parsers, help and checks are made.

Nothing slow is imported here, so that a wrong option is reported at once.
"""

import argparse
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from levimass import BASE_MODELS, PAPER_MODEL, AnalysisChoices, AnalysisSettings, Setting, settings_of

if TYPE_CHECKING:
    from analysis.diagnosis import SavedModel

Parsed = Callable[[str], Any]


def _name(text: str) -> str:
    if not text or "\0" in text:
        raise argparse.ArgumentTypeError(f"{text!r} names no file or folder")  # such as an unset shell variable
    return text


def _path(text: str) -> Path:
    return Path(_name(text))


def _from(least: float, kind: type[int] | type[float], words: str) -> Parsed:
    """Return a parser of finite numbers not below ``least``; ``words`` is the message for other numbers."""

    def number(text: str) -> float:
        value = kind(text)
        if not least <= value < math.inf:
            raise argparse.ArgumentTypeError(f"{text} is {words}")
        return value

    return number


_whole = _from(0, int, "below zero")
_positive = _from(5e-324, float, "not a positive number")
_positive_int = _from(1, int, "not a positive whole number")


def _numbers(text: str) -> tuple[float, ...]:
    try:
        found = sorted({float(part) for part in text.split(",")})
    except ValueError:
        found = []
    if not found or not all(math.isfinite(value) and value >= 0.0 for value in found):
        raise argparse.ArgumentTypeError(f"{text!r} is not a list of numbers such as 0.05,0.2")
    return tuple(found)


def _speeds(text: str) -> tuple[float, ...]:
    found = _numbers(text)
    if found[0] == 0.0:
        raise argparse.ArgumentTypeError("a block at rest does not strike the plate")
    return found


class Version(argparse.Action):
    """Print the version and exit."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from app.command_line.machine import version_text

        print(version_text())
        parser.exit()


class _Sources:
    """The forms of all sources as text, made when argparse prints the help, because their import is slow."""

    def __str__(self) -> str:
        from instrument.devices import source_words

        return source_words()


@dataclass(frozen=True, slots=True)
class Option:
    """An option, or a command's argument.  ``parse`` None: a switch without a value; ``more`` is passed to argparse."""

    flag: str
    help: str
    metavar: str = ""
    parse: Parsed | None = None
    more: Mapping[str, Any] = field(default_factory=dict)
    later: object = ""  # its text is put for "%(later)s" when the help is printed

    @property
    def key(self) -> str:
        """Get the name of the attribute in the parsed options."""
        return self.flag.lstrip("-").replace("-", "_")

    def add(self, to: Any, *names: str) -> None:
        """Add the option to a parser or to an argument group, under its flag or under ``names``."""
        if self.parse is None:
            to.add_argument(*(names or (self.flag,)), action="store_true", help=self.help)
        else:
            named = names or (self.flag,)
            action = to.add_argument(*named, type=self.parse, metavar=self.metavar, help=self.help, **self.more)
            action.later = self.later


_OPTIONAL = {"nargs": "?", "const": ""}
_EACH = {"action": "append"}
COMMANDS = (  # each is a command and, for earlier versions' scripts, also an option
    Option("--replay", "analyse recordings (files or folders)", "PATH", _path, {"nargs": "+"}),
    Option("--acquire", "arm, wait for the light switch, record N shots", "N", _positive_int),
    Option("--simulate", "write recordings from the simulated bench", "DIR", _path),
    Option(
        "--paper",
        "compare the paper's numbers with this program's (and with a recording's)",
        "RECORDING",
        _path,
        {"nargs": "?", "const": False},
    ),
    Option("--map", "list the channels of a TDMS, HDF5, WAV or CSV file, and map them", "FILE", _path),
    Option("--prepare", "compile everything now, for the first start (--jobs N)"),
    Option("--doctor", "check this machine, with --source its signals too"),
)
WINDOW, PLAN = "window", "plan"  # commands without an option of the same name


@dataclass(frozen=True, slots=True)
class Group:
    """Options under one heading of the help, and the commands that accept them."""

    heading: str
    commands: tuple[str, ...]
    options: tuple[Option, ...]


def _of_setting(setting: Setting) -> Option:
    usual = getattr(AnalysisSettings(), setting.key)

    def number(text: str) -> float:
        value = float(text)
        try:
            setting.check(value)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None
        return value

    said = f"{setting.hover[0].lower()}{setting.hover[1:]} ({usual:g})"
    return Option(setting.flag, said, setting.metavar, number)


OK, FAILED, USAGE, INTERRUPTED = 0, 1, 2, 130  # exit statuses
CHOSEN = tuple(setting for setting in settings_of(AnalysisChoices) if setting.flag)
GROUPS = (
    Group("with --doctor", ("doctor",), (
        Option("--bundle", "write checks, settings and log for support (ZIP)", "FILE", _path),
    )),
    Group("with --replay", ("replay",), (
        Option("--json", "write the result (- for standard output)", "FILE", _name),
        Option("--export", "write CSV: one motion file per shot, and shots.csv", "DIR", _path),
        Option("--hdf5", "with --export: each motion file in HDF5 too"),
        Option("--report", "write a printable report: one HTML file", "FILE", _path),
        Option("--no-diagnose", "stop after the base model's fit"),
        Option("--plan", "plan the next shots: they distinguish the candidates or halve the ± of PARAMETER (or of all)",
               "PARAMETER", str, _OPTIONAL),
        Option("--unchecked", "skip the SHA-512 check of the data (faster)"),
        *map(_of_setting, CHOSEN),
        Option("--model", f"base model: {', '.join(BASE_MODELS)} (default: {PAPER_MODEL}), or a model file (.toml)",
               "NAME", str),
        Option("--foretell", "test the predictions of the model file, without refitting, on these shots"),
        Option("--law", "a law of your own (TOML) that the diagnosis tries too", "FILE", _path, _EACH),
        Option("--save-model", "save the diagnosed model", "FILE", _path),
        Option("--jobs", "a campaign over N processes, resumable", "N", _positive_int),
        Option("--scheduler", "a campaign over the machines of a dask scheduler", "ADDRESS", str),
        Option("--insecure", "with --scheduler: allow another machine without TLS"),
    )),
    Group("with --paper (and --json)", ("paper",), (
        Option("--figures", "draw figures 4 to 7, PNG and SVG", "DIR", _path),
    )),
    Group("with --acquire", ("acquire",), (
        Option("--source", "%(later)s", "SOURCE", str, later=_Sources()),
        Option("--out", "folder for the recordings", "DIR", _path),
        Option("--rate", "sample rate", "HZ", _positive),
        Option("--samples", "samples per channel and shot", "N", _positive_int),
        Option("--timeout", "longest wait for a shot (60)", "S", _positive, {"default": 60.0}),
        Option("--resolve", "diagnose, then take up to M distinguishing shots (--json FILE)", "M", _positive_int),
    )),
    Group("range of the rig, with --plan or --resolve (default: 0.05 to 0.6 m/s, 50 g, 12 mm)", ("replay", "acquire"), (
        Option("--speeds", "speeds that a planned shot may have", "M/S,...", _speeds),
        Option("--weights", "masses that can be added to the block; 0: none", "KG,...", _numbers),
        Option("--run-up", "free flight before the plate", "M", _positive),
    )),
    Group("with --map (and --rate)", ("map",), (
        Option("--channel", "measurement, reference or switch; or displacement", "ROLE=NAME", str, _EACH),
        Option("--unit", "of a displacement: m, mm, um or nm (as its header says)", "UNIT", _name),
        Option("--volts", "volts per stored unit", "ROLE=VOLTS", str, _EACH),
        Option("--mass", "mass of the moving part", "KG", _positive),
        Option("--rest", "rest frequency, needed without a reference channel", "HZ", _positive),
        Option("--wavelength", "wavelength in air (632.8e-9)", "M", _positive),
        Option("--bits", "resolution of the digitizer in bits, if the file stores counts", "N", _positive_int),
        Option("--for-folder", "for every file of this format in the folder"),
    )),
    Group("with --simulate", ("simulate",), (
        Option("--shots", "shots to simulate (3)", "N", _positive_int, {"default": 3}),
        Option("--seed", "seed of the draw (1)", "S", _whole, {"default": 1}),
        Option("--effect", "an effect the base model lacks", "NAME:PARAMETER=VALUE,...", str),
        Option("--undeclared", "draw a hidden effect, or none, at random"),
    )),
    Group("the simulated bench: with --simulate, --acquire --source bench, or the window",
          ("simulate", "acquire", WINDOW), (
        Option("--site",
               "bench site: quiet, ISO-office, VC-A to VC-G, or a TOML file (default: quiet; in the window as set)",
               "SITE", _name),
    )),
)  # fmt: skip
_ALSO: dict[str, dict[str, str]] = {  # option -> further commands that accept it; its help there, if another
    "json": {"paper": "", "acquire": ""},
    "source": {"doctor": ""},
    "jobs": {"prepare": "compile in N processes"},
    "rate": {"map": ""},
    "model": {"map": "base model of a displacement: contact (default) or paper"},
}
_ONE_CALL = "need all shots in one process: omit --jobs and --scheduler"
EXCLUDED = (  # (option, options that it excludes, message)
    ("save_model", ("no_diagnose",), "--save-model needs a diagnosis: omit --no-diagnose"),
    ("jobs", ("scheduler",), "--jobs and --scheduler exclude each other"),
    ("diagnosis_seconds", ("no_diagnose", "jobs"),
     "--diagnosis-seconds needs a diagnosis: omit --no-diagnose and --jobs"),
    ("law", ("no_diagnose",), "--law needs a diagnosis: omit --no-diagnose"),
    ("plan", ("no_diagnose",), "--plan needs a diagnosis: omit --no-diagnose"),
    ("effect", ("undeclared",), "--undeclared draws the effect at random: omit --effect"),
    *((name, ("jobs", "scheduler"), f"--report, --hdf5, --foretell, --law, --plan and --save-model {_ONE_CALL}")
      for name in ("report", "hdf5", "save_model", "foretell", "law", "plan")),
)  # fmt: skip
NEEDED = (  # (option, options of which it needs at least one)
    ("hdf5", ("export",)),
    ("insecure", ("scheduler",)),
    ("acquire", ("source",)),
    ("acquire", ("out",)),
    *((name, ("plan", "resolve")) for name in ("speeds", "weights", "run_up")),
)


def commands_of(group: Group, option: Option) -> tuple[str, ...]:
    return (*group.commands, *_ALSO.get(option.key, ()))


def help_in(command: str, option: Option) -> str:
    """Return what an option does with this command."""
    return _ALSO.get(option.key, {}).get(command) or option.help


def is_model_file(model: str) -> bool:
    """Return whether the value of ``--model`` is a file rather than a base model."""
    return model.endswith(".toml") or "/" in model


def known_model(model: str | None) -> "SavedModel | None":
    """Return the model in a model file, or None if ``model`` is the name of a base model.  Raises RecordingError."""
    if model is None or not is_model_file(model):
        return None
    from app.session import load_model  # slow to import, so not at the top

    return load_model(Path(model))
