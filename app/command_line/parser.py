"""Parse the command line, either a command with its options or only options; refuse invalid combinations."""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain

from app.command_line import options as declared
from app.command_line.options import (
    COMMANDS,
    PLAN,
    WINDOW,
    Option,
    Version,
    commands_of,
    help_in,
    is_model_file,
)
from levimass import BASE_MODELS, AnalysisSettings


def flat_parser() -> argparse.ArgumentParser:
    """Return the parser of all options, including the commands as options."""
    parser = argparse.ArgumentParser(
        prog="levimass",
        description="Levitation Mass Method: from the beat of two light frequencies to force and restitution. "
        "Without an option the desktop window opens.",
        epilog="Each of the first options is a command too: levimass replay PATH, levimass acquire N, "
        "levimass plan PATH; levimass replay --help lists its options.",
    )
    parser.add_argument("--version", action=Version, nargs=0, help="print version, licence and dependencies")
    one_of = parser.add_mutually_exclusive_group()
    for command in COMMANDS:
        command.add(one_of)
    for group in declared.GROUPS:
        place = parser.add_argument_group(group.heading)
        for option in group.options:
            option.add(place)
    return parser


def command_parser(name: str) -> argparse.ArgumentParser:
    """Return the parser of one command, with the options that it accepts."""
    command = next((c for c in COMMANDS if c.key == ("replay" if name == PLAN else name)), None)
    about = "plan the next shots" if name == PLAN else command.help if command else "open the window"
    parser = argparse.ArgumentParser(prog=f"levimass {name}", description=f"{about[0].upper()}{about[1:]}.")
    if command is not None and command.parse is not None:
        more = {key: value for key, value in command.more.items() if key != "const"}
        replace(command, help="", more=more).add(parser, command.key)
    excluded = _excluded_by(name)
    for option, commands in _options():
        if (command.key if command else name) in commands and option.key not in excluded:
            replace(option, help=help_in(name, option)).add(parser)
    return parser


def _excluded_by(name: str) -> set[str]:
    """Return the options that a command excludes, with those for which everything they need is excluded."""
    excluded = {other for one, others, _ in declared.EXCLUDED if one == name for other in others}
    return excluded | {one for one, needed in declared.NEEDED if excluded.issuperset(needed)}


def _options() -> Iterator[tuple[Option, tuple[str, ...]]]:
    """Yield each declared option and the commands that it goes with."""
    for group in declared.GROUPS:
        for option in group.options:
            yield option, commands_of(group, option)


def parse(arguments: list[str]) -> argparse.Namespace:
    """Parse and check the arguments, of which the first may be a command.  Raises SystemExit on wrong usage."""
    parser, names = flat_parser(), [*(command.key for command in COMMANDS), PLAN, WINDOW]
    if not arguments or arguments[0] not in names:
        options = parser.parse_args(arguments)
    else:
        options, name = parser.parse_args([]), arguments[0]
        parser = command_parser(name)
        parser.parse_args(arguments[1:], options)
        if name in ("prepare", "doctor"):
            setattr(options, name, True)
        if name == "paper" and options.paper is None:
            options.paper = False
        if name == PLAN and options.plan is None:
            options.plan = ""
    _check(parser, options)
    return options


def command_of(options: argparse.Namespace) -> str:
    for command in COMMANDS:
        value = getattr(options, command.key)
        if value is not None and (value is not False or command.parse is not None):
            return command.key
    return WINDOW


def settings_from(options: argparse.Namespace) -> AnalysisSettings:
    """Return the analysis settings given by the options."""
    given = {setting.key: getattr(options, setting.key) for setting in declared.CHOSEN}
    return AnalysisSettings(**{key: value for key, value in given.items() if value is not None})


def _check(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """End with a usage error if an option does not apply to this command or excludes another."""
    command, usual = command_of(options), flat_parser().parse_args([])
    given = {name for name, value in vars(options).items() if value != getattr(usual, name)}
    problem = next(chain(_misplaced(given, command), _ill_combined(given), _wrong_values(options, command)), None)
    if problem is not None:
        parser.error(problem)


def _misplaced(given: set[str], command: str) -> Iterator[str]:
    for option, known in _options():
        if option.key in given and command not in known:
            yield f"{option.flag} goes with {', '.join(f'--{name}' for name in known if name != WINDOW)}"


def _ill_combined(given: set[str]) -> Iterator[str]:
    for name, others, why in declared.EXCLUDED:
        if name in given and given & set(others):
            yield why
    for name, others in declared.NEEDED:
        if name in given and not given & set(others):
            yield f"{_flag(name)} goes with {' or '.join(map(_flag, others))}"


def _wrong_values(options: argparse.Namespace, command: str) -> Iterator[str]:
    if command == "acquire" and options.json is not None and options.resolve is None:
        yield "--json goes with --acquire only together with --resolve"
    if options.model is not None and options.model not in BASE_MODELS and not is_model_file(options.model):
        yield f"--model: no model called {options.model!r}; there are {', '.join(BASE_MODELS)}"
    if options.foretell and (options.model is None or not is_model_file(options.model)):
        yield "--foretell goes with --model FILE: it tests that file's model"
    if options.site is not None:
        yield from _wrong_site(options, command)


def _wrong_site(options: argparse.Namespace, command: str) -> Iterator[str]:
    from instrument.bench import site_named
    from instrument.devices import is_bench

    if command == "acquire" and not is_bench(options.source):
        yield "--site applies only to the simulated bench: with --simulate, with --acquire --source bench, or alone"
    try:
        site_named(options.site)
    except ValueError as error:
        yield f"--site: {error}"


def _flag(name: str) -> str:
    return "--" + name.replace("_", "-")
