"""A force written as a formula: read by a whitelist, turned into a kernel of the catalogue's kind, never evaluated.

The text is parsed into Python's syntax tree and every node of it is looked at: numbers, the named state, the named
parameters, ``+ - * / **`` and the functions of ``functions.FUNCTIONS``; whatever else stands in it is refused with its
place.  From the tree a kernel is written, or an array computed; the text itself is run nowhere.
"""

import ast
import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from analysis.collision.effects.kernel import Q_RATE, SIGN_V, TOUCHING, WRITTEN, XI, XI_RATE, Kernel, Q, U, V, X, Y
from analysis.collision.laws.functions import FUNCTIONS, divided, multiplied, raised, raised_arrays

LONGEST = 400  # characters: a law that one can read
_DEEPEST = 40
_GREATEST_POWER = 12  # of a whole exponent, multiplied out

TIME = "t"  # since the first touch: a hidden state that grows by a second a second
STATE = {"x": X, "v": V, "y": Y, "u": U, "d": XI, "d_rate": XI_RATE, TIME: Q}
UNITS = {"x": "m", "v": "m/s", "y": "m", "u": "m/s", "d": "m", "d_rate": "m/s", TIME: "s"}
_CONSTANTS = {"pi": math.pi}
_SIGNS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}


class FormulaError(ValueError):
    """Why a formula cannot be read, in one line that names the place; ``column`` counts from 1 (0: the whole)."""

    def __init__(self, what: str, column: int = 0) -> None:
        super().__init__(f"column {column}: {what}" if column else what)
        self.column = column


@dataclass(frozen=True, slots=True)
class Formula:
    """A formula that was read: its text, the parameters it may name (in the kernel's order), the state it names."""

    text: str
    parameters: tuple[str, ...]
    state: tuple[str, ...]

    @property
    def straight(self) -> bool:
        """Get whether the formula is linear in the state between two turns of the block."""
        return _degree(_tree(self.text)) <= 1 and not self.timed

    @property
    def kinked(self) -> bool:
        """Get whether the formula has corners or steps that are none of the events of a collision."""
        return any(map(_bends_sharply, ast.walk(_tree(self.text))))

    @property
    def timed(self) -> bool:
        """Get whether the formula names the time since the first touch."""
        return TIME in self.state

    def values(self, state: Mapping[str, Any], parameters: Mapping[str, Any]) -> Any:
        """Return the formula on arrays of the named state (SI units; real, or complex to carry a derivative)."""
        return _on_arrays(_tree(self.text), {**_CONSTANTS, **state, **parameters})


def read(text: str, parameters: Sequence[str]) -> Formula:
    """Read a formula over the state and ``parameters``; FormulaError says what cannot be, and where."""
    for name in parameters:
        if name in STATE or name in FUNCTIONS or name in _CONSTANTS:
            raise FormulaError(f"a parameter cannot be called {name!r}: the word is taken")
    tree = _tree(text)
    named: set[str] = set()
    _look(tree, frozenset(parameters), named, 0)
    unused = [name for name in parameters if name not in named]
    if unused:
        raise FormulaError(f"the parameter {unused[0]!r} does not stand in the formula")
    state = tuple(name for name in STATE if name in named)
    return Formula(text, tuple(parameters), state)


@cache
def kernel_of(formula: Formula, adds_to: int, while_touching: bool = False) -> Kernel:
    """Return the formula as a mechanical effect that adds to the output ``adds_to`` (see ``effects.kernel``).

    ``while_touching``: only in contact.  Written once a formula; compiled where it is first used ever, in half a
    second, and kept under a name that is a digest of what was written: it can never be another's.
    """
    force = _written(_tree(formula.text), formula.parameters)
    condition = f"if s[{TOUCHING}].real > 0.5: " if while_touching else ""
    clock = f"    out[{Q_RATE}] += 1.0\n" if formula.timed else ""
    body = f"(s, p, out):\n{clock}    {condition}out[{adds_to}] += {force}\n"
    name = f"law_{hashlib.sha256(body.encode()).hexdigest()[:24]}"
    names: dict[str, Any] = {f.kernel.__name__: f.kernel for f in FUNCTIONS.values()} | {"__name__": __name__}
    names |= {helper.__name__: helper for helper in (raised, multiplied, divided)}
    # What is run here was written above, node by node from the whitelist.
    exec(compile(f"def {name}{body}", WRITTEN, "exec"), names)
    law: Kernel = names[name]
    return law


@cache
def _tree(text: str) -> ast.expr:
    if len(text) > LONGEST:
        raise FormulaError(f"longer than {LONGEST} characters")
    if not text.strip():
        raise FormulaError("empty")
    if "\n" in text.strip() or "\0" in text:
        raise FormulaError("more than one line")
    for place, character in enumerate(text.strip(), 1):
        if character == "#" or not character.isascii():  # Python would pass over the first, and rename some letters
            raise FormulaError(f"{character!r} does not belong into a formula", place)
    try:
        return ast.parse(text.strip(), mode="eval").body
    except SyntaxError as error:
        raise FormulaError(f"not a formula ({error.msg})", error.offset or 0) from None
    except (RecursionError, MemoryError, ValueError):
        raise FormulaError("nested too deep") from None


