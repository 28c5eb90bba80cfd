# SPDX-License-Identifier: Apache-2.0
"""`@whole` and `@part`: a kernel of many functions, optimised and made machine code once, as one.

numba does both for every function together with all that it calls, so at each level of a call tree what is below is
optimised and emitted anew, a tree of small functions many times over. A part is only translated to LLVM's language;
the whole that calls it, or calls what calls it, takes it in. What a part may not do: be called from Python, or make an
array.
"""

import numba
from llvmlite import binding
from numba import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering

from haptic_device import cache

ERROR_MODEL = "numpy"  # division by zero follows IEEE 754, nothing raises


def part(function, arrays=False):
    """A function of kernels: called by `whole` ones and other parts, TypeError if by Python; may it make arrays?"""
    made = numba.njit(pipeline_class=_compiler(_PartLowering), no_cpython_wrapper=True, no_cfunc_wrapper=True,
                      _nrt=arrays, **_OPTIONS)(function)
    if not numba.config.DISABLE_JIT:
        _ignore_literals(made)
    return made


def whole(function, *signature):
    """A kernel that Python calls; all the parts it calls are compiled with it. With a signature, at once."""
    numba.config.CACHE_DIR = cache.FOLDER
    return numba.njit(*signature, pipeline_class=_compiler(_WholeLowering), cache=True, **_OPTIONS)(function)


_OPTIONS = {"nogil": True, "error_model": ERROR_MODEL}


def _ignore_literals(made):
    """numba compiles once for the argument 0, once for 1 and once for any other integer: here for any one only."""
    template = made.get_call_template
    made.get_call_template = lambda given, named: template(
        [types.unliteral(kind) for kind in given], {name: types.unliteral(kind) for name, kind in named.items()})


class _PartLibrary(JITCodeLibrary):
    """LLVM code as it was written down."""

    def _optimize_functions(self, module):
        module.data_layout = self._codegen._data_layout

    def finalize(self):
        self._finalized = True


class _WholeLibrary(JITCodeLibrary):
    """Takes in parts, their parts, and so on."""

    def add_linking_library(self, library):
        if library in self._linking_libraries:
            return
        super().add_linking_library(library)
        for below in library._linking_libraries if isinstance(library, _PartLibrary) else ():
            self.add_linking_library(below)


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
        context.insert_user_function(refusal, lowered.fndesc, [state.library])
        state["cr"] = lowered._replace(cfunc=refusal)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class _WholeLowering(NativeLowering):
    _name = "whole_lowering"

    def run_pass(self, state):
        state.library = _WholeLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super().run_pass(state)


def _compiler(lowering):
    class Compiler(CompilerBase):
        def define_pipelines(self):
            manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
            manager.passes = [(lowering if kind is NativeLowering else kind, text) for kind, text in manager.passes]
            manager._finalized = False
            manager.finalize()
            return [manager]

    return Compiler


def _refusal(lowered, library):
    """What Python gets in place of machine code: PyObject_Call(closure, args, named), which says it is not callable."""
    address = binding.address_of_symbol("PyObject_Call")
    name = lowered.fndesc.qualname.split(".")[-1]
    return numba._dynfunc.make_function(lowered.fndesc.lookup_module(), name, "", address, lowered.env, (library,))
