"""Read a force from a formula checked against a whitelist, and generate an effect's function from it.

The text is parsed into Python's syntax tree, and every node is checked: numbers, the state, the parameters,
``+ - * / **`` and the functions of ``functions.FUNCTIONS`` are allowed; anything else is rejected with its column.
Code is generated from the tree, for the effect's function and for arrays; the text itself is never executed.
"""

import ast
import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from analysis.collision.effects.kernel import GENERATED, Q_RATE, SIGN_V, TOUCHING, XI, XI_RATE, Kernel, Q, U, V, X, Y
from analysis.collision.laws.functions import FUNCTIONS, OPERATIONS

MAX_CHARACTERS = 400
_MAX_DEPTH = 40
_MAX_POWER = 12  # largest integer exponent that is evaluated as a product

TIME = "t"  # time since the first touch: a hidden state of rate one
STATE = {"x": X, "v": V, "y": Y, "u": U, "d": XI, "d_rate": XI_RATE, TIME: Q}
_FUNCTIONS = FUNCTIONS | OPERATIONS
_CONSTANTS = {"pi": math.pi}
_SIGNS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}


class FormulaError(ValueError):
    """Why a formula cannot be read, in one line with the column; ``column`` counts from 1 (0: the whole formula)."""

    def __init__(self, what: str, column: int = 0) -> None:
        super().__init__(f"column {column}: {what}" if column else what)
        self.column = column


@dataclass(frozen=True, slots=True)
class Formula:
    """A formula that was read: its text, its parameters in the kernel's order, and the states in it."""

    text: str
    parameters: tuple[str, ...]
    state: tuple[str, ...]

    @property
    def straight(self) -> bool:
        """Get whether the formula is linear in the state for each direction of the block."""
        return _degree(_tree(self.text)) <= 1 and not self.timed

    @property
    def kinked(self) -> bool:
        """Get whether the formula has corners or steps that are not events of a collision."""
        return any(map(_bends_sharply, ast.walk(_tree(self.text))))

    @property
    def timed(self) -> bool:
        """Get whether the formula depends on the time since the first touch."""
        return TIME in self.state

    def values(self, state: Mapping[str, Any], parameters: Mapping[str, Any]) -> Any:
        """Evaluate the formula on arrays of the state (SI units; real, or complex to carry a derivative)."""
        s = {STATE[name]: values for name, values in state.items()}
        s[SIGN_V] = np.sign(np.real(s.get(V, 0.0)))
        return _on_arrays(self.text, self.parameters)(s, [parameters[name] for name in self.parameters])


def read(text: str, parameters: Sequence[str]) -> Formula:
    """Read a formula of the state and ``parameters``.  Raises FormulaError."""
    for name in parameters:
        if name in STATE or name in FUNCTIONS or name in _CONSTANTS:
            raise FormulaError(f"a parameter cannot be called {name!r}: the word is taken")
    tree = _tree(text)
    named: set[str] = set()
    _check_node(tree, frozenset(parameters), named, 0)
    unused = [name for name in parameters if name not in named]
    if unused:
        raise FormulaError(f"the parameter {unused[0]!r} is not in the formula")
    state = tuple(name for name in STATE if name in named)
    return Formula(text, tuple(parameters), state)


@cache
def kernel_of(formula: Formula, adds_to: int, while_touching: bool = False) -> Kernel:
    """Return the formula as a mechanical effect that adds to the output ``adds_to`` (see ``effects.kernel``).

    ``while_touching``: it acts only in contact.  It is compiled at its first use, in half a second, and cached under a
    name that is unique, because it is a digest of the generated text.
    """
    force = _written(_tree(formula.text), formula.parameters)
    condition = f"if s[{TOUCHING}].real > 0.5: " if while_touching else ""
    clock = f"    out[{Q_RATE}] += 1.0\n" if formula.timed else ""
    body = f"(s, p, out):\n{clock}    {condition}out[{adds_to}] += {force}\n"
    name = f"law_{hashlib.sha256(body.encode()).hexdigest()[:24]}"
    names: dict[str, Any] = {f.kernel.__name__: f.kernel for f in _FUNCTIONS.values()} | {"__name__": __name__}
    # the executed text was generated above, node by node, from whitelisted nodes
    exec(compile(f"def {name}{body}", GENERATED, "exec"), names)
    law: Kernel = names[name]
    return law


@cache
def _on_arrays(text: str, parameters: tuple[str, ...]) -> Callable[[Mapping[int, Any], Sequence[Any]], Any]:
    """Return the formula as a function of arrays, called with the same indices as an effect's function."""
    names = {f.kernel.__name__: f.arrays for f in _FUNCTIONS.values()}
    written = f"lambda s, p: {_written(_tree(text), parameters)}"  # generated as in ``kernel_of``
    function: Callable[[Mapping[int, Any], Sequence[Any]], Any] = eval(compile(written, GENERATED, "eval"), names)
    return function