def _look(node: ast.expr, parameters: frozenset[str], named: set[str], depth: int) -> None:
    """Look at every node; FormulaError at the first that is not of a formula."""
    column = node.col_offset + 1
    if depth > _DEEPEST:
        raise FormulaError("nested too deep", column)
    below: list[ast.expr] = []
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            if abs(value) > 1e300 or not math.isfinite(value):
                raise FormulaError("a number beyond all size", column)
        case ast.Name(id=name):
            if name not in STATE and name not in parameters and name not in _CONSTANTS:
                known = ", ".join((*STATE, *sorted(parameters)))
                raise FormulaError(f"no {name!r} is known here; there are {known}", column)
            named.add(name)
        case ast.UnaryOp(op=ast.UAdd() | ast.USub(), operand=operand):
            below = [operand]
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div() | ast.Pow(), right=right):
            below = [left, right]
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            if name not in FUNCTIONS:
                raise FormulaError(f"no function {name!r}; there are {', '.join(FUNCTIONS)}", column)
            takes = FUNCTIONS[name].takes
            if len(arguments) != takes:
                raise FormulaError(f"{name} takes {takes}, not {len(arguments)}", column)
            below = arguments
        case ast.BinOp(op=ast.BitXor()):
            raise FormulaError("a power is written **, not ^", column)
        case _:
            raise FormulaError("only numbers, names, + - * / ** and functions are for formulas", column)
    for child in below:
        _look(child, parameters, named, depth + 1)


def _degree(node: ast.expr) -> int:
    """Return the power of the state in a formula: 0 where it names none, 2 for whatever is not linear."""
    match node:
        case ast.Name(id=name):
            return int(name in STATE)
        case ast.UnaryOp(operand=operand):
            return _degree(operand)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            return max(_degree(left), _degree(right))
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            return min(2, _degree(left) + _degree(right))
        case ast.BinOp(left=left, op=ast.Div(), right=right) if _degree(right) == 0:
            return _degree(left)
        case ast.Call(func=ast.Name(id="sign"), args=[ast.Name(id="v")]):
            return 0  # switched exactly where the block turns
        case ast.Call(func=ast.Name(id="abs"), args=[ast.Name(id="v")]):
            return 1
        case _:
            named = any(isinstance(inner, ast.Name) and inner.id in STATE for inner in ast.walk(node))
            return 2 if named else 0


def _bends_sharply(node: ast.AST) -> bool:
    match node:
        case ast.Call(func=ast.Name(id="sign" | "abs"), args=[ast.Name(id="v" | "d")]):
            return False  # the block turns, or the bodies meet
        case ast.Call(func=ast.Name(id="sign" | "abs" | "step" | "min" | "max")):
            return any(isinstance(inner, ast.Name) and inner.id in STATE for inner in ast.walk(node))
    return False


def _whole(node: ast.expr) -> int | None:
    """Return a whole exponent that is multiplied out, or None."""
    sign = 1
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        node, sign = node.operand, -1
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        value = float(node.value)
        if value == int(value) and 1 <= value <= _GREATEST_POWER:
            return sign * int(value)
    return None


def _written(node: ast.expr, parameters: tuple[str, ...]) -> str:
    """Return the node as a kernel's source."""
    match node:
        case ast.Constant(value=value):
            return f"({float(value)!r})"  # type: ignore[arg-type]
        case ast.Name(id=name):
            if name in _CONSTANTS:
                return f"({_CONSTANTS[name]!r})"
            return f"p[{parameters.index(name)}]" if name in parameters else f"s[{STATE[name]}]"
        case ast.UnaryOp(op=op, operand=operand):
            return f"({'-' if isinstance(op, ast.USub) else '+'}{_written(operand, parameters)})"
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            base, whole = _written(left, parameters), _whole(right)
            if whole is None:
                return f"raised({base}, {_written(right, parameters)})"
            product = f"multiplied({base}, {abs(whole)})"
            return product if whole > 0 else f"divided(1.0, {product})"
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            return f"divided({_written(left, parameters)}, {_written(right, parameters)})"
        case ast.BinOp(left=left, op=op, right=right):
            return f"({_written(left, parameters)} {_SIGNS[type(op)]} {_written(right, parameters)})"
        case ast.Call(func=ast.Name(id=name), args=arguments):
            if name in ("sign", "abs") and isinstance(arguments[0], ast.Name) and arguments[0].id == "v":
                # The integrators switch the block's direction exactly where it turns.
                return f"s[{SIGN_V}].real" if name == "sign" else f"(s[{V}] * s[{SIGN_V}].real)"
            inside = ", ".join(_written(a, parameters) for a in arguments)
            return f"{FUNCTIONS[name].kernel.__name__}({inside})"
    raise AssertionError(ast.dump(node))  # ``_look`` lets nothing else pass


def _on_arrays(node: ast.expr, names: Mapping[str, Any]) -> Any:
    match node:
        case ast.Constant(value=value):
            return float(value)  # type: ignore[arg-type]
        case ast.Name(id=name):
            return names[name]
        case ast.UnaryOp(op=op, operand=operand):
            value = _on_arrays(operand, names)
            return -value if isinstance(op, ast.USub) else value
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            base, whole = _on_arrays(left, names), _whole(right)
            if whole is None:
                return raised_arrays(base, _on_arrays(right, names))
            return np.asarray(base) ** whole if whole > 0 else 1.0 / np.asarray(base) ** -whole
        case ast.BinOp(left=left, op=op, right=right):
            a, b = _on_arrays(left, names), _on_arrays(right, names)
            if isinstance(op, ast.Add):
                return a + b
            if isinstance(op, ast.Sub):
                return a - b
            return a * b if isinstance(op, ast.Mult) else np.divide(a, b)
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return FUNCTIONS[name].arrays(*(_on_arrays(a, names) for a in arguments))
    raise AssertionError(ast.dump(node))
