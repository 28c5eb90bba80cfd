# SPDX-License-Identifier: Apache-2.0
"""Kernels of many functions, optimised and made machine code once, as one: the fast way of whole.py.

numba does both for every function together with all that it calls, so at each level of a call tree what is below is
optimised and emitted anew, a tree of small functions many times over. A part is only translated to LLVM's language;
the whole that calls it, or calls what calls it, takes it in.

This file alone leans on inner classes of numba. `whole.py` takes it for the versions of numba that it was tested with.
"""

import numba
from llvmlite import binding
from numba.core import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering

INNER = (  # what is used of them, beyond what the imports above would miss
    (numba._dynfunc, "make_function"), (JITCodeLibrary, "add_linking_library"), (JITCodeLibrary, "finalize"),
    (JITCodeLibrary, "_optimize_functions"), (Flags, "options"), (DefaultPassBuilder, "define_nopython_pipeline"),
)  # fmt: skip
for _owner, _name in INNER:
    getattr(_owner, _name)  # AttributeError now, and not in the middle of a kernel


def part(function, arrays, options):
    """The dispatcher of a part: TypeError if Python calls it. arrays: whether it makes some."""
    made = numba.njit(pipeline_class=_PartCompiler, no_cpython_wrapper=True, no_cfunc_wrapper=True,
                      _nrt=arrays, **options)(function)  # fmt: skip
    ignore_literals(made)
    return made


def ignore_literals(made):
    """numba compiles once for the argument 0, once for 1 and once for any other integer: here for any one only."""
    template = made.get_call_template
    made.get_call_template = lambda given, named: template(
        [types.unliteral(kind) for kind in given], {name: types.unliteral(kind) for name, kind in named.items()})


class _PartLibrary(JITCodeLibrary):
    """LLVM code as it was written down; what it links are the parts it calls, their parts, and so on, callers first."""

    def _optimize_functions(self, module):
        module.data_layout = self._codegen._data_layout

    def add_linking_library(self, library):
        if library not in self._linking_libraries:
            super().add_linking_library(library)

    def finalize(self):
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(NativeLowering):
    _name = "part_lowering"

    def run_pass(self, state):
        context = state.targetctx
        state.library = _PartLibrary(context.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        refusal = _refusal(lowered, state.library)
        # a caller need not know that these are parts: numba's own njit links no further than it is told
        context.insert_user_function(refusal, lowered.fndesc, [state.library, *state.library._linking_libraries])
        state["cr"] = lowered._replace(cfunc=refusal)
        return True


class _Flags(Flags):
    """As numba's own, which asks property after property whenever it looks whether it has met a call before."""

    __slots__ = ()

    def values(self):
        return _DEFAULTS | self._values


_DEFAULTS = {name: option.default for name, option in Flags.options.items()}
_OF_NO_USE = {  # to what parts are written in: no closures, no `with`, no loops over literals; each pass takes its time
    "WithLifting", "InlineClosureLikes", "InlineInlinables", "MakeFunctionToJitFunction", "FindLiterallyCalls",
    "LiteralUnroll", "LiteralPropagationSubPipelinePass", "InlineOverloads", "DumpParforDiagnostics",
}  # fmt: skip
_OF_ARRAYS = {"NopythonRewrites"}  # of expressions of arrays, and those make some


class _PartCompiler(CompilerBase):
    def __init__(self, typing, target, library, args, return_type, flags, names):
        super().__init__(typing, target, library, args, return_type, _Flags(flags), names)

    def define_pipelines(self):
        skipped = _OF_NO_USE if self.state.flags.nrt else _OF_NO_USE | _OF_ARRAYS
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        manager.passes = [(_PartLowering if kind is NativeLowering else kind, text) for kind, text in manager.passes
                          if kind.__name__ not in skipped]  # fmt: skip
        manager._finalized = False
        manager.finalize()
        return [manager]


def _refusal(lowered, library):
    """What Python gets in place of machine code: PyObject_Call(closure, args, named), which says it is not callable."""
    address = binding.address_of_symbol("PyObject_Call")
    name = lowered.fndesc.qualname.split(".")[-1]
    return numba._dynfunc.make_function(lowered.fndesc.lookup_module(), name, "", address, lowered.env, (library,))
