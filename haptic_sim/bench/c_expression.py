# SPDX-License-Identifier: Apache-2.0
"""Expressions of the laws in C, with their types: numbers, pointers to records, arrays and tables of reals, several
values."""

import ast
import builtins
import math
from typing import NamedTuple

_WORDS = {"auto", "case", "char", "const", "default", "do", "double", "end", "enum", "extern", "float", "goto", "int",
          "long", "part0", "register", "short", "signed", "static", "struct", "switch", "union", "void"}  # fmt: skip
_OPERATORS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.BitAnd: "&", ast.BitOr: "|", ast.BitXor: "^"}
_RELATIONS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}


def named(name: str) -> str:
    """A local's name, other than C's own words."""
    return f"{name}_" if name in _WORDS else name


class Number(NamedTuple):
    """A type of C that is passed by value."""

    c: str


INTEGER, REAL, VOID = Number("long long"), Number("double"), Number("void")
REALS, TABLE = Number("struct reals"), Number("struct table")  # of one and of two dimensions


class Record(NamedTuple):
    """Pointer to a structure with the fields of a numpy dtype, all of eight bytes."""

    name: str
    dtype: object

    @property
    def c(self) -> str:
        return f"struct {self.name} *"

    def text(self) -> str:
        """Its definition."""
        fields = []
        for name, (dtype, _) in self.dtype.fields.items():
            size = f"[{math.prod(dtype.shape)}]" if dtype.shape else ""
            fields.append(f"{'double' if dtype.base.kind == 'f' else 'long long'} {named(name)}{size};")
        return f"struct {self.name} {{ {' '.join(fields)} }};"


class Values(NamedTuple):
    """A structure of what a function returns at once."""

    name: str
    kinds: tuple

    @property
    def c(self) -> str:
        return f"struct {self.name}"

    def text(self) -> str:
        """Its definition."""
        return f"struct {self.name} {{ {' '.join(f'{kind.c} part{i};' for i, kind in enumerate(self.kinds))} }};"


class Found(NamedTuple):
    """An expression in C and its type; `value` instead, if it is known before the program runs."""

    code: str
    kind: object
    value: object = None


