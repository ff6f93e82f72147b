"""Small changes of a source file, each of which some test must notice."""

import ast
import copy
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

BOUNDARY = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}
OPPOSITE = {
    ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
ARITHMETIC = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Mod: ast.Mult,
    ast.FloorDiv: ast.Div, ast.Pow: ast.Mult, ast.LShift: ast.RShift, ast.RShift: ast.LShift,
    ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd, ast.BitXor: ast.BitAnd,
}  # fmt: skip
PAIRS = ("min max", "any all", "ceil floor", "argmin argmax", "popleft pop")
SISTERS = {a: b for pair in PAIRS for a, b in (pair.split(), pair.split()[::-1])}
SKIPPED_KEYWORDS = {"strict", "dtype"}
CHANGED = {*BOUNDARY, *OPPOSITE, *ARITHMETIC}
LONGEST = 120


@dataclass(frozen=True)
class Mutant:
    """One change.

    Attributes:
        file: Source file, from the root of the tree.
        function: Qualified name of the outermost function it lies in; empty outside functions.
        place: Qualified name of the innermost function or class, for people.
        change: Text before and after; with `file` and `place` it names the mutant for good.
        lines: First and last line of the statement, or of a compound statement's head.
        line: Where the change itself is.
        code: The compiled module with the change.
    """

    file: str
    function: str
    place: str
    change: str
    lines: tuple[int, int]
    line: int
    code: object

    @property
    def name(self) -> str:
        return f"{self.file}:{self.place}: {self.change}"


def mutants_of(root: Path, file: str) -> list[Mutant]:
    """All mutants of a file, in the order of the text."""
    tree = ast.parse((root / file).read_text("utf-8"))
    found: list[Mutant] = []
    names: Counter[tuple[str, str]] = Counter()
    for parent, field, index, place, function, context, lines in _walk(tree, "", "", tree, (1, 1)):
        node = _get(parent, field, index)
        shown = context if _is_number(node) else None
        before = _text(shown or node)
        for new in _changes(node, parent, bool(function)):
            ast.fix_missing_locations(ast.copy_location(new, node))
            _set(parent, field, index, new)
            after = _text(shown or new)
            code = compile(tree, str(root / file), "exec")
            _set(parent, field, index, node)
            change = f"{before} -> {after}"
            if shown and len(before) > LONGEST:
                change = f"{_text(node)} -> {_text(new)}"
            names[place, change] += 1
            if (again := names[place, change]) > 1:
                change += f" #{again}"
            found.append(Mutant(file, function, place, change, lines, node.lineno, code))
    return found


def unchanged(root: Path, file: str) -> Mutant:
    """No change at all: what every test must let live."""
    code = compile((root / file).read_text("utf-8"), str(root / file), "exec")
    return Mutant(file, "", "", "none", (1, 1), 1, code)


def _is_number(node: ast.AST) -> bool:
    """True of a literal, also with a sign."""
    if isinstance(node, ast.UnaryOp):
        return isinstance(node.operand, ast.Constant)
    return isinstance(node, ast.Constant)


def _text(node: ast.AST) -> str:
    """The node in one line; of a compound statement its head."""
    text = ast.unparse(node)
    return re.sub(r"\s+", " ", text.split(":\n")[0] if isinstance(node, ast.stmt) else text)


def _get(parent, field, index):
    value = getattr(parent, field)
    return value if index is None else value[index]


def _set(parent, field, index, new):
    if index is None:
        setattr(parent, field, new)
    else:
        getattr(parent, field)[index] = new


def _walk(node, place, function, context, lines):
    """Yield every place where a node hangs that may be changed: (parent, field, index, ...)."""
    for field, value in ast.iter_fields(node):
        if _is_left_alone(node, field):
            continue
        for index, child in enumerate(value) if isinstance(value, list) else [(None, value)]:
            if not isinstance(child, ast.AST) or _is_nothing(child):
                continue
            inner, owner = place, function
            if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                inner = f"{place}.{child.name}".strip(".")
                if not function and not isinstance(child, ast.ClassDef):
                    owner = inner
            # defaults are made outside the function they belong to
            if field in ("defaults", "kw_defaults") and owner == place:
                owner = ""
            near = context
            if isinstance(node, ast.expr | ast.keyword | ast.stmt) and not (
                _is_number(node) or isinstance(node, ast.Slice) or hasattr(node, "body")
            ):
                near = node
            near_lines = lines
            if isinstance(child, ast.stmt):
                near_lines = (child.lineno, child.end_lineno)
                if hasattr(child, "body"):
                    near_lines = (child.lineno, max(child.lineno, child.body[0].lineno - 1))
            if isinstance(child, ast.expr | ast.stmt):
                yield node, field, index, inner, owner, near, near_lines
            yield from _walk(child, inner, owner, near, near_lines)


