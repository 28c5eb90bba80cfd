# SPDX-License-Identifier: Apache-2.0
"""A kernel's law in C, translated from its own source: what a C compiler makes of the same arithmetic.

The laws are written in a small part of Python (numbers, records, arrays and tables, loops over ranges and rows), and so
a translation line by line is possible: it is the same law by construction, and stays so when the law is edited. Kernels
outside that part (they make arrays, or call the operating system) are refused by ValueError.
"""

import ast
import inspect
import textwrap
from typing import NamedTuple

from haptic_sim.bench.c_expression import INTEGER, REAL, REALS, TABLE, VOID, Expressions, Found, Record, Values, named

HEAD = """#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
struct reals { double *at; long long size; };
struct table { double *at; long long size, width; };
static inline struct reals row_of(struct table t, long long i) { return (struct reals){t.at + i * t.width, t.width}; }
static inline double least_real(double a, double b) { return b < a ? b : a; }
static inline double most_real(double a, double b) { return b > a ? b : a; }
static inline long long least_integer(long long a, long long b) { return b < a ? b : a; }
static inline long long most_integer(long long a, long long b) { return b > a ? b : a; }
static inline long long floor_divide(long long a, long long b) { long long q = a / b; return q - (a % b && (a < 0) != (b < 0)); }
static inline long long modulo(long long a, long long b) { long long r = a % b; return r && (r < 0) != (b < 0) ? r + b : r; }
"""  # noqa: E501


class Function(NamedTuple):
    """A kernel for these argument types: its name in C, what it returns, and its text."""

    name: str
    returns: object
    text: str


class Program:
    """All that a kernel needs, in the order in which C wants it."""

    def __init__(self):
        self.records, self.values, self.functions = {}, {}, {}

    def record(self, dtype) -> Record:
        """The type of a pointer to such a record."""
        return self.records.setdefault(dtype, Record(f"record_{len(self.records)}", dtype))

    def tuple_of(self, kinds) -> Values:
        """The type of several values returned at once."""
        kinds = tuple(kinds)
        return self.values.setdefault(kinds, Values(f"values_{len(self.values)}", kinds))

    def function(self, kernel, kinds) -> Function:
        """The kernel for these argument types, translated when it is first asked for."""
        function = getattr(kernel, "py_func", kernel)
        key = function, tuple(kinds)
        if key not in self.functions:
            name = f"{function.__name__.strip('_')}_{len(self.functions)}"
            self.functions[key] = None  # its place in the order comes when it is done
            made = _Body(self, function, kinds).translate(name)
            del self.functions[key]
            self.functions[key] = made
        if self.functions[key] is None:
            raise ValueError(f"kernel {function.__name__} calls itself; it cannot be translated to C")
        return self.functions[key]

    def text(self) -> str:
        """The program but for its main function."""
        return "\n".join([HEAD, *(one.text() for one in self.records.values()),
                          *(one.text() for one in self.values.values()),
                          *(one.text for one in self.functions.values())])  # fmt: skip