class Expressions:
    """Translates expressions of one function: `kinds` are the types of its names as far as they are known."""

    def __init__(self, program, known: dict, kinds: dict):
        self.program, self.known, self.kinds = program, known, kinds

    def of(self, node) -> Found:
        """An expression; ValueError, one sentence, for one that is none of the laws' language."""
        handler = getattr(self, f"_{type(node).__name__.lower()}_", None)
        if handler is None:
            raise ValueError(f"a kernel with {ast.unparse(node)!r} cannot be translated to C")
        return handler(node)

    def learn(self, name, kind):
        """A local has this type too."""
        self.kinds[name] = self.wider(self.kinds[name], kind) if name in self.kinds else kind

    @staticmethod
    def wider(one, other):
        """The type that holds both."""
        return REAL if {one, other} == {INTEGER, REAL} else one

    @staticmethod
    def loaded(target):
        """The same place, to be read."""
        return ast.parse(ast.unparse(target), mode="eval").body

    def _constant(self, value):
        if isinstance(value, bool | int):
            return Found(f"{int(value)}", INTEGER, value)
        if isinstance(value, float):
            return Found("INFINITY" if value == math.inf else "NAN" if math.isnan(value) else repr(value), REAL, value)
        return Found("", VOID, value)

    def _constant_(self, node):
        return self._constant(node.value)

    def _name_(self, node):
        if node.id in self.kinds:
            return Found(named(node.id), self.kinds[node.id])
        return self._constant(self.known[node.id] if node.id in self.known else getattr(builtins, node.id))

    def _attribute_(self, node):
        base = self.of(node.value)
        if base.kind == VOID:
            return self._constant(getattr(base.value, node.attr))
        if base.kind in (REALS, TABLE):  # its size, or its shape, of which only the first is asked for
            return Found(f"{base.code}.size", INTEGER)
        dtype = base.kind.dtype.fields[node.attr][0]
        place = f"{base.code}->{named(node.attr)}"
        if dtype.shape:
            kind = REALS if len(dtype.shape) == 1 else TABLE
            return Found(f"(({kind.c}){{{place}, {', '.join(map(str, dtype.shape))}}})", kind)
        return Found(place, REAL if dtype.kind == "f" else INTEGER)

    def _subscript_(self, node):
        base = self.of(node.value)
        if base.kind == INTEGER:
            return base
        if base.kind == REALS:
            return Found(f"{base.code}.at[{self.of(node.slice).code}]", REAL)
        if isinstance(node.slice, ast.Tuple):
            row, column = (self.of(index).code for index in node.slice.elts)
            return Found(f"{base.code}.at[{row} * {base.code}.width + {column}]", REAL)
        return Found(f"row_of({base.code}, {self.of(node.slice).code})", REALS)

    def _tuple_(self, node):
        parts = [self.of(part) for part in node.elts]
        kind = self.program.tuple_of(part.kind for part in parts)
        return Found(f"(({kind.c}){{{', '.join(part.code for part in parts)}}})", kind)

    def _binop_(self, node):
        a, b = self.of(node.left), self.of(node.right)
        kind = self.wider(a.kind, b.kind)
        if isinstance(node.op, ast.Div):
            return Found(f"((double){a.code} / (double){b.code})", REAL)
        if isinstance(node.op, ast.Pow):
            return Found(f"({a.code} * {a.code})" if b.value == 2 else f"pow({a.code}, {b.code})", kind)
        if isinstance(node.op, ast.Mod | ast.FloorDiv):
            whole = "modulo" if isinstance(node.op, ast.Mod) else "floor_divide"
            if kind == REAL:
                return Found(f"({a.code} - floor({a.code} / {b.code}) * {b.code})", REAL)
            return Found(f"{whole}({a.code}, {b.code})", INTEGER)
        return Found(f"({a.code} {_OPERATORS[type(node.op)]} {b.code})", kind)

    def _unaryop_(self, node):
        found = self.of(node.operand)
        if isinstance(node.op, ast.Not):
            return Found(f"(!{found.code})", INTEGER)
        return Found(f"({'-' if isinstance(node.op, ast.USub) else '+'}{found.code})", found.kind)

    def _boolop_(self, node):
        sign = " && " if isinstance(node.op, ast.And) else " || "
        return Found(f"({sign.join(self.of(part).code for part in node.values)})", INTEGER)

    def _compare_(self, node):
        terms, left = [], self.of(node.left)
        for sign, right in zip(node.ops, node.comparators, strict=True):
            if isinstance(sign, ast.In):
                equal = " || ".join(f"{left.code} == {self.of(one).code}" for one in right.elts)
                terms.append(f"({equal})")
                continue
            other = self.of(right)
            terms.append(f"({left.code} {_RELATIONS[type(sign)]} {other.code})")
            left = other
        return Found(f"({' && '.join(terms)})", INTEGER)

    def _ifexp_(self, node):
        test, yes, no = self.of(node.test), self.of(node.body), self.of(node.orelse)
        return Found(f"({test.code} ? {yes.code} : {no.code})", self.wider(yes.kind, no.kind))

    def _call_(self, node):
        called, given = self.of(node.func).value, [self.of(argument) for argument in node.args]
        if called in (min, max):
            return self._extreme("least" if called is min else "most", given)
        if called is abs:
            return Found(f"{'fabs' if given[0].kind == REAL else 'llabs'}({given[0].code})", given[0].kind)
        if called is int:
            return Found(f"((long long){given[0].code})", INTEGER)
        if called is round:
            return Found(f"((long long)rint({given[0].code}))", INTEGER)
        if getattr(called, "__module__", "") == "math":
            code = f"{called.__name__}({', '.join(one.code for one in given)})"
            whole = called is math.floor
            return Found(f"((long long){code})" if whole else code, INTEGER if whole else REAL)
        function = self.program.function(called, [one.kind for one in given])
        return Found(f"{function.name}({', '.join(one.code for one in given)})", function.returns)

    def _extreme(self, which, given):
        found = given[0]
        for one in given[1:]:
            kind = self.wider(found.kind, one.kind)
            found = Found(f"{which}_{'real' if kind == REAL else 'integer'}({found.code}, {one.code})", kind)
        return found
