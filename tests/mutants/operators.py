"""Every fault of one kind each that a source file could have: small changes of its text, found in its syntax tree."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

# the gate turned round: "<=" for "<" is no fault where numbers are never equal
_COMPARED = {"Lt": ">=", "LtE": ">", "Gt": "<=", "GtE": "<", "Eq": "!=", "NotEq": "=="}
_ADDED = {"Add": "-", "Sub": "+", "Mult": "/", "Div": "*"}
_EITHER_WAY = ("max", "min", "maximum", "minimum", "hypot", "isclose", "suppress")  # of arguments in any order
_EITHER_WAY_OF_NUMPY = (
    "clip",
    "add",
    "multiply",
    "fmin",
    "fmax",
    "convolve",
    "logical_and",
    "logical_or",
    "array_equal",
)
_EITHER_WAY_OF_LLVM = ("add", "mul")  # of the builder of its instructions
_COUNTED = 9  # an integer up to which one more is one too many; a larger one is a size, and doubled
_GUARD = "strict"  # of zip: what it guards against is another fault of the program
_GENERIC = ("Callable", "Generic", "Mapping", "NDArray", "Sequence", "dict", "list", "tuple")  # subscripted: a type
_THROUGH = ("abs", "sqrt", "sorted", "deg2rad", "clip", "square", "reversed", "conj")


@dataclass(frozen=True, slots=True)
class Fault:
    """A change of the text between two offsets of a file, in UTF-8 bytes."""

    path: str
    line: int
    kind: str
    start: int
    stop: int
    before: str
    after: str

    def applied(self, source: bytes) -> bytes:
        """Return the source with the fault in it."""
        return source[: self.start] + self.after.encode() + source[self.stop :]

    def parses(self, root: Path) -> bool:
        """Return whether the file is still Python with the fault in it; to ask this of every fault takes minutes."""
        try:
            ast.parse(self.applied((root / self.path).read_bytes()))
        except SyntaxError:
            return False
        return True


def faults_of(root: Path, path: str) -> list[Fault]:
    """Return every fault that the operators know for one file, a few of which do not parse.

    There is none in annotations and docstrings.
    """
    source = (root / path).read_bytes()
    tree = ast.parse(source)
    starts = [0]
    for text in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(text))
    skipped = {id(inner) for node in _not_run(tree) for inner in ast.walk(node)}
    sets = {id(node) for node in _sets(tree)}
    found = []
    for node in ast.walk(tree):
        if id(node) in skipped or id(node) in sets:
            continue
        for kind, at, after in _changes(node, source, starts):
            start, stop = starts[at.lineno - 1] + at.col_offset, starts[at.end_lineno - 1] + at.end_col_offset
            before = source[start:stop].decode()
            fault = Fault(path, at.lineno, kind, start, stop, before, after)
            if before != after:
                found.append(fault)
    return found


def _changes(node: ast.AST, source: bytes, starts: list[int]) -> Iterator[tuple[str, ast.expr | ast.stmt, str]]:
    def text(of: ast.AST) -> str:
        return source[
            starts[of.lineno - 1] + of.col_offset : starts[of.end_lineno - 1]
            + of.end_col_offset  # type: ignore
        ].decode()

    match node:
        case ast.Constant(value=bool()):
            yield "default", node, str(not node.value)
        case ast.Constant(value=int()):
            counted = abs(node.value) <= _COUNTED
            yield "off by one" if counted else "factor", node, str(node.value + 1 if counted else 2 * node.value)
        case ast.Constant(value=float()):
            yield "factor", node, repr(2.0 * node.value if node.value else 1.0)
        case ast.UnaryOp(op=ast.USub()):
            yield "sign", node, f"({text(node.operand)})"
        case ast.UnaryOp(op=ast.Not()):
            yield "comparison", node, f"({text(node.operand)})"
        case ast.BinOp() if type(node.op).__name__ in _ADDED:
            kind = "sign" if isinstance(node.op, ast.Add | ast.Sub) else "factor"
            yield kind, node, f"({text(node.left)}) {_ADDED[type(node.op).__name__]} ({text(node.right)})"
        case ast.Compare(ops=[op]) if type(op).__name__ in _COMPARED:
            yield (
                "comparison",
                node,
                f"({text(node.left)}) {_COMPARED[type(op).__name__]} ({text(node.comparators[0])})",
            )
        case ast.BoolOp(values=[one, *_]):
            yield "comparison", node, f"({text(one)})"
        case ast.Expr(value=ast.Call()):
            yield "call left out", node, "pass"
        case ast.Call(func=called, args=arguments, keywords=named):
            name = called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")
            if name in _THROUGH and arguments:
                yield "call left out", node, f"({text(arguments[0])})"
            plain = len(arguments) >= 2 and not any(isinstance(a, ast.Starred) for a in arguments)
            of = getattr(called.value, "id", "") if isinstance(called, ast.Attribute) else ""
            either_way = {"np": _EITHER_WAY_OF_NUMPY, "builder": _EITHER_WAY_OF_LLVM}.get(of, ())
            commutes = name in _EITHER_WAY or name in either_way
            if plain and not commutes and text(arguments[0]) != text(arguments[1]):
                rest = [text(a) for a in arguments[2:]] + [text(k) for k in named]
                swapped = ", ".join([text(arguments[1]), text(arguments[0]), *rest])
                yield "swapped", node, f"{text(called)}({swapped})"
            if named and named[-1].arg not in (None, _GUARD):
                left = ", ".join(text(a) for a in (*arguments, *named[:-1]))
                yield "ignored argument", node, f"{text(called)}({left})"
        case ast.Tuple(elts=[one, two], ctx=ast.Load()) if text(one) != text(two):
            yield "swapped", node, f"({text(two)}, {text(one)})"


def _is_class(node: ast.expr) -> bool:
    """Return whether a name is written as those of classes are."""
    return isinstance(node, ast.Name) and node.id[0].isupper() and not node.id.isupper()


def _sets(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield tuples whose order is none: exceptions to catch, and what a value is looked for in.

    Also what an assertion demands together: less of it guards against fewer other faults, and is none itself.
    """
    for node in ast.walk(tree):
        match node:
            case ast.ExceptHandler(type=ast.Tuple() as those):
                yield those
            case ast.Compare(ops=[ast.In() | ast.NotIn()], comparators=[ast.Tuple() as those]):
                yield those
            case ast.Assert(test=ast.BoolOp(op=ast.And()) as those):
                yield those
            case ast.Call(func=ast.Name(id="isinstance" | "issubclass"), args=[_, ast.Tuple() as those]):
                yield those


def _not_run(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield annotations, docstrings, imports, what only names types, and guards."""
    for node in ast.walk(tree):
        guards = isinstance(node, ast.keyword) and node.arg == _GUARD
        if guards or isinstance(node, ast.Import | ast.ImportFrom | ast.Raise):
            yield node
        elif isinstance(node, ast.AnnAssign | ast.arg) and node.annotation is not None:
            yield node.annotation
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            if node.returns is not None:
                yield node.returns
            yield from node.decorator_list
        elif isinstance(node, ast.ClassDef):
            yield from node.decorator_list
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            yield node
        elif isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name) and node.value.id in _GENERIC:
            yield node.slice  # tuple[X, ...] is a type wherever it stands
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Subscript) and _is_class(node.func.value):
            yield node.func.slice  # ShotJob[Spectra](...) is made without its type