@cache
def _tree(text: str) -> ast.expr:
    if len(text) > MAX_CHARACTERS:
        raise FormulaError(f"longer than {MAX_CHARACTERS} characters")
    if not text.strip():
        raise FormulaError("empty")
    if "\n" in text.strip() or "\0" in text:
        raise FormulaError("more than one line")
    for place, character in enumerate(text.strip(), 1):
        if character == "#" or not character.isascii():  # Python would skip a comment, and normalise some letters
            raise FormulaError(f"{character!r} is not allowed in a formula", place)
    try:
        return ast.parse(text.strip(), mode="eval").body
    except SyntaxError as error:
        raise FormulaError(f"not a formula ({error.msg})", error.offset or 0) from None
    except (RecursionError, MemoryError, ValueError):
        raise FormulaError("nested too deep") from None


def _check_node(node: ast.expr, parameters: frozenset[str], named: set[str], depth: int) -> None:
    """Check every node.  Raises FormulaError for the first node that is not allowed."""
    column = node.col_offset + 1
    if depth > _MAX_DEPTH:
        raise FormulaError("nested too deep", column)
    below: list[ast.expr] = []
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            if abs(value) > 1e300 or not math.isfinite(value):
                raise FormulaError("a number beyond all size", column)
        case ast.Name(id=name):
            if name not in {*STATE, *parameters, *_CONSTANTS}:
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
        _check_node(child, parameters, named, depth + 1)


def _degree(node: ast.expr) -> int:
    """Return the degree of a formula in the state: 0 if it does not depend on it, 1 if linear, otherwise 2."""
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
            return 0  # constant between the turns of the block, which are events
        case ast.Call(func=ast.Name(id="abs"), args=[ast.Name(id="v")]):
            return 1
        case _:
            named = any(isinstance(inner, ast.Name) and inner.id in STATE for inner in ast.walk(node))
            return 2 if named else 0


def _bends_sharply(node: ast.AST) -> bool:
    match node:
        case ast.Call(func=ast.Name(id="sign" | "abs"), args=[ast.Name(id="v" | "d")]):
            return False  # the turn of the block and the touch are events
        case ast.Call(func=ast.Name(id="sign" | "abs" | "step" | "min" | "max")):
            return any(isinstance(inner, ast.Name) and inner.id in STATE for inner in ast.walk(node))
    return False


def _whole(node: ast.expr) -> int | None:
    """Return an integer exponent that is evaluated as a product, or None."""
    sign = 1
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        node, sign = node.operand, -1
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        value = float(node.value)
        if value == int(value) and 1 <= value <= _MAX_POWER:
            return sign * int(value)
    return None


def _written(node: ast.expr, parameters: tuple[str, ...]) -> str:
    """Return the source text of a node, in terms of ``s`` and ``p`` of an effect's function."""
    match node:
        case ast.Constant(value=value):
            return f"({float(value)!r})"  # type: ignore[arg-type]
        case ast.Name(id=name):
            return _written_name(name, parameters)
        case ast.UnaryOp(op=op, operand=operand):
            return f"({'-' if isinstance(op, ast.USub) else '+'}{_written(operand, parameters)})"
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            return _written_power(left, right, parameters)
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            return f"quotient({_written(left, parameters)}, {_written(right, parameters)})"
        case ast.BinOp(left=left, op=op, right=right):
            return f"({_written(left, parameters)} {_SIGNS[type(op)]} {_written(right, parameters)})"
        # the solver changes the block's direction exactly at its turn
        case ast.Call(func=ast.Name(id="sign"), args=[ast.Name(id="v")]):
            return f"s[{SIGN_V}].real"
        case ast.Call(func=ast.Name(id="abs"), args=[ast.Name(id="v")]):
            return f"(s[{V}] * s[{SIGN_V}].real)"
        case ast.Call(func=ast.Name(id=name), args=arguments):
            inside = ", ".join(_written(a, parameters) for a in arguments)
            return f"{_FUNCTIONS[name].kernel.__name__}({inside})"
    raise AssertionError(ast.dump(node))  # ``_check_node`` allows no other node


def _written_name(name: str, parameters: tuple[str, ...]) -> str:
    if name in _CONSTANTS:
        return f"({_CONSTANTS[name]!r})"
    return f"p[{parameters.index(name)}]" if name in parameters else f"s[{STATE[name]}]"


def _written_power(base: ast.expr, exponent: ast.expr, parameters: tuple[str, ...]) -> str:
    whole = _whole(exponent)
    if whole is None:
        return f"positive_power({_written(base, parameters)}, {_written(exponent, parameters)})"
    product = f"whole_power({_written(base, parameters)}, {abs(whole)})"
    return product if whole > 0 else f"quotient(1.0, {product})"