class _Body(Expressions):
    """One function on its way; the types of locals are found by going over it until they no longer change."""

    def __init__(self, program, function, kinds):
        tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
        names = [argument.arg for argument in tree.args.args]
        super().__init__(program, function.__globals__, dict(zip(names, kinds, strict=True)))
        self.tree, self.parameters, self.returns = tree, names, VOID

    def translate(self, name):
        lines, before = [], None
        while before != (self.kinds, self.returns):
            before = dict(self.kinds), self.returns
            lines = self._block(self.tree.body)
        local = [f"{kind.c} {named(n)};" for n, kind in self.kinds.items() if n not in self.parameters]
        given = ", ".join(f"{self.kinds[n].c} {named(n)}" for n in self.parameters)
        text = "\n".join(["{", *local, *lines, "}"])
        return Function(name, self.returns, f"static {self.returns.c} {name}({given})\n{text}\n")

    def _block(self, statements):
        return [line for statement in statements for line in self._statement(statement)]

    def _statement(self, node):
        handler = getattr(self, f"_{type(node).__name__.lower()}", None)
        if handler is None:
            raise ValueError(f"a kernel with {type(node).__name__} (line {node.lineno}) cannot be translated to C")
        return handler(node)

    def _expr(self, node):
        return [] if isinstance(node.value, ast.Constant) else [f"{self.of(node.value).code};"]

    def _pass(self, node):
        return []

    def _break(self, node):
        return ["break;"]

    def _continue(self, node):
        return ["continue;"]

    def _if(self, node):
        lines = [f"if ({self.of(node.test).code}) {{", *self._block(node.body), "}"]
        return [*lines, "else {", *self._block(node.orelse), "}"] if node.orelse else lines

    def _while(self, node):
        return [f"while ({self.of(node.test).code}) {{", *self._block(node.body), "}"]

    def _for(self, node):
        """The counter is one of its own: Python's loop variable may be changed in the loop, and is not beyond it."""
        counter = f"k{node.lineno}"
        first, last, step, value = self._way(node.iter, counter)
        self.learn(node.target.id, value.kind)
        return [f"for (long long {counter} = {first}, end = {last}; {counter} {'<' if step > 0 else '>'} end; "
                f"{counter} += {step}) {{",
                f"{named(node.target.id)} = {value.code};", *self._block(node.body), "}"]  # fmt: skip

    def _way(self, over, counter):
        """First, end and step of the counter, and what the loop's variable then is."""
        if isinstance(over, ast.Call) and getattr(over.func, "id", "") == "range":
            bounds = [self.of(argument) for argument in over.args]
            first, last = ("0", bounds[0].code) if len(bounds) == 1 else (bounds[0].code, bounds[1].code)
            return first, last, int(ast.literal_eval(over.args[2])) if len(bounds) > 2 else 1, Found(counter, INTEGER)
        array = self.of(over)
        row = array.kind == TABLE
        value = Found(f"row_of({array.code}, {counter})", REALS) if row else Found(f"{array.code}.at[{counter}]", REAL)
        return "0", f"{array.code}.size", 1, value

    def _augassign(self, node):
        whole = ast.BinOp(self.loaded(node.target), node.op, node.value)
        return self._store(node.target, self.of(ast.copy_location(whole, node)))

    def _return(self, node):
        if node.value is None:
            return ["return;"]
        if isinstance(node.value, ast.Tuple):
            parts = [self.of(part) for part in node.value.elts]
            known = self.returns.kinds if isinstance(self.returns, Values) else [part.kind for part in parts]
            self.returns = self.program.tuple_of(self.wider(a, b.kind) for a, b in zip(known, parts, strict=True))
            return [f"return (struct {self.returns.name}){{{', '.join(part.code for part in parts)}}};"]
        found = self.of(node.value)
        self.returns = found.kind if self.returns == VOID else self.wider(self.returns, found.kind)
        return [f"return {found.code};"]

    def _assign(self, node):
        target = node.targets[0]
        if isinstance(target, ast.Tuple):
            return self._unpack(target.elts, node.value)
        value, lines = self.of(node.value), []
        if len(node.targets) == 1:
            return self._store(target, value)
        for one in node.targets:
            lines += self._store(one, value._replace(code="shared"))
        return [f"{{ {value.kind.c} shared = {value.code};", *lines, "}"]

    def _unpack(self, targets, value):
        if isinstance(value, ast.Tuple):
            parts = [self.of(part) for part in value.elts]
            keep = [f"{part.kind.c} part{i} = {part.code};" for i, part in enumerate(parts)]
            names = [part._replace(code=f"part{i}") for i, part in enumerate(parts)]
        else:
            found = self.of(value)
            keep = [f"{found.kind.c} several = {found.code};"]
            names = [found._replace(code=f"several.part{i}", kind=kind) for i, kind in enumerate(found.kind.kinds)]
        stores = [line for target, part in zip(targets, names, strict=True) for line in self._store(target, part)]
        return ["{", *keep, *stores, "}"]

    def _store(self, target, value):
        if isinstance(target, ast.Name):
            self.learn(target.id, value.kind)
            return [f"{named(target.id)} = {value.code};"]
        if isinstance(target, ast.Subscript) and isinstance(ends := _ends(target.slice), ast.Slice):
            array = self.of(_row(target) if ends is not target.slice else target.value).code
            return [f"for (long long all = 0; all < {array}.size; all++) {array}.at[all] = {value.code};"]
        return [f"{self.of(self.loaded(target)).code} = {value.code};"]


def _ends(index):
    return index.elts[-1] if isinstance(index, ast.Tuple) else index


def _row(target):
    """table[i] of table[i, :]."""
    return Expressions.loaded(ast.Subscript(target.value, target.slice.elts[0], ast.Load()))


__all__ = ["INTEGER", "REAL", "REALS", "TABLE", "Program"]