def _is_left_alone(node: ast.AST, field: str) -> bool:
    """Annotations and decorators are judged by other tools, prose by readers."""
    if field in ("annotation", "returns", "decorator_list", "ctx", "bases", "format_spec"):
        return True
    if field in ("targets", "target") and isinstance(node, ast.Assign | ast.AnnAssign | ast.For):
        return True
    if isinstance(node, ast.Call) and field == "args":
        called = getattr(node.func, "id", getattr(node.func, "attr", ""))
        return called.endswith("Error")
    return isinstance(node, ast.keyword) and node.arg in SKIPPED_KEYWORDS


def _is_nothing(child: ast.AST) -> bool:
    """Docstrings, imports, assertions, slots: no behaviour, or one that only tools see."""
    if isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant):
        return True
    if isinstance(child, ast.Assign) and getattr(child.targets[0], "id", "") == "__slots__":
        return True
    if isinstance(child, ast.If) and getattr(child.test, "id", "") == "TYPE_CHECKING":
        return True
    return isinstance(child, ast.Import | ast.ImportFrom | ast.Assert)


def _changes(node, parent, in_function):
    """What may stand in place of the node."""
    if isinstance(node, ast.Constant) and isinstance(parent, ast.JoinedStr | ast.UnaryOp):
        return
    if isinstance(node, ast.stmt):
        if in_function:
            yield from _statement(node, parent)
    elif isinstance(node, ast.Constant):
        yield from (ast.Constant(value) for value in _values(node.value))
    elif isinstance(node, ast.Compare):
        for at, op in enumerate(node.ops):
            for table in (BOUNDARY, OPPOSITE):
                if type(op) in table:
                    new = copy.copy(node)
                    new.ops = [*node.ops[:at], table[type(op)](), *node.ops[at + 1 :]]
                    yield new
    elif isinstance(node, ast.BinOp) and type(node.op) in ARITHMETIC:
        yield ast.BinOp(node.left, ARITHMETIC[type(node.op)](), node.right)
    elif isinstance(node, ast.UnaryOp):
        if _is_number(node):
            yield from (ast.UnaryOp(node.op, ast.Constant(v)) for v in _values(node.operand.value))
        yield node.operand
    elif isinstance(node, ast.BoolOp):
        yield ast.BoolOp(ast.Or() if isinstance(node.op, ast.And) else ast.And(), node.values)
        for at in range(len(node.values)):
            rest = [*node.values[:at], *node.values[at + 1 :]]
            yield rest[0] if len(rest) == 1 else ast.BoolOp(node.op, rest)
    elif isinstance(node, ast.Dict):
        for at in range(len(node.keys)):
            yield ast.Dict(
                [*node.keys[:at], *node.keys[at + 1 :]], [*node.values[:at], *node.values[at + 1 :]]
            )
    elif isinstance(node, ast.Call):
        yield from _call(node)
    if _is_asked(node, parent):
        yield ast.UnaryOp(ast.Not(), node)


def _is_asked(node, parent) -> bool:
    """True of a condition that no other change turns round."""
    if isinstance(node, ast.Compare | ast.BoolOp | ast.UnaryOp | ast.Constant):
        return False
    asks = isinstance(parent, ast.If | ast.While | ast.IfExp) and parent.test is node
    return asks or (isinstance(parent, ast.comprehension) and node in parent.ifs)


def _statement(node, parent):
    if isinstance(node, ast.Return):
        if node.value is None or getattr(node.value, "value", 0) is None:
            if not (isinstance(parent, ast.FunctionDef) and node is parent.body[-1]):
                yield ast.Pass()
        elif not (isinstance(node.value, ast.Constant) and isinstance(node.value.value, bool)):
            yield ast.Return(ast.Constant(None))
    elif isinstance(
        node, ast.Expr | ast.Assign | ast.AugAssign | ast.Raise | ast.Break | ast.Continue
    ) or (isinstance(node, ast.AnnAssign) and node.value is not None):
        yield ast.Pass()
    if isinstance(node, ast.AugAssign) and type(node.op) in ARITHMETIC:
        yield ast.AugAssign(node.target, ARITHMETIC[type(node.op)](), node.value)


def _values(value):
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, int | float):
        yield value + 1
        if value:
            yield type(value)(0)
    elif isinstance(value, str) and " " not in value:
        yield value + "x"
    elif isinstance(value, bytes) and b" " not in value:
        yield value + b"x"


def _call(node):
    name = getattr(node.func, "id", getattr(node.func, "attr", None))
    if name in SISTERS:
        func = copy.copy(node.func)
        setattr(func, "id" if isinstance(func, ast.Name) else "attr", SISTERS[name])
        yield ast.Call(func, node.args, node.keywords)
